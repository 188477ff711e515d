"""Start `running`: the algorithm runs on in manual, and only its output is not used (section 6)."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import FromInitialOutput, Grow


class Hooks(FromInitialOutput):
    """The transfer does nothing to the integral."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Let the integral grow in every mode."""
        first = grow(x.state, x.a.transfer.first_scan == "holds")
        x.b.let("I", select(x.b.fresh, first, grow(x.state, False)), "integral; it goes on in manual (section 6)")
