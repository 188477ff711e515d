"""How two controllers come back from an output limit, each at its own scan interval (specs/equations.md, section 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.certificate.trials import NOISE, STEPS, Course, TrialPlan, TriedController

_BEYOND: Final = 0.6
"""The output starts so near to the limit that it would need this part of the way that it goes where nothing limits it."""
_APART: Final = 0.02
"""Difference of outputs that is worth a word, per way to the limit: 1 % of the output span where that is 50 %."""
_LEAST: Final = 0.05
"""The output starts at least so far from the limit [% of the output span]."""
_LATE: Final = 0.02
"""Difference of leaving times that is worth a word, in characteristic times; one scan of the slower controller at least."""
_SMOOTH: Final = 0.1
"""Time over which noise is averaged, in characteristic times: ten of its values."""
_HAIR: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Recovery:
    """What a controller did when a large error had driven it to the high limit, and the error turned.

    Attributes
    ----------
    reached : float
        Its output when the error turned [% of the output span].
    at_limit : bool
        Whether that is a limit.
    stays : float
        For how long it stood there from the first scan with the error of the other sign [s]: 0 where that scan leaves it for good,
        infinite where it does not leave while that error lasts.
    at_zero : float
        Its output with the error back at zero, in the end [% of the output span].
    """

    reached: float
    at_limit: bool
    stays: float
    at_zero: float


@dataclass(frozen=True, slots=True)
class Recoveries:
    """What both did, and which of it differs by more than their linear laws explain.

    Attributes
    ----------
    both : tuple of Recovery
        Source and target after steps of the error.
    short, late, apart : bool
        Whether only one reaches the limit; whether one leaves it later; whether the outputs differ with the error back at zero.
    noisy : tuple of float or None
        Outputs on the way back from the low limit along a ramp with measurement noise, averaged over the noise, where they are
        furthest apart [% of the output span]; ``None`` where they do not differ.
    noisy_at : float
        When that is, after the ramp back has begun [s].
    """

    both: tuple[Recovery, Recovery]
    short: bool
    late: bool
    apart: bool
    noisy: tuple[float, float] | None
    noisy_at: float

    @property
    def differ(self) -> bool:
        """Whether there is any difference."""
        return self.short or self.late or self.apart or self.noisy is not None


def recoveries(tried: tuple[TriedController, TriedController], plan: TrialPlan, scans: tuple[float, float]) -> Recoveries:
    """Return how both come back from a limit.

    Each is at rest first; then the measurement alone makes the error. Both are run without limits as well: what their linear laws
    make different is no difference at a limit. The output starts in the middle, or nearer to the limit if need be.

    Parameters
    ----------
    tried : tuple of TriedController
        Source and target.
    plan : TrialPlan
        Time, size and limits.
    scans : tuple of float
        Scan intervals [s].

    Raises
    ------
    ScanError
        An output overflows.
    """
    high, low = plan.limits[1], plan.limits[0]
    free, way = _free(tried, plan, STEPS, 2.0)
    found = [b.course(STEPS, max(plan.middle, high - way), limited=True) for b in tried]
    both = _recovery(found[0], plan), _recovery(found[1], plan)
    ends = [[_at(c, t * plan.time) for t in (2.0, 5.0, 6.0)] for c in free]
    law = max(abs(x - y) for x, y in zip(*ends, strict=True))
    stays = both[0].stays, both[1].stays
    worth = max(max(scans) * (1 + 1e-9), _LATE * plan.time)
    noisy, when = _noisy(tried, plan, low)
    return Recoveries(
        both=both,
        short=both[0].at_limit != both[1].at_limit,
        late=stays[0] != stays[1] and abs(stays[0] - stays[1]) > worth,
        apart=abs(both[0].at_zero - both[1].at_zero) > _APART * way + law,
        noisy=noisy,
        noisy_at=when,
    )


def _free(
    tried: tuple[TriedController, TriedController], plan: TrialPlan, part: tuple[str, str], until: float
) -> tuple[list[Course], float]:
    """Return what both do without limits, and the way to the limit [% of the output span]: as far as both go beyond."""
    free = [b.course(part, plan.middle, limited=False) for b in tried]
    half = (plan.limits[1] - plan.limits[0]) / 2
    way = min(half, *(_BEYOND * abs(_at(c, until * plan.time) - plan.middle) for c in free))
    return free, max(way, _LEAST)


def _at(course: Course, time: float) -> float:
    """Return the output in the last scan before a time [s]."""
    times, outputs = course
    return float(outputs[np.searchsorted(times, time - _HAIR * (times[1] - times[0])) - 1])


def _recovery(course: Course, plan: TrialPlan) -> Recovery:
    times, outputs = course
    step, (low, high) = float(times[1] - times[0]), plan.limits
    turn, zero, back = (np.searchsorted(times, t - _HAIR * step) for t in (2 * plan.time, _turned(plan), 5 * plan.time))
    reached, rounding = float(outputs[turn - 1]), 1e-6 * (high - low)  # limits in float32
    at_high = reached >= high - rounding
    if not at_high and reached > low + rounding:
        return Recovery(reached, False, 0.0, float(outputs[-1]))
    held = outputs[zero:back]
    still = np.flatnonzero(held >= high - rounding if at_high else held <= low + rounding)
    off = int(still[-1]) + 1 if still.size else 0
    return Recovery(reached, True, math.inf if off >= held.size else off * step, float(outputs[-1]))


def _turned(plan: TrialPlan) -> float:
    """Return when the error has the other sign [s]."""
    return 2 * plan.time + plan.ramp / 2


def _noisy(tried: tuple[TriedController, TriedController], plan: TrialPlan, low: float) -> tuple[tuple[float, float] | None, float]:
    """Return outputs on the way back from the limit with noise where they are furthest apart, and when [s]."""
    free, way = _free(tried, plan, NOISE, 3.0)
    found = [b.course(NOISE, min(plan.middle, low + way), limited=True) for b in tried]
    at = free[0][0]
    law = float(np.max(np.abs(np.subtract(*(_averaged(c, at, plan.time) for c in free)))))
    mine, other = (_averaged(c, at, plan.time) for c in found)
    apart = np.where(at >= 3 * plan.time, np.abs(mine - other), 0.0)
    worst = int(np.argmax(apart))
    if not apart[worst] > _APART * way + law:
        return None, 0.0
    return (float(mine[worst]), float(other[worst])), float(at[worst]) - 3 * plan.time


def _averaged(course: Course, at: Floats, time: float) -> Floats:
    """Return outputs at the source's scans, each averaged over the noise before it."""
    times, outputs = course
    held = outputs[np.searchsorted(times, at + _HAIR * (at[1] - at[0]), side="right") - 1]
    n = max(1, round(_SMOOTH * time / float(at[1] - at[0])))
    sums = np.cumsum(np.concatenate((np.full(n, held[0]), held)))
    averaged: Floats = (sums[n:] - sums[:-n]) / n
    return averaged
