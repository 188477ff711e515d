"""Start `bumpless`: at a transfer the integral is what the last output leaves for it (section 6)."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import Grow, StartHooks


class Hooks(StartHooks):
    """The first automatic output is the last output."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Set the integral at a transfer."""
        x.b.let("I", select(x.t.on, grow(x.state, False), needed), "integral; at a transfer u - P - D, bumpless (section 6)")
