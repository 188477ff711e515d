"""``pidemu compare``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from pidemu.card.library import load_card
from pidemu.cli.common import (
    OutputArgument,
    action_option,
    assignments,
    echo,
    heading,
    json_option,
    limits_option,
    number,
    print_json,
    table,
    vendors_option,
)
from pidemu.cli.events import moved
from pidemu.cli.inputs import inputs
from pidemu.errors import RecordError
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import counted
from pidemu.files.writing import beside
from pidemu.records.compare import Comparison, compare
from pidemu.records.files import SIGNALS, Record, write_record
from pidemu.records.playback import NO_BUMP
from pidemu.records.side_by_side import dials
from pidemu.records.standard import StandardRecord

if TYPE_CHECKING:
    _ScansType = click.ParamType[tuple[float, ...]]
else:
    _ScansType = click.ParamType

_ROWS: Final = 20
"""Rows of a table after which it is said how many more there are."""
_EXAMPLE: Final = "pidemu compare fisher/provox GAIN=2 RESET=4 RATE=0.1 emerson/deltav GAIN=2 RESET=15 RATE=6"


class Scans(_ScansType):
    """Scan intervals with commas between [s]."""

    name = "H[,H2,...]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Read the intervals."""
        if isinstance(value, tuple):
            return value
        try:
            intervals = tuple(float(x) for x in str(value).split(","))
            if not all(math.isfinite(x) and x > 0 for x in intervals):
                raise ValueError
        except ValueError:
            self.fail(f"'{value}' is not a scan interval; write seconds, such as 0.5, or 1,0.5 for one per card", param, ctx)
        return intervals


@click.command("compare", short_help="Run cards on the same signals and compare their outputs.")
@click.argument("words", nargs=-1, metavar="CARD [NAME=VALUE]... CARD [NAME=VALUE]...")
@click.option("--record", "file", metavar="FILE.csv", help="Recorded signals, as for 'pidemu run'; by default the standard record.")
@click.option("--scan", type=Scans(), help="Scan interval of all, or of each card [s]; by default the first card's for all.")
@action_option
@limits_option
@click.option(
    "--initial-output",
    type=float,
    help="Output before the first scan; by default the first recorded one, else 0; 50 with the standard record.",
)
@click.option(
    "-o",
    "--output",
    "target",
    type=OutputArgument(),
    metavar="FILE.csv",
    help="Where to write the signals and all outputs, as columns.",
)
@click.option(
    "--plot",
    "picture",
    type=OutputArgument(),
    metavar="FILE.png|svg",
    help="Draw the signals, outputs and differences; needs matplotlib.",
)
@vendors_option
@json_option
def command(
    words: tuple[str, ...],
    file: str | None,
    scan: tuple[float, ...] | None,
    action: str,
    limits: tuple[float, float] | None,
    initial_output: float | None,
    target: str | None,
    picture: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run two or more CARDs, each with the settings after it, on the same signals, and compare their outputs with the first one's.

    The standard record steps, ramps and shakes setpoint and PV, drives the output to both limits and goes through manual. Its
    length goes by the integral time of the first card, its size by the gain.
    """
    if picture is not None:
        from pidemu.report.plots import check_picture

        check_picture(picture)
    named = _split(words)
    settings = [load_card(card, vendors).settings(assignments(values)) for card, values in named]
    read = inputs(file)
    check_outputs({"--output": target, "--plot": picture}, RecordError, read)  # now, and not after the work
    if scan is not None and len(scan) not in (1, len(settings)):
        raise click.UsageError(f"{len(scan)} scan intervals for {len(settings)} cards; give one for all, or one for each")
    comparison = compare(
        settings,
        file,
        scan,
        action="direct" if action == "direct" else "reverse",
        output_limits=limits,
        initial_output=initial_output,
    )
    if target is not None:
        _write(comparison, target, read)
    if as_json:
        print_json(comparison.to_dict())
    else:
        _print(comparison, file)
    skipped = [f"{file}: {comparison.record.skipped}"] if comparison.record.skipped else []
    for note in (*skipped, *comparison.notes):
        echo(f"note: {note}", err=True)
    if picture is not None:
        from pidemu.report.plots import plot_comparison

        plot_comparison(picture, comparison)


def _split(words: tuple[str, ...]) -> list[tuple[str, list[str]]]:
    """Return every card with the words after it; a card is a word with a slash, or a .yaml file, without ``=``."""
    found: list[tuple[str, list[str]]] = []
    for word in words:
        if "=" not in word and ("/" in word or word.endswith((".yaml", ".yml"))):
            found.append((word, []))
        elif "=" not in word:
            raise click.UsageError(f"'{word}' is neither a card, such as emerson/deltav, nor a setting, such as GAIN=2")
        elif not found:
            raise click.UsageError(f"'{word}' comes before any card; write for example: {_EXAMPLE}")
        else:
            found[-1][1].append(word)
    if len(found) < 2:
        count = "one card is" if found else "no card is"
        raise click.UsageError(f"{count} given, and a comparison needs two; for example: {_EXAMPLE}")
    return found


def _print(c: Comparison, file: str | None) -> None:
    heading(_title(c, file))
    rows = [[run.label, f"{number(run.scan)} s", dials(run.settings)] for run in c.runs]
    table(["card", "scan", "settings"], rows, right=(1,))
    heading(f"\nDifference from {c.runs[0].label} [% of the output span]")
    rows = []
    for d in c.differences:
        where = [d.segment, f"{number(d.time)} s"] if d.largest >= NO_BUMP else ["", ""]
        rows.append([d.label, _percent(d.largest), *where, _percent(d.rms)])
    table(["", "largest", "in", "at", "rms"], rows, right=(1, 3, 4))
    heading("\nLargest difference in each part of the record")
    rows = []
    for i, s in enumerate(c.segments):
        times = [f"{number(s.start)} s", f"{number(s.end)} s"]
        rows.append([s.name, *times, *(_percent(d.by_segment[i]) for d in c.differences)])
    _table(["", "from", "to", *(d.label for d in c.differences)], rows)
    transfers = [t for t in c.transfers() if not t[0].startswith("power-up") or any(abs(x) >= NO_BUMP for x in t[2])]
    if transfers:
        heading("\nWhat the output moves by at transfers")
        rows = [[text, f"{number(at)} s", *("-" if math.isnan(x) else moved(x) for x in bumps)] for text, at, bumps in transfers]
        _table(["", "at", *(run.label for run in c.runs)], rows)
    spent = {run.label: (run.playback.saturated("low"), run.playback.saturated("high")) for run in c.runs}
    if any(any(pair) for pair in spent.values()):
        heading("\nTime at the output limits, in automatic")
        rows = [[label, f"{number(low)} s", f"{number(high)} s"] for label, (low, high) in spent.items()]
        table(["", "low", "high"], rows, right=(1, 2))


def _title(c: Comparison, file: str | None) -> str:
    record, count = c.record, len(c.times)
    length = f"{counted(count, 'scan')}, {number(c.times[-1] - c.times[0])} s"
    if not isinstance(record, StandardRecord):
        return f"{file}: {length}"
    return f"standard record: {length}; moves of {_percent(record.size)} %, {number(record.characteristic_time)} s each"


def _percent(x: float) -> str:
    if math.isnan(x):
        return "-"
    return "none" if x < NO_BUMP else number(x, 3)


def _table(columns: list[str], rows: list[list[str]]) -> None:
    """Print the first rows of a table whose columns are numbers but for the first."""
    table(columns, rows[:_ROWS], right=range(1, len(columns)))
    if len(rows) > _ROWS:
        echo(f"  and {len(rows) - _ROWS} more; --json lists all")


def _write(c: Comparison, target: str, read: Sequence[str | Path]) -> None:
    """Write the record as the first card saw it, with all outputs as columns."""
    record: Record = c.record
    columns = {label: values.tolist() for label, values in c.outputs.items()}
    if not record.rows:
        names = [n for n in ("sp", "pv", "auto", "manual", *SIGNALS) if getattr(record, n) is not None]
        signals = [c.times.tolist(), *(getattr(record, n).tolist() for n in names)]
        rows = tuple(tuple("" if math.isnan(x) else f"{x!r}" for x in row) for row in zip(*signals, strict=True))
        record = Record(record.sp, record.pv, header=("time", *names), rows=rows)
    with beside(target, RecordError, read) as stream:
        write_record(record, columns, stream)
