"""Loops as programs, grouped by what they have in common."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from pidemu.analysis.loop_figures import LoopFigures
from pidemu.errors import PidemuError
from pidemu.fleet.loops import FleetPlan, Loop
from pidemu.program.ir import Program, Structure
from pidemu.simulation.experiment import Measuring, Steps, experiment
from pidemu.simulation.outcome import late_scan, margins_if_any
from pidemu.simulation.trial import Trial


@dataclass(frozen=True)
class Prepared:
    """A loop ready to run: the numbers of its program.

    Attributes
    ----------
    place : int
        Its place in the fleet.
    tag : str
        Its name.
    trial : Trial
        What runs.
    structure : Structure
        What its program shares with others.
    values, initial : tuple of float
        Coefficients, and states before the first scan.
    lengths : tuple of int
        Scans that each delay line delays by.
    margins : LoopFigures or None
        Margins of the sampled loop, where they were asked for and there are any.
    """

    place: int
    tag: str
    trial: Trial
    structure: Structure
    values: tuple[float, ...]
    initial: tuple[float, ...]
    lengths: tuple[int, ...]
    margins: LoopFigures | None = None


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


@dataclass(frozen=True)
class Group:
    """Loops that share a structure.

    Attributes
    ----------
    structure : Structure
        What their programs have in common.
    members : tuple of Prepared
        The loops, by number of scans and dead time, so that those of a block take equally long and have delay lines of like length.
    """

    structure: Structure
    members: tuple[Prepared, ...]

    @property
    def scans(self) -> int:
        """How many scans a loop does on average, rounded up."""
        return -(-sum(m.trial.scans for m in self.members) // len(self.members))

    def parts(self, width: int, longer: int) -> Iterator[tuple[Prepared, ...]]:
        """Yield the loops of one block after the other; a block runs until its last loop is done.

        Parameters
        ----------
        width : int
            At most so many loops in a block.
        longer : int
            None has more than so many times the scans of another.
        """
        start = 0
        for i, member in enumerate(self.members):
            if i - start == width or member.trial.scans > longer * self.members[start].trial.scans:
                yield self.members[start:i]
                start = i
        yield self.members[start:]


def prepared(loops: Iterable[tuple[int, Loop]], plan: FleetPlan, shared: dict[Structure, Structure]) -> list[Prepared | Failed]:
    """Return each loop as a program, or why it cannot be run.

    Parameters
    ----------
    loops : iterable of (int, Loop)
        Loops with their places in the fleet.
    plan : FleetPlan
        What is done to them.
    shared : dict
        Structures that there are already; new ones are added, so that like loops share theirs.
    """
    with _no_collection():
        return [_prepared(place, loop, plan, shared) for place, loop in loops]


def _prepared(place: int, loop: Loop, plan: FleetPlan, shared: dict[Structure, Structure]) -> Prepared | Failed:
    try:
        trial = plan.trial(loop)
        program = measured(trial)
        margins = margins_if_any(trial) if plan.margins else None
        structure = program.structure
        shared_one = shared.setdefault(structure, structure)
    except Exception as error:  # whatever it is: one wrong loop among thousands stops no other
        return Failed(place, reason_of(error))
    return Prepared(place, loop.tag, trial, shared_one, program.values, program.initial, program.lengths, margins)


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
def _no_collection() -> Iterator[None]:
    """Make many objects without looking for circles among them after every few hundred: there are none."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def measured(trial: Trial) -> Program:
    """Return a trial as a program that makes its own steps and figures; errors count from the load step on, or from the start."""
    at, sizes = [], []
    for step in (trial.setpoint_step, trial.load_step):
        at.append(trial.scans if step is None else trial.first(step[0]))
        sizes.append(0.0 if step is None else step[1])
    start = 0 if trial.load_step is None else at[1]
    measuring = Measuring(trial.scan, start, late_scan(trial.scans), trial.initial[2], trial.limits)
    loop = trial.program(trial.controller())
    return experiment(loop, Steps(trial.initial[0], sizes[0], at[0], sizes[1], at[1]), measuring)


def grouped(members: Iterable[Prepared]) -> list[Group]:
    """Return the loops by structure.

    Parameters
    ----------
    members : iterable of Prepared
        Loops that were prepared together, so that like ones share their structure.
    """
    found: dict[int, list[Prepared]] = {}
    for member in members:
        found.setdefault(id(member.structure), []).append(member)
    return [Group(some[0].structure, tuple(sorted(some, key=lambda m: (m.trial.scans, m.lengths)))) for some in found.values()]
