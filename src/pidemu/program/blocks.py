"""Blocks: the pieces a scan program is put together from, one function per equation of specs/equations.md.

A block gets the `Builder` and the expressions it works on, adds its coefficients, states and assignments, and returns its result.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.card.model.signals import ErrorShape, SignalFilter
from pidemu.columns.functions import exp, expm1
from pidemu.program.ir import Assign, Binary, Expr, Floor, Name, Operand, Program, Quantity, equal, expr, names_in, select

TINY: Final = 1e-300
"""States smaller than this are set to zero: denormal numbers make a scan many times slower (specs/equations.md, section 7)."""
TINY_SINGLE: Final = 1e-37
"""The same for float32."""

_AGO: Final = {1: "at the last scan", 2: "two scans ago"}
INPUTS: Final = (
    Quantity("sp", "setpoint", "%"),
    Quantity("pv", "measurement", "%"),
    Quantity("auto", "automatic (1) or manual (0)", "-"),
    Quantity("manual", "output set by the operator; NaN: hold", "%"),
)
"""What every program reads."""
EXTRA_INPUTS: Final = {
    "cascade": Quantity("cascade", "remote setpoint, which puts the loop in cascade; NaN: none", "%"),
    "track": Quantity("track", "output to follow; NaN: none", "%"),
    "reset": Quantity("reset", "external reset; NaN: the output itself", "%"),
    "feedforward": Quantity("feedforward", "feedforward", "%"),
}
"""What a program reads where that is asked for."""


class Builder:
    """Collects a program's parts in order; `sign` is -1 for direct action, `tiny` what `flushed` takes for zero."""

    def __init__(self, title: str, signals: Sequence[str] = (), sign: float = 1.0, tiny: float = TINY) -> None:
        self.title = title
        self.signals = signals
        self.sign = sign
        self.tiny = tiny
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

    def let(self, name: str, value: Operand, text: str, unit: str = "%") -> Name:
        """Add an assignment; that to a state has the state's unit."""
        unit = self._states[name][0].unit if name in self._states else unit
        self._body.append(Assign(name, expr(value), text, unit))
        return Name(name)

    def has(self, signal: str) -> bool:
        """Tell whether the program reads one of the `EXTRA_INPUTS`."""
        return signal in self.signals

    @property
    def automatic(self) -> Expr:
        """Whether this scan is an automatic one: not in manual, and no output to follow."""
        on = Name("auto") > 0.0
        return on & Binary("!=", Name("track"), Name("track")) if self.has("track") else on

    @property
    def fresh(self) -> Expr:
        """Whether there has been no scan yet."""
        return equal(self.state("begun", "there has been a scan", "-"), 0.0)

    def _live(self) -> set[str]:
        """Return every name that the output depends on, in this scan or by way of a state in a later one."""
        reads: dict[str, set[str]] = {}
        for assign in self._body:
            reads.setdefault(assign.name, set()).update(names_in(assign.value))
        live: set[str] = set()
        found = {"u"}
        while found:
            live |= found
            found = {name for reader in found for name in reads.get(reader, ())} - live
        return live

    def program(self, a: Algorithm) -> Program:
        """Return the finished program, without what its output does not depend on."""
        live = self._live()
        self._states = {name: state for name, state in self._states.items() if name in live}
        self._body = [assign for assign in self._body if assign.name in live]
        self._coefficients = {name: pair for name, pair in self._coefficients.items() if name in live}
        return Program(
            title=self.title,
            inputs=(*INPUTS, *(q for name, q in EXTRA_INPUTS.items() if name in self.signals)),
            coefficients=tuple(q for q, _ in self._coefficients.values()),
            values=tuple(v for _, v in self._coefficients.values()),
            states=tuple(q for q, _ in self._states.values()),
            initial=tuple(v for _, v in self._states.values()),
            body=tuple(self._body),
            precision="float32" if a.arithmetic.type == "float32" else "float64",
            wide_literals=a.arithmetic.literals == "float64",
        )


def flushed(x: Expr, tiny: float = TINY) -> Expr:
    """Return `x`, or zero where it is denormally small (section 7); NaN stays NaN."""
    return select((x > -tiny) & (x < tiny), 0.0, x)


def limited(x: Expr, low: Expr, high: Expr) -> Expr:
    """Return `x` within ``[low, high]`` (section 5)."""
    return select(x > high, high, select(x < low, low, x))


def magnitude(x: Expr) -> Expr:
    """Return ``|x|``."""
    return select(x < 0.0, 0.0 - x, x)


def rounded(x: Expr, step: Expr) -> Expr:
    """Return the multiple of `step` nearest to `x`, a half upwards (section 7)."""
    return Floor(x / step + 0.5) * step


def towards(x: Expr, last: Expr, reach: Expr | None, down: Expr | None) -> Expr:
    """Return `x`, but at most `reach` above and `down` below `last` (section 8, rate limit); ``None`` is no limit."""
    if down is not None:
        x = select(x < last - down, last - down, x)
    return x if reach is None else select(x > last + reach, last + reach, x)


def signal_lag(b: Builder, x: Expr, afresh: Expr, f: SignalFilter[float], h: float, what: str) -> Name:
    """First-order filter on setpoint, measurement or error (section 4)."""
    return lag(b, x, afresh, f.at(h), h, f.rule, 1, what)


def shaped(b: Builder, e: Expr, afresh: Expr, s: ErrorShape[float], what: str) -> Name:
    """Return an error as P and I use it (section 8).

    Parameters
    ----------
    b : Builder
        The program under construction.
    e : Expr
        The error.
    afresh : Expr
        Where true, there is no earlier error.
    s : ErrorShape
        What to do to it.
    what : str
        Prefix of the names.
    """
    size = b.let(f"{what}_abs", magnitude(e), "size of the error")
    if s.shape != "gap":
        over = b.coefficient("over", s.over, "error at which the shaped one is the same", "%")
        if s.shape == "squared":
            return b.let(f"{what}_s", e * (size / over), "error squared, with its sign (section 8)")
        share = 1.0 if s.linearity is None else s.linearity
        linear = b.coefficient("linearity", share, "share of the linear gain", "-")
        rest = b.coefficient("rest", 1 - share, "share of the gain that grows with the error", "-")
        return b.let(f"{what}_s", e * (linear + rest * (size / over)), "gain linear in |e| (section 8)")
    width = s.band or 0.0
    band = b.coefficient("band", width, "half width of the band", "%")
    inside = size < band if s.edge == "outside" else size <= band
    if s.zero_crossing:
        crossed, e1 = (
            b.state(f"{what}_crossed", "the error has crossed zero within the band", "-"),
            b.state(f"{what}_was", "last error"),
        )
        before = select(afresh, e, e1)
        seen = (crossed > 0.0) | (e * before <= 0.0)
        b.let(crossed.id, select(inside & seen, 1.0, 0.0), "zero crossing (section 8)")
        b.let(e1.id, e, "kept for the next scan")
        inside = crossed > 0.0
    less: Expr = e
    if s.subtracted:
        cut = b.coefficient("cut", (1 - s.gain) * width, "what the band takes from the error outside it", "%")
        less = select(e < 0.0, e + cut, e - cut)
    within: Expr = b.coefficient("gap_gain", s.gain, "gain within the band", "-") * e if s.gain else expr(0.0)
    return b.let(f"{what}_s", select(inside, within, less), "deadband or gap (section 8)")


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
    result = b.let(f"{what}_f", flushed(b.let(f"{what}_f", total, "weighted sum"), b.tiny), text)
    for line, newest in ((old, result), (signals, x)):
        for n in reversed(range(len(line))):
            b.let(line[n].id, line[n - 1] if n else newest, "shift the filter's history")
    return result


def summed(parts: Sequence[Expr | None]) -> Expr:
    """Return the sum of the parts that there are, from the left; there is at least one."""
    first, *others = (part for part in parts if part is not None)
    return functools.reduce(operator.add, others, first)


def difference(x: Expr, *parts: Expr | None) -> Expr:
    """Return `x` less the parts that there are, one after the other."""
    return functools.reduce(operator.sub, (part for part in parts if part is not None), x)


def _bilinear(rule: Rule, h: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``s`` as a quotient of polynomials in ``q = z^-1`` (section 4)."""
    match rule:
        case Rule.BACKWARD:
            return (1.0, -1.0), (h, 0.0)
        case Rule.FORWARD:
            return (1.0, -1.0), (0.0, h)
        case Rule.TRAPEZOIDAL:
            return (2.0, -2.0), (h, h)
    raise ValueError(f"the {rule.value} rule is one of the derivative only")


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


def derivative(b: Builder, x: Expr, afresh: Expr, a: Algorithm, gain: float, Tf: float, h: float) -> Name:
    """Return the derivative term, filtered with `Tf` (section 4); without filter the backward difference.

    Parameters
    ----------
    b : Builder
        The program under construction.
    x : Expr
        The signal, ``c r - y``.
    afresh : Expr
        Where true, start with no derivative.
    a : Algorithm
        For the rule, and for what happens at the start and in manual.
    gain : float
        ``kd``.
    Tf, h : float
        Filter time and scan interval [s].
    """
    history = 3 if a.derivative.rule is Rule.FOUR_POINT else 1
    past = [
        b.state(f"x{n}", f"signal of the derivative {'at the last scan' if n == 1 else f'{n} scans ago'}")
        for n in range(1, history + 1)
    ]
    for state in past:
        b.let(state.id, _before(b, a, x, state, afresh), "no derivative of the step from nothing to the first sample")
    state = b.state("D", "derivative term")
    old = _term_before(a, state, afresh)
    lagged = a.derivative.rule is Rule.LAGGED_DIFFERENCE
    if lagged:
        _lagged_difference(b, x, past[0], gain, Tf, h)
    elif a.derivative.rule is Rule.FOUR_POINT:
        g = b.coefficient("kd_10h", gain / (10 * h), "kd/(10 h)", "-")
        b.let("D", g * (3.0 * (x - past[2]) + past[0] - past[1]), "derivative, four-point difference (section 4)")
    elif not Tf:
        g = b.coefficient("kd_h", gain / h, "kd/h", "-")
        b.let("D", g * (x - past[0]), "derivative, backward difference (section 4)")
    else:
        decay, strength = _decay(a.derivative.rule, gain, Tf, h)
        share = b.coefficient("D_decay", decay, "decay of the filtered derivative per scan", "-")
        k = b.coefficient("D_gain", strength, "kd over the filter's time", "-")
        b.let("D", share * old + k * (x - past[0]), f"derivative, Tf = {Tf:.6g} s, {a.derivative.rule.value} (section 4)")
        b.let("D", flushed(state, b.tiny), "no denormal numbers (section 7)")
    for n in reversed(range(not lagged, history)):
        b.let(past[n].id, past[n - 1], "shift the derivative's history")
    if not lagged:
        b.let("x1", x, "kept for the next scan")
    if a.transfer.derivative == "preset":
        b.let("D", select(b.automatic, state, 0.0), "no derivative in manual")
        for place in past:
            b.let(place.id, select(b.automatic, place, x), "in manual the history is the present sample")
    return state


def _before(b: Builder, a: Algorithm, x: Expr, state: Name, afresh: Expr) -> Expr:
    """Return the derivative's last signal, as the start and the transfer make it (section 6)."""
    if a.transfer.derivative == "zeroed":
        return select(equal(Name("on"), 0.0), 0.0, state)
    if a.derivative.starts == "zero":
        return select(b.fresh, 0.0, select(afresh, x, state) if a.transfer.derivative == "restarted" else state)
    return select(afresh, x, state)


def _term_before(a: Algorithm, state: Name, afresh: Expr) -> Expr:
    return select(equal(Name("on"), 0.0), 0.0, state) if a.transfer.derivative == "zeroed" else select(afresh, 0.0, state)


def _decay(rule: Rule, gain: float, Tf: float, h: float) -> tuple[float, float]:
    """Return what the filtered derivative keeps per scan, and its gain on the signal's change (section 4)."""
    match rule:
        case Rule.BACKWARD:
            return Tf / (Tf + h), gain / (Tf + h)
        case Rule.FORWARD:
            return 1 - h / Tf, gain / Tf
        case Rule.TRAPEZOIDAL:
            return (2 * Tf - h) / (2 * Tf + h), 2 * gain / (2 * Tf + h)
        case Rule.EXACT:
            return exp(-h / Tf), gain * -expm1(-h / Tf) / h
    raise ValueError(f"the {rule.value} rule has a block of its own")


def _lagged_difference(b: Builder, x: Expr, xf: Name, gain: float, Tf: float, h: float) -> None:
    """The difference of the signal and its own exact lag, ``D = (kd/Tf)(x - xf)`` (section 4)."""
    keep = b.coefficient("D_decay", exp(-h / Tf), "share of the lagged signal that is kept", "-")
    take = b.coefficient("D_take", 1 - exp(-h / Tf), "share of the new signal", "-")
    k = b.coefficient("D_gain", gain / Tf, "kd/Tf", "1/s")
    b.let(xf.id, keep * xf + take * x, "signal of the derivative, lagged")
    b.let("D", k * (x - xf), f"derivative, Tf = {Tf:.6g} s, lagged difference (section 4)")


def increment(b: Builder, w: Expr, afresh: Expr, rate: float, h: float, rule: Rule, *, from_zero: bool = False) -> Expr:
    """Return what the integral of `w` grows by in this scan (section 4).

    With the forward rule this is the growth *after* the output of this scan, so a positional program adds it there.

    Parameters
    ----------
    b : Builder
        The program under construction.
    w : Expr
        The signal.
    afresh : Expr
        Where true, there is no earlier signal.
    rate : float
        ``ki``, ``1/Ti`` or 1, as the state holds the integral of ``ki e``, ``e/Ti`` or ``e``.
    h : float
        Scan interval [s].
    rule : Rule
        Scan rule.
    from_zero : bool
        Whether the signal before the first one counts as zero.
    """
    if rule is not Rule.TRAPEZOIDAL:
        return b.coefficient("ki_h", rate * h, "integral gain times h", "-") * w
    w1 = b.state("w1", "signal of the integral at the last scan")
    half = b.coefficient("ki_h2", rate * h / 2, "integral gain times h/2", "-")
    first = select(b.fresh, 0.0, w1) if from_zero else select(afresh, w, w1)
    b.let("w1", first, "from zero at power-up" if from_zero else "no step from nothing to the first sample")
    b.let("w_old", w1, "signal of the last increment")
    grown = b.let("dI", half * (w + w1), "increment of the integral, trapezoidal (section 4)")
    b.let("w1", w, "kept for the next scan")
    return grown


def saturated(v: Expr, low: Expr, high: Expr, grows: Expr) -> Expr:
    """Return whether the sum is beyond a limit and the integral's increment pushes it further (section 5, conditional)."""
    return ((v > high) & (grows > 0.0)) | ((v < low) & (grows < 0.0))


def held_at_limit(u: Expr, low: Expr, high: Expr, grows: Expr) -> Expr:
    """Return whether the last output stands at a limit and the integral's increment pushes it further (section 5, freeze)."""
    return ((u >= high) & (grows > 0.0)) | ((u <= low) & (grows < 0.0))


def at_limit(u: Expr, low: Expr, high: Expr) -> Expr:
    """Return whether the last output stands at a limit (section 5, freeze in both directions)."""
    return (u >= high) | (u <= low)


def saturated_by_sign(v: Expr, low: Expr, high: Expr, e: Expr) -> Expr:
    """Return whether the sum is beyond a limit and has the sign of the error (section 5, conditional by error times output)."""
    return ((v > high) | (v < low)) & (e * v > 0.0)


def held(manual: Expr, u: Expr) -> Expr:
    """Return the operator's output, or the last output where the operator has set nothing (NaN)."""
    return select(equal(manual, manual), manual, u)
