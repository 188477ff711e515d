"""Rows of a table that differ in their numbers only: one is read and recorded, the others' numbers are computed as its were.

A pattern is the text of a row without its tag and without the numbers of dials, process, scan interval, steps, time and limits.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.card.load import match_name
from pidemu.columns.functions import standing_for
from pidemu.columns.lots import KindOfComputation, Lot
from pidemu.columns.replay import Recording
from pidemu.columns.traced import NotTracedError, Tape
from pidemu.fleet.kinds import Kind, numbered
from pidemu.fleet.rows import Row, RowReader, check_row
from pidemu.settings.ranges import RANGES

_NUMBER: Final = re.compile(r"([-+.0-9](?<![\w.+-].)[0-9.]*(?:[eE][+-]?[0-9]+)?)(?![\d.+-])")
"""What may be a number, and is no part of a name or of a longer number."""
_TAG: Final = re.compile(r'("?)\w(?:[\w.:/# -]*[\w.:/#-])?\1')
"""A tag that is the same however it is read, with or without quotation marks."""
_QUOTED: Final = re.compile('[^"]*|"[^"]*"')
_WITH_NUMBERS: Final = ("scan", "limits", "setpoint", "load", "time")
"""Cells that hold numbers and their units only."""
_OF_PROCESS: Final = ("gain", "lag", "lead", "delay")
_NAME: Final = re.compile(r"([^;,=]*)=\s*\Z")
_WORD: Final = "000000000{}"
_WORDS: Final = re.compile("0{9}([0-9]+)")
"""What stands for a number in a row that is recorded: a number as nobody writes it."""

_AT_ONCE: Final = 4096
"""Rows whose words are made numbers at a time."""

Pattern = tuple[str, ...]
"""The text between the numbers."""


@dataclass(frozen=True, slots=True)
class RecordedRow:
    """How rows of a pattern are read.

    Attributes
    ----------
    kind : Kind
        The kind of their loops.
    card : str
        The id of their card.
    recording : Recording
        From the numbers that are written to those of the loops.
    """

    kind: Kind
    card: str
    recording: Recording


class Patterns:
    """Rows by pattern.

    Parameters
    ----------
    reader : RowReader
        What reads a row.
    seen : dict
        The line of every tag.
    """

    def __init__(self, reader: RowReader, seen: dict[str, int]) -> None:
        self._reader, self._seen = reader, seen
        self._before = reader.header.index("tag")
        self._found: dict[Pattern, _Rows] = {}
        self._free: dict[Pattern, tuple[bool, ...] | None] = {}

    def take(self, which: int, number: int, line: str) -> str | None:
        """Take a row, and return its tag; ``None`` where it is to be read alone.

        Parameters
        ----------
        which : int
            The number of the row.
        number, line : int and str
            Its line in the file.
        """
        delimiter, before = self._reader.delimiter, self._before
        parts = line.split(delimiter, before + 1)
        if len(parts) <= before or not _TAG.fullmatch(parts[before]):
            return None
        tag, parts[before] = parts[before].strip('"'), ""
        if before and not all(map(_QUOTED.fullmatch, parts[:before])):
            return None  # a delimiter within quotation marks
        words = _NUMBER.split(delimiter.join(parts))
        pattern, numbers = tuple(words[::2]), words[1::2]
        free = self._free[pattern] if pattern in self._free else self._looked_at(pattern, numbers)
        if free is None or self._seen.setdefault(tag, number) != number:
            return None
        if not all(free):
            pattern, numbers = _refilled(pattern, numbers, free)
        rows = self._found.get(pattern)
        if rows is None:
            rows = self._found[pattern] = _Rows()
        rows.add(which, numbers)
        return tag

    def _looked_at(self, pattern: Pattern, numbers: Sequence[str]) -> tuple[bool, ...] | None:
        """Return which numbers of a pattern differ from loop to loop; ``None`` where it is no row of a loop."""
        try:
            actual = self._reader.row(_filled(pattern, numbers), {})
            check_row({"tag": "?", **actual}, 0, {})
            marked = self._reader.row(_filled(pattern, map(_WORD.format, range(len(numbers)))), {})
            free = set(_free(marked, self._reader.card(actual["card"]).data.options))
            found = tuple(i in free for i in range(len(numbers)))
        except Exception:  # whatever it is, each row says it for itself
            found = None
        self._free[pattern] = found
        return found

    def read(self) -> tuple[list[tuple[RecordedRow, Lot]], list[int]]:
        """Return the numbers of loops of a kind, with how they were read; and which rows are to be read one by one."""
        done: list[tuple[RecordedRow, Lot]] = []
        left: list[int] = []
        for pattern, rows in self._found.items():
            lot, wrong = rows.as_lot()
            left += wrong
            record = _Recorder(self._reader, pattern).record
            found, others = KindOfComputation[RecordedRow]().compute(lot, record)
            done += found
            left += others
        return done, left


class _Rows:
    """Rows of a pattern: their numbers are kept as such, which takes a tenth of the room of their words."""

    def __init__(self) -> None:
        self._which: list[int] = []
        self._words: list[Sequence[str]] = []
        self._lots: list[Lot] = []
        self._wrong: list[int] = []

    def add(self, which: int, words: Sequence[str]) -> None:
        """Add a row, by its number."""
        self._which.append(which)
        self._words.append(words)
        if len(self._words) == _AT_ONCE:
            self._keep()

    def _keep(self) -> None:
        columns, wrong = _as_floats(self._words)
        lot = Lot(np.array(self._which), columns)
        self._lots.append(lot.chosen(~wrong))
        self._wrong += lot.which[wrong].tolist()
        self._which, self._words = [], []

    def as_lot(self) -> tuple[Lot, list[int]]:
        """Return the rows, and those of which a number is none."""
        if self._words:
            self._keep()
        return Lot.joined(self._lots), self._wrong


@dataclass(frozen=True, slots=True)
class _Recorder:
    """Reads rows of a pattern with traced numbers."""

    reader: RowReader
    pattern: Pattern

    def record(self, _which: int, numbers: Sequence[float]) -> RecordedRow:
        """Read a row of these numbers, and return how it was done."""
        tape = Tape()
        words = {_WORD.format(i): tape.number(x) for i, x in enumerate(numbers)}
        row = self.reader.row(_filled(self.pattern, words), {})
        with standing_for(words):
            loop = self.reader.loop({"tag": "", **row})
        found = numbered(loop)
        if found is None:
            raise NotTracedError("a loop of a kind of its own")
        return RecordedRow(found.kind, loop.settings.card.id, Recording.of(tape, numbers, found.numbers))


def _filled(pattern: Pattern, numbers: Iterator[str] | Sequence[str] | Mapping[str, object]) -> str:
    """Return the text of a row, its tag empty."""
    return "".join(itertools.chain.from_iterable(itertools.zip_longest(pattern, numbers, fillvalue="")))


def _refilled(pattern: Pattern, numbers: Sequence[str], free: Sequence[bool]) -> tuple[Pattern, list[str]]:
    """Return a pattern with the numbers that are part of it, and the others."""
    filled = [pattern[0]]
    for text, number, is_free in zip(pattern[1:], numbers, free, strict=True):
        if is_free:
            filled.append(text)
        else:
            filled[-1] += number + text
    return tuple(filled), [number for number, is_free in zip(numbers, free, strict=True) if is_free]


def _free(row: Row, options: Mapping[str, object]) -> Iterator[int]:
    """Yield which numbers of a marked row differ from loop to loop; choices of options and ranges are part of a pattern."""
    for column, cell in row.items():
        for word in _WORDS.finditer(cell):
            named = _NAME.search(cell[: word.start()])
            name = named[1].strip() if named else ""
            of_dial = column == "settings" and name and match_name(name, options) is None and name not in RANGES
            if of_dial or (column == "process" and name in _OF_PROCESS) or column in _WITH_NUMBERS:
                yield int(word[1])


def _as_floats(numbers: Sequence[Sequence[str]]) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return numbers by column, and the rows of which one is none, or too large or too small for a computer's."""
    wrong = np.zeros(len(numbers), dtype=bool)
    try:
        flat = np.fromiter(map(float, itertools.chain.from_iterable(numbers)), np.float64)
    except ValueError:  # such as 1.2.3
        flat = np.array([_float(word) for row in numbers for word in row])
    columns = flat.reshape(len(numbers), -1).T
    wrong |= ~np.isfinite(columns).all(axis=0)
    for column, row in np.argwhere(columns == 0).tolist():
        word = numbers[row][column]
        wrong[row] |= word != "0" and re.search("[1-9]", word.casefold().partition("e")[0]) is not None
    return columns, wrong


def _float(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan
