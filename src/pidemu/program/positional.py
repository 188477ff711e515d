"""The positional implementation: the output is the sum of the terms, and the integral is a state (sections 4 to 6)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.program import blocks, output
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Name, equal, expr, select
from pidemu.program.terms import Terms

_FEEDS_BACK = ("back-calculation", "external-reset")


@dataclass(frozen=True, slots=True)
class _Sum:
    """How the integral's state counts in the sum of the terms.

    The state holds the integral of ``ki e``, of ``e/Ti`` with the gain on the whole sum, or of ``e`` with both applied afterwards.

    Attributes
    ----------
    gain : Name or None
        Gain on the whole sum.
    time : Name or None
        Integral time that the state is divided by.
    """

    gain: Name | None
    time: Name | None

    def term(self, state: Expr) -> Expr:
        """Return the integral term of a state."""
        return state if self.time is None else state / self.time

    def state(self, term: Expr) -> Expr:
        """Return the state of an integral term."""
        return term if self.time is None else term * self.time

    def output(self, total: Expr) -> Expr:
        """Return the output of a sum of terms."""
        return total if self.gain is None else self.gain * total

    def total(self, out: Expr) -> Expr:
        """Return the sum of terms of an output."""
        return out if self.gain is None else out / self.gain


def positional(b: Builder, a: Algorithm, h: float, t: Terms, bias: float) -> None:
    """Add the assignments of a positional controller."""
    manual = output.by_hand(b, a, t.u)
    last = output.kept(b, a, t.u)
    feed = output.feedforward(b, a)
    P: Expr = t.P
    moved: Expr | None = None
    if a.accumulated and a.kp and a.b == 0:
        P, moved = _accumulated(b, a, t)
    scheme = _scheme(b, a)
    holds_sum = bool(a.ki) or (a.start == "load-output" and a.keeps_integral) or moved is not None or a.limits_without_integral
    I: Expr | None = None  # noqa: E741 (the field's symbol)
    grown: Expr | None = None
    if holds_sum:
        state = b.state("I", "integral sum")
        grown = _growth(b, a, h, t) if a.ki else None
        grown = _gated(b, a, t, scheme, P, state, grown, last if a.start == "running" else t.u, feed)
        needed = scheme.state(blocks.difference(scheme.total(t.u if feed is None else t.u - feed), P, t.D))
        I = scheme.term(_integral(b, a, t, needed, scheme, P, state, grown, moved))  # noqa: E741
    elif bias:
        I = scheme.total(b.coefficient("bias", bias, "output at zero error", "%"))  # noqa: E741
    inner = blocks.summed([P, I])
    if a.windup == "recompute" and a.gate.without_derivative and not a.ki:
        inner = b.let("PI", scheme.total(blocks.limited(scheme.output(inner), t.low, t.high)), "P within the limits (section 5)")
    if I is not None:
        b.let("I_kept", Name("I"), "integral before what comes after the output")
    total = scheme.output(blocks.summed([inner, t.D]))
    if feed is not None and not a.feedforward_after:
        v: Expr = b.let("v", total + feed, "sum of the terms, with the feedforward (section 6)")
    else:
        v = b.let("v", total, "sum of the terms")
    v = output.lagged(b, a, h, v, "v")
    after = feed if a.feedforward_after else None
    out = output.within_limits(b, a, h, t, v, last, after)
    if after is not None:
        v = b.let("v_all", v + after, "sum of the terms and feedforward")
    final = output.stepped(b, a, t, out)
    if a.zero_first_output:
        nothing = blocks.limited(expr(0.0), t.low, t.high)
        final = b.let("out_1", select(b.fresh, nothing, final), "the first scan only prepares the block (section 6)")
    if holds_sum and a.ki:
        _after_output(b, a, h, t, scheme, P, v, out, grown, feed)
        _in_manual(b, a, t, scheme, P, manual if feed is None else manual - feed)
    if last is not t.u:
        b.let(last.id, out if a.start == "running" else select(b.automatic, out, manual), "output as the algorithm knows it")
    if a.windup == "freeze" and a.gate.without_derivative and a.ki:
        b.let("inner", scheme.output(blocks.summed([P, I])), "sum without the derivative, kept for the next scan")
    output.finish(b, final, manual)


def _scheme(b: Builder, a: Algorithm) -> _Sum:
    if a.holds == "ki e":
        return _Sum(None, None)
    gain = b.coefficient("kp", a.kp, "gain on the sum of the terms, signed for action", "%/%")
    if a.holds == "e/Ti" or not a.ki:
        return _Sum(gain, None)
    return _Sum(gain, b.coefficient("Ti", a.kp / a.ki, "integral time", "s"))


def _accumulated(b: Builder, a: Algorithm, t: Terms) -> tuple[Expr, Expr | None]:
    """P on PV, accumulated from its value at the start: into the integral sum, or on its own (section 5, clamp-sum)."""
    y1 = b.state("y1", "measurement at the last scan")
    y = t.signals.y
    b.let("y1", select(t.fresh, y, y1), "no step from nothing to the first sample")
    moved = b.let("dP", Name("minus_kp") * (y - y1), "what the proportional term moves by")
    b.let("y1", y, "kept for the next scan")
    if a.windup == "clamp-sum":
        return b.let("P", 0.0, "the proportional term is in the integral sum"), moved
    own = b.state("P_sum", "accumulated proportional term")
    return b.let("P_sum", select(t.fresh, 0.0, own) + moved, "proportional term on PV, accumulated"), None


def _growth(b: Builder, a: Algorithm, h: float, t: Terms) -> Expr:
    """Return what the integral's state grows by (section 4); nothing within the integral's deadband (section 8)."""
    rate = {"ki e": a.ki, "e/Ti": a.ki / a.kp if a.kp else 0.0, "e": 1.0}[a.holds]
    grown = blocks.increment(b, t.w, t.fresh, rate, h, a.integral_rule, from_zero=a.integral_from_zero)
    if a.integral_deadband is not None:
        band = b.coefficient("i_band", a.integral_deadband, "integral deadband", "%")
        still = select(blocks.magnitude(t.signals.e) <= band, 1.0, 0.0)
        inside = b.let("i_still", still, "within the integral's deadband", "-") > 0.0
        grown = b.let("dI", select(inside, 0.0, grown), "no integration within the integral's deadband (section 8)")
    return grown


def _gated(
    b: Builder, a: Algorithm, t: Terms, scheme: _Sum, P: Expr, state: Name, grown: Expr | None, last: Name, feed: Expr | None
) -> Expr | None:
    """Stop or hasten the integral at a limit where the windup scheme says so (section 5)."""
    if grown is None or (a.windup not in ("freeze", "conditional") and a.gate.fast_return == 1):
        return grown
    if a.windup == "conditional" and not a.gate.drops and a.integral_rule is not Rule.FORWARD:
        return b.let("dI", grown, "increment of the integral")  # what leads beyond a limit is taken back after the output
    grown = b.let("dI", grown, "increment of the integral")
    pushes = scheme.output(scheme.term(grown))
    if a.gate.fast_return != 1:
        _hastened(b, a, t, scheme, P, state, grown, pushes, feed)
    if a.windup == "freeze" and not a.gate.this_scan:
        return _frozen(b, a, t, state, grown, pushes, last)
    if a.windup == "conditional":
        ahead = state if a.integral_rule is Rule.FORWARD else state + grown
        total = scheme.output(blocks.summed([P, scheme.term(ahead), t.D]))
        v0 = b.let("v0", total if feed is None else total + feed, "sum with this increment")
        if a.gate.by_output_sign:
            stop = blocks.saturated_by_sign(v0, t.low, t.high, t.signals.e if b.sign > 0 else 0.0 - t.signals.e)
        else:
            stop = blocks.saturated(v0, t.low, t.high, pushes)
        return b.let("dI", select(stop, 0.0, grown), "conditional: none that leads beyond a limit (section 5)")
    return grown


def _hastened(
    b: Builder, a: Algorithm, t: Terms, scheme: _Sum, P: Expr, state: Name, grown: Expr, pushes: Expr, feed: Expr | None
) -> None:
    """While the output is beyond a limit of the windup and the integral on its way back, hasten it, up to there (section 5)."""
    now = scheme.output(blocks.summed([P, scheme.term(state), t.D]))
    before = b.let("v_I", now if feed is None else now + feed, "sum before this scan's increment")
    ahead = b.let("v_dI", blocks.limited(before + pushes, t.low, t.high), "output with it")
    factor = b.coefficient("fast", a.gate.fast_return, "factor on the way back from a limit", "-")
    arw_low = b.coefficient("arw_low", a.gate.fast_beyond[0], "low limit of the windup", "%")
    arw_high = b.coefficient("arw_high", a.gate.fast_beyond[1], "high limit of the windup", "%")
    high, low = (scheme.state(scheme.total(limit - before)) for limit in (arw_high, arw_low))
    hastened = b.let("dI_fast", factor * grown, "increment of a shorter integral time")
    flipped = scheme.gain is not None and a.kp < 0  # the state moves against the output
    down = select(hastened > high, high, hastened) if flipped else select(hastened < high, high, hastened)
    up = select(hastened < low, low, hastened) if flipped else select(hastened > low, low, hastened)
    from_high, from_low = (ahead > arw_high) & (pushes < 0.0), (ahead < arw_low) & (pushes > 0.0)
    b.let("fast_now", select(from_high | from_low, 1.0, 0.0), "on the way back from a limit", "-")
    b.let("dI", select(from_high, down, select(from_low, up, grown)), "fast return from a limit (section 5)")


def _frozen(b: Builder, a: Algorithm, t: Terms, state: Name, grown: Expr, pushes: Expr, last: Name) -> Expr:
    """Stop the integral while the last output, or the last sum without the derivative, stands at a limit (section 5, freeze)."""
    g = a.gate
    if g.without_derivative:
        last = b.state("inner", "sum without the derivative at the last scan")
    at_limit = blocks.at_limit(last, t.low, t.high)
    if g.both:
        stop, text = at_limit, "none"
    elif g.unless_smaller:
        stop, text = at_limit & (state * grown >= 0.0), "none that makes the integral larger"
    else:
        stop, text = blocks.held_at_limit(last, t.low, t.high, pushes), "none that pushes further"
    if g.without_derivative or a.zero_power_up:
        stop = equal(b.state("begun", "there has been a scan", "-"), 1.0) & stop
    if g.from_integrated and a.integral_rule is Rule.TRAPEZOIDAL:
        b.let("w1", select(stop, Name("w_old"), Name("w1")), "the last signal that was integrated")
    return b.let("dI", select(stop, 0.0, grown), f"freeze: {text} while the last output is at a limit (section 5)")


def _integral(
    b: Builder, a: Algorithm, t: Terms, needed: Expr, scheme: _Sum, P: Expr, state: Name, grown: Expr | None, moved: Expr | None
) -> Expr:
    """Set the integral at a transfer, let it grow otherwise (section 6)."""
    now = None if a.integral_rule is Rule.FORWARD else grown

    later = now if a.gate.this_scan else None
    now = None if a.gate.this_scan else now

    def grow(base: Expr, holds: bool = False) -> Expr:
        total = base if now is None or holds else base + now
        return total if moved is None else total + moved

    match a.start:
        case "bumpless":
            b.let("I", select(t.on, grow(state), needed), "integral; at a transfer u - P - D, bumpless (section 6)")
        case "load-output":
            load = scheme.state(scheme.total(t.u if a.loads_as_it_is else blocks.limited(t.u, t.low, t.high)))
            if a.first_scan_holds:
                loaded = select(b.automatic, select(t.on, grow(state), grow(load, holds=True)), state)
            else:
                loaded = grow(select(t.on, state, load))
            b.let("I", loaded, "integral; at a transfer loaded with the last output (section 6)")
        case "tracked":
            b.let("I", select(b.fresh, needed, grow(state)), "integral; in manual it tracks the output (section 6)")
        case "zero":
            start = grow(expr(0.0), a.first_scan_holds)
            b.let("I", select(t.on, grow(state), start), "integral; at a transfer it starts at zero (section 6)")
        case "keep":
            start = grow(state, a.first_scan_holds)
            kept = select(b.automatic, select(t.on, grow(state), start) if a.first_scan_holds else grow(state), state)
            b.let("I", kept, "integral; it stands still in manual (section 6)")
        case "running":
            b.let("I", select(b.fresh, grow(state, a.first_scan_holds), grow(state)), "integral; it goes on in manual (section 6)")
    if a.zero_power_up:
        b.let("I", select(b.fresh, grow(expr(0.0), a.first_scan_holds), state), "at power-up it starts at zero (section 6)")
    elif a.start in ("keep", "running"):
        b.let("I", select(b.fresh, needed, state), "the first scan is a transfer from the initial output (section 6)")
    if later is not None:
        b.let("I_old", state, "integral before this scan's increment")
        at_once = not a.first_scan_holds and a.start not in ("bumpless", "tracked")
        b.let("I", state + later if at_once else select(t.on, state + later, state), "with this scan's increment")
    _limit(b, a, t, state)
    if a.windup == "recompute" and a.gate.without_derivative and a.ki:
        _recomputed(b, a, t, scheme, P, None, state)
    return state


def _limit(b: Builder, a: Algorithm, t: Terms, state: Name) -> None:
    """Limit the integral's state where the card says so (section 5)."""
    if a.windup in ("clamp", "clamp-sum"):
        b.let("I", blocks.limited(state, t.low, t.high), f"{a.windup}: the sum within the output limits (section 5)")
    if a.integral_limits is not None and a.integral_rule is not Rule.FORWARD:
        low, high = _limits(b, a, t)
        limited = blocks.limited(state, low, high)
        if a.start == "load-output" and a.first_scan_holds:
            limited = select(t.on, limited, state)
        b.let("I", limited, "limits of the integral (section 5)")


def _limits(b: Builder, a: Algorithm, t: Terms) -> tuple[Expr, Expr]:
    low, high = a.integral_limits or (None, None)
    return (
        t.low if low is None else b.coefficient("i_low", low, "low limit of the integral", "%"),
        t.high if high is None else b.coefficient("i_high", high, "high limit of the integral", "%"),
    )


def _after_output(
    b: Builder, a: Algorithm, h: float, t: Terms, scheme: _Sum, P: Expr, v: Expr, out: Expr, grown: Expr | None, feed: Expr | None
) -> None:
    """Do what is done to the integral after the output (section 5)."""
    state = Name("I")
    forward = a.integral_rule is Rule.FORWARD and grown is not None
    if a.windup in _FEEDS_BACK:
        seen: Expr = out
        if a.windup == "external-reset" and b.has("reset"):
            outside = Name("reset")
            seen = b.let("seen", select(equal(outside, outside), outside, out), "external reset in place of the output (section 5)")
        back: Expr = b.coefficient("back", _share(a, h), "share of the cut-off taken out of the integral per scan", "-")
        if a.gate.fast_return != 1:
            hastened = replace(a, tracking_time=a.tracking_time / a.gate.fast_return)
            fast = b.coefficient("back_fast", _share(hastened, h), "the same on the way back from a limit", "-")
            back = select(Name("fast_now") > 0.0, fast, back)
        pulled = state + scheme.state(scheme.total(back * (seen - v)))
        if a.integral_deadband is not None:
            pulled = select(Name("i_still") > 0.0, state, pulled)
        b.let("I", pulled, f"{a.windup}, Tt = {a.tracking_time:.6g} s (section 5)")
    if a.windup == "recompute" and not a.gate.without_derivative:
        _recomputed(b, a, t, scheme, P, t.D, state, feed)
    if a.windup == "conditional" and not a.gate.drops and not forward and grown is not None:
        _taken_back(b, a, t, scheme, v, grown)
    if a.windup == "freeze" and a.gate.this_scan:
        beyond = (v >= t.high) | (v <= t.low)
        b.let("I", select(beyond, Name("I_old"), state), "freeze: an increment that leads beyond a limit is not kept (section 5)")
    if forward:
        assert grown is not None
        if a.first_scan_holds:
            going = equal(b.state("begun", "there has been a scan", "-"), 1.0) if a.start == "running" else t.on
            grown = select(going, grown, 0.0)
        b.let("I", state + grown, "integral, after the output: forward (section 4)")
        if a.integral_limits is not None:
            low, high = _limits(b, a, t)
            b.let("I", blocks.limited(state, low, high), "limits of the integral (section 5)")
    if a.windup == "reset-outside-band":
        gain = scheme.gain if scheme.gain is not None else b.coefficient("kp_band", a.kp, "proportional gain", "%/%")
        reach = blocks.magnitude(gain * t.signals.e)
        b.let("I", select(reach > t.high - t.low, 0.0, state), "cleared outside the proportional band (section 5)")
    if a.windup in _FEEDS_BACK:
        b.let("I", blocks.flushed(state, b.tiny), "no denormal numbers (section 7)")


def _taken_back(b: Builder, a: Algorithm, t: Terms, scheme: _Sum, v: Expr, grown: Expr) -> None:
    """Of an increment that leads beyond a limit keep what leads to the limit (section 5, conditional)."""
    pushes = b.let("moved_I", scheme.output(scheme.term(grown)), "what the increment moves the sum by")
    over, under = v - t.high, v - t.low
    high = select(over < pushes, over, pushes)
    low = select(under > pushes, under, pushes)
    extra = select((over > 0.0) & (pushes > 0.0), high, select((under < 0.0) & (pushes < 0.0), low, 0.0))
    going = equal(b.state("begun", "there has been a scan", "-"), 1.0) if a.start == "running" else t.on
    kept = Name("I") - scheme.state(scheme.total(b.let("cut_I", select(going, extra, 0.0), "how far it leads beyond")))
    b.let("I", kept, "conditional: the integral up to the limit (section 5)")


def _share(a: Algorithm, h: float) -> float:
    """Return the share of the cut-off that is taken out of the integral per scan (section 5)."""
    if not a.tracking_time:
        return 1.0
    implicit = a.implicit_tracking or (a.windup == "external-reset" and a.integral_rule is Rule.BACKWARD)
    return h / (a.tracking_time + h) if implicit else h / a.tracking_time


def _recomputed(
    b: Builder, a: Algorithm, t: Terms, scheme: _Sum, P: Expr, D: Expr | None, state: Name, feed: Expr | None = None
) -> None:
    """At a limit set the integral to what the limit leaves for it; with D ``None`` before the derivative is added (section 5)."""
    sum_of_terms = scheme.output(blocks.summed([P, scheme.term(state), D]))
    total = b.let("v_I", sum_of_terms if feed is None else sum_of_terms + feed, "sum that is held against the limits")
    high = scheme.state(blocks.difference(scheme.total(blocks.difference(t.high, feed)), P, D))
    low = scheme.state(blocks.difference(scheme.total(blocks.difference(t.low, feed)), P, D))
    new = select(total >= t.high, high, select(total <= t.low, low, state))
    b.let("I", select(b.fresh, state, new) if a.zero_first_output else new, "recompute: what the limit leaves (section 5)")
    if a.gate.clamped:
        b.let("I", blocks.limited(state, t.low, t.high), "within the output limits (section 5)")


def _in_manual(b: Builder, a: Algorithm, t: Terms, scheme: _Sum, P: Expr, manual: Expr) -> None:
    """In manual set the integral to what the operator's output leaves for it, where the card tracks (section 6)."""
    if a.start == "tracked":
        state = Name("I")
        needed = scheme.state(blocks.difference(scheme.total(manual), P, t.D))
        b.let("I", select(b.automatic, state, needed), "in manual the integral tracks the output (section 6)")
    if a.start == "keep" or (a.start == "load-output" and a.first_scan_holds):
        b.let("I", select(b.automatic, Name("I"), Name("I_kept")), "the integral stands still in manual (section 6)")
    if a.start == "zero":
        b.let("I", select(b.automatic, Name("I"), 0.0), "no integral in manual (section 6)")
