"""What the commands share: arguments, numbers in print, tables."""

from __future__ import annotations

import json
import math
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import click

from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.errors import SettingError
from pidemu.excerpt import printable, printable_json, shortened, visible
from pidemu.formatting import json_safe
from pidemu.formatting import number as number  # noqa: PLC0414  # the commands take it from here
from pidemu.parsing import assignments as assignments  # noqa: PLC0414
from pidemu.parsing import pair, seconds, step
from pidemu.settings.ranges import SignalRange, read_range

if TYPE_CHECKING:
    from pidemu.card.load import Card

    _NameType = click.ParamType[str]
    _PairType = click.ParamType[tuple[float, float]]
    _RangeType = click.ParamType[SignalRange]
    _TimeType = click.ParamType[float]
    _StepType = click.ParamType[float | tuple[float, float]]
else:
    _NameType = _PairType = _RangeType = _TimeType = _StepType = click.ParamType  # it has no type parameter before click 8.4

vendors_option = click.option(
    "--vendors",
    multiple=True,
    metavar="DIR",
    help="A folder of your own cards, <vendor>/<block>.yaml; searched first. Repeatable.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")


_CELL: Final = 200
"""Characters of a cell of a table on the screen: one that is longer would widen every row."""


class OutputArgument(_NameType):
    """The name of a file or folder that is written."""

    def __init__(self, kind: str = "file") -> None:
        self.name = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Refuse an empty name, which would lead to the folder that the command stands in."""
        if not str(value).strip():
            self.fail(f"give a {self.name} name", param, ctx)
        return str(value)


class PairArgument(_PairType):
    """Two numbers with a comma between, such as ``0,200``."""

    name = "LOW,HIGH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Read the two numbers."""
        if isinstance(value, tuple):
            return value
        try:
            return pair(str(value))
        except SettingError as error:
            self.fail(str(error), param, ctx)


class RangeArgument(_RangeType):
    """A signal range with its unit, such as ``0,400 degC``."""

    name = "LOW,HIGH UNIT"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> SignalRange:
        """Read the range."""
        try:
            return read_range(value)
        except SettingError as error:
            self.fail(str(error), param, ctx)


class TimeArgument(_TimeType):
    """A time, in seconds or with a unit.

    Parameters
    ----------
    positive : bool
        Whether it must be more than zero.
    """

    name = "TIME"

    def __init__(self, positive: bool = False) -> None:
        self._positive = positive

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the time [s]."""
        try:
            time = seconds(str(value))
            if self._positive and not 0 < time < math.inf:
                raise SettingError(f"'{value}' is not more than 0 s; write a time such as 0.5 or 10 min")
            return time
        except SettingError as error:
            self.fail(str(error), param, ctx)


class StepArgument(_StepType):
    """The size of a step, or when it comes and its size."""

    name = "SIZE|WHEN,SIZE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | tuple[float, float]:
        """Read the step [s, %]."""
        try:
            return value if isinstance(value, float | tuple) else step(str(value))
        except SettingError as error:
            self.fail(str(error), param, ctx)


class ScanArgument(_StepType):
    """One scan interval, or two with a comma between [s]."""

    name = "H[,H2]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | tuple[float, float]:
        """Read one or two intervals."""
        if isinstance(value, float | tuple):
            return value
        try:
            intervals = [seconds(x) for x in str(value).split(",")]
            if not 1 <= len(intervals) <= 2 or not all(math.isfinite(x) and x > 0 for x in intervals):
                raise ValueError
        except (SettingError, ValueError):
            self.fail(
                f"'{value}' is not a scan interval; write seconds, such as 0.5, or a unit too, 500 ms; 1,0.5 for source and target",
                param,
                ctx,
            )
        return intervals[0] if len(intervals) == 1 else (intervals[0], intervals[1])


action_option = click.option(
    "--action",
    type=click.Choice(["reverse", "direct"]),
    default="reverse",
    show_default=True,
    help="Reverse: the output falls when PV rises.",
)
limits_option = click.option("--limits", type=PairArgument(), help="Output limits; by default the card's.")
setpoint_option = click.option(
    "--setpoint",
    type=StepArgument(),
    help="Size of the setpoint step [%], or its time [s] and size; by default 10 after a twentieth of the run. 0 for none.",
)
load_option = click.option(
    "--load",
    type=StepArgument(),
    help="Size of the load step at the process input [%], or its time [s] and size; by default 10 after half the run. 0 for none.",
)
engine_option = click.option(
    "--engine",
    type=click.Choice(["auto", *ENGINES]),
    help="The engine that runs it, which is then named; all give the same numbers. By default, and with auto, the fastest.",
)


def asked_for(word: str | None) -> Engine | None:
    """Return the engine that ``--engine`` forces; ``None`` leaves the choice."""
    return next((e for e in ENGINES if e == word), None)


def given(**values: Any) -> dict[str, Any]:
    """Return what is given, for a function that has defaults of its own."""
    return {name: value for name, value in values.items() if value is not None}


def overridden(base: Mapping[str, object], top: Mapping[str, object]) -> dict[str, object]:
    """Return `base` with the values of `top`, whatever the case of the names."""
    named = {n.casefold() for n in top}
    return {**{n: v for n, v in base.items() if n.casefold() not in named}, **top}


def split_options(card: Card, given: Mapping[str, object]) -> tuple[dict[str, object], dict[str, object]]:
    """Split what was given for a card into options and dials."""
    options = {o.casefold() for o in card.options}
    chosen = {k: v for k, v in given.items() if k.casefold() in options}
    return chosen, {k: v for k, v in given.items() if k not in chosen}


def echo(text: str = "", *, err: bool = False) -> None:
    """Print lines in which nothing but what is printed here controls the terminal."""
    click.echo(printable(text), err=err)


def heading(text: str) -> None:
    """Print a heading: bold for people, plain when piped."""
    click.secho(printable(text), bold=True)


def _width(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)


def table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, indent: int = 2, right: Sequence[int] = (), err: bool = False
) -> None:
    """Print a table: aligned plain text when piped, a rich table on a terminal.

    Parameters
    ----------
    columns : sequence of str
        Headings; all empty for none.
    rows : sequence of sequence of str
        Cells.
    indent : int
        Spaces to the left.
    right : sequence of int
        Columns that hold numbers, aligned to the right.
    err : bool
        Print on stderr.
    """
    rows = [[shortened(visible(cell), _CELL) for cell in row] for row in rows]
    if (sys.stderr if err else sys.stdout).isatty():
        _rich(columns, rows, indent, right, err)
        return
    lines = [list(columns), *([list(r) for r in rows])] if any(columns) else [list(r) for r in rows]
    widths = [max((_width(line[i]) for line in lines), default=0) for i in range(len(columns))]
    for line in lines:
        cells = []
        for i, cell in enumerate(line):
            pad = " " * (widths[i] - _width(cell))
            cells.append(pad + cell if i in right else cell + pad)
        click.echo((" " * indent + "  ".join(cells)).rstrip(), err=err)


def wrapped(text: str, indent: str = "  ") -> None:
    """Print a paragraph, within the terminal's width; 110 columns when piped."""
    width = min(110, shutil.get_terminal_size().columns) if sys.stdout.isatty() else 110
    rest = " " * len(indent)
    echo(textwrap.fill(text, width, initial_indent=indent, subsequent_indent=rest, break_long_words=False))


def _rich(columns: Sequence[str], rows: Sequence[Sequence[str]], indent: int, right: Sequence[int], err: bool) -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, show_header=any(columns), header_style="bold", pad_edge=False)
    for i, column in enumerate(columns):
        grid.add_column(Text(column), justify="right" if i in right else "left", overflow="fold")
    for row in rows:
        grid.add_row(*(Text(cell, style=_style(cell)) for cell in row))
    Console(stderr=err).print(Padding(grid, (0, 0, 0, indent)))


def _style(cell: str) -> str:
    return {"assumed": "yellow", "inferred": "cyan", "documented": "green", "measured": "green"}.get(cell, "")


def print_json(value: Any) -> None:
    """Print plain values as JSON, with words for what is infinite."""
    click.echo(printable_json(json.dumps(json_safe(value), indent=2, ensure_ascii=False, allow_nan=False, default=str)))
