"""The integral of the absolute error after a load step (specs/equations.md, section 9, point 6)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.analysis.figures import loop_figures, scan_for, time_scale
from pidemu.analysis.open_loop import OpenLoop
from pidemu.card.model.base import Rule
from pidemu.card.model.signals import Measurement, SignalFilter
from pidemu.controller.running import Running
from pidemu.law.law import Law
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from pidemu.program.builder import build
from pidemu.settings.ranges import UNLIMITED
from pidemu.settings.settings import Settings

_SMALL: Final = 1e-6
"""Size of the load step that is simulated [%]: far from whatever depends on size."""
_SETTLED: Final = 1e-7
"""Two blocks with at most this share of the integral are the last."""
_MOST_SCANS: Final = 100_000
"""Scans that are simulated, at most, for a process of one or two states; the more states, the fewer."""
_FEW: Final = 20
"""Where not even so many blocks can be simulated, longer scan intervals stand for the short one."""
_FEWEST: Final = 4
"""Blocks from which an integral is known."""
_ROUGHLY: Final = 0.02
"""Four quarters of a simulation that fall geometrically within this go on so."""
_LEFT: Final = 0.01
"""At most this share of an integral is estimated from how it fell before."""
_FINE: Final = 100
"""Scans in the time in which the loop moves, to simulate a continuous controller."""
_RESONANCE: Final = 0.1
"""So much of a radian of the process's resonances lies between them at most."""


def load_iae(settings: Settings, process: Process, scan: float | None = None, factor: float = 1.0) -> float:
    """Return the integral of the absolute error after a load step of 1 % at the process input, in the linear range.

    The scan program of the algorithm runs in a closed loop with the process, without what depends on the size of signals: limits,
    deadbands, steps of the output, rounding to float32 or integers. The action is that of negative feedback.

    Parameters
    ----------
    settings : Settings
        Card and settings.
    process : Process
        The process.
    scan : float, optional
        Scan interval [s]; by default that of `pidemu.analysis.figures.scan_for`.
    factor : float
        What the controller's gain is multiplied by; its sign does not count.

    Returns
    -------
    float
        The integral, by the trapezoidal rule between scans [% s]. Infinite where the loop is unstable, and where the error does not
        go to zero because nothing integrates; NaN where the error has not settled within the scans that are simulated.

    Raises
    ------
    ScanError
        A filter is unstable at the scan interval.
    """
    law = settings.law(scan_for(settings, process) if scan is None else scan)
    if not loop_figures(law, process, factor).stable:
        return math.inf
    short = law.scan is not None and law.scan < _short_interval(law, process, factor) / 2
    if short and law.algorithm.dahlin is None and _FEW * _scans_of_a_block(law, process, factor) > _most_scans(process):
        return _extrapolated(law, process, factor)
    return _iae(law, process, factor, _most_scans(process))


def continuous_load_iae(settings: Settings, process: Process, factor: float = 1.0) -> float:
    """Return the same for the continuous law, without sampling.

    Two short scan intervals are extrapolated to none; the backward rule stands for all, which then are alike. NaN where the loop is
    stable, but not with any scan interval: with an unfiltered derivative whose gain, times the process's at high frequencies, is 1
    or more.
    """
    law = settings.law()
    if not loop_figures(law, process, factor).stable:
        return math.inf
    return _extrapolated(law, process, factor)


def _extrapolated(law: Law, process: Process, factor: float) -> float:
    """Return the integral of a stable loop without sampling, or sampled at a far shorter interval than two that are simulated."""
    h = _short_interval(law, process, factor)
    fine = [Law(_as_continuous(law.algorithm), t) for t in (h, h / 2)]
    if not all(loop_figures(x, process, factor).stable for x in fine):
        return math.nan
    long, short = (_iae(x, process, factor, _most_scans(process) // 2) for x in fine)
    share = (law.scan or 0.0) / (h / 2)
    return long if math.isinf(long) else (2 - share) * short - (1 - share) * long


def _short_interval(law: Law, process: Process, factor: float) -> float:
    """Return a scan interval at which a loop is nearly as without sampling [s]."""
    resonances = [_RESONANCE / abs(p) for p in process.poles if p.imag]
    return min(time_scale(law, process, factor) / _FINE, *resonances, math.inf)


def _most_scans(process: Process) -> int:
    """Return how many scans may be simulated: bounded by work, which grows with the square of the process's states."""
    states = len(process.poles)
    return _MOST_SCANS // max(1, states * states // 20)


def _scans_of_a_block(law: Law, process: Process, factor: float) -> int:
    """Return how many scans are looked at together: some times the time in which the loop moves."""
    assert law.scan is not None
    moves = time_scale(law, process, factor)
    block = process.delay + max(min(10 * moves, 20 * process.time), moves / 5)
    return math.ceil(block / law.scan)


def _iae(law: Law, process: Process, factor: float, most: int) -> float:
    """Return the integral of a stable loop at the scans, by so many of them; the factor is put into the process."""
    a, h = law.algorithm, law.scan
    assert h is not None
    if not (a.ki or a.dahlin is not None or 0 in process.zeros):
        return math.inf
    scans = _scans_of_a_block(law, process, factor)
    if _FEWEST * scans > most:
        return math.nan
    gain = OpenLoop(law, process, factor).gain or abs(factor)  # a controller that does nothing does so with any gain
    shares = _shares(a, h, replace(process, gain=process.gain * gain), scans)
    return _summed(shares, most // scans) / abs(factor)


def _summed(shares: Iterator[float], most: int) -> float:
    """Return the sum of the integral's shares, block by block; NaN where it is not known after so many.

    A slow mode that is left over decays geometrically from block to block; its sum is known long before it has gone.
    """
    found: list[float] = []
    total = 0.0
    while len(found) < most:
        found.append(next(shares))
        total += found[-1]
        if len(found) > 2 and max(found[-2:]) <= _SETTLED * total:
            return total
        if len(found) > 3 and found[-1] < found[-2] and _is_geometric(found[-4:]):
            return total + _tail(found[-2], found[-1])
    quarter = len(found) // 4
    parts = [sum(found[i * quarter : (i + 1) * quarter]) for i in range(4)]
    if not parts[3] < parts[2]:
        return math.nan
    left = _tail(parts[2], parts[3])
    return total + left if _is_geometric(parts, _ROUGHLY) or left < _LEFT * total else math.nan


def _is_geometric(shares: list[float], within: float = 1e-4) -> bool:
    if not all(shares):
        return False  # nothing had reached the measurement yet
    first, second, third = (y / x for x, y in itertools.pairwise(shares))
    return max(abs(second - first), abs(third - second)) < within * (1 - third)


def _tail(before: float, after: float) -> float:
    """Return the sum of what is to come after two terms of a geometric series."""
    return after * after / (before - after)


def _shares(algorithm: Algorithm, h: float, process: Process, scans: int) -> Iterator[float]:
    """Yield the integral of the absolute error per block of scans, after a load step of 1 % from rest [% s]."""
    linear = algorithm.linear
    running = Running(lambda _h: linear, lambda a, h: build(a, h, limits=UNLIMITED), h)
    running.rest(0.0, 0.0, 0.0)
    scan, state, plant = running.compiled.scan, running.state, Plant(process.sampled(h))
    last = 0.0
    while True:
        total = 0.0
        for _ in range(scans):
            y = plant.measure()
            total += abs(y + last) / 2 if y * last >= 0 else (y * y + last * last) / (2 * abs(y - last))
            last = y
            plant.move(scan(state, 0.0, y, 1.0, nan) + _SMALL)
        yield total * h / _SMALL


def _as_continuous(a: Algorithm) -> Algorithm:
    """Return the algorithm with the backward rule throughout, and filter times that do not depend on the scan interval."""

    def lag(f: SignalFilter[float] | None) -> SignalFilter[float] | None:
        return None if f is None else SignalFilter(time=f.time)

    filt = a.derivative.filter
    return replace(
        a,
        integral=replace(a.integral, rule=Rule.BACKWARD),
        derivative=replace(a.derivative, rule=Rule.BACKWARD, filter=None if filt is None else replace(filt, rule=None)),
        setpoint=replace(a.setpoint, filter=lag(a.setpoint.filter)),
        measurement=Measurement(filter=lag(a.measurement.filter)),
        error=replace(a.error, filter=lag(a.error.filter)),
    )
