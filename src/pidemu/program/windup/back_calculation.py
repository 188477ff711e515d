"""Scheme `back-calculation`: the integral is pulled back by what was cut off (section 5)."""

from __future__ import annotations

from pidemu.card.windup.back_calculation import WindupBackCalculation
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr
from pidemu.program.windup.feedback import flush, pull_back, share_per_scan
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupBackCalculation[float]]):
    """Every scan takes a share of the cut-off out of the integral."""

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Pull the integral back by what was cut off."""
        share = share_per_scan(self.scheme.Tt, x.h, implicit=self.scheme.implicit)
        back = x.b.coefficient("back", share, "share of the cut-off taken out of the integral per scan", "-")
        pull_back(x, v, out, back, f"back-calculation, Tt = {self.scheme.Tt:.6g} s (section 5)")

    def at_the_end(self, x: Positional) -> None:
        """Leave no denormal numbers."""
        flush(x)
