"""Scheme `recompute`: at a limit the integral is what the limit leaves for it (section 5)."""

from __future__ import annotations

from pidemu.card.windup.recompute import WindupRecompute
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupRecompute[float]]):
    """The integral is set at a limit: after the output, or before the derivative is added."""

    def after_terms(self, x: Positional) -> None:
        """Set the integral to what a limit leaves for it besides P."""
        if self.scheme.without_derivative and x.a.ki:
            self._set(x, x.sum_with(x.state, None), x.t.low, x.t.high, None)

    def without_integral(self, x: Positional, inner: Expr) -> Expr:
        """Return P within the limits."""
        if not self.scheme.without_derivative:
            return inner
        limited = blocks.limited(x.held.output(inner), x.t.low, x.t.high)
        return x.b.let("PI", x.held.total(limited), "P within the limits (section 5)")

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Set the integral to what a limit leaves for it besides P and D."""
        if not self.scheme.without_derivative:
            D = x.t.D
            self._set(x, x.behind(x.sum_with(x.state, D)), x.before(x.t.low), x.before(x.t.high), D)

    def _set(self, x: Positional, total: Expr, low: Expr, high: Expr, D: Expr | None) -> None:
        b, t = x.b, x.t
        v = b.let("v_I", total, "sum that is held against the limits")
        at_low, at_high = (x.left_for_integral(limit, D) for limit in (low, high))
        new = select(v >= t.high, at_high, select(v <= t.low, at_low, x.state))
        if x.a.transfer.first_output == "zero":
            new = select(b.fresh, x.state, new)
        b.let("I", new, "recompute: what the limit leaves (section 5)")
        if self.scheme.clamped:
            b.let("I", blocks.limited(x.state, t.low, t.high), "within the output limits (section 5)")
