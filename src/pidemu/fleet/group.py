"""Groups: prepared loops that share a structure, side by side."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from pidemu.analysis.loop_figures import LoopFigures
from pidemu.fleet.recorded import PreparedColumns
from pidemu.program.ir import Structure
from pidemu.simulation.trial import Trial

T = TypeVar("T")


class Prepared(NamedTuple):
    """A loop ready to run, or that ran.

    Attributes
    ----------
    place : int
        Its place in the fleet.
    tag, card : str
        Its name, and the id of its card.
    scan : float
        Scan interval [s].
    scans : int
        How many scans.
    answer : float
        When the process begins to answer the last step [s] (`pidemu.simulation.outcome.last_answer`).
    margins : LoopFigures or None
        Margins of the sampled loop, where they were asked for and there are any.
    stable : bool or None
        Whether it is stable; ``None`` where that is not known.
    """

    place: int
    tag: str
    card: str
    scan: float
    scans: int
    answer: float
    margins: LoopFigures | None
    stable: bool | None


@dataclass(frozen=True, eq=False)
class Group:
    """Loops that share a structure.

    Attributes
    ----------
    structure : Structure
        What their programs have in common.
    places : ndarray, shape (loops,)
        Their places in the fleet.
    tags, cards : tuple of str
        Their names, and the ids of their cards.
    columns : PreparedColumns
        The numbers of their programs.
    trial : callable
        From a place to the trial of its loop.
    judged : tuple or None
        Margins of each, and whether it is stable; where there are neither, ``None``.
    notes : tuple of str or None
        Why a scan interval is longer than a loop would take; ``None`` where none is.
    """

    structure: Structure
    places: npt.NDArray[np.int64]
    tags: tuple[str, ...]
    cards: tuple[str, ...]
    columns: PreparedColumns
    trial: Callable[[int], Trial]
    judged: tuple[tuple[LoopFigures | None, bool | None], ...] | None = None
    notes: tuple[str, ...] | None = None

    def __len__(self) -> int:
        return len(self.tags)

    def __iter__(self) -> Iterator[Prepared]:
        margins, stable = ([None] * len(self),) * 2 if self.judged is None else zip(*self.judged, strict=True)
        numbers = (x.tolist() for x in (self.columns.scan, self.scans, self.columns.answer))
        return map(Prepared, self.places.tolist(), self.tags, self.cards, *numbers, margins, stable)

    @property
    def scans(self) -> npt.NDArray[np.int64]:
        """How many scans each does."""
        return self.columns.scans.astype(np.int64)

    @property
    def mean_scans(self) -> int:
        """How many scans a loop does on average, rounded up."""
        return -(-int(self.scans.sum()) // len(self))

    def chosen(self, which: Sequence[int]) -> Group:
        """Return some of the loops, as a group."""
        judged = None if self.judged is None else _some(self.judged, which)
        at = np.asarray(which)
        return Group(
            self.structure,
            self.places[at],
            _some(self.tags, which),
            _some(self.cards, which),
            self.columns.chosen(at),
            self.trial,
            judged,
            None if self.notes is None else _some(self.notes, which),
        )

    def light(self) -> Group:
        """Return what is known of the loops, without what it takes to run them."""
        none = np.empty((len(self), 0))
        columns = replace(self.columns, values=none, initial=none, lengths=none)
        return replace(self, structure=None, columns=columns, trial=None)  # type: ignore[arg-type]

    def parts(self, width: int, longer: int) -> Iterator[Group]:
        """Yield the loops of one block after the other; a block runs until its last loop is done.

        Parameters
        ----------
        width : int
            At most so many loops in a block.
        longer : int
            None has more than so many times the scans of another.
        """
        scans, start = self.scans, 0
        while start < len(self):
            end = min(start + width, int(np.searchsorted(scans, longer * scans[start], "right")))
            yield self.chosen(range(start, end))
            start = end


def grouped(prepared: Iterable[Group]) -> list[Group]:
    """Return loops that were prepared together as one group per structure.

    Those of a group stand in the order of number of scans and dead time, so that the loops of a block take equally long and have
    delay lines of like length.

    Parameters
    ----------
    prepared : iterable of Group
        The loops; like ones share their structure.
    """
    found: dict[int, list[Group]] = {}
    for group in prepared:
        found.setdefault(id(group.structure), []).append(group)
    return [_in_order(_joined(groups)) for groups in found.values()]


def _joined(groups: Sequence[Group]) -> Group:
    if len(groups) == 1:
        return groups[0]
    judged = None
    if any(g.judged is not None for g in groups):
        judged = _all(g.judged or ((None, None),) * len(g) for g in groups)
    notes = _all(g.notes or ("",) * len(g) for g in groups) if any(g.notes is not None for g in groups) else None
    return Group(
        groups[0].structure,
        np.concatenate([g.places for g in groups]),
        _all(g.tags for g in groups),
        _all(g.cards for g in groups),
        PreparedColumns.joined([g.columns for g in groups]),
        groups[0].trial,
        judged,
        notes,
    )


def _some(items: Sequence[T], which: Iterable[int]) -> tuple[T, ...]:
    return tuple(items[i] for i in which)


def _all(parts: Iterable[Iterable[T]]) -> tuple[T, ...]:
    return tuple(itertools.chain.from_iterable(parts))


def _in_order(group: Group) -> Group:
    keys = (group.places, *group.columns.lengths.T[::-1], group.columns.scans)
    return group.chosen(np.lexsort(keys).tolist())
