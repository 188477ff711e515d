"""The positional implementation: the output is the sum of the terms, and the integral is a state (sections 4 to 6).

What happens to the integral at a limit is in `pidemu.program.windup`, what a transfer does to it in `pidemu.program.transfer`.
"""

from __future__ import annotations

from typing import Any

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.program import blocks, output
from pidemu.program.blocks import Builder
from pidemu.program.integral import HeldSum, Positional
from pidemu.program.ir import Expr, Name, expr, select
from pidemu.program.terms import Terms
from pidemu.program.transfer import start_hooks
from pidemu.program.transfer.hooks import StartHooks
from pidemu.program.windup import windup_hooks
from pidemu.program.windup.hooks import WindupHooks


def positional(b: Builder, a: Algorithm, h: float, t: Terms, bias: float) -> None:
    """Add the assignments of a positional controller."""
    manual = output.by_hand(b, a, t.u)
    last = output.kept(b, a, t.u)
    feed = output.feedforward(b, a)
    P, moved = _proportional(b, a, t)
    x = Positional(b, a, h, t, HeldSum.of(b, a), P, last, feed, a.transfer.way.runs_on)
    windup, start = windup_hooks(a.integral.windup), start_hooks(a.transfer.way)
    I: Expr | None = None  # noqa: E741 (the field's symbol)
    grown: Expr | None = None
    holds_sum = bool(a.ki) or start.holds_sum(a) or moved is not None or a.integral.windup.limits_without_integral
    if holds_sum:
        b.state("I", "integral sum")
        grown = windup.gate(x, _growth(b, a, h, t)) if a.ki else None
        _integral(x, windup, start, grown, moved)
        I = x.held.term(x.state)  # noqa: E741
    elif bias:
        I = x.held.total(b.coefficient("bias", bias, "output at zero error", "%"))  # noqa: E741
    inner = blocks.summed([P, I])
    if not a.ki:
        inner = windup.without_integral(x, inner)
    if I is not None:
        b.let("I_kept", x.state, "integral before what comes after the output")
    v, out, final = _output(x, x.held.output(blocks.summed([inner, t.D])))
    if holds_sum and a.ki:
        _after_output(x, windup, v, out, grown)
        start.in_manual(x, x.before(manual))
    if last is not t.u:
        b.let(last.id, out if x.runs_on else select(b.automatic, out, manual), "output as the algorithm knows it")
    if a.ki:
        windup.remember(x, blocks.summed([P, I]))
    output.finish(b, final, manual)


def _proportional(b: Builder, a: Algorithm, t: Terms) -> tuple[Expr, Expr | None]:
    """Return P; and what P on PV moves by, where that is accumulated into the integral's own sum (section 5, clamp-sum)."""
    if not (a.proportional.accumulated and a.kp and a.b == 0):
        return t.P, None
    y1 = b.state("y1", "measurement at the last scan")
    y = t.signals.y
    b.let("y1", select(t.fresh, y, y1), "no step from nothing to the first sample")
    moved = b.let("dP", Name("minus_kp") * (y - y1), "what the proportional term moves by")
    b.let("y1", y, "kept for the next scan")
    if a.integral.windup.holds_proportional:
        return b.let("P", 0.0, "the proportional term is in the integral sum"), moved
    own = b.state("P_sum", "accumulated proportional term")
    return b.let("P_sum", select(t.fresh, 0.0, own) + moved, "proportional term on PV, accumulated"), None


def _growth(b: Builder, a: Algorithm, h: float, t: Terms) -> Expr:
    """Return what the integral's state grows by (section 4); nothing within the integral's deadband (section 8)."""
    rate = {"ki e": a.ki, "e/Ti": a.ki / a.kp if a.kp else 0.0, "e": 1.0}[a.integral.holds]
    grown = blocks.increment(b, t.w, t.fresh, rate, h, a.integral.rule, from_zero=a.integral.starts == "zero")
    if a.integral.deadband is not None:
        band = b.coefficient("i_band", a.integral.deadband, "integral deadband", "%")
        still = select(blocks.magnitude(t.signals.e) <= band, 1.0, 0.0)
        inside = b.let("i_still", still, "within the integral's deadband", "-") > 0.0
        grown = b.let("dI", select(inside, 0.0, grown), "no integration within the integral's deadband (section 8)")
    return grown


def _integral(x: Positional, windup: WindupHooks[Any], start: StartHooks, grown: Expr | None, moved: Expr | None) -> None:
    """Set the integral at a transfer, let it grow otherwise (section 6); a provisional increment is added last (section 5)."""
    provisional = grown if windup.adds_provisionally and x.a.integral.rule is not Rule.FORWARD else None
    now = None if x.a.integral.rule is Rule.FORWARD or windup.adds_provisionally else grown

    def grow(base: Expr, waits: bool) -> Expr:
        total = base if now is None or waits else base + now
        return total if moved is None else total + moved

    needed = x.left_for_integral(x.before(x.t.u), x.t.D)
    start.set(x, grow, needed)
    start.power_up(x, grow, needed)
    if provisional is not None:
        x.b.let("I_old", x.state, "integral before this scan's increment")
        at_once = x.a.transfer.first_scan != "holds" and x.a.transfer.way.can_hold
        ahead = x.state + provisional
        x.b.let("I", ahead if at_once else select(x.t.on, ahead, x.state), "with this scan's increment")
    windup.after_growth(x)
    if x.a.integral.limits is not None and x.a.integral.rule is not Rule.FORWARD:
        low, high = _limits(x)
        x.b.let("I", start.own_limits(x, blocks.limited(x.state, low, high)), "limits of the integral (section 5)")
    windup.after_terms(x)


def _limits(x: Positional) -> tuple[Expr, Expr]:
    """Return the integral's own limits, which may be those of the output."""
    limits = x.a.integral.limits
    assert limits is not None
    assert limits.low is not None
    low = x.t.low if isinstance(limits.low, str) else x.b.coefficient("i_low", limits.low, "low limit of the integral", "%")
    high = x.t.high if isinstance(limits.high, str) else x.b.coefficient("i_high", limits.high, "high limit of the integral", "%")
    return low, high


def _output(x: Positional, total: Expr) -> tuple[Expr, Expr, Expr]:
    """Return the sum before limits, the output as the algorithm knows it, and the real one."""
    b, a, feed = x.b, x.a, x.feed
    after = feed if a.feedforward is not None and a.feedforward.summed == "after-limits" else None
    if feed is not None and after is None:
        v: Expr = b.let("v", total + feed, "sum of the terms, with the feedforward (section 6)")
    else:
        v = b.let("v", total, "sum of the terms")
    v = output.lagged(b, a, x.h, v, "v")
    out = output.within_limits(b, a, x.h, x.t, v, x.last, after)
    if after is not None:
        v = b.let("v_all", v + after, "sum of the terms and feedforward")
    final = output.stepped(b, a, x.t, out)
    if a.transfer.first_output == "zero":
        nothing = blocks.limited(expr(0.0), x.t.low, x.t.high)
        final = b.let("out_1", select(b.fresh, nothing, final), "the first scan only prepares the block (section 6)")
    return v, out, final


def _after_output(x: Positional, windup: WindupHooks[Any], v: Expr, out: Expr, grown: Expr | None) -> None:
    """Do what is done to the integral after the output (sections 4 and 5)."""
    windup.after_output(x, v, out, grown)
    if x.a.integral.rule is Rule.FORWARD and grown is not None:
        if x.a.transfer.first_scan == "holds":
            grown = select(x.going, grown, 0.0)
        x.b.let("I", x.state + grown, "integral, after the output: forward (section 4)")
        if x.a.integral.limits is not None:
            low, high = _limits(x)
            x.b.let("I", blocks.limited(x.state, low, high), "limits of the integral (section 5)")
    windup.at_the_end(x)
