"""What both controllers are tried with at limits and transfers: parts of the standard record, and what each makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.certificate.scaled_controller import ScaledController
from pidemu.controller.bench import Bench
from pidemu.controller.controller import Controller
from pidemu.errors import ScanError
from pidemu.records.files import Record
from pidemu.records.sampling import record_from_percent
from pidemu.records.standard import LEAST_SCANS, MOST_SCANS, REST, StandardRecord, scale_of, standard_record
from pidemu.settings.action import Action
from pidemu.settings.ranges import UNLIMITED, Limits

_MOST_SCANS: Final = 2000
"""The characteristic time is at most this many scans: it is a figure that is wanted, not a plot."""
_TOO_MANY: Final = 10_000
"""With more it is not tried: the other's interval is so much longer that the two have no time in common."""
_SLOW: Final = 5.0
"""A large error changes in so many derivative times, so that the derivative adds 40 % to what P does when it reverses."""
_FARTHEST: Final = 45.0
"""The largest error [% of the measurement span]: the measurement alone makes it, from 50 %."""
STEPS: Final = ("large positive error", "manual")
"""Parts of the standard record with a large error, as much of it the other way, and none: from the first to before the second."""
NOISE: Final = ("into a limit, with noise", "")
"""Parts with a ramp into a limit and back, with noise; to the end."""
Course = tuple[Floats, Floats]
"""Times from the start of a part [s], and outputs [% of the output span]."""


@dataclass(frozen=True, slots=True)
class TrialPlan:
    """What is tried.

    Attributes
    ----------
    time, size : float
        Characteristic time [s] and size [% of the source's measurement span] of the standard record.
    limits : tuple of float
        Output limits of both [% of the output span].
    ramp : float
        How long the large error takes to change [s]: no measurement in a plant steps by as much, and a derivative would kick.
    """

    time: float
    size: float
    limits: tuple[float, float]
    ramp: float = 0.0

    @property
    def error(self) -> float:
        """The large error [% of the source's measurement span]."""
        return min(8 * self.size, _FARTHEST)

    @property
    def offset(self) -> float:
        """The size of the error at the transfer to automatic [% of the source's measurement span]."""
        return self.size / 2

    @property
    def middle(self) -> float:
        """The output in the middle between the limits [% of the output span]."""
        return sum(self.limits) / 2


def planned(
    both: tuple[ScaledController, ScaledController], time_and_size: tuple[float, float], limits: tuple[float, float]
) -> TrialPlan:
    """Return what to try: with this time and size, or with another time where that takes too many scans, or too few.

    Parameters
    ----------
    both : tuple of ScaledController
        Source and target; the source sets the size that goes with another time.
    time_and_size : tuple of float
        Characteristic time [s] and size [%].
    limits : tuple of float
        Output limits [%].
    """
    time, size = time_and_size
    source, scans = both[0].settings, (both[0].scan, both[1].scan)
    shortest = LEAST_SCANS * max(scans)
    longest = max(_MOST_SCANS * min(scans), shortest)
    if time > longest:
        time, size = scale_of(source, longest / MOST_SCANS)  # of which this is the longest time
    elif time < shortest:
        time, size = scale_of(source, max(scans))
    derivative = max(abs(side.own.kd / side.own.kp) if side.own.kp else abs(side.own.kd) * time for side in both)
    return TrialPlan(time, size, limits, min(_SLOW * derivative, time / 2))


class TriedController:
    """One of the two controllers, to be tried.

    Parameters
    ----------
    side : ScaledController
        The controller.
    plan : TrialPlan
        What is tried.
    action : {"reverse", "direct"}
        Control action.
    span : float
        The source's measurement span per this one's, both in engineering units: what its percent are multiplied by.

    Raises
    ------
    ScanError
        It cannot be emulated at this interval.
    """

    def __init__(self, side: ScaledController, plan: TrialPlan, action: Action, span: float) -> None:
        if plan.time > _TOO_MANY * side.scan:
            raise ScanError(
                f"its scan interval of {side.scan:g} s is too short beside the other's; give intervals nearer to each other"
            )
        self._side, self._plan, self._action, self._span = side, plan, action, span
        self._ranges = side.settings.own_ranges
        self._record = _record(side.scan, plan.time, plan.size)

    @property
    def key(self) -> tuple[object, ...]:
        """What makes two of them the same."""
        return self._side.settings.card.id, self._side.settings, self._side.scan, self._plan, self._action, self._span

    def course(self, part: tuple[str, str], start: float, *, limited: bool) -> Course:
        """Return what the controller does with the error of some parts of the record, made by the measurement alone.

        Parameters
        ----------
        part : tuple of str
            The first part, and the one before which it ends.
        start : float
            The output at rest before it [% of the output span].
        limited : bool
            Whether the output limits are those of the plan, or none.

        Raises
        ------
        ScanError
            The output overflows.
        """
        first = self._begins(part[0])
        last = self._begins(part[1]) if part[1] else self._record.sp.size
        times = self._since(part[0])[first:last]
        error = (self._record.sp - self._record.pv)[first:last]
        if part == STEPS:
            error = self._plan.error * self._softened(times, error / np.max(np.abs(error)))
        pv = REST - self._span * error
        own = record_from_percent(Record(sp=np.full_like(pv, REST), pv=pv), self._ranges)
        controller = self._at_rest(start, self._plan.limits if limited else UNLIMITED)
        outputs = self._ranges.op.in_percent(controller.run(own.sp, own.pv))
        if not np.isfinite(outputs).all():
            raise self._overflow()
        return times, outputs

    def transfers(self) -> tuple[float, float]:
        """Return the bumps at the transfers to manual and back [% of the output span].

        The signals are those of ``manual`` with the first scan of ``return to automatic``; the operator starts from what the output
        was.

        Raises
        ------
        ScanError
            The output overflows.
        """
        (low, high), record = self._plan.limits, self._record
        assert record.manual is not None
        seen = replace(
            record,
            sp=REST + (record.sp - REST) * self._span,
            pv=REST + (record.pv - REST) * self._span,
            manual=low + record.manual * ((high - low) / 100),
        )
        own = record_from_percent(seen, self._ranges)
        assert own.manual is not None
        controller = self._at_rest(self._plan.middle, self._plan.limits)
        controller.run(own.sp[:3], own.pv[:3])
        start, end = self._begins("manual"), self._begins("return to automatic")
        last = controller.output
        by_hand: Floats = np.concatenate((np.array([last]), own.manual[start + 1 : end]))
        moved = controller.run(own.sp[start:end], own.pv[start:end], False, by_hand)
        after = controller.run(own.sp[end : end + 1], own.pv[end : end + 1])
        jumps = float(moved[0]) - last, float(after[0]) - float(moved[-1])
        bumps = self._ranges.op.change_in_percent(jumps[0]), self._ranges.op.change_in_percent(jumps[1])
        if not all(map(math.isfinite, bumps)):
            raise self._overflow()
        return bumps

    def check(self) -> None:
        """Try whether the controller can be emulated at all.

        Raises
        ------
        ScanError
            It cannot, or its output overflows.
        """
        self.course(STEPS, self._plan.middle, limited=True)

    def _softened(self, times: Floats, error: Floats) -> Floats:
        """Return the steps of an error of size 1, each taking the time of the plan."""
        time, ramp = self._plan.time, self._plan.ramp
        if not ramp:
            return error
        edges = [0.0, ramp, 2 * time, 2 * time + ramp, 5 * time, 5 * time + ramp]
        softened: Floats = np.interp(times, edges, [0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
        return softened

    def _at_rest(self, start: float, limits: Limits) -> Controller:
        side = self._side
        bench = Bench.in_percent(side.settings, side.scan, sp=REST, pv=REST, op=start, limits=limits, action=self._action)
        return bench.at_rest()

    def _begins(self, name: str) -> int:
        """Return the first sample of a segment."""
        return int(np.searchsorted(self._since(name), -1e-6 * self._side.scan))

    def _since(self, name: str) -> Floats:
        """Return the times of the record since a segment began [s]."""
        assert self._record.time is not None
        times: Floats = self._record.time - next(s.start for s in self._record.segments if s.name == name)
        return times

    def _overflow(self) -> ScanError:
        reasons = "; ".join(self._side.own.too_coarse(self._side.scan)) or "the settings are unstable by themselves"
        return ScanError(f"its output overflows at a scan interval of {self._side.scan:g} s: {reasons}")


@lru_cache(maxsize=2)
def _record(scan: float, time: float, size: float) -> StandardRecord:
    """Return the standard record; mostly source and target want the same one."""
    return standard_record(scan, time=time, size=size)
