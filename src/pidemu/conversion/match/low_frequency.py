"""The match at low frequencies: the moments of the feedback path agree, the filter being fixed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pidemu.card.model.base import Form
from pidemu.conversion.match.factors import ROUNDING, apart, behind_signal_filter, without_proportional, without_rounding
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target


def low_frequency(moments: Sequence[float], target: Target, filt: TargetFilter) -> tuple[Numbers, ...]:
    """Return the numbers for which the feedback path of the target has the moments ``m0, m1, m2``, the filter being fixed.

    A series form has two such solutions; the one with ``Ti >= Td`` comes first.

    Parameters
    ----------
    moments : sequence of float
        ``m0`` [1/s], ``m1`` [-] and ``m2`` [s].
    target : Target
        The target.
    filt : TargetFilter
        The target's filter, with the value it shall have.

    Raises
    ------
    NoMatchError
        There are none.
    """
    m0, m1, m2 = without_rounding(moments)
    if not target.has_proportional:
        return (without_proportional(m0, m2, target, target.idle_gain),)
    if not target.has_derivative:
        return (Numbers(m1, m0, 0.0),)
    if target.shape.filter_on != "term" and filt.kind != "none":
        return tuple(_behind_filter(m0, m1, m2, target, filt))
    if target.form is not Form.SERIES:
        return (Numbers(m1, m0, m2),)
    return tuple(_series_roots(m0, m1, m2, filt))


def _series_roots(m0: float, m1: float, m2: float, filt: TargetFilter) -> Iterator[Numbers]:
    """Solve for the derivative strength of a series form, both roots."""
    # D: strength of the derivative term in seconds; the filter's time is sigma D + tau
    shrink = 1 - filt.ratio if filt.lead_lag else 1.0
    if shrink <= 0:
        raise NoMatchError(f"its lead-lag filter ratio {filt.ratio:g} leaves no lead")
    sigma, tau = filt.ratio / shrink, filt.time
    linear, square = m1 - m0 * tau, m0 * (1 + sigma)
    root = linear * linear - 4 * square * m2
    if root < -ROUNDING * linear * linear:
        has, needs = apart(m1 * m1 / (m0 * m2), 4 * (1 + sigma))
        raise NoMatchError(
            f"as a standard form its integral time is {has} times its derivative time, and this series form with its filter needs "
            f"{needs} times or more"
        )
    sum_ = linear + math.copysign(math.sqrt(max(root, 0.0)), linear)
    for D in (2 * m2 / sum_ if m2 else 0.0, sum_ / (2 * square) if m2 and square else None):
        if D is not None:
            K = m1 - m0 * D
            yield Numbers(K, m0, K * (D / shrink + (tau if filt.lead_lag and D else 0.0)))


def _behind_filter(m0: float, m1: float, m2: float, target: Target, filt: TargetFilter) -> Iterator[Numbers]:
    """Match the moments of a target whose filter multiplies the whole feedback path."""
    second = 0.5 if target.shape.filter_order == 2 else 1.0
    if filt.kind == "time":
        Tf = filt.time
        n1, n2 = m1 + m0 * Tf, m2 + m1 * Tf + m0 * Tf * Tf * (1 - second)
        return behind_signal_filter(m0, n1, n2, None, target.form)
    known = {Form.STANDARD: True, Form.PARALLEL: filt.of == "derivative-time", Form.SERIES: filt.of == "effective-derivative"}
    if not known.get(target.form):
        raise NoMatchError("there is no closed form for this filter")
    rho = filt.ratio
    # Tf = rho Td:  m0 rho (1 - (1 - second) rho) Td^2 + m1 (1 - rho) Td - m2 = 0
    square, linear = m0 * rho * (1 - (1 - second) * rho), m1 * (1 - rho)
    root = linear * linear + 4 * square * m2
    if root < 0 or (linear == 0 and square == 0):
        raise NoMatchError("its filter is too long for the source's derivative")
    Td = 2 * m2 / (linear + math.copysign(math.sqrt(root), linear or 1.0)) if m2 else 0.0
    K = m1 + m0 * rho * Td
    return behind_signal_filter(m0, K, K * Td, None, target.form)
