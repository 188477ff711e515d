"""One loop of a kind prepared, and recorded; the others of its kind are prepared by what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.columns.replay import Recording
from pidemu.columns.traced import NotTracedError, Tape
from pidemu.fleet.kinds import with_numbers
from pidemu.fleet.loops import FleetPlan, Loop
from pidemu.program.ir import Structure
from pidemu.simulation.measured import measured
from pidemu.simulation.outcome import feedback_is_negative, last_answer


@dataclass(frozen=True, slots=True)
class PreparedColumns:
    """The numbers of loops of one structure, side by side.

    Attributes
    ----------
    values, initial : ndarray, shape (loops, coefficients) and (loops, states)
        Coefficients, and states before the first scan.
    lengths : ndarray, shape (loops, lines)
        Scans that each delay line delays by.
    scan, scans, answer : ndarray, shape (loops,)
        Scan intervals [s], numbers of scans, and when the last step is answered [s] (`pidemu.simulation.outcome.last_answer`).
    """

    values: Floats
    initial: Floats
    lengths: Floats
    scan: Floats
    scans: Floats
    answer: Floats

    def chosen(self, which: npt.NDArray[Any]) -> PreparedColumns:
        """Return the numbers of some of the loops."""
        return PreparedColumns(*(getattr(self, f.name)[which] for f in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[PreparedColumns]) -> PreparedColumns:
        """Return the numbers of several lots of loops, one after the other."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))


@dataclass(frozen=True, slots=True)
class RecordedLoop:
    """How loops of a kind are prepared.

    Attributes
    ----------
    structure : Structure
        What their programs have in common.
    recording : Recording
        From the numbers of the loops to those of their programs.
    """

    structure: Structure
    recording: Recording

    def columns(self, found: Floats) -> PreparedColumns:
        """Return the results of the recording by name, shape (results, loops)."""
        s = self.structure
        ends = np.cumsum([len(s.coefficients), len(s.states), len(s.lines)])
        values, initial, lengths, (scan, scans, answer) = np.split(found, ends)
        return PreparedColumns(values.T, initial.T, lengths.T, scan, scans, answer)


def record(loop: Loop, numbers: Sequence[float], plan: FleetPlan) -> RecordedLoop:
    """Prepare a loop, and return how it was done.

    Parameters
    ----------
    loop : Loop
        The loop.
    numbers : sequence of float
        Its numbers.
    plan : FleetPlan
        What is done to it.

    Raises
    ------
    NotTracedError
        It takes more than its numbers to prepare it: the time is chosen by its frequency response, or its feedback is positive.
    PidemuError
        The loop cannot be run.
    """
    if loop.scan is None or (loop.time is None and plan.time is None) or plan.margins:
        raise NotTracedError("what is chosen by the frequency response of the loop is not recorded")
    tape = Tape()
    trial = plan.trial(with_numbers(loop, [tape.number(x) for x in numbers]))
    program = measured(trial)
    if not feedback_is_negative(trial):
        raise NotTracedError("whether the loop is stable is looked up for it alone")
    results = (*program.values, *program.initial, *program.lengths, trial.scan, trial.scans, last_answer(trial))
    return RecordedLoop(program.structure, Recording.of(tape, numbers, results))
