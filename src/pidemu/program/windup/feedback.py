"""What back-calculation and external reset have in common: a share of the cut-off is taken out of the integral (section 5)."""

from __future__ import annotations

from pidemu.program import blocks
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, Name, select


def share_per_scan(time: float, h: float, *, implicit: bool) -> float:
    """Return the share of the cut-off that is taken out of the integral in a scan.

    Parameters
    ----------
    time : float
        Tracking time [s]; 0: all of it.
    h : float
        Scan interval [s].
    implicit : bool
        Whether it is ``h/(Tt + h)``, instead of ``h/Tt``.
    """
    if not time:
        return 1.0
    return h / (time + h) if implicit else h / time


def pull_back(x: Positional, v: Expr, seen: Expr, share: Expr, text: str) -> None:
    """Take a share of what `seen` is less than the sum `v` out of the integral, unless it stands still within its deadband."""
    pulled = x.state + x.held.state(x.held.total(share * (seen - v)))
    if x.a.integral.deadband is not None:
        pulled = select(Name("i_still") > 0.0, x.state, pulled)
    x.b.let("I", pulled, text)


def flush(x: Positional) -> None:
    """Set an integral to zero that is denormally small: it decays without end."""
    x.b.let("I", blocks.flushed(x.state, x.b.tiny), "no denormal numbers (section 7)")
