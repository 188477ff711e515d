"""An algorithm, a scan interval and limits to a scan program.

Order within a scan (specs/equations.md, section 4): read, filter, terms, sum, limits, then what is done after the output.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from pidemu.algorithm import Algorithm, check_filters
from pidemu.card.models import Rule
from pidemu.errors import ScanError
from pidemu.scan import blocks
from pidemu.scan.blocks import Builder
from pidemu.scan.program import Expr, Name, Program, equal, select

Action = Literal["reverse", "direct"]


@dataclass(frozen=True, slots=True)
class Terms:
    """The expressions that both implementations start from."""

    P: Expr
    D: Expr | None
    y: Expr
    w: Expr
    low: Name
    high: Name
    u: Name
    on: Expr
    fresh: Expr


def build(
    algorithm: Algorithm,
    scan: float,
    *,
    action: Action = "reverse",
    limits: tuple[float, float] = (0.0, 100.0),
    bias: float = 0.0,
    initial_output: float = 0.0,
    title: str = "PID",
) -> Program:
    """Return the scan program of an algorithm.

    Parameters
    ----------
    algorithm : Algorithm
        What to run, reverse acting.
    scan : float
        Scan interval [s].
    action : {"reverse", "direct"}
        Control action: with ``"direct"`` the output rises when the measurement rises.
    limits : tuple of float
        Output limits [%, or the card's output units].
    bias : float
        Output at zero error of a positional controller without integral [as limits].
    initial_output : float
        Output before the first scan [as limits].
    title : str
        The program's title.

    Raises
    ------
    ScanError
        The scan interval, the limits or the bias cannot be used, or the combination is not defined.
    """
    _check(algorithm, scan, limits, bias, initial_output)
    sign = 1.0 if action == "reverse" else -1.0
    a = replace(algorithm, kp=sign * algorithm.kp, ki=sign * algorithm.ki, kd=sign * algorithm.kd)
    b = Builder(title)
    terms = _terms(b, a, scan, limits, initial_output)
    output = _velocity(b, a, scan, terms) if a.velocity else _positional(b, a, scan, terms, bias)
    manual = b.let("man", blocks.held(Name("manual"), terms.u), "the operator's output; held where none is set (section 6)")
    b.let("u", select(Name("auto") > 0.0, output, manual), "output")
    b.let("on", select(Name("auto") > 0.0, 1.0, 0.0), "mode, kept for the next scan")
    if not a.restarted:
        b.let("begun", 1.0, "there has been a scan")
    return b.program()


def _check(a: Algorithm, h: float, limits: tuple[float, float], bias: float, initial_output: float) -> None:
    if not (math.isfinite(h) and h > 0):
        raise ScanError(f"scan interval {h:g} s is not a positive number")
    for name, value in (("bias", bias), ("initial output", initial_output)):
        if not math.isfinite(value):
            raise ScanError(f"the {name} {value:g} is not a finite number")
    low, high = limits
    if not low < high:
        raise ScanError(f"output limits {low:g} to {high:g} are no range; give low, then high")
    if bias and (a.ki or a.velocity):
        raise ScanError("a bias belongs to a positional controller without integral action; leave it out")
    if a.windup == "external-reset" and a.integral_rule is Rule.TRAPEZOIDAL and a.ki:
        raise ScanError("external-reset windup is defined for the backward and forward rules only")
    check_filters(a, h)


def _share(a: Algorithm, h: float) -> float:
    """Return the share of the cut-off that is taken out of the integral per scan (section 5)."""
    implicit = a.windup == "external-reset" and a.integral_rule is Rule.BACKWARD
    return h / (a.tracking_time + h) if implicit else h / a.tracking_time if a.tracking_time else math.inf


def _terms(b: Builder, a: Algorithm, h: float, limits: tuple[float, float], initial_output: float) -> Terms:
    """Filter the measurement and compute P, D and the signal that the integral acts on (sections 2 and 4)."""
    low = b.coefficient("low", limits[0], "low output limit", "%")
    high = b.coefficient("high", limits[1], "high output limit", "%")
    u = b.state("u", "last output", "%", initial_output)
    on = b.state("on", "automatic in the last scan", "-")
    was_auto = on > 0.0
    fresh = equal(on, 0.0) if a.restarted else equal(b.state("begun", "there has been a scan", "-"), 0.0)
    sp, y = Name("sp"), Name("pv")
    if a.has_signal_filter and a.filter_on == "measurement":
        y = blocks.lag(b, y, fresh, a.Tf, h, a.filter_rule, a.filter_order, "pv")
    e = b.let("e", sp - y, "error")
    P: Expr = b.let("P", _proportional(b, a, e, sp, y), "proportional term") if a.kp else _zero(b)
    D = None
    if a.kd:
        x, kd = (y, -a.kd) if a.c == 0 else (_difference(b, a.c, "c", e, sp, y), a.kd)
        x = x if isinstance(x, Name) else b.let("x", x, "signal of the derivative")
        D = blocks.derivative(b, x, fresh, kd, a.Tf if a.has_term_filter else 0.0, h, a.derivative_rule)
    w: Expr = e
    if a.series and D is not None and a.ki:
        per_gain = b.coefficient("per_kp", 1 / a.kp, "1/kp", "-")
        w = b.let("w", e + per_gain * D, "signal of the integral: series form (section 2)")
    return Terms(P, D, y, w, low, high, u, was_auto, fresh)


def _zero(b: Builder) -> Expr:
    return b.let("P", 0.0, "no proportional term")


def _difference(b: Builder, weight: float, name: str, e: Expr, sp: Expr, y: Expr) -> Expr:
    """Return ``weight*sp - y``; the weight is not 0."""
    return e if weight == 1 else b.coefficient(name, weight, "setpoint weight", "-") * sp - y


def _proportional(b: Builder, a: Algorithm, e: Expr, sp: Expr, y: Expr) -> Expr:
    if a.b == 0:
        return b.coefficient("minus_kp", -a.kp, "proportional gain on PV, signed for action", "%/%") * y
    return b.coefficient("kp", a.kp, "proportional gain, signed for action", "%/%") * _difference(b, a.b, "b", e, sp, y)


def _lagged(b: Builder, a: Algorithm, h: float, x: Expr, what: str) -> Expr:
    """Return the output, or its increment, behind the filter if there is one; it starts afresh at a transfer."""
    if not (a.has_signal_filter and a.filter_on == "output"):
        return x
    return blocks.lag(b, x, equal(Name("on"), 0.0), a.Tf, h, a.filter_rule, a.filter_order, what)


def _positional(b: Builder, a: Algorithm, h: float, t: Terms, bias: float) -> Expr:
    """Sum the terms; the integral is a state (sections 4 to 6)."""
    P: Expr = t.P
    moved: Expr | None = None
    if a.accumulated and a.kp and a.b == 0:
        P, moved = _accumulated(b, a, t)
    holds_sum = bool(a.ki) or a.load_output or moved is not None
    I: Expr | None = None  # noqa: E741 (the field's symbol)
    grown: Expr | None = None
    if holds_sum:
        state = b.state("I", "integral sum")
        grown = blocks.increment(b, t.w, t.fresh, a.ki, h, a.integral_rule) if a.ki else None
        grown = _gated(b, a, t, P, state, grown)
        I = _start_and_grow(b, a, t, P, state, grown, moved)  # noqa: E741
    elif bias:
        I = b.coefficient("bias", bias, "output at zero error", "%")  # noqa: E741
    v: Expr = b.let("v", blocks.summed([P, I, t.D]), "sum of the terms")
    v = _lagged(b, a, h, v, "v")
    out = b.let("out", blocks.limited(v, t.low, t.high), "output limits (section 5)")
    if holds_sum and a.ki:
        _after_output(b, a, h, v, out, grown)
    return out


def _accumulated(b: Builder, a: Algorithm, t: Terms) -> tuple[Expr, Expr | None]:
    """P on PV, accumulated from its value at the start: into the integral sum, or on its own (section 5, clamp-sum)."""
    y1 = b.state("y1", "measurement at the last scan")
    b.let("y1", select(t.fresh, t.y, y1), "no step from nothing to the first sample")
    moved = b.let("dP", Name("minus_kp") * (t.y - y1), "what the proportional term moves by")
    b.let("y1", t.y, "kept for the next scan")
    if a.windup == "clamp-sum":
        return b.let("P", 0.0, "the proportional term is in the integral sum"), moved
    own = b.state("P_sum", "accumulated proportional term")
    return b.let("P_sum", select(t.fresh, 0.0, own) + moved, "proportional term on PV, accumulated"), None


def _gated(b: Builder, a: Algorithm, t: Terms, P: Expr, state: Name, grown: Expr | None) -> Expr | None:
    """Stop the integral at a limit where the scheme says so (section 5)."""
    if grown is None or a.windup not in ("freeze", "conditional"):
        return grown
    grown = b.let("dI", grown, "increment of the integral")
    if a.windup == "freeze":
        stop = blocks.held_at_limit(t.u, t.low, t.high, grown)
        return b.let(
            "dI", select(stop, 0.0, grown), "freeze: none that pushes further while the last output is at a limit (section 5)"
        )
    ahead = [P, state, None if a.integral_rule is Rule.FORWARD else grown, t.D]
    v0 = b.let("v0", blocks.summed(ahead), "sum with this increment")
    stop = blocks.saturated(v0, t.low, t.high, grown)
    return b.let("dI", select(stop, 0.0, grown), "conditional: none that pushes further beyond a limit (section 5)")


def _start_and_grow(b: Builder, a: Algorithm, t: Terms, P: Expr, state: Name, grown: Expr | None, moved: Expr | None) -> Expr:
    """Set the integral at a transfer, let it grow otherwise (section 6)."""
    now = None if a.integral_rule is Rule.FORWARD else grown
    if a.load_output:
        total = select(t.on, state, blocks.limited(t.u, t.low, t.high))
        total = total if now is None else total + now
        total = total if moved is None else total + moved
        b.let("I", total, "integral; at a transfer loaded with the last output (section 6)")
    else:
        start = t.u - P if t.D is None else t.u - P - t.D
        grow = state if now is None else state + now
        grow = grow if moved is None else grow + moved
        b.let("I", select(t.on, grow, start), "integral; at a transfer u - P - D, bumpless (section 6)")
    if a.windup in ("clamp", "clamp-sum"):
        b.let("I", blocks.limited(state, t.low, t.high), f"{a.windup}: the sum within the output limits (section 5)")
    return state


def _after_output(b: Builder, a: Algorithm, h: float, v: Expr, out: Expr, grown: Expr | None) -> None:
    """Do what is done to the integral after the output (section 5)."""
    state = Name("I")
    if a.windup in ("back-calculation", "external-reset"):
        back = b.coefficient("back", _share(a, h), "share of the cut-off taken out of the integral per scan", "-")
        b.let("I", state + back * (out - v), f"{a.windup}, Tt = {a.tracking_time:.6g} s (section 5)")
    if a.integral_rule is Rule.FORWARD and grown is not None:
        b.let("I", state + grown, "integral, after the output: forward (section 4)")
    if a.windup in ("back-calculation", "external-reset"):
        b.let("I", blocks.flushed(state), "no denormal numbers (section 7)")


def _velocity(b: Builder, a: Algorithm, h: float, t: Terms) -> Expr:
    """Add the increments of the terms to the last limited output (section 4)."""
    parts: list[Expr | None] = []
    if a.kp:
        P1 = b.state("P1", "proportional term at the last scan")
        parts.append(b.let("dP", t.P - P1, "increment of the proportional term"))
        b.let("P1", t.P, "kept for the next scan")
    if a.ki:
        grown = blocks.increment(b, t.w, t.fresh, a.ki, h, a.integral_rule)
        if a.integral_rule is Rule.FORWARD:
            late = b.state("dI1", "increment of the integral of the last scan")
            parts.append(b.let("dI", late, "increment of the integral, one scan late: forward (section 4)"))
            b.let("dI1", grown, "kept for the next scan")
        else:
            parts.append(grown)
    if t.D is not None:
        D1 = b.state("D1", "derivative term at the last scan")
        parts.append(b.let("dD", t.D - D1, "increment of the derivative term"))
        b.let("D1", t.D, "kept for the next scan")
    moved = blocks.summed(parts) if parts else 0.0
    du: Expr = b.let("du", select(t.on, moved, 0.0), "increment; none at a transfer, bumpless (section 6)")
    du = _lagged(b, a, h, du, "du")
    v = b.let("v", t.u + du, "last output and increment")
    return b.let("out", blocks.limited(v, t.low, t.high), "output limits (section 5)")
