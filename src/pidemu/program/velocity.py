"""The velocity implementation: increments of the terms are added to the last limited output (section 4)."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.errors import ScanError
from pidemu.program import blocks, output
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, select
from pidemu.program.terms import Terms
from pidemu.program.windup import windup_hooks


def velocity(b: Builder, a: Algorithm, h: float, t: Terms) -> None:
    """Add the assignments of a velocity controller."""
    manual = output.by_hand(b, a, t.u)
    last = output.kept(b, a, t.u)
    parts: list[Expr | None] = []
    if a.kp:
        parts.append(_proportional(b, a, t))
    if a.ki:
        parts.append(_integral(b, a, h, t))
    if t.D is not None:
        D1 = b.state("D1", "derivative term at the last scan")
        parts.append(b.let("dD", t.D - D1, "increment of the derivative term"))
        b.let("D1", t.D, "kept for the next scan")
    feed = output.feedforward(b, a)
    if feed is not None:
        feed1 = b.state("FF1", "feedforward at the last scan")
        parts.append(b.let("dFF", feed - feed1, "increment of the feedforward (section 6)"))
        b.let("FF1", feed, "kept for the next scan")
    moved = blocks.summed(parts) if parts else 0.0
    du: Expr = b.let("du", select(t.on, moved, 0.0), "increment; none at a transfer, bumpless (section 6)")
    du = output.lagged(b, a, h, du, "du")
    base = windup_hooks(a.integral.windup).velocity_base(b, last)
    v = b.let("v", base + du, "last output and increment")
    output.of_sum(b, a, h, t, v, last, manual)


def _proportional(b: Builder, a: Algorithm, t: Terms) -> Expr:
    """Return the increment of P, from the signals' own increments where the structure depends on the mode."""
    if a.cascade_b is not None:
        return _of_the_mode(b, a, t, a.cascade_b)
    P1 = b.state("P1", "signal of P at the last scan")
    kp = b.coefficient("kp", a.kp, "proportional gain, signed for action", "%/%")
    moved = b.let("dP", kp * (t.P - P1), "increment of the proportional term")
    b.let("P1", t.P, "kept for the next scan")
    return moved


def _of_the_mode(b: Builder, a: Algorithm, t: Terms, in_cascade: float) -> Expr:
    """The weight of the present mode counts on both samples, so that a change of mode moves nothing by itself (section 6)."""
    s = t.signals
    r1, y1 = b.state("r_last", "setpoint at the last scan"), b.state("y_last", "measurement at the last scan")
    b.let("r_last", select(t.fresh, s.r, r1), "no step from nothing to the first sample")
    b.let("y_last", select(t.fresh, s.y, y1), "no step from nothing to the first sample")
    weight: Expr = b.coefficient("b_auto", a.b, "setpoint weight in automatic", "-")
    if s.cascade is not None:
        other = b.coefficient("b_cascade", in_cascade, "setpoint weight in cascade", "-")
        weight = b.let("b_now", select(s.cascade, other, weight), "setpoint weight in this mode", "-")
    kp = b.coefficient("kp", a.kp, "proportional gain, signed for action", "%/%")
    if not a.is_shaped:
        change: Expr = weight * (s.r - r1) - (s.y - y1)
    else:
        change = _shaped(b, a, t, weight * s.r - s.y, "x_now") - _shaped(b, a, t, weight * r1 - y1, "x_was")
    moved = b.let("dP", kp * change, "increment of the proportional term, structure of the mode (section 6)")
    b.let("r_last", s.r, "kept for the next scan")
    b.let("y_last", s.y, "kept for the next scan")
    return moved


def _shaped(b: Builder, a: Algorithm, t: Terms, x: Expr, name: str) -> Expr:
    """Return a signal of P as the mode shapes it.

    Raises
    ------
    ScanError
        The shape remembers a crossing of zero, which a change of structure has no meaning for.
    """
    if a.error.zero_crossing:
        raise ScanError("a zero-crossing gap is not defined for increments whose structure depends on the mode")
    plain = b.let(name, x, "signal of P")
    shaped = blocks.shaped(b, plain, t.fresh, a.error, f"e_{name}")
    here = shaped if a.shapes_proportional else plain
    if t.signals.cascade is None or a.shapes_proportional == a.shapes_in_cascade:
        return here
    return select(t.signals.cascade, shaped if a.shapes_in_cascade else plain, here)


def _integral(b: Builder, a: Algorithm, h: float, t: Terms) -> Expr:
    """Return the increment of the integral (section 4)."""
    grown = blocks.increment(b, t.w, t.fresh, a.ki, h, a.integral.rule, from_zero=a.integral.starts == "zero")
    if a.integral.deadband is not None:
        band = b.coefficient("i_band", a.integral.deadband, "integral deadband", "%")
        grown = b.let("dI", select(blocks.magnitude(t.signals.e) <= band, 0.0, grown), "integral deadband (section 8)")
    if a.integral.rule is not Rule.FORWARD:
        return grown
    late = b.state("dI1", "increment of the integral of the last scan")
    moved = b.let("dI", late, "increment of the integral, one scan late: forward (section 4)")
    b.let("dI1", grown, "kept for the next scan")
    return moved
