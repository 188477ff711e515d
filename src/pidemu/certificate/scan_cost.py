"""What scan intervals and rules cost: the phase that a new controller loses against the old one (specs, section 9)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pidemu.certificate.models import ScanCost, TooSlow
from pidemu.law.law import Law

if TYPE_CHECKING:
    from pidemu.process.process import Process

_BELOW = 0.5
"""Share of half the scan rate at which rules are compared where the crossover lies beyond it."""


def usual_crossover(law: Law) -> float:
    """Return where the crossover of a loop usually lies [rad/s]: at ``2/Te``, with ``Te = m1/m0`` the effective integral time.

    Without integral action the derivative time takes its place. NaN for proportional action alone, which has no time of its own.
    """
    m0, m1, m2 = law.moments()
    time = abs(m1 / m0) if m0 and m1 else abs(m2 / m0) ** 0.5 if m0 and m2 else 1 / abs(m0) if m0 else abs(m2 / m1) if m1 else 0.0
    return 2 / time if time else math.nan


def scan_cost(source: Law, target: Law, factor: float = 1.0, process: Process | None = None) -> ScanCost:
    """Return the phase that the target's scan costs, beyond what the two continuous laws differ by.

    Parameters
    ----------
    source, target : Law
        The discrete laws at their scan intervals.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    process : Process, optional
        The process: the phase is that at the crossover of the source's loop. Without it, at `usual_crossover`.
    """
    assert source.scan is not None
    assert target.scan is not None
    plain = Law(source.algorithm), Law(target.algorithm)
    at = usual_crossover(plain[0])
    if process is not None:
        from pidemu.analysis.figures import crossover

        found = crossover(lambda w: factor * source.held(w), process, source.scan)
        at = at if found is None else found
    slow = [math.isfinite(at) and at >= math.pi / law.scan for law in (source, target) if law.scan is not None]
    too_slow: TooSlow = "both" if all(slow) else "source" if slow[0] else "target" if slow[1] else ""
    if source.scan == target.scan and too_slow:  # only rules can differ: judged where there still is something to compare
        return ScanCost(at, _phase_lost(source, target, plain, _BELOW * math.pi / source.scan), too_slow)
    if too_slow or not math.isfinite(at):
        return ScanCost(at, math.inf if too_slow else 0.0, too_slow)
    return ScanCost(at, _phase_lost(source, target, plain, at), "")


def _phase_lost(source: Law, target: Law, plain: tuple[Law, Law], w: float) -> float:
    ratio = target.held(w) / source.held(w) / (plain[1].response(w) / plain[0].response(w))
    return 0.0 - math.degrees(float(np.angle(ratio)[()]))
