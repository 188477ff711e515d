"""Blocks: the pieces a scan program is put together from, one function per equation of specs/equations.md.

A block gets the `Builder` and the expressions it works on, adds its coefficients, states and assignments, and returns its result.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from typing import Final

from pidemu.card.models import Rule
from pidemu.scan.program import Assign, Expr, Name, Operand, Program, Quantity, equal, expr, names_in, select

TINY: Final = 1e-300
"""States smaller than this are set to zero: denormal numbers make a scan many times slower (specs/equations.md, section 7)."""

_AGO: Final = {1: "at the last scan", 2: "two scans ago"}
INPUTS: Final = (
    Quantity("sp", "setpoint", "%"),
    Quantity("pv", "measurement", "%"),
    Quantity("auto", "automatic (1) or manual (0)", "-"),
    Quantity("manual", "output set by the operator; NaN: hold", "%"),
)


class Builder:
    """Collects a program's parts in order."""

    def __init__(self, title: str) -> None:
        self.title = title
        self._coefficients: dict[str, tuple[Quantity, float]] = {}
        self._states: dict[str, tuple[Quantity, float]] = {}
        self._body: list[Assign] = []

    def coefficient(self, name: str, value: float, text: str, unit: str) -> Name:
        """Add a number fixed by the settings."""
        self._coefficients[name] = (Quantity(name, text, unit), value)
        return Name(name)

    def state(self, name: str, text: str, unit: str = "%", initial: float = 0.0) -> Name:
        """Add something kept from scan to scan."""
        self._states.setdefault(name, (Quantity(name, text, unit), initial))
        return Name(name)

    def let(self, name: str, value: Operand, text: str) -> Name:
        """Add an assignment."""
        self._body.append(Assign(name, expr(value), text))
        return Name(name)

    def program(self) -> Program:
        """Return the finished program, without states that nothing reads."""
        read = {name for assign in self._body for name in names_in(assign.value)} | {"u"}
        unread = self._states.keys() - read
        self._states = {name: state for name, state in self._states.items() if name in read}
        self._body = [assign for assign in self._body if assign.name not in unread]
        return Program(
            title=self.title,
            inputs=INPUTS,
            coefficients=tuple(q for q, _ in self._coefficients.values()),
            values=tuple(v for _, v in self._coefficients.values()),
            states=tuple(q for q, _ in self._states.values()),
            initial=tuple(v for _, v in self._states.values()),
            body=tuple(self._body),
        )


def flushed(x: Expr) -> Expr:
    """Return `x`, or zero where it is denormally small (section 7); NaN stays NaN."""
    return select((x > -TINY) & (x < TINY), 0.0, x)


def limited(x: Expr, low: Expr, high: Expr) -> Expr:
    """Return `x` within ``[low, high]`` (section 5)."""
    return select(x > high, high, select(x < low, low, x))


def lag(b: Builder, x: Expr, afresh: Expr, Tf: float, h: float, rule: Rule, order: int, what: str) -> Name:
    """First- or second-order lag of a signal (sections 2 and 4); `afresh`: start in the steady state of `x`.

    The order is the card's. The second-order one is ``1/(1 + Tf s + Tf^2 s^2/2)``.
    """
    inputs, poles = _weights(rule, Tf, h, order)
    text = f"filter on the {what}, Tf = {Tf:.6g} s, {rule.value} (section 4)"
    old = [b.state(f"{what}{n}", f"{what}, filtered, {_AGO[n]}") for n in range(1, order + 1)]
    signals = [b.state(f"{what}_in{n}", f"{what}, unfiltered, {_AGO[n]}") for n in range(1, order + 1) if any(inputs[1:])]
    for state in (*old, *signals):
        b.let(state.id, select(afresh, x, state), "start in the steady state of the first sample")
    weighted = [(f"{what}_g{n}", inputs[n], signal) for n, signal in enumerate([x, *signals])]
    weighted += [(f"{what}_a{n}", poles[n - 1], state) for n, state in enumerate(old, 1)]
    words = f"weight in the filter on the {what}"
    total = summed([b.coefficient(name, weight, words, "-") * signal for name, weight, signal in weighted if weight])
    result = b.let(f"{what}_f", flushed(b.let(f"{what}_f", total, "weighted sum")), text)
    for line, newest in ((old, result), (signals, x)):
        for n in reversed(range(len(line))):
            b.let(line[n].id, line[n - 1] if n else newest, "shift the filter's history")
    return result


def summed(parts: Sequence[Expr | None]) -> Expr:
    """Return the sum of the parts that there are, from the left; there is at least one."""
    first, *others = (part for part in parts if part is not None)
    return functools.reduce(operator.add, others, first)


def _bilinear(rule: Rule, h: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``s`` as a quotient of polynomials in ``q = z^-1`` (section 4)."""
    match rule:
        case Rule.BACKWARD:
            return (1.0, -1.0), (h, 0.0)
        case Rule.FORWARD:
            return (1.0, -1.0), (0.0, h)
        case Rule.TRAPEZOIDAL:
            return (2.0, -2.0), (h, h)


def _denominator(rule: Rule, Tf: float, h: float, order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    (n0, n1), (d0, d1) = _bilinear(rule, h)
    if order == 1:
        return (d0, d1), (d0 + Tf * n0, d1 + Tf * n1)
    half = Tf * Tf / 2
    top = (d0 * d0, 2 * d0 * d1, d1 * d1)
    bottom = (
        d0 * d0 + Tf * n0 * d0 + half * n0 * n0,
        2 * d0 * d1 + Tf * (n0 * d1 + n1 * d0) + 2 * half * n0 * n1,
        d1 * d1 + Tf * n1 * d1 + half * n1 * n1,
    )
    return top, bottom


def _weights(rule: Rule, Tf: float, h: float, order: int) -> tuple[list[float], list[float]]:
    """Return the weights of the input and of the filtered past."""
    top, bottom = _denominator(rule, Tf, h, order)
    return [x / bottom[0] for x in top], [-x / bottom[0] for x in bottom[1:]]


def derivative(b: Builder, x: Expr, afresh: Expr, gain: float, Tf: float, h: float, rule: Rule) -> Name:
    """Return the derivative term, filtered with `Tf` (section 4); without filter the backward difference.

    Parameters
    ----------
    b : Builder
        The program under construction.
    x : Expr
        The signal, ``c r - y``.
    afresh : Expr
        Where true, start with no derivative.
    gain : float
        ``kd``.
    Tf, h : float
        Filter time and scan interval [s].
    rule : Rule
        Scan rule.
    """
    x1 = b.state("x1", "signal of the derivative at the last scan")
    b.let("x1", select(afresh, x, x1), "no derivative of the step from nothing to the first sample")
    if not Tf:
        g = b.coefficient("kd_h", gain / h, "kd/h", "-")
        d = b.let("D", g * (x - x1), "derivative, backward difference (section 4)")
        b.let("x1", x, "kept for the next scan")
        return d
    match rule:
        case Rule.BACKWARD:
            decay, strength = Tf / (Tf + h), gain / (Tf + h)
        case Rule.FORWARD:
            decay, strength = 1 - h / Tf, gain / Tf
        case Rule.TRAPEZOIDAL:
            decay, strength = (2 * Tf - h) / (2 * Tf + h), 2 * gain / (2 * Tf + h)
    state = b.state("D", "derivative term")
    a = b.coefficient("D_decay", decay, "decay of the filtered derivative per scan", "-")
    k = b.coefficient("D_gain", strength, "kd over the filter's time", "-")
    old = select(afresh, 0.0, state)
    b.let("D", a * old + k * (x - x1), f"derivative, Tf = {Tf:.6g} s, {rule.value} (section 4)")
    b.let("D", flushed(state), "no denormal numbers (section 7)")
    b.let("x1", x, "kept for the next scan")
    return state


def increment(b: Builder, w: Expr, afresh: Expr, ki: float, h: float, rule: Rule) -> Expr:
    """Return what the integral of `w` grows by in this scan (section 4).

    With the forward rule this is the growth *after* the output of this scan, so a positional program adds it there.
    """
    if rule is not Rule.TRAPEZOIDAL:
        return b.coefficient("ki_h", ki * h, "ki h", "-") * w
    w1 = b.state("w1", "signal of the integral at the last scan")
    half = b.coefficient("ki_h2", ki * h / 2, "ki h/2", "-")
    b.let("w1", select(afresh, w, w1), "no step from nothing to the first sample")
    grown = b.let("dI", half * (w + w1), "increment of the integral, trapezoidal (section 4)")
    b.let("w1", w, "kept for the next scan")
    return grown


def saturated(v: Expr, low: Expr, high: Expr, grows: Expr) -> Expr:
    """Return whether the sum is beyond a limit and the integral's increment pushes it further (section 5, conditional)."""
    return ((v > high) & (grows > 0.0)) | ((v < low) & (grows < 0.0))


def held_at_limit(u: Expr, low: Expr, high: Expr, grows: Expr) -> Expr:
    """Return whether the last output stands at a limit and the integral's increment pushes it further (section 5, freeze)."""
    return ((u >= high) & (grows > 0.0)) | ((u <= low) & (grows < 0.0))


def held(manual: Expr, u: Expr) -> Expr:
    """Return the operator's output, or the last output where the operator has set nothing (NaN)."""
    return select(equal(manual, manual), manual, u)
