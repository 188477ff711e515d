"""What a transfer may do to the integral within a scan: the hooks that the files beside this one fill in (section 6)."""

from __future__ import annotations

from collections.abc import Callable

from pidemu.algorithm.model import Algorithm
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, Name, expr, select

Grow = Callable[[Expr, bool], Expr]
"""From the state before to the state behind this scan's increment; with ``True`` without that increment."""


class StartHooks:
    """What a start does. A hook that is not filled in does nothing."""

    def holds_sum(self, a: Algorithm) -> bool:
        """Tell whether there is an integral state to load, without integral action."""
        return False

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Set the integral at a transfer, let it grow otherwise; with the state `needed` the output stays."""
        raise NotImplementedError

    def power_up(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Set the integral at the very first scan, where that is no transfer like others."""
        if x.a.transfer.power_up == "zero":
            start = grow(expr(0.0), x.a.transfer.first_scan == "holds")
            x.b.let("I", select(x.b.fresh, start, x.state), "at power-up it starts at zero (section 6)")

    def own_limits(self, x: Positional, limited: Expr) -> Expr:
        """Return the state within the integral's own limits."""
        return limited

    def in_manual(self, x: Positional, manual: Expr) -> None:
        """Set the integral in manual; `manual` is the operator's output without the feedforward."""


class FromInitialOutput(StartHooks):
    """A start that leaves the integral as it is: the very first scan is a transfer from the initial output."""

    def power_up(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Begin with what the initial output leaves for the integral."""
        if x.a.transfer.power_up == "zero":
            super().power_up(x, grow, needed)
        else:
            x.b.let("I", select(x.b.fresh, needed, x.state), "the first scan is a transfer from the initial output (section 6)")


def stand_still(x: Positional) -> None:
    """Leave the integral in manual as the scan found it."""
    x.b.let("I", select(x.b.automatic, x.state, Name("I_kept")), "the integral stands still in manual (section 6)")
