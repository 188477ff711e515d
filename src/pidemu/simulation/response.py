"""What a loop made of a step: the figures by which responses are compared, from signals at the scans."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.simulation.experiment import integral_of_error
from pidemu.simulation.simulate import Simulation
from pidemu.simulation.trial import first_scan

SETTLED: Final = 0.05
"""A response has settled where the error stays within this part of the step, or of its largest error after a load step."""
_NO_SWING: Final = 0.01
"""A swing that begins a response is at least this part of its largest."""
_RISE: Final = (0.1, 0.9)
"""Between these parts of its step a measurement rises."""


@dataclass(frozen=True, slots=True)
class ResponseFigures:
    """The response to one step, until the next one or the end of the run.

    Errors count from the scan of the step; between scans they go along straight lines. Times count from the step as well, the dead
    time included.

    Attributes
    ----------
    step : {"setpoint", "load"}
        What stepped.
    size : float
        How far [%].
    ie, iae, ise, itae : float
        Integrals of the error, of its size, of its square and of time times its size [% s, % s, %^2 s, % s^2].
    largest_error : float
        Largest error after a load step [%]; after a setpoint step the largest beyond the new setpoint.
    overshoot : float
        The latter per step; NaN after a load step.
    decay_ratio : float
        Third swing of the error over the first; 0 where there are not so many, NaN with noise on the measurement.
    rise_time : float
        From 10 to 90 % of the setpoint step [s]; NaN where it is not reached, and after a load step.
    settling_time : float
        After which the error stays within 5 % of the step, or of its largest after a load step [s]; NaN where it does not.
    peak_output : float
        Largest move of the output from where it was [%].
    travel : float
        What the output moves by in all [%].
    last_error : float
        The error in the last scan [%].
    """

    step: str
    size: float
    ie: float
    iae: float
    ise: float
    itae: float
    largest_error: float
    overshoot: float
    decay_ratio: float
    rise_time: float
    settling_time: float
    peak_output: float
    travel: float
    last_error: float


UNITS: Final = {
    "size": "%", "ie": "% s", "iae": "% s", "ise": "%^2 s", "itae": "% s^2", "largest_error": "%", "overshoot": "-",
    "decay_ratio": "-", "rise_time": "s", "settling_time": "s", "peak_output": "%", "travel": "%", "last_error": "%",
}  # fmt: skip
"""The figures with their units."""


def response_figures(run: Simulation) -> tuple[ResponseFigures, ...]:
    """Return the figures of each response of a run, in the order of the steps.

    Parameters
    ----------
    run : Simulation
        The loop that ran.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    >>> run = pidemu.simulate(s, pidemu.Process.from_lags(1.0, lags=[10], delay=1), 0.1, load=0)
    >>> (setpoint,) = response_figures(run)
    >>> round(setpoint.overshoot, 3), round(setpoint.rise_time, 1), round(setpoint.last_error, 6)
    (0.0, 8.4, 0.0)
    """
    with np.errstate(all="ignore"):  # a loop that runs away has no finite figures
        return tuple(_figures(run, *part) for part in _parts(run))


def _parts(run: Simulation) -> Iterator[tuple[str, float, int, int]]:
    """Yield what stepped, how far, and the scans of its response."""
    found = []
    for name, step in (("setpoint", run.setpoint_step), ("load", run.load_step)):
        if step is not None:
            found.append((first_scan(step[0], run.scan, run.times.size), name, step[1]))
    found.sort()
    for i, (start, name, size) in enumerate(found):
        end = found[i + 1][0] if i + 1 < len(found) else run.times.size
        if end - start > 1:
            yield name, size, start, end


def _figures(run: Simulation, name: str, size: float, start: int, end: int) -> ResponseFigures:
    h, error, output = run.scan, run.error[start:end], run.output[start:end]
    before = float(run.output[start - 1]) if start else run.initial[2]
    a, b = error[:-1], error[1:]
    beyond = -error * math.copysign(1.0, size) if name == "setpoint" else np.abs(error)
    largest = max(float(np.max(beyond)), 0.0)
    band = SETTLED * (abs(size) if name == "setpoint" else largest)
    return ResponseFigures(
        step=name,
        size=size,
        ie=float(np.sum(a + b) / 2 * h),
        iae=integral_of_error(error, h),
        ise=float(np.sum(a * a + a * b + b * b) / 3 * h),
        itae=float(np.trapezoid(np.arange(error.size) * h * np.abs(error), dx=h)),
        largest_error=largest,
        overshoot=largest / abs(size) if name == "setpoint" else math.nan,
        decay_ratio=math.nan if run.around.noise else _decay_ratio(error),  # noise crosses zero too
        rise_time=_rise_time(1 - error / size, h) if name == "setpoint" else math.nan,
        settling_time=_settling_time(error, band, h),
        peak_output=float(np.max(np.abs(output - before))),
        travel=float(np.abs(output[0] - before) + np.sum(np.abs(np.diff(output)))),
        last_error=float(error[-1]),
    )


def _decay_ratio(error: Floats) -> float:
    """Return the third lobe of the error over the first; a lobe lies between two changes of sign."""
    ends = np.flatnonzero(error[:-1] * error[1:] < 0) + 1
    if ends.size < 2:
        return 0.0
    lobes = [float(np.max(np.abs(lobe))) for lobe in np.split(error, ends)]
    first = next(i for i, lobe in enumerate(lobes) if not lobe < _NO_SWING * max(lobes))  # what an earlier response left
    return lobes[first + 2] / lobes[first] if first + 2 < len(lobes) else 0.0


def _rise_time(part: Floats, h: float) -> float:
    """Return the time between a tenth and nine tenths of a step that a measurement has made [s]."""
    times = [_reached(part, level) for level in _RISE]
    return (times[1] - times[0]) * h


def _reached(part: Floats, level: float) -> float:
    """Return where a level is first reached, in scans, along a straight line; NaN where it is not."""
    there = np.flatnonzero(part >= level)
    if not there.size:
        return math.nan
    k = int(there[0])
    return float(k - (part[k] - level) / (part[k] - part[k - 1])) if k else 0.0


def _settling_time(error: Floats, band: float, h: float) -> float:
    """Return when the error enters a band for good [s], along a straight line; NaN where it does not."""
    outside = np.flatnonzero(np.abs(error) > band)
    if not outside.size:
        return 0.0
    k = int(outside[-1])
    if k + 1 == error.size:
        return math.nan
    now, then = abs(float(error[k])), abs(float(error[k + 1]))
    return (k + (now - band) / (now - then)) * h
