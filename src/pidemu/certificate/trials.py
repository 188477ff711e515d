"""What a controller does at an output limit and at transfers, found by emulation on parts of the standard record."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from pidemu.certificate.sides import Side
from pidemu.emulator import Controller
from pidemu.errors import ScanError
from pidemu.record.files import Floats
from pidemu.record.playback import Timing, limits_of
from pidemu.record.sampling import Scale, controller_for
from pidemu.record.standard import LEAST_SCANS, MOST_SCANS, REST, StandardRecord, scale_of, standard_record
from pidemu.scan.build import Action
from pidemu.settings import Settings

_MOST_SCANS: Final = 2000
"""The characteristic time is at most this many scans: it is a figure that is wanted, not a plot."""
_TOO_MANY: Final = 10_000
"""With more it is not tried: the other's interval is so much longer that the two have no time in common."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is tried.

    Attributes
    ----------
    time, size : float
        Characteristic time [s] and size [% of the source's measurement span] of the standard record.
    limits : tuple of float
        Output limits of both [% of the output span].
    """

    time: float
    size: float
    limits: tuple[float, float]

    @property
    def error(self) -> float:
        """The large error [% of the source's measurement span]."""
        return min(8 * self.size, 90.0)

    @property
    def offset(self) -> float:
        """The size of the error at the transfer to automatic [% of the source's measurement span]."""
        return self.size / 2

    @property
    def middle(self) -> float:
        """The output at rest [% of the output span]: in the middle between the limits."""
        return sum(self.limits) / 2


@dataclass(frozen=True, slots=True)
class Trial:
    """What a controller did.

    Attributes
    ----------
    at_limit : bool
        Whether the large error brought it to a limit, where it stood when the error changed its sign.
    stays : float
        For how long it stood there from the first scan with the error of the other sign [s]: 0 where that scan leaves it for good,
        infinite where it does not leave while that error lasts.
    at_zero : float
        Its output with the error back at zero, in the end [% of the output span].
    to_manual : float
        Bump at the transfer to manual where the operator's output is what the output was [% of the output span].
    to_automatic : float
        Bump at the transfer to automatic with an error [% of the output span].
    """

    at_limit: bool
    stays: float
    at_zero: float
    to_manual: float
    to_automatic: float


def planned(source: Settings, scans: tuple[float, float], time_and_size: tuple[float, float], limits: tuple[float, float]) -> Plan:
    """Return what to try: with this time and size, or with another time where that takes too many scans, or too few.

    Parameters
    ----------
    source : Settings
        The source, which sets the size that goes with another time.
    scans : tuple of float
        Scan intervals of source and target [s].
    time_and_size : tuple of float
        Characteristic time [s] and size [%].
    limits : tuple of float
        Output limits [%].
    """
    time, size = time_and_size
    shortest = LEAST_SCANS * max(scans)
    longest = max(_MOST_SCANS * min(scans), shortest)
    if time > longest:
        time, size = scale_of(source, longest / MOST_SCANS)  # of which this is the longest time
    elif time < shortest:
        time, size = scale_of(source, max(scans))
    return Plan(time, size, limits)


def tried(side: Side, plan: Plan, action: Action, span: float) -> Trial:
    """Run a controller at rest into its limit and back, and at rest again through manual and back.

    The signals are those of the standard record from ``large positive error`` to ``back from the limit``, and those of ``manual``
    with the first scan of ``return to automatic``; the operator starts from what the output was.

    Parameters
    ----------
    side : Side
        The controller.
    plan : Plan
        Time, size and limits.
    action : {"reverse", "direct"}
        Control action.
    span : float
        The source's measurement span per this one's, both in engineering units: what its percent are multiplied by.

    Raises
    ------
    ScanError
        It cannot be emulated at this interval, which includes an output that overflows.
    """
    if plan.time > _TOO_MANY * side.scan:
        raise ScanError(
            f"its scan interval of {side.scan:g} s is too short beside the other's; give intervals nearer to each other"
        )
    record = _record(side.scan, plan.time, plan.size)
    seen = replace(record, sp=REST + (record.sp - REST) * span, pv=REST + (record.pv - REST) * span)
    low, high = plan.limits
    if record.manual is not None:
        seen = replace(seen, manual=low + record.manual * ((high - low) / 100))
    scale = Scale(side.settings)
    own = scale.own(seen)
    assert isinstance(own, StandardRecord)
    controller, _ = controller_for(side.settings, Timing(side.scan), action, plan.limits, plan.middle)
    controller.rest(float(own.sp[0]), float(own.pv[0]), scale.output_own(plan.middle))
    at_rest = controller.state
    at_limit, stays, at_zero = _into_the_limit(controller, own, scale)
    controller.reset()
    controller.start(**at_rest)
    to_manual, to_automatic = (bump * side.op_percent for bump in _through_manual(controller, own))
    if not all(map(math.isfinite, (at_zero, to_manual, to_automatic))):
        reasons = "; ".join(side.own.too_coarse(side.scan)) or "the settings are unstable by themselves"
        raise ScanError(f"its output overflows at a scan interval of {side.scan:g} s: {reasons}")
    return Trial(at_limit, stays, at_zero, to_manual, to_automatic)


@lru_cache(maxsize=2)
def _record(scan: float, time: float, size: float) -> StandardRecord:
    """Return the standard record; mostly source and target want the same one."""
    return standard_record(scan, time=time, size=size)


def _into_the_limit(controller: Controller, own: StandardRecord, scale: Scale) -> tuple[bool, float, float]:
    """Return whether the large error leads to a limit, how long it holds there once it has turned [s], and the output after it."""
    start, turn = (_begins(own, f"large {sign} error") for sign in ("positive", "negative"))
    back, end = _begins(own, "back from the limit"), _begins(own, "manual")
    outputs = controller.run(own.sp[start:end], own.pv[start:end])
    low, high = limits_of(controller)
    before = outputs[turn - start - 1]
    if not (before >= high or before <= low):
        return False, 0.0, float(scale.output_percent(outputs[-1:])[0])
    held: Floats = outputs[turn - start : back - start]
    still = np.flatnonzero(held >= high if before >= high else held <= low)
    off = int(still[-1]) + 1 if still.size else 0
    stays = math.inf if off >= held.size else off * controller.interval
    return True, stays, float(scale.output_percent(outputs[-1:])[0])


def _through_manual(controller: Controller, own: StandardRecord) -> tuple[float, float]:
    """Return the bumps from automatic to manual and back [as the output]."""
    controller.run(own.sp[:3], own.pv[:3])
    start, end = _begins(own, "manual"), _begins(own, "return to automatic")
    assert own.manual is not None
    last = controller.output
    by_hand = np.concatenate(([last], own.manual[start + 1 : end]))
    moved = controller.run(own.sp[start:end], own.pv[start:end], False, by_hand)
    after = controller.run(own.sp[end : end + 1], own.pv[end : end + 1])
    return float(moved[0]) - last, float(after[0]) - float(moved[-1])


def _begins(record: StandardRecord, name: str) -> int:
    """Return the first sample of a segment."""
    assert record.time is not None
    at = next(s.start for s in record.segments if s.name == name)
    return int(np.searchsorted(record.time, at - 1e-6 * (record.time[1] - record.time[0])))
