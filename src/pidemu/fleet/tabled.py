"""The loops of a table: their numbers in columns; a loop itself is made where somebody asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pidemu.columns.lots import Lot
from pidemu.fleet.kinds import Kind, with_numbers
from pidemu.fleet.lists import LoopList, by_kind
from pidemu.fleet.loops import Loop
from pidemu.fleet.patterns import RecordedRow
from pidemu.fleet.rows import RowReader


class TableLoops(LoopList):
    """Loops of a table, which take the room of their text and their numbers.

    Parameters
    ----------
    reader : RowReader
        What reads a row.
    lines : sequence of (int, str)
        The rows of the table: each with its line in the file, and the text.
    tags : sequence of str
        The tag of each row.
    alike : sequence of (RecordedRow, Lot)
        Rows that were read together: of what kind, which, and the numbers of their loops.
    alone : mapping of int to Loop
        Rows that were read one by one.
    """

    def __init__(
        self,
        reader: RowReader,
        lines: Sequence[tuple[int, str]],
        tags: Sequence[str],
        alike: Sequence[tuple[RecordedRow, Lot]],
        alone: Mapping[int, Loop],
    ) -> None:
        self._reader, self._lines = reader, lines
        count = len(lines)
        cards: list[str | None] = [None] * count
        for recorded, lot in alike:
            for i in lot.which.tolist():
                cards[i] = recorded.card
        for i, loop in alone.items():
            cards[i] = loop.settings.card.id
        self.rows = [i for i, card in enumerate(cards) if card is not None]
        """The row of each loop; the others make none."""
        self.tags = [tags[i] for i in self.rows]
        self.cards = [card for card in cards if card is not None]
        place = np.full(count, -1)
        place[self.rows] = np.arange(len(self.rows))
        self._alike = [(recorded.kind, Lot(place[lot.which], lot.columns)) for recorded, lot in alike]
        self._alone = {int(place[i]): loop for i, loop in alone.items()}

    def __len__(self) -> int:
        return len(self.rows)

    def _at(self, which: int) -> Loop:
        """Return a loop, made of its row if it was read with others."""
        which = range(len(self))[which]
        known = self._alone.get(which)
        return known if known is not None else self._reader.loop(self._reader.row(self._lines[self.rows[which]][1], {}))

    def chosen(self, which: Sequence[int]) -> TableLoops:
        """Return some of the loops."""
        part = object.__new__(TableLoops)
        part._reader, part._lines = self._reader, [self._lines[self.rows[i]] for i in which]
        part.rows = list(range(len(which)))
        part.tags, part.cards = [self.tags[i] for i in which], [self.cards[i] for i in which]
        place = np.full(len(self), -1)
        place[np.asarray(which, dtype=np.int64)] = np.arange(len(which))
        part._alike = []
        for kind, lot in self._alike:
            some = lot.chosen(place[lot.which] >= 0)
            if len(some):
                part._alike.append((kind, Lot(place[some.which], some.columns)))
        part._alone = {int(place[i]): loop for i, loop in self._alone.items() if place[i] >= 0}
        return part

    def quickly(self) -> Iterator[Loop]:
        """Yield the loops for who looks at their numbers: tags, and how settings were typed, may be another loop's."""
        found: list[Loop | None] = [self._alone.get(i) for i in range(len(self))]
        for _, lot in self._alike:
            first = self[int(lot.which[0])]
            for which, numbers in zip(lot.which.tolist(), lot.columns.T.tolist(), strict=True):
                found[which] = with_numbers(first, numbers)
        return (loop for loop in found if loop is not None)

    def by_kind(self) -> tuple[list[tuple[Kind, Lot]], list[int]]:
        """Return the numbers of the loops by kind, and those loops that are of a kind of their own."""
        alone, others = by_kind(self._alone.items())
        found: dict[Kind, list[Lot]] = {}
        for kind, lot in (*self._alike, *alone):
            found.setdefault(kind, []).append(lot)
        return [(kind, Lot.joined(lots)) for kind, lots in found.items()], others
