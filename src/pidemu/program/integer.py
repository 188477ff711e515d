"""Integer arithmetic with carried remainders: a velocity PID in counts (section 7)."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.columns.functions import each, plain
from pidemu.errors import ScanError
from pidemu.program import blocks, output
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Floor, Name, select
from pidemu.program.terms import Terms

_TICKS: Final = 10_000
"""Parts of a second that times are counted in."""
_LARGEST: Final = 2.0**53
"""Whole numbers beyond this have no exact float."""


def integer(b: Builder, a: Algorithm, h: float, t: Terms) -> None:
    """Add the assignments of a velocity controller, standard form, D on PV, in whole numbers.

    With ``e``, ``y`` in counts, times in ticks, and remainders ``Ir``, ``Dr`` carried from scan to scan::

        dP = e - e1
        dI = (e h + Ir) div Ti            Ir = (e h + Ir) mod Ti
        dD = (Td (y1 - y) - h D + Dr) div (h + Tf)      Dr = ... mod (h + Tf)      D = D + dD
        M  = M + kp (dP + dI + dD)

    ``kp`` is a whole number of ``1/gain_counts``, so that ``M`` counts in ``1/(counts gain_counts)`` percent and loses nothing;
    the output
    is ``M`` in whole counts. Division rounds down.

    Raises
    ------
    ScanError
        The algorithm is not of this kind, or the scan interval is not a whole number of ticks.
    """
    if not a.velocity or a.series or a.c != 0 or a.b != 1 or a.integral.rule is not Rule.BACKWARD or a.is_shaped:
        raise ScanError("integer arithmetic is defined for velocity PID in standard form, P on error and D on the measurement")
    manual = output.by_hand(b, a, t.u)
    fine_counts = a.arithmetic.gain_counts or 1
    counts = b.coefficient("counts", float(a.arithmetic.counts or 1), "counts per percent", "1/%")
    fine = b.coefficient("fine", float(fine_counts), "parts of a count that the output sum is kept in", "-")
    kp = b.coefficient("kp_counts", _whole(a.kp * fine_counts, "gain"), "gain in counts, signed for action", "-")
    y = b.let("y_c", _whole_counts(t.signals.y, counts), "measurement in counts", "-")
    e = b.let("e_c", _whole_counts(t.signals.r, counts) - y, "error in counts", "-")
    parts: list[Expr] = [_proportional(b, e, t)]
    if a.ki:
        parts.append(_integral(b, e, _ticks(h, "scan interval"), _ticks(a.kp / a.ki, "integral time")))
    if a.kd:
        parts.append(
            _derivative(b, y, _ticks(h, "scan interval"), _ticks(a.kd / a.kp, "derivative time"), _ticks(a.Tf, "filter time"), t)
        )
    total = b.state("M", "output sum, in parts of a count", "-")
    resting = Floor(t.u * counts * fine + 0.5)
    b.let("M", select(t.on, total, resting), "at a transfer the sum is the last output (section 6)")
    moved = b.let("dM", kp * blocks.summed(parts), "increment of the output sum", "-")
    b.let("M", select(t.on, total + moved, total), "no increment at a transfer, bumpless (section 6)")
    b.let("M", blocks.limited(total, t.low * counts * fine, t.high * counts * fine), "output limits (section 5)")
    out = b.let("out", blocks.limited(Floor(total / fine) / counts, t.low, t.high), "output in whole counts")
    output.finish(b, out, manual)


def _ticks(seconds: float, what: str) -> int:
    """Return a time in steps of the arithmetic."""
    found: int = each(partial(_whole_ticks, what), seconds)
    return found


def _whole_ticks(what: str, seconds: float) -> int:
    ticks = Fraction(seconds).limit_denominator(10**7) * _TICKS
    if abs(ticks - round(ticks)) > Fraction(1, 1000) or (seconds and not round(ticks)):
        raise ScanError(f"the {what} of {seconds:g} s is not a whole number of {1 / _TICKS:g} s, the step of integer arithmetic")
    return round(ticks)


def _whole(value: float, what: str) -> float:
    if abs(value - round(value)) > 1e-6:
        raise ScanError(f"the {what} is not a whole number of counts, {value:g}; give it in the steps of the card's dial")
    if abs(value) >= _LARGEST:
        raise ScanError(f"the {what} is too large for whole numbers")
    found: float = plain(round(value))
    return found


def _whole_counts(x: Expr, counts: Name) -> Expr:
    return Floor(x * counts + 0.5)


def _proportional(b: Builder, e: Expr, t: Terms) -> Expr:
    e1 = b.state("e1", "error in counts at the last scan", "-")
    moved = b.let("dP", e - select(t.fresh, e, e1), "increment of the proportional term", "-")
    b.let("e1", e, "kept for the next scan")
    return moved


def _divided(b: Builder, name: str, total: Expr, by: Name, remainder: Name, text: str) -> Name:
    """Divide whole numbers and carry the remainder to the next scan."""
    whole = b.let(f"{name}_n", total, f"{text}, before the division", "-")
    result = b.let(name, Floor(whole / by), f"{text} (section 7)", "-")
    b.let(remainder.id, whole - result * by, "remainder, carried to the next scan (section 7)")
    return result


def _integral(b: Builder, e: Expr, h: int, Ti: int) -> Expr:
    step, time = (
        b.coefficient("h_ticks", plain(h), "scan interval", "ticks"),
        b.coefficient("Ti_ticks", plain(Ti), "integral time", "ticks"),
    )
    rest = b.state("Ir", "remainder of the integral", "-")
    return _divided(b, "dI", e * step + rest, time, rest, "increment of the integral")


def _derivative(b: Builder, y: Expr, h: int, Td: int, Tf: int, t: Terms) -> Expr:
    step, time = (
        b.coefficient("h_ticks", plain(h), "scan interval", "ticks"),
        b.coefficient("Td_ticks", plain(Td), "derivative time", "ticks"),
    )
    under = b.coefficient("under", plain(h + Tf), "scan interval and filter time", "ticks")
    y1, D, rest = (
        b.state("y1", "measurement in counts at the last scan", "-"),
        b.state("D", "derivative term in counts", "-"),
        b.state("Dr", "remainder of the derivative", "-"),
    )
    b.let("y1", select(t.fresh, y, y1), "no derivative of the step from nothing to the first sample")
    moved = _divided(b, "dD", time * (y1 - y) - step * D + rest, under, rest, "increment of the derivative")
    b.let("D", D + moved, "derivative term")
    b.let("y1", y, "kept for the next scan")
    return moved
