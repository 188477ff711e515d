"""Schemes `clamp` and `clamp-sum`: the sum within the output limits (section 5)."""

from __future__ import annotations

from pidemu.card.windup.clamp import WindupClamp
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupClamp[float]]):
    """The integral sum is limited before it is used."""

    def after_growth(self, x: Positional) -> None:
        """Keep the sum within the output limits."""
        text = f"{self.scheme.scheme}: the sum within the output limits (section 5)"
        low, high = (x.held.state(limit) for limit in (x.t.low, x.t.high))
        if x.held.factor is not None and x.a.ki < 0:
            low, high = high, low
        x.b.let("I", blocks.limited(x.state, low, high), text)
