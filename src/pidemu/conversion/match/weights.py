"""The setpoint weights with which the setpoint paths agree as far as they can."""

from __future__ import annotations

from dataclasses import replace

from pidemu.algorithm.model import Algorithm
from pidemu.conversion.match.factors import ROUNDING
from pidemu.conversion.target.target import Target
from pidemu.law.law import Law
from pidemu.units import Role


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
    if abs(determinant) <= ROUNDING * (abs(by_b[0] * by_c[1]) + abs(by_c[0] * by_b[1])):
        return None, None
    b = (wanted[0] * by_c[1] - by_c[0] * wanted[1]) / determinant
    c = (by_b[0] * wanted[1] - wanted[0] * by_b[1]) / determinant
    return _snapped(b), _snapped(c)


def _snapped(weight: float | None) -> float | None:
    if weight is None:
        return None
    return float(round(weight)) if abs(weight - round(weight)) < 1e-9 else weight
