"""Closed forms: the numbers of a target that match a source (specs/equations.md, section 3)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form
from pidemu.conversion.target import Numbers, Target, TargetFilter
from pidemu.errors import UndefinedError
from pidemu.law.law import Law
from pidemu.units import Role


class NoMatchError(Exception):
    """A closed form has no solution; the message is the reason, for the user.

    Attributes
    ----------
    fundamental : bool
        Whether no filter and no other match of the same target could help.
    """

    def __init__(self, reason: str, *, fundamental: bool = False) -> None:
        super().__init__(reason)
        self.fundamental = fundamental


_ROUNDING = 1e-12
"""Relative size below which a difference of two products is their rounding."""


def check_terms(source: Algorithm, target: Target) -> None:
    """Refuse a source with a term that the target does not have.

    Raises
    ------
    NoMatchError
        The target lacks integral, derivative or proportional action, or cannot be without proportional action.
    """
    have = f"{target.card.id}{_chosen(target)}"
    if not (source.kp or source.ki or source.kd):
        raise NoMatchError("the source has no action, every term is off")
    if source.ki and not target.has_integral:
        raise NoMatchError(f"the source has integral action, {have} has none")
    if source.kd and not target.has_derivative:
        raise NoMatchError(f"the source has derivative action, {have} has none")
    if source.kp and not target.has_proportional:
        raise NoMatchError(f"the source has proportional action, {have} has none")
    if not source.kp and target.has_proportional and target.form is not Form.PARALLEL:
        raise NoMatchError(f"the source has no proportional action; the {target.form.value} form of {have} cannot be without it")
    if source.kd and not source.kp and target.has_proportional and target.filter.of == "derivative-time":
        raise NoMatchError(f"the source has no proportional action; the derivative's filter of {have} goes with kd/kp")


def _chosen(target: Target) -> str:
    chosen = target.variant.choice_text
    return f" ({chosen})" if chosen else ""


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
    if abs(d2 - wanted_d2) > _ROUNDING * max(d1 * d1, abs(d2)):
        raise NoMatchError("the two filters are of different order")
    if target.form is Form.SERIES and not target.has_proportional:
        if n1 or n2:
            raise NoMatchError("the target has no proportional term")
        return (_without_proportional(n0, 0.0, target, target.idle_gain),)
    if shape.filter_on != "term":
        return tuple(_through_signal_filter(n0, n1, n2, d1, target))
    if shape.series:
        return tuple(_exact_series(n0, n1, n2, d1, filt))
    kp = _clean(n1 - n0 * d1, n1)
    kd = _clean(n2 - kp * d1, n2)
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
    return (replace(_without_proportional(n0, kd, target, gain), Tf=d1),)


def _clean(difference: float, scale: float) -> float:
    return 0.0 if abs(difference) <= _ROUNDING * abs(scale) else difference


def without_rounding(moments: Sequence[float]) -> tuple[float, float, float]:
    """Return the moments with an ``m2`` that is only the rounding of its neighbours made zero."""
    m0, m1, m2 = moments
    return m0, m1, _clean(m2, abs(m1 * m1 / m0) if m0 else abs(m2))


def _leads(n0: float, n1: float, n2: float) -> tuple[float, ...]:
    """Return the time constants that ``n0 + n1 s + n2 s^2`` is factored into, the smaller first: derivative times of a series form.

    Raises
    ------
    NoMatchError
        The zeros are complex.
    """
    root = n1 * n1 - 4 * n0 * n2
    if root < -_ROUNDING * n1 * n1:
        raise NoMatchError(_complex_zeros(n0, n1, n2), fundamental=True)
    sum_ = n1 + math.copysign(math.sqrt(max(root, 0.0)), n1)
    if not n2:
        return (0.0,)
    return (2 * n2 / sum_, sum_ / (2 * n0)) if n0 else (2 * n2 / sum_,)


def _exact_series(n0: float, n1: float, n2: float, d1: float, filt: TargetFilter) -> Iterator[Numbers]:
    """Factor the numerator; the filter is on the derivative term or the lag of a lead-lag."""
    leads = _leads(n0, n1, n2)
    times = [_clean(lead if filt.lead_lag else lead - d1, lead) for lead in leads]
    if max(times) < 0:
        raise NoMatchError(
            f"its filter, {d1:.6g} s, is longer than the derivative time {max(leads):.6g} s of the equivalent series form"
        )
    for lead, time in zip(leads, times, strict=True):
        K = n1 - n0 * lead
        if time >= 0:
            yield Numbers(K, n0, K * time, d1)


def _complex_zeros(n0: float, n1: float, n2: float) -> str:
    ratio = n1 * n1 / (n0 * n2)
    return (
        "the source has complex zeros: as a standard form its integral time is "
        f"{_apart(ratio, 4.0)[0]} times its derivative time, and a series form needs 4 times or more"
    )


def _apart(x: float, y: float) -> tuple[str, str]:
    """Return two numbers with four digits, or as many more as tell them apart."""
    digits = next((d for d in range(4, 16) if f"{x:.{d}g}" != f"{y:.{d}g}"), 16)
    return f"{x:.{digits}g}", f"{y:.{digits}g}"


def _through_signal_filter(n0: float, n1: float, n2: float, Tf: float, target: Target) -> Iterator[Numbers]:
    """Return the numbers for a target whose filter multiplies the whole feedback path, of ``n0 + n1 s + n2 s^2`` before it."""
    free = Tf if target.filter.free else None
    if target.form is not Form.SERIES:
        yield Numbers(n1, n0, n2, free)
        return
    for lead in _leads(n0, n1, n2):
        K = n1 - n0 * lead
        yield Numbers(K, n0, K * lead, free)


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
        return (_without_proportional(m0, m2, target, target.idle_gain),)
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
    if root < -_ROUNDING * linear * linear:
        has, needs = _apart(m1 * m1 / (m0 * m2), 4 * (1 + sigma))
        raise NoMatchError(
            f"as a standard form its integral time is {has} times its derivative time, and this series form with its filter needs "
            f"{needs} times or more"
        )
    sum_ = linear + math.copysign(math.sqrt(max(root, 0.0)), linear)
    for D in (2 * m2 / sum_ if m2 else 0.0, sum_ / (2 * square) if m2 and square else None):
        if D is not None:
            K = m1 - m0 * D
            yield Numbers(K, m0, K * (D / shrink + (tau if filt.lead_lag and D else 0.0)))


def _without_proportional(m0: float, m2: float, target: Target, gain: float) -> Numbers:
    if target.form is Form.PARALLEL:
        return Numbers(0.0, m0, m2)
    return Numbers(math.copysign(gain, m0 or m2), m0, m2)


def _behind_filter(m0: float, m1: float, m2: float, target: Target, filt: TargetFilter) -> Iterator[Numbers]:
    """Match the moments of a target whose filter multiplies the whole feedback path."""
    second = 0.5 if target.shape.filter_order == 2 else 1.0
    if filt.kind == "time":
        Tf = filt.time
        return _through_signal_filter(m0, m1 + m0 * Tf, m2 + m1 * Tf + m0 * Tf * Tf * (1 - second), Tf, target)
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
    return _through_signal_filter(m0, K, K * Td, rho * Td, target)


def textbook(source: Algorithm, dial_kd: float, target: Target) -> Numbers:
    """Return what manuals print: filters ignored (specs/equations.md, section 3, textbook match).

    Parameters
    ----------
    source : Algorithm
        The source.
    dial_kd : float
        ``K Td`` by the source's derivative dial [s].
    target : Target
        The target.

    Raises
    ------
    NoMatchError
        The rule has no answer.
    """
    kp, ki, kd = source.kp, source.ki, dial_kd
    if source.series and target.form is Form.SERIES and target.has_proportional:
        return Numbers(kp, ki, kd)
    if source.series and kd:
        kp = source.kp * (1 + (kd / source.kp) * (ki / source.kp))
    if not target.has_proportional:
        return _without_proportional(ki, kd, target, target.idle_gain)
    if target.form is not Form.SERIES or not kd:
        return Numbers(kp, ki, kd)
    if kp * kp < 4 * ki * kd * (1 - _ROUNDING):
        raise NoMatchError("the textbook rule needs an integral time of 4 times the derivative time or more")
    lead = _leads(ki, kp, kd)[0]
    K = kp - ki * lead
    return Numbers(K, ki, K * lead)


def weights(law: Law, target: Target, feedback: Algorithm, scan: float | None = None) -> tuple[float | None, float | None]:
    """Return the free setpoint weights b and c for which the setpoint paths' moments agree (specs/equations.md, sections 2 and 3).

    The moments ``m1`` and ``m2`` of the setpoint path are linear in b and c. Both laws are continuous, or both as a process sees
    them at their scan intervals.

    Parameters
    ----------
    law : Law
        The source's law.
    target : Target
        The target.
    feedback : Algorithm
        The target's algorithm with its feedback path matched.
    scan : float, optional
        The target's scan interval [s], where `law` is discrete.
    """
    c_free = target.may_choose(Role.DERIVATIVE_WEIGHT) and feedback.kd != 0
    b_free = target.may_choose(Role.PROPORTIONAL_WEIGHT) and feedback.kp != 0
    if not (b_free or c_free):
        return None, None
    held = (0.0 if b_free else feedback.b, 0.0 if c_free else feedback.c)

    def moments(b: float, c: float) -> tuple[float, ...]:
        return Law(replace(feedback, b=b, c=c), scan).held_expansion(3, "setpoint")[1:]

    base = moments(*held)
    wanted = [w - x for w, x in zip(law.held_expansion(3, "setpoint")[1:], base, strict=True)]
    by_b = [x - y for x, y in zip(moments(1.0, held[1]), base, strict=True)]
    by_c = [x - y for x, y in zip(moments(held[0], 1.0), base, strict=True)]
    if not c_free:
        return _snapped(wanted[0] / by_b[0]) if by_b[0] else None, None
    if not b_free:
        return None, _snapped(wanted[1] / by_c[1]) if by_c[1] else None
    determinant = by_b[0] * by_c[1] - by_c[0] * by_b[1]
    if abs(determinant) <= _ROUNDING * (abs(by_b[0] * by_c[1]) + abs(by_c[0] * by_b[1])):
        return None, None
    b = (wanted[0] * by_c[1] - by_c[0] * wanted[1]) / determinant
    c = (by_b[0] * wanted[1] - wanted[0] * by_b[1]) / determinant
    return _snapped(b), _snapped(c)


def _snapped(weight: float | None) -> float | None:
    if weight is None:
        return None
    return float(round(weight)) if abs(weight - round(weight)) < 1e-9 else weight
