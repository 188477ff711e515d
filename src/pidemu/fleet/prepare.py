"""Loops made ready to run: one by one, or all of a kind at once; both ways give the same numbers.

The single way builds the program of a loop, which takes a millisecond. Of a kind of loops one is prepared so and recorded, and the
others' numbers are computed as its were (`pidemu.fleet.recorded`). Where guards say that a loop has another structure, it begins a
recording of its own, or is prepared alone.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from pidemu.columns.lots import KindOfComputation, Lot
from pidemu.errors import PidemuError
from pidemu.fleet.group import Group
from pidemu.fleet.lists import PlacedLoops
from pidemu.fleet.loops import FleetPlan
from pidemu.fleet.recorded import PreparedColumns, RecordedLoop, record
from pidemu.program.ir import Structure
from pidemu.simulation.measured import measured
from pidemu.simulation.outcome import last_answer, margins_if_any, stability_of
from pidemu.simulation.trial import Trial

_SLICE: Final = 64
"""Loops that are prepared one by one from one look at what is done to the next."""


@dataclass(frozen=True)
class Failed:
    """A loop that cannot be run.

    Attributes
    ----------
    place : int
        Its place in the fleet.
    reason : str
        Why.
    """

    place: int
    reason: str


class Preparation:
    """Prepares the loops of a run, and remembers how.

    Parameters
    ----------
    plan : FleetPlan
        What is done to the loops.

    Attributes
    ----------
    structures : dict
        The structures that there are, so that like loops share theirs.
    """

    def __init__(self, plan: FleetPlan) -> None:
        self._plan = plan
        self._kinds: dict[Hashable, KindOfComputation[RecordedLoop]] = {}
        self.structures: dict[Structure, Structure] = {}

    def prepared(self, loops: PlacedLoops) -> Iterator[Group | Failed]:
        """Yield loops as programs, many of them at once, or why one cannot be run.

        Parameters
        ----------
        loops : PlacedLoops
            Some loops of the fleet.
        """
        left: list[int] = list(range(len(loops)))
        if not self._plan.margins:  # these take each loop by itself
            kinds, left = loops.loops.by_kind()
            for kind, lot in kinds:
                known = self._kinds.setdefault(kind, KindOfComputation())
                done, others = known.compute(lot, self._record(loops))
                left += others
                yield from (self._group(loops, recorded, one) for recorded, one in done)
        left.sort()
        for start in range(0, len(left), _SLICE):
            with no_collection():
                found = [self._alone(loops, i) for i in left[start : start + _SLICE]]
            yield from found

    def _record(self, loops: PlacedLoops) -> Callable[[int, Sequence[float]], RecordedLoop]:
        return lambda which, numbers: record(loops.loops[which], numbers, self._plan)

    def _group(self, loops: PlacedLoops, recorded: RecordedLoop, lot: Lot) -> Group:
        which, all_of_them = lot.which.tolist(), loops.loops
        return Group(
            self.structures.setdefault(recorded.structure, recorded.structure),
            np.array([loops.places[i] for i in which]),
            tuple(all_of_them.tags[i] for i in which),
            tuple(all_of_them.cards[i] for i in which),
            recorded.columns(lot.columns),
            partial(_trial, self._plan, loops),
        )

    def _alone(self, loops: PlacedLoops, which: int) -> Group | Failed:
        """Prepare one loop."""
        place, loop = loops[which]
        try:
            trial = self._plan.trial(loop)
            program = measured(trial)
            margins = margins_if_any(trial) if self._plan.margins else None
            stable = stability_of(trial, margins)
            shared = self.structures.setdefault(program.structure, program.structure)
        except Exception as error:  # whatever it is: one wrong loop among thousands stops no other
            return Failed(place, reason_of(error))
        numbers = (program.values, program.initial, program.lengths, trial.scan, trial.scans, last_answer(trial))
        columns = PreparedColumns(*(np.array([x], dtype=np.float64) for x in numbers))
        trial_at, card = partial(_trial, self._plan, loops), loop.settings.card.id
        notes = (trial.note,) if trial.note else None
        return Group(shared, np.array([place]), (loop.tag,), (card,), columns, trial_at, ((margins, stable),), notes)


def _trial(plan: FleetPlan, loops: PlacedLoops, place: int) -> Trial:
    return plan.trial(loops.at(place))


def reason_of(error: Exception) -> str:
    """Return why a loop failed; what is not an error of pidemu's own is called what it is.

    Parameters
    ----------
    error : Exception
        What was raised.
    """
    if isinstance(error, PidemuError):
        return str(error)
    return (
        f"internal error of this loop ({type(error).__name__}: {error}); give the loop what pidemu.Loop documents, "
        f"and report it where that is done"
    )


@contextlib.contextmanager
def no_collection() -> Iterator[None]:
    """Make many objects without looking for circles among them after every few hundred: there are none."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
