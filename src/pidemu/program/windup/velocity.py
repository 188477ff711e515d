"""Scheme `velocity`: the increment is added to the last limited output (section 5)."""

from __future__ import annotations

from pidemu.card.windup.velocity import WindupVelocity
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Name, equal, select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupVelocity[float]]):
    """What the incremental form does by itself."""

    def velocity_base(self, b: Builder, last: Name) -> Expr:
        """Return the output that is read back, where there is one and the card reads it."""
        if not (self.scheme.reads_back and b.has("reset")):
            return last
        return b.let("base", select(equal(Name("reset"), Name("reset")), Name("reset"), last), "output read back (section 5)")
