"""Scheme `external-reset`: the integral is a lag of the limited output (section 5)."""

from __future__ import annotations

from pidemu.card.model.base import Rule
from pidemu.card.windup.external_reset import FastReturn, WindupExternalReset
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, Name, equal, select
from pidemu.program.windup.feedback import flush, pull_back, share_per_scan
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupExternalReset[float]]):
    """Integral by positive feedback, written as growth less a share of the cut-off, which is the same."""

    def gate(self, x: Positional, grown: Expr) -> Expr:
        """Hasten the increment on the way back from the scheme's own limits."""
        if self.scheme.fast_return is None:
            return grown
        grown = x.b.let("dI", grown, "increment of the integral")
        _hasten(x, grown, self.scheme.fast_return)
        return grown

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Feed the integral with the limited output, or with the external reset."""
        b, Ti, fast = x.b, x.a.Ti, self.scheme.fast_return
        implicit = x.a.integral.rule is Rule.BACKWARD
        seen: Expr = out
        if b.has("reset"):
            outside = Name("reset")
            seen = b.let("seen", select(equal(outside, outside), outside, out), "external reset in place of the output (section 5)")
        share = share_per_scan(Ti, x.h, implicit=implicit)
        back: Expr = b.coefficient("back", share, "share of the cut-off taken out of the integral per scan", "-")
        if fast is not None:
            share = share_per_scan(Ti / fast.factor, x.h, implicit=implicit)
            back = select(
                Name("fast_now") > 0.0, b.coefficient("back_fast", share, "the same on the way back from a limit", "-"), back
            )
        pull_back(x, v, seen, back, f"external-reset, Tt = {Ti:.6g} s (section 5)")

    def at_the_end(self, x: Positional) -> None:
        """Leave no denormal numbers."""
        flush(x)


def _hasten(x: Positional, grown: Expr, f: FastReturn[float]) -> None:
    """While the output is beyond a limit of the windup and the integral on its way back, hasten it, up to there."""
    b, t = x.b, x.t
    pushes = x.held.output(x.held.term(grown))
    before = b.let("v_I", x.behind(x.sum_with(x.state, t.D)), "sum before this scan's increment")
    ahead = b.let("v_dI", blocks.limited(before + pushes, t.low, t.high), "output with it")
    factor = b.coefficient("fast", f.factor, "factor on the way back from a limit", "-")
    arw_low = b.coefficient("arw_low", f.low, "low limit of the windup", "%")
    arw_high = b.coefficient("arw_high", f.high, "high limit of the windup", "%")
    high, low = (x.held.state(x.held.total(limit - before)) for limit in (arw_high, arw_low))
    hastened = b.let("dI_fast", factor * grown, "increment of a shorter integral time")
    flipped = x.held.gain is not None and x.a.kp < 0  # the state moves against the output
    down = select(hastened > high, high, hastened) if flipped else select(hastened < high, high, hastened)
    up = select(hastened < low, low, hastened) if flipped else select(hastened > low, low, hastened)
    from_high, from_low = (ahead > arw_high) & (pushes < 0.0), (ahead < arw_low) & (pushes > 0.0)
    b.let("fast_now", select(from_high | from_low, 1.0, 0.0), "on the way back from a limit", "-")
    b.let("dI", select(from_high, down, select(from_low, up, grown)), "fast return from a limit (section 5)")
