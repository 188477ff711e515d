"""The closed loop of a controller and a process: margins, sensitivities, stability (specs/equations.md, section 9, point 6).

The open loop is ``L = C P``. With a continuous law, ``P`` is the process with its dead time. With the discrete law of a scan
interval, ``P`` is the exact pulse transfer function of the process behind the hold, ``L`` is that of the sampled loop, and
frequencies end at ``pi/h``: the margins then say when the sampled loop itself becomes unstable.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from pidemu.analysis.crossings import crossings
from pidemu.analysis.loop_figures import LoopFigures
from pidemu.analysis.open_loop import PER_DECADE, OpenLoop, OpenLoopResponse, picture_of
from pidemu.arrays import Floats
from pidemu.card.model.card_file import default_scan
from pidemu.law.law import Law
from pidemu.law.rational import Response
from pidemu.process.process import Process
from pidemu.settings.settings import Settings

SCANS_PER_TIME: Final = 20
"""By default, at least this many scans in the time in which the loop moves."""
_PEAKS: Final = 4
"""So many peaks of a sensitivity are looked at."""
_EDGE: Final = 1e10
"""A sensitivity beyond this is one of a loop on the edge of stability, which rounding put on its stable side."""


def loop_figures(law: Law, process: Process, factor: float = 1.0, iae: float = math.nan) -> LoopFigures:
    """Return the figures of a closed loop.

    Parameters
    ----------
    law : Law
        The controller: continuous, or discrete for the sampled loop. The action is taken to be that of negative feedback: a process
        with a negative gain has a controller that acts the other way.
    process : Process
        The process.
    factor : float
        What the controller's gain is multiplied by.
    iae : float
        The integral of the absolute error, to be handed on [% s].

    Returns
    -------
    LoopFigures
        Of several gain margins the factor nearest to 1 (below 1: the gain may not fall so far), of several phase margins the one
        nearest to 0 with its crossover, and the smallest delay margin. An unstable loop has infinite ``Ms`` and ``Mt`` and the
        delay margin 0. The delay margin of a sampled loop is phase margin over crossover frequency.

    Raises
    ------
    UndefinedError
        The controller is a recursion in scans and `law` the continuous one.
    ProcessError
        The process cannot be sampled at the law's interval.
    """
    loop = OpenLoop(law, process, factor)
    if not loop.gain:
        return LoopFigures(process.is_stable, math.inf, math.inf, math.inf, math.nan, 1.0, 0.0, iae)
    picture = picture_of(loop)
    crossovers = crossovers_of(loop, picture)
    Ms, Mt = _largest(loop, picture, lambda x: 1 / np.abs(1 + x)), _largest(loop, picture, lambda x: np.abs(x / (1 + x)))
    unstable = loop.unstable(picture, crossovers) or not Ms < _EDGE
    phases = np.angle(-loop(crossovers)) if crossovers.size else np.array([])  # from -180 degrees
    nearest = int(np.argmin(np.abs(phases))) if phases.size else -1
    delays = np.mod(phases, 2 * math.pi) / crossovers
    last = picture.all_sizes[1][-1]
    at_infinity = law.scan is None and last < 0.1  # the sensitivity goes on to 1
    if last >= 1 and law.scan is None:
        delays = np.append(delays, 0.0)  # an unfiltered derivative: no delay at all is allowed
    return LoopFigures(
        stable=not unstable,
        gain_margin=_gain_margin(loop, picture),
        phase_margin=math.degrees(phases[nearest]) if phases.size else math.inf,
        delay_margin=0.0 if unstable else float(min(delays, default=math.inf)),
        crossover=float(crossovers[nearest]) if phases.size else math.nan,
        Ms=math.inf if unstable else max(Ms, float(at_infinity)),
        Mt=math.inf if unstable else Mt,
        iae=iae,
    )


def time_scale(law: Law, process: Process, factor: float = 1.0) -> float:
    """Return the time in which the closed loop moves [s]: the reciprocal of its gain crossover frequency.

    Where there is none, the times of the process; 1 s where it has none either.
    """
    loop = OpenLoop(law, process, factor)
    if loop.gain:
        crossovers = crossovers_of(loop, picture_of(loop))
        if crossovers.size:
            return float(1 / crossovers[-1])
    return process.time or 1.0


def crossover(controller: Callable[[Floats], Response], process: Process, scan: float | None = None) -> float | None:
    """Return the highest frequency at which the open loop has the gain 1 [rad/s]; ``None`` where there is none.

    Parameters
    ----------
    controller : callable
        From frequencies [rad/s] to the controller's response; of a sampled controller with its hold.
    process : Process
        The process.
    scan : float, optional
        Scan interval [s]: frequencies end at ``pi/scan``.
    """

    def decibel(w: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):  # no response, or that of an undamped pole
            found = np.log(np.abs(controller(w) * process.response(w)))
        return np.where(np.isnan(found), -np.inf, found)

    corners = [abs(r) for r in (*process.poles, *process.zeros) if r] or [1 / process.delay if process.delay else 1.0]
    low, high = min(corners) * 1e-5, max(corners) * 1e5 if scan is None else math.pi / scan
    low = min(low, high * 1e-5)
    w = np.geomspace(low, high, math.ceil(2 * PER_DECADE * math.log10(high / low)))
    found = crossings(w, decibel(w), decibel)
    return float(found[-1]) if found.size else None


def scan_for(settings: Settings, process: Process) -> float:
    """Return the card's scan interval, or a twentieth of the time in which the loop moves where that is shorter [s]."""
    h = default_scan(settings.equation)
    law = settings.law(h if settings.algorithm().dahlin is not None else None)
    shorter = time_scale(law, process) / SCANS_PER_TIME
    digit = 10.0 ** (1 - math.floor(math.log10(shorter)))
    return min(h, math.floor(shorter * digit + 1e-9) / digit)  # two digits, which a controller that counts in ticks can have


def settling_time(settings: Settings, process: Process, h: float) -> float:
    """Return a time after which the loop hardly moves any more, roughly [s]."""
    a = settings.algorithm(scan=h)
    law = Law(a, h if a.dahlin is not None else None)
    slow = process.time
    if a.ki:
        slow = abs(a.kp / a.ki) + (0.0 if process.integrators else 1 / abs(a.ki * process.gain))
    return 8 * max(time_scale(law, process), process.delay, slow, h)


def crossovers_of(loop: OpenLoop, picture: OpenLoopResponse) -> Floats:
    """Return where the loop gain is 1 [rad/s]."""
    w, sizes = picture.all_sizes
    with np.errstate(divide="ignore"):  # nothing comes through a process with a zero at 0, as far down as floating point goes
        return crossings(w, np.log(sizes), lambda x: np.log(np.abs(loop(x))))


def gain_factors(loop: OpenLoop, picture: OpenLoopResponse) -> Floats:
    """Return the factors of the loop gain at which a root crosses the edge of stability.

    The open loop also is a real number where the frequencies end: at the Nyquist frequency of a sampled loop, and at zero frequency
    where nothing integrates.
    """
    w, values = picture.w, picture.values
    behind = (values[1:].real < 0) & (values[:-1].real < 0)
    sizes = [np.abs(loop(crossings(w, values.imag, lambda x: loop(x).imag, behind)))]
    if not loop.integrates and values[0].real < 0:
        sizes.append(np.abs(values[:1]))
    if loop.law.scan is not None and values[-1].real < 0 and w[-1] >= math.pi / loop.law.scan * (1 - 1e-9):
        sizes.append(np.abs(values[-1:]))
    with np.errstate(divide="ignore"):  # nothing comes through
        return np.asarray(1 / np.concatenate(sizes), dtype=np.float64)


def _gain_margin(loop: OpenLoop, picture: OpenLoopResponse) -> float:
    """Return the factor nearest to 1 by which the loop gain may change; infinite where there is none."""
    factors = gain_factors(loop, picture)
    return float(factors[np.argmin(np.abs(np.log(factors)))]) if factors.size else math.inf


def _largest(loop: OpenLoop, picture: OpenLoopResponse, of: Callable[[Response], Floats]) -> float:
    """Return the largest value of a function of the open loop: the highest peaks, each looked at more and more finely."""
    with np.errstate(divide="ignore", invalid="ignore"):  # on the edge of stability
        return _highest_peak(loop, picture.w, of(picture.values), of)


def _highest_peak(loop: OpenLoop, w: Floats, found: Floats, of: Callable[[Response], Floats]) -> float:
    padded = np.concatenate([[-math.inf], found, [-math.inf]])
    peaks = np.flatnonzero((found >= padded[:-2]) & (found >= padded[2:]))
    largest = float(found.max())
    for peak in peaks[np.argsort(found[peaks])[-_PEAKS:]]:
        near, k = w, int(peak)
        for _ in range(3):
            near = np.geomspace(near[max(k - 1, 0)], near[min(k + 1, near.size - 1)], 60)
            finer = of(loop(near))
            k = int(np.argmax(finer))
            largest = max(largest, float(finer[k]))
    return largest
