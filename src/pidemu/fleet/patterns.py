"""Rows of a table that differ in their numbers only: one is read and recorded, the others' numbers are computed as its were.

A pattern is the text of a row without its tag and without the numbers of dials, process, scan interval, steps, time and limits.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.card.load import match_name
from pidemu.columns.lots import KindOfComputation, Lot
from pidemu.columns.replay import Recording
from pidemu.columns.traced import NotTracedError, Tape, standing_for
from pidemu.fleet.kinds import Kind, numbered
from pidemu.fleet.rows import Row, RowReader
from pidemu.settings.ranges import RANGES

_NUMBER: Final = re.compile(r"(?<![\w.+-])([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![\d.+-])")
_COLUMNS: Final = ("card", "action", "settings", "process", "scan", "limits", "setpoint", "load", "time")
"""What makes a pattern; in the first two a number is part of a name."""
_END: Final = "\x1f"
"""Between the cells of a pattern; it stands in none."""
_OF_PROCESS: Final = ("gain", "lag", "lead", "delay")
_NAME: Final = re.compile(r"([^;,=]*)=\s*\Z")
_WORD: Final = "000000000{}"
"""What stands for a number in a row that is recorded: a number that nobody writes so."""

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


@dataclass
class Patterns:
    """Rows by pattern.

    Attributes
    ----------
    reader : RowReader
        What reads a row.
    """

    reader: RowReader
    _found: dict[Pattern, tuple[list[int], list[list[str]]]] = field(default_factory=dict)
    _free: dict[Pattern, tuple[bool, ...]] = field(default_factory=dict)

    def add(self, which: int, row: Row) -> None:
        """Take a row, by its number."""
        get = row.get
        parts = _NUMBER.split(_END.join([get(name, "") for name in _COLUMNS[2:]]))
        numbers = parts[1::2]
        pattern = (row["card"], get("action", ""), *parts[::2])
        free = self._free.get(pattern)
        if free is None:
            free = self._free[pattern] = tuple(_free(self.reader, pattern))
        if not all(free):
            pattern, numbers = _refilled(pattern, numbers, free)
        found = self._found.get(pattern)
        if found is None:
            found = self._found[pattern] = ([], [])
        found[0].append(which)
        found[1].append(numbers)

    def read(self) -> tuple[list[tuple[RecordedRow, Lot]], list[int]]:
        """Return the numbers of loops of a kind, with how they were read; and which rows are to be read one by one."""
        done: list[tuple[RecordedRow, Lot]] = []
        left: list[int] = []
        for pattern, (which, numbers) in self._found.items():
            columns, wrong = _as_floats(numbers)
            lot = Lot(np.array(which), columns)
            left += lot.which[wrong].tolist()
            recorder = _Recorder(self.reader, pattern)
            found, others = KindOfComputation[RecordedRow]().compute(lot.chosen(~wrong), recorder.record)
            done += found
            left += others
        return done, left


@dataclass(frozen=True, slots=True)
class _Recorder:
    """Reads rows of a pattern with traced numbers."""

    reader: RowReader
    pattern: Pattern

    def record(self, _which: int, numbers: Sequence[float]) -> RecordedRow:
        """Read a row of these numbers, and return how it was done."""
        tape = Tape()
        words = {_WORD.format(i): tape.number(x) for i, x in enumerate(numbers)}
        card, action, *texts = self.pattern
        text = "".join(itertools.chain.from_iterable(itertools.zip_longest(texts, words, fillvalue="")))
        row = dict(zip(_COLUMNS, (card, action, *text.split(_END)), strict=True))
        with standing_for(words):
            loop = self.reader.loop({"tag": "", **{name: cell for name, cell in row.items() if cell}})
        found = numbered(loop)
        if found is None:
            raise NotTracedError("a loop of a kind of its own")
        return RecordedRow(found.kind, loop.settings.card.id, Recording.of(tape, numbers, found.numbers))


def _as_floats(numbers: Sequence[Sequence[str]]) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return numbers by column, and the rows of which one is too large or too small for a computer's."""
    count = len(numbers[0])
    flat = np.fromiter(map(float, itertools.chain.from_iterable(numbers)), np.float64, count * len(numbers))
    columns = flat.reshape(len(numbers), count).T
    wrong = np.asarray(np.isinf(columns).any(axis=0))
    for column, row in np.argwhere(columns == 0):
        wrong[row] |= re.search("[1-9]", numbers[row][column].casefold().partition("e")[0]) is not None
    return columns, wrong


def _refilled(pattern: Pattern, numbers: Sequence[str], free: Sequence[bool]) -> tuple[Pattern, list[str]]:
    """Return a pattern with the numbers that are part of it, and the others."""
    card, action, *texts = pattern
    filled = [texts[0]]
    for text, number, is_free in zip(texts[1:], numbers, free, strict=True):
        if is_free:
            filled.append(text)
        else:
            filled[-1] += number + text
    return (card, action, *filled), [number for number, is_free in zip(numbers, free, strict=True) if is_free]


def _free(reader: RowReader, pattern: Pattern) -> list[bool]:
    """Return which numbers of a pattern differ from loop to loop; choices of options, signal ranges and the like are part of it."""
    card, _, *texts = pattern
    try:
        options = reader.card(card).data.options
    except Exception:  # whatever it is, each row says it for itself
        return [False] * (len(texts) - 1)
    found, cell = [], 0
    for text in texts[:-1]:
        cell += text.count(_END)
        name = _NAME.search(text.rpartition(_END)[2])
        word = name[1].strip() if name else ""
        if _COLUMNS[2 + cell] == "settings":
            found.append(bool(word) and match_name(word, options) is None and word.casefold() not in RANGES)
        else:
            found.append(word in _OF_PROCESS if _COLUMNS[2 + cell] == "process" else True)
    return found
