"""A fleet as a CSV file: a row per loop, and what came of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pidemu.card.library import folders, loaded_files
from pidemu.errors import CardError, FleetError, PidemuError, suggest
from pidemu.excerpt import quoted, visible
from pidemu.files.reading import Kind, control, read_text
from pidemu.files.tables import Lines, split_lines, write_table
from pidemu.fleet.lists import LoopList
from pidemu.fleet.loops import Loop
from pidemu.fleet.patterns import Patterns
from pidemu.fleet.prepare import no_collection, reason_of
from pidemu.fleet.result import HEADER, FleetResult
from pidemu.fleet.rows import COLUMNS, REQUIRED, Row, RowReader, cells, check_row
from pidemu.fleet.tabled import TableLoops

_KIND: Final = Kind("a table of loops", "save it as CSV text in UTF-8, with a header line such as tag,card,settings,process")


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
    loops : sequence of Loop
        The loops, in the order of the file.
    lines : tuple of int
        The line of each loop in the file, counted from 1.
    wrong : tuple of WrongRow
        The rows that make no loop, and why.
    skipped : str
        Which lines of the file say nothing, in words: ``skipped: 2 comment lines above the header``.
    """

    path: str
    loops: LoopList
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
        header = _header(cells(names, delimiter))
    except FleetError as error:
        raise FleetError(f"{visible(str(path))}:{head}: {error}") from None
    reader = RowReader(tuple(header), delimiter, tuple(vendors))
    with no_collection():
        return LoopTable(str(path), *_Reading(reader, rows).result(), lines.skipped)


class _Reading:
    """Reads the rows of a table: those that are alike together, the others one by one."""

    def __init__(self, reader: RowReader, lines: Sequence[tuple[int, str]]) -> None:
        self._reader, self._lines = reader, lines
        self._wrong: list[WrongRow] = []
        self._tags = [""] * len(lines)
        self._alone: list[int] = []
        seen: dict[str, int] = {}
        self._patterns = Patterns(reader, seen)
        for which, (number, line) in enumerate(lines):
            tag = self._patterns.take(which, number, line)
            if tag is None:
                self._look_at(which, seen)
            else:
                self._tags[which] = tag

    def _look_at(self, which: int, seen: dict[str, int]) -> None:
        """Look at a row that is to be read alone."""
        row: Row = {}
        try:
            check_row(self._reader.row(self._lines[which][1], row), self._lines[which][0], seen)
        except Exception as error:
            self._fail(which, row, error)
        else:
            self._tags[which] = row["tag"]
            self._alone.append(which)

    def _fail(self, which: int, row: Row, error: Exception) -> None:
        reason = _in_one_line(error) if isinstance(error, PidemuError) else reason_of(error)
        tag, card = (visible(row.get(name, "")) for name in ("tag", "card"))
        self._wrong.append(WrongRow(self._lines[which][0], tag, card, reason))

    def result(self) -> tuple[TableLoops, tuple[int, ...], tuple[WrongRow, ...]]:
        """Return the loops, their lines, and the rows that make none."""
        alike, others = self._patterns.read()
        alone: dict[int, Loop] = {}
        for which in sorted([*self._alone, *others]):
            row: Row = {}
            try:
                alone[which] = self._reader.loop(self._reader.row(self._lines[which][1], row))
            except Exception as error:  # whatever it is: one wrong row among thousands stops no other
                self._fail(which, row, error)
        loops = TableLoops(self._reader, self._lines, self._tags, alike, alone)
        self._wrong.sort(key=lambda wrong: wrong.line)
        return loops, tuple(self._lines[i][0] for i in loops.rows), tuple(self._wrong)


def _lines(path: str | Path) -> Lines:
    """Return the lines of a file; a control character, or a byte that is not UTF-8, costs its row only."""
    lines = split_lines(read_text(path, FleetError, _KIND, by_line=True), skip_empty_rows=True)
    if len(lines.rows) < 2:
        wanted = f"the file has a header line such as {','.join(REQUIRED)} and one line per loop"
        raise FleetError(f"{visible(str(path))}: no loops; {wanted}")
    return lines


def _header(found: Sequence[str]) -> list[str]:
    """Return the names of the columns."""
    for at, cell in enumerate(found, 1):
        if fault := control(cell):
            raise FleetError(f"column {at}: {fault}")
    stripped = [cell.strip() for cell in found]
    names = [cell.casefold() for cell in stripped]
    unknown = [cell for cell, name in zip(stripped, names, strict=True) if name not in COLUMNS]
    if unknown:
        which = quoted(", ".join(f"'{quoted(cell)}'{suggest(cell, COLUMNS)}" for cell in unknown), 400)
        raise FleetError(f"unknown column{'s' if len(unknown) > 1 else ''} {which}; columns: {', '.join(COLUMNS)}")
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        raise FleetError(f"no column '{missing[0]}'; {', '.join(REQUIRED)} are needed")
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise FleetError(f"the column '{twice[0]}' comes twice; keep one")
    return names


def _in_one_line(error: PidemuError) -> str:
    """Return the message of an error, as a row of a table can hold it."""
    if isinstance(error, CardError) and error.problems:
        return "; ".join(problem.headline() for problem in error.problems)
    return "; ".join(str(error).splitlines())
