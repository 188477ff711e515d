"""A fleet as a CSV file: a row per loop, and what came of each."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pidemu.card.library import folders, load_card_by_id, loaded_files
from pidemu.errors import CardError, FleetError, PidemuError, SettingError, suggest
from pidemu.excerpt import quoted, visible
from pidemu.files.reading import Kind, control, read_text
from pidemu.files.tables import Lines, counted, shown_delimiter, split_lines, split_row, write_table
from pidemu.fleet.loops import Loop
from pidemu.fleet.prepare import reason_of
from pidemu.fleet.result import HEADER, FleetResult
from pidemu.parsing import assignments, pair, seconds, step
from pidemu.process.process import parse_process
from pidemu.settings.action import Action

COLUMNS: Final = ("tag", "card", "settings", "process", "scan", "action", "limits", "setpoint", "load", "time")
"""Columns of a file of loops."""
_REQUIRED: Final = COLUMNS[:4]
_KIND: Final = Kind("a table of loops", "save it as CSV text in UTF-8, with a header line such as tag,card,settings,process")
_ACTIONS: Final[Mapping[str, Action]] = {"reverse": "reverse", "direct": "direct"}


@dataclass(frozen=True)
class WrongRow:
    """A row that makes no loop.

    Attributes
    ----------
    line : int
        Its line in the file, counted from 1.
    tag, card : str
        What stands in these columns.
    reason : str
        Cause and remedy.
    """

    line: int
    tag: str
    card: str
    reason: str


@dataclass(frozen=True)
class LoopTable:
    """What a file of loops holds.

    Attributes
    ----------
    path : str
        The file.
    loops : tuple of Loop
        The loops, in the order of the file.
    lines : tuple of int
        The line of each loop in the file, counted from 1.
    wrong : tuple of WrongRow
        The rows that make no loop, and why.
    skipped : str
        Which lines of the file say nothing, in words: ``skipped: 2 comment lines above the header``.
    """

    path: str
    loops: tuple[Loop, ...]
    lines: tuple[int, ...]
    wrong: tuple[WrongRow, ...]
    skipped: str = ""

    def __len__(self) -> int:
        return len(self.lines) + len(self.wrong)

    def located(self, line: int, tag: str, reason: str) -> str:
        """Return a message with the place it is about: ``loops.csv:7: FIC-101: reason``."""
        return ": ".join(part for part in (f"{visible(self.path)}:{line}", quoted(tag), quoted(reason, 2000)) if part)

    def rows(self, result: FleetResult | None) -> Iterator[dict[str, Any]]:
        """Yield a row per row of the file, with its line and the names of a result's table; what is not known is ``None``.

        Parameters
        ----------
        result : FleetResult or None
            What came of `loops`; ``None`` where there are none.
        """
        ran = [] if result is None else [{"line": line, **row} for line, row in zip(self.lines, result.rows(), strict=True)]
        empty = dict.fromkeys(HEADER)
        failed = [
            {"line": w.line, **empty, "tag": w.tag, "card": w.card, "status": "failed", "reason": w.reason} for w in self.wrong
        ]
        yield from sorted([*ran, *failed], key=lambda row: int(str(row["line"])))

    def write(self, path: str | Path, result: FleetResult | None) -> None:
        """Write the table of a result as CSV, with the rows that make no loop among the others.

        Parameters
        ----------
        path : str or Path
            The file.
        result : FleetResult or None
            What came of `loops`; ``None`` where there are none.

        Raises
        ------
        FleetError
            The file cannot be written, is the file of loops, or that of a card.
        """
        write_table(path, HEADER, self.rows(result), FleetError, inputs=[self.path, *loaded_files()])


def read_loops(path: str | Path, vendors: Sequence[str | Path] = ()) -> LoopTable:
    """Read a CSV file of loops: a header line, a row per loop; lines above these that begin with ``# `` are comments.

    The cells are separated by commas, or by semicolons or tabs where the header line has these. Columns, in any order: ``tag``,
    ``card``, ``settings`` (``GAIN=2; RESET=4; RATE=6 s``: dials in the card's units or with one, and options, by the card's names),
    ``process`` (``gain=1, lag=20, delay=3``, see `pidemu.process.process.parse_process`), and, where they are there, ``scan`` [s],
    ``action`` (reverse, direct), ``limits`` of the output [%] (``0,100``), ``setpoint`` and ``load`` (size of a step [%], or when
    [s] and size: ``60,5``) and ``time`` [s]. What an empty cell does not say, the fleet decides.

    Parameters
    ----------
    path : str or Path
        The file.
    vendors : sequence of path, optional
        Folders of the user's own cards, searched before the built-in ones.

    Returns
    -------
    LoopTable
        The loops, and the rows that make none: a wrong row does not stop the others.

    Raises
    ------
    FleetError
        The file cannot be read, lacks a column or has an unknown one, or holds no row.
    CardNotFoundError
        There is no such folder of cards.
    """
    folders(vendors)  # one that is not there is no fault of a row
    lines = _lines(path)
    (head, names), *rows = lines.rows
    delimiter = lines.delimiter
    try:
        if lines.contradiction:
            raise FleetError(lines.contradiction)
        header = _header(_cells(names, delimiter))
    except FleetError as error:
        raise FleetError(f"{visible(str(path))}:{head}: {error}") from None
    loops: list[Loop] = []
    numbers: list[int] = []
    wrong: list[WrongRow] = []
    seen: dict[str, int] = {}
    for number, line in rows:
        row: Mapping[str, str] = {}
        try:
            cells = _cells(line, delimiter)
            row = {name: cell.strip() for name, cell in zip(header, cells, strict=False) if cell.strip()}
            _refuse_hidden(header, cells)
            if len(cells) != len(header):
                remedy = f"put a cell that holds {shown_delimiter(delimiter)} in quotation marks"
                remedy = "comments stand above the header" if cells[0].startswith("#") and len(cells) == 1 else remedy
                raise FleetError(f"{counted(len(cells), 'cell')}, the header has {len(header)}; {remedy}")
            loops.append(_loop(row, number, seen, vendors))
            numbers.append(number)
        except Exception as error:  # whatever it is: one wrong row among thousands stops no other
            reason = _in_one_line(error) if isinstance(error, PidemuError) else reason_of(error)
            tag, card = (visible(row.get(name, "")) for name in ("tag", "card"))
            wrong.append(WrongRow(number, tag, card, reason))
    return LoopTable(str(path), tuple(loops), tuple(numbers), tuple(wrong), lines.skipped)


def _lines(path: str | Path) -> Lines:
    """Return the lines of a file; a control character, or a byte that is not UTF-8, costs its row only."""
    lines = split_lines(read_text(path, FleetError, _KIND, by_line=True), skip_empty_rows=True)
    if len(lines.rows) < 2:
        wanted = f"the file has a header line such as {','.join(_REQUIRED)} and one line per loop"
        raise FleetError(f"{visible(str(path))}: no loops; {wanted}")
    return lines


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; what is not seen is still at their ends."""
    try:
        return split_row(line, delimiter)
    except ValueError as error:
        raise FleetError(control(line) or str(error)) from None


def _refuse_hidden(header: Sequence[str], cells: Sequence[str]) -> None:
    """Refuse a control character, or a byte that is not UTF-8, in a cell; the column is the one that the header names."""
    for name, cell in itertools.zip_longest(header, cells, fillvalue=""):
        fault = control(cell)
        if fault is not None:
            raise FleetError(f"column {name}: {fault}" if name else fault)


def _header(cells: Sequence[str]) -> list[str]:
    """Return the names of the columns."""
    for at, cell in enumerate(cells, 1):
        if fault := control(cell):
            raise FleetError(f"column {at}: {fault}")
    cells = [cell.strip() for cell in cells]
    names = [cell.casefold() for cell in cells]
    unknown = [cell for cell, name in zip(cells, names, strict=True) if name not in COLUMNS]
    if unknown:
        which = quoted(", ".join(f"'{quoted(cell)}'{suggest(cell, COLUMNS)}" for cell in unknown), 400)
        raise FleetError(f"unknown column{'s' if len(unknown) > 1 else ''} {which}; columns: {', '.join(COLUMNS)}")
    missing = [name for name in _REQUIRED if name not in names]
    if missing:
        raise FleetError(f"no column '{missing[0]}'; {', '.join(_REQUIRED)} are needed")
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise FleetError(f"the column '{twice[0]}' comes twice; keep one")
    return names


def _loop(row: Mapping[str, str], line: int, seen: dict[str, int], vendors: Sequence[str | Path]) -> Loop:
    """Return the loop of a row; `seen` has the line of every tag."""
    for name in ("tag", "card", "process"):
        if name not in row:
            raise FleetError(f"no {name}; every loop needs one")
    first = seen.setdefault(row["tag"], line)
    if first != line:
        raise FleetError(f"line {first} has this tag already; give each loop its own")
    words = (word for word in row.get("settings", "").split(";") if word.strip())
    given = assignments(words, such="GAIN=2; RESET=20 s/repeat", between="semicolons, such as GAIN=2; RESET=20")
    readers = {"scan": seconds, "time": seconds, "setpoint": step, "load": step, "limits": pair, "action": _action}
    found: dict[str, Any] = {}
    for name, read in readers.items():
        if name in row:
            try:
                found["output_limits" if name == "limits" else name] = read(row[name])
            except SettingError as error:
                raise SettingError(f"{name}: {error}") from None
    settings = load_card_by_id(row["card"], vendors).settings(given)
    return Loop(row["tag"], settings, parse_process(row["process"]), **found)


def _action(text: str) -> Action:
    action = _ACTIONS.get(text.casefold())
    if action is None:
        raise SettingError(
            f"'{quoted(text)}' is neither reverse nor direct{suggest(text, _ACTIONS)}; leave the cell empty for negative feedback"
        )
    return action


def _in_one_line(error: PidemuError) -> str:
    """Return the message of an error, as a row of a table can hold it."""
    if isinstance(error, CardError) and error.problems:
        return "; ".join(problem.headline() for problem in error.problems)
    return "; ".join(str(error).splitlines())
