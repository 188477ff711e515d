"""The exact match: all coefficients of the feedback path agree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from pidemu.card.model.base import Form
from pidemu.conversion.match.factors import ROUNDING, behind_signal_filter, clean, leads, without_proportional
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target
from pidemu.errors import UndefinedError
from pidemu.law.law import Law
from pidemu.units import Role


def exact(law: Law, target: Target) -> tuple[Numbers, ...]:
    """Return the numbers for which all coefficients of the feedback path agree.

    The target's filter must be free, or follow from an overall multiplier that is: with a filter time in proportion to the
    derivative on the dial, the multiplier decides how much of the derivative stands there. A series form has two solutions; the one
    with ``Ti >= Td`` comes first.

    Raises
    ------
    NoMatchError
        There are none.
    """
    try:
        n0, n1, n2, d1, d2 = law.coefficients()
    except UndefinedError:
        raise NoMatchError("the source has more filters than the target") from None
    shape, filt = target.shape, target.filter
    of_dial = target.form is Form.PARALLEL and filt.of != "derivative-time"
    by_multiplier = of_dial and filt.ratio > 0 and target.may_choose(Role.MULTIPLIER)
    if not filt.free and not by_multiplier:
        raise NoMatchError("the target's filter is fixed")
    if filt.needed and n2 and not d1:
        raise NoMatchError("the target's derivative always has a filter, the source's has none")
    wanted_d2 = d1 * d1 / 2 if shape.filter_order == 2 and shape.filter_on == "measurement" else 0.0
    if abs(d2 - wanted_d2) > ROUNDING * max(d1 * d1, abs(d2)):
        raise NoMatchError("the two filters are of different order")
    if target.form is Form.SERIES and not target.has_proportional:
        if n1 or n2:
            raise NoMatchError("the target has no proportional term")
        return (without_proportional(n0, 0.0, target, target.idle_gain),)
    if shape.filter_on != "term":
        return tuple(behind_signal_filter(n0, n1, n2, d1 if filt.free else None, target.form))
    if shape.series:
        return tuple(_exact_series(n0, n1, n2, d1, filt))
    kp = clean(n1 - n0 * d1, n1)
    kd = clean(n2 - kp * d1, n2)
    if not filt.free and not (kd and d1):
        raise NoMatchError("there is no derivative with a filter to set the multiplier by")
    if not filt.free:
        return (Numbers(kp, n0, kd, multiplier=abs(filt.ratio * kd / (d1 * target.percent_per_unit))),)
    if target.has_proportional:
        return (Numbers(kp, n0, kd, d1),)
    if abs(kp) > 0:
        raise NoMatchError("the target has no proportional term")
    # the gain is free: with a filter it is the one that leaves the filter as delivered
    gain = abs(filt.ratio * kd / d1) if filt.ratio and kd and d1 else target.idle_gain
    return (replace(without_proportional(n0, kd, target, gain), Tf=d1),)


def _exact_series(n0: float, n1: float, n2: float, d1: float, filt: TargetFilter) -> Iterator[Numbers]:
    """Factor the numerator; the filter is on the derivative term or the lag of a lead-lag."""
    found = leads(n0, n1, n2)
    times = [clean(lead if filt.lead_lag else lead - d1, lead) for lead in found]
    if max(times) < 0:
        raise NoMatchError(
            f"its filter, {d1:.6g} s, is longer than the derivative time {max(found):.6g} s of the equivalent series form"
        )
    for lead, time in zip(found, times, strict=True):
        K = n1 - n0 * lead
        if time >= 0:
            yield Numbers(K, n0, K * time, d1)
