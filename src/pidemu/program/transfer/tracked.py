"""Start `tracked`: in manual the integral follows the output (section 6)."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import Grow, StartHooks


class Hooks(StartHooks):
    """The first automatic scan moves on from where the integral followed the output."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Set the integral at the very first scan; later it is where it should be."""
        x.b.let("I", select(x.b.fresh, needed, grow(x.state, False)), "integral; in manual it tracks the output (section 6)")

    def in_manual(self, x: Positional, manual: Expr) -> None:
        """Set the integral to what the operator's output leaves for it."""
        needed = x.left_by_hand(manual)
        x.b.let("I", select(x.b.automatic, x.state, needed), "in manual the integral tracks the output (section 6)")
