"""Scheme `reset-outside-band`: no integral outside the proportional band (section 5)."""

from __future__ import annotations

from pidemu.card.windup.reset_outside_band import WindupResetOutsideBand
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupResetOutsideBand[float]]):
    """The integral is cleared while P alone would be larger than the output span."""

    def at_the_end(self, x: Positional) -> None:
        """Clear the integral outside the proportional band."""
        gain = x.held.gain if x.held.gain is not None else x.b.coefficient("kp_band", x.a.kp, "proportional gain", "%/%")
        reach = blocks.magnitude(gain * x.t.signals.e)
        text = "cleared outside the proportional band (section 5)"
        x.b.let("I", select(reach > x.t.high - x.t.low, 0.0, x.state), text)
