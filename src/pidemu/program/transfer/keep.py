"""Start `keep`: the integral stands as it stood (section 6)."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import FromInitialOutput, Grow, stand_still


class Hooks(FromInitialOutput):
    """The integral goes on from where it stood."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Let the integral grow in automatic only."""
        holds = x.a.transfer.first_scan == "holds"
        grown, start = grow(x.state, False), grow(x.state, holds)
        kept = select(x.b.automatic, select(x.t.on, grown, start) if holds else grown, x.state)
        x.b.let("I", kept, "integral; it stands still in manual (section 6)")

    def in_manual(self, x: Positional, manual: Expr) -> None:
        """Leave the integral."""
        stand_still(x)
