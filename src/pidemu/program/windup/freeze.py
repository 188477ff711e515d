"""Scheme `freeze`: no integration while the output stands at a limit (section 5)."""

from __future__ import annotations

from pidemu.card.model.base import Rule
from pidemu.card.windup.freeze import WindupFreeze
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, Name, select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupFreeze[float]]):
    """Integration stops while the last output, or the last sum without the derivative, or this scan's sum is at a limit."""

    @property
    def adds_provisionally(self) -> bool:
        """Whether this scan's increment counts for the output and is kept only if the sum stays within the limits."""
        return self.scheme.judged_on == "sum"

    def gate(self, x: Positional, grown: Expr) -> Expr:
        """Return no increment while what is judged stands at a limit."""
        b, scheme, t = x.b, self.scheme, x.t
        grown = b.let("dI", grown, "increment of the integral")
        if self.adds_provisionally:
            return grown
        pushes = x.held.output(x.held.term(grown))
        inner = scheme.judged_on == "sum-without-derivative"
        last = b.state("inner", "sum without the derivative at the last scan") if inner else x.last if x.runs_on else t.u
        at_limit = blocks.at_limit(last, t.low, t.high)
        stop, text = {
            "both": (at_limit, "none"),
            "unless-smaller": (at_limit & (x.state * grown >= 0.0), "none that makes the integral larger"),
            "further": (blocks.held_at_limit(last, t.low, t.high, pushes), "none that pushes further"),
        }[scheme.direction]
        if inner or x.a.transfer.power_up == "zero":
            stop = x.begun & stop
        if scheme.resumes_from == "last-integrated" and x.a.integral.rule is Rule.TRAPEZOIDAL:
            b.let("w1", select(stop, Name("w_old"), Name("w1")), "the last signal that was integrated")
        return b.let("dI", select(stop, 0.0, grown), f"freeze: {text} while the last output is at a limit (section 5)")

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Take an increment back with which the sum is beyond a limit, where it was added provisionally."""
        if self.adds_provisionally:
            beyond = (v >= x.t.high) | (v <= x.t.low)
            text = "freeze: an increment that leads beyond a limit is not kept (section 5)"
            x.b.let("I", select(beyond, Name("I_old"), x.state), text)

    def remember(self, x: Positional, inner: Expr) -> None:
        """Keep the sum without the derivative."""
        if self.scheme.judged_on == "sum-without-derivative":
            x.b.let("inner", x.held.output(inner), "sum without the derivative, kept for the next scan")
