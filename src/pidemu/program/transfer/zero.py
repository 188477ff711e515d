"""Start `zero`: the integral starts at zero (section 6)."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, expr, select
from pidemu.program.transfer.hooks import Grow, StartHooks


class Hooks(StartHooks):
    """There is no integral until the transfer."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Start the integral at zero."""
        start = grow(expr(0.0), x.a.transfer.first_scan == "holds")
        x.b.let("I", select(x.t.on, grow(x.state, False), start), "integral; at a transfer it starts at zero (section 6)")

    def in_manual(self, x: Positional, manual: Expr) -> None:
        """Clear the integral."""
        x.b.let("I", select(x.b.automatic, x.state, 0.0), "no integral in manual (section 6)")
