"""Scheme `conditional`: no integration beyond a limit (section 5)."""

from __future__ import annotations

from pidemu.card.model.base import Rule
from pidemu.card.windup.conditional import WindupConditional
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupConditional[float]]):
    """An increment that leads beyond a limit counts as far as the limit, or not at all."""

    def _is_taken_back(self, x: Positional) -> bool:
        return self.scheme.last_increment == "to-the-limit" and x.a.integral.rule is not Rule.FORWARD

    def gate(self, x: Positional, grown: Expr) -> Expr:
        """Return no increment that leads beyond a limit, where that is not taken back after the output."""
        b, t = x.b, x.t
        grown = b.let("dI", grown, "increment of the integral")
        if self._is_taken_back(x):
            return grown
        pushes = x.held.output(x.held.term(grown))
        ahead = x.state if x.a.integral.rule is Rule.FORWARD else x.state + grown
        v0 = b.let("v0", x.behind(x.sum_with(ahead, t.D)), "sum with this increment")
        if self.scheme.test == "error-times-output":
            stop = blocks.saturated_by_sign(v0, t.low, t.high, t.signals.e if b.sign > 0 else 0.0 - t.signals.e)
        else:
            stop = blocks.saturated(v0, t.low, t.high, pushes)
        return b.let("dI", select(stop, 0.0, grown), "conditional: none that leads beyond a limit (section 5)")

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Of an increment that leads beyond a limit keep what leads to the limit."""
        if not self._is_taken_back(x) or grown is None:
            return
        b, t = x.b, x.t
        pushes = b.let("moved_I", x.held.output(x.held.term(grown)), "what the increment moves the sum by")
        over, under = v - t.high, v - t.low
        high = select(over < pushes, over, pushes)
        low = select(under > pushes, under, pushes)
        extra = select((over > 0.0) & (pushes > 0.0), high, select((under < 0.0) & (pushes < 0.0), low, 0.0))
        cut = b.let("cut_I", select(x.going, extra, 0.0), "how far it leads beyond")
        kept = x.state - x.held.state(x.held.total(cut))
        b.let("I", kept, "conditional: the integral up to the limit (section 5)")
