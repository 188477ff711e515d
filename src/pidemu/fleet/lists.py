"""Lists of loops: those of a fleet, some of them, and those of one kind among them."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

import numpy as np

from pidemu.columns.lots import Lot
from pidemu.errors import FleetError
from pidemu.fleet.kinds import Kind, numbered
from pidemu.fleet.loops import Loop


class LoopList(Sequence[Loop]):
    """The loops of a fleet, or some of them, in order.

    Parameters
    ----------
    loops : iterable of Loop
        The loops.

    Attributes
    ----------
    tags, cards : sequence of str
        The names of the loops, and the ids of their cards.
    """

    def __init__(self, loops: Iterable[Loop]) -> None:
        self._loops = tuple(loops)
        self.tags: Sequence[str] = [loop.tag for loop in self._loops]
        self.cards: Sequence[str] = [loop.settings.card.id for loop in self._loops]

    def __len__(self) -> int:
        return len(self._loops)

    @overload
    def __getitem__(self, at: int) -> Loop: ...
    @overload
    def __getitem__(self, at: slice) -> LoopList: ...
    def __getitem__(self, at: int | slice) -> Loop | LoopList:
        return self.chosen(range(len(self))[at]) if isinstance(at, slice) else self._at(at)

    def _at(self, which: int) -> Loop:
        return self._loops[which]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and len(self) == len(other) and all(map(operator.eq, self, other))

    def __repr__(self) -> str:
        return f"<{len(self):,} loops>"

    __hash__ = None  # type: ignore[assignment]  # of its loops, some may be written as they are asked for

    def chosen(self, which: Sequence[int]) -> LoopList:
        """Return some of the loops."""
        return LoopList([self._loops[i] for i in which])

    def quickly(self) -> Iterator[Loop]:
        """Yield the loops for who looks at their numbers: tags, and how settings were typed, may be another loop's."""
        return iter(self._loops)

    def by_kind(self) -> tuple[list[tuple[Kind, Lot]], list[int]]:
        """Return the numbers of the loops by kind, and those loops that are of a kind of their own."""
        return by_kind(enumerate(self._loops))


def by_kind(loops: Iterable[tuple[int, Loop]]) -> tuple[list[tuple[Kind, Lot]], list[int]]:
    """Return the numbers of loops by kind, and those loops that are of a kind of their own.

    Parameters
    ----------
    loops : iterable of (int, Loop)
        The loops, with their numbers in a list.
    """
    found: dict[Kind, tuple[list[int], list[list[float]]]] = {}
    others = []
    for i, loop in loops:
        one = numbered(loop)
        if one is None:
            others.append(i)
        else:
            which, numbers = found.setdefault(one.kind, ([], []))
            which.append(i)
            numbers.append(one.numbers)
    lots = [(kind, Lot(np.array(which), np.array(numbers, dtype=np.float64).T)) for kind, (which, numbers) in found.items()]
    return lots, others


class PlacedLoops(Sequence[tuple[int, Loop]]):
    """Loops with their places in a fleet.

    Parameters
    ----------
    loops : LoopList
        The loops.
    places : sequence of int
        Their places.
    """

    def __init__(self, loops: LoopList, places: Sequence[int]) -> None:
        self.loops, self.places = loops, places

    @classmethod
    def of(cls, pairs: Iterable[tuple[int, Loop]]) -> PlacedLoops:
        """Return them from pairs of place and loop."""
        if isinstance(pairs, PlacedLoops):
            return pairs
        both = list(pairs)
        return cls(LoopList(loop for _, loop in both), [place for place, _ in both])

    def __len__(self) -> int:
        return len(self.places)

    def at(self, place: int) -> Loop:
        """Return the loop at a place of the fleet."""
        return self.loops[self.places.index(place)]

    @overload
    def __getitem__(self, at: int) -> tuple[int, Loop]: ...
    @overload
    def __getitem__(self, at: slice) -> PlacedLoops: ...
    def __getitem__(self, at: int | slice) -> tuple[int, Loop] | PlacedLoops:
        if isinstance(at, slice):
            return PlacedLoops(self.loops[at], self.places[at])
        return self.places[at], self.loops[at]


def unique(loops: Iterable[Loop]) -> LoopList:
    """Return the loops as a list.

    Raises
    ------
    FleetError
        There are none, or two have the same tag.
    """
    found = loops if isinstance(loops, LoopList) else LoopList(loops)
    if not found:
        raise FleetError("a fleet has no loops; give at least one")
    seen: set[str] = set()
    for tag in found.tags:
        if tag in seen:
            raise FleetError(f"two loops have the tag '{tag}'; give each its own")
        seen.add(tag)
    return found
