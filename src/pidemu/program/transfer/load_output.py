"""Start `load-output`: at a transfer the integral is loaded with the last output (section 6)."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import Grow, StartHooks, stand_still


class Hooks(StartHooks):
    """The terms come on top of what is loaded."""

    def holds_sum(self, a: Algorithm) -> bool:
        """Tell whether what is loaded stays as a constant, without integral action."""
        return a.transfer.without_integral == "kept"

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Load the integral at a transfer."""
        u, on = x.t.u, x.t.on
        load = u if x.a.transfer.loaded == "as-it-is" else blocks.limited(u, x.t.low, x.t.high)
        load = x.held.state(x.held.total(load))
        if _holds(x):
            loaded = select(x.b.automatic, select(on, grow(x.state, False), grow(load, True)), x.state)
        else:
            loaded = grow(select(on, x.state, load), False)
        x.b.let("I", loaded, "integral; at a transfer loaded with the last output (section 6)")

    def own_limits(self, x: Positional, limited: Expr) -> Expr:
        """Return the state within the integral's own limits, unless it was loaded in this scan and waits."""
        return select(x.t.on, limited, x.state) if _holds(x) else limited

    def in_manual(self, x: Positional, manual: Expr) -> None:
        """Leave the integral in manual, where it waits in the first scan."""
        if _holds(x):
            stand_still(x)


def _holds(x: Positional) -> bool:
    return x.a.transfer.first_scan == "holds"
