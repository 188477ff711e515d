"""The closed loop of an emulated controller and a process, scan by scan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.certificate.models import LoopComparison, LoopFigures
from pidemu.emulator import Controller
from pidemu.errors import ProcessError
from pidemu.loop.figures import loop_figures, scan_for, settling_time
from pidemu.loop.hold import Plant
from pidemu.loop.load_response import continuous_load_iae, load_iae
from pidemu.loop.open_loop import low_frequency_sign
from pidemu.loop.process import Process
from pidemu.record.files import Record
from pidemu.record.playback import Timing
from pidemu.record.sampling import Scale, controller_for, limits_for
from pidemu.scan.build import Action
from pidemu.settings import Settings

Floats = npt.NDArray[np.float64]
Step = tuple[float, float]

_DEFAULT_SCANS: Final = 50_000
"""The default duration ends here."""
_MOST_SCANS: Final = 5_000_000
_FULL: Final = (0.0, 100.0)
_UNLIMITED: Final = (-1e12, 1e12)


@dataclass(frozen=True)
class Simulation:
    """A closed loop that ran.

    Attributes
    ----------
    settings : Settings
        The controller's settings.
    process : Process
        The process.
    scan : float
        Scan interval [s].
    action : {"reverse", "direct"}
        Control action.
    limits : tuple of float
        Output limits [%].
    times, setpoint, measurement, output : ndarray of float, shape (n,)
        Times of the scans [s], and the signals there [%]: the measurement as read, the output as it goes out.
    setpoint_step, load_step : tuple of float or None
        When and how far setpoint and load stepped [s, %].
    """

    settings: Settings
    process: Process
    scan: float
    action: Action
    limits: tuple[float, float]
    times: Floats
    setpoint: Floats
    measurement: Floats
    output: Floats
    setpoint_step: Step | None
    load_step: Step | None

    @property
    def error(self) -> Floats:
        """Setpoint minus measurement [%]."""
        return self.setpoint - self.measurement

    @property
    def iae(self) -> float:
        """Integral of the absolute error [% s], along straight lines between scans: from the load step or from the start."""
        start = 0 if self.load_step is None else _first(self.times, self.load_step[0])
        a, b = self.error[start:-1], self.error[start + 1 :]
        crosses = a * b < 0
        apart = np.where(crosses, np.abs(a - b), 1.0)
        return float(np.sum(np.where(crosses, (a * a + b * b) / (2 * apart), np.abs(a + b) / 2)) * self.scan)


def simulate(
    settings: Settings,
    process: Process,
    scan: float | None = None,
    *,
    setpoint: float | Step = 10.0,
    load: float | Step = 10.0,
    time: float | None = None,
    action: Action | None = None,
    output_limits: tuple[float, float] | None = None,
    initial: tuple[float, float, float] = (50.0, 50.0, 50.0),
) -> Simulation:
    """Run the emulated controller of a card in a closed loop with a process, from rest.

    In every scan the controller reads the measurement, and its output stands until the next scan. Between scans the process is
    exact, its dead time too.

    Parameters
    ----------
    settings : Settings
        Card and settings of the controller.
    process : Process
        The process, from output [%] to measurement [%].
    scan : float, optional
        Scan interval [s]; by default the card's, or a twentieth of the time in which the loop moves (the reciprocal of its gain
        crossover frequency) where that is shorter.
    setpoint, load : float or tuple of float
        Size of a setpoint step, and of a load step that adds to the controller's output at the process [%]; or when [s] and size.
        By default after a twentieth of the time, and after half of it. They count from the first scan at or after that time; a size
        of 0 is no step.
    time : float, optional
        How long [s]; by default long enough for both responses to settle, at most 50,000 scans.
    action : {"reverse", "direct"}, optional
        Control action; by default that of negative feedback.
    output_limits : tuple of float, optional
        Low and high output limit [%]; by default the card's, 0 to 100 where it has none.
    initial : tuple of float
        Setpoint, measurement and output [%] before; the process is at rest there.

    Returns
    -------
    Simulation
        The signals in percent, and the scan interval.

    Raises
    ------
    ProcessError
        The time or a step cannot be used, or the card has no choice of action and its gain has the wrong sign for the process.
    ScanError
        The controller cannot be run as asked.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    >>> p = pidemu.Process.from_lags(1.0, lags=[10], delay=2)
    >>> found = pidemu.simulate(s, p, scan=0.1, setpoint=0, load=(10, 5), time=200)
    >>> round(found.iae, 2)  # near 5 Ti/K = 25: the error hardly changes its sign
    25.0
    """
    h = float(scan) if scan is not None else scan_for(settings, process)
    length = _duration(settings, process, h) if time is None else float(time)
    if not 0 < length < math.inf or not length < _MOST_SCANS * h:
        raise ProcessError(f"a simulation of {length:g} s, scanned every {h:g} s, cannot be run; give a time of a few responses")
    sp_step, load_step = _step("setpoint", setpoint, length / 20, length), _step("load", load, length / 2, length)
    chosen = action or _negative_feedback(settings, process)
    limits = limits_for(settings, output_limits, _FULL)
    if not limits[0] <= initial[2] <= limits[1]:
        raise ProcessError(
            f"the initial output {initial[2]:g} % is outside the output limits {limits[0]:g} to {limits[1]:g} %; give another, or "
            f"other limits such as output_limits=(0, 100)"
        )
    times: Floats = np.arange(math.floor(length / h * (1 + 1e-12)) + 1, dtype=np.float64) * h
    sp = initial[0] + _signal(sp_step, times)
    controller = _at_rest(settings, h, chosen, limits, initial)
    pv, out = _run(controller, Plant(process.sampled(h)), sp, _signal(load_step, times), initial)
    return Simulation(settings, process, h, chosen, limits, times, sp, pv, out, sp_step, load_step)


def compare_loops(
    source: Settings, target: Settings, process: Process, scans: tuple[float, float] | None = None, factor: float = 1.0
) -> LoopComparison:
    """Return the figures of the closed loop with a source's and with a target's settings.

    Parameters
    ----------
    source, target : Settings
        The settings.
    process : Process
        The process.
    scans : tuple of float, optional
        Scan intervals of source and target [s]: the sampled loops. Without them, the continuous ones.
    factor : float
        What the source's gain is multiplied by for new signal ranges.

    Raises
    ------
    UndefinedError
        A controller is a recursion in scans, and there are no scan intervals.
    ScanError, ProcessError
        Controller or process cannot be sampled so.
    """
    h = scans or (None, None)
    return LoopComparison(process.text, _figures(source, process, h[0], factor), _figures(target, process, h[1], 1.0))


def _figures(settings: Settings, process: Process, scan: float | None, factor: float) -> LoopFigures:
    iae = continuous_load_iae(settings, process, factor) if scan is None else load_iae(settings, process, scan, factor)
    return loop_figures(settings.law(scan), process, factor, iae)


def _duration(settings: Settings, process: Process, h: float) -> float:
    return min(2 * settling_time(settings, process, h), _DEFAULT_SCANS * h)


def _negative_feedback(settings: Settings, process: Process) -> Action:
    """Return the action with which the feedback is negative."""
    right = process.feedback_sign * low_frequency_sign(settings.algorithm()) >= 0
    if not right and settings.equation.action.fixed:
        raise ProcessError(
            f"{settings.card.id} has no choice of control action, and with the sign of its gain the feedback from {process} would "
            f"be positive; give the gain the other sign"
        )
    return "reverse" if right else "direct"


def _step(name: str, given: float | Step, at: float, end: float) -> Step | None:
    """Return when and how far a signal steps, or ``None`` where it does not."""
    try:
        when, size = (float(x) for x in given) if isinstance(given, Sequence) else (at, float(given))
    except (TypeError, ValueError):
        raise ProcessError(f"{name} is {given!r}; give the size of the step in %, or (time, size)") from None
    if not (math.isfinite(size) and 0 <= when < end):
        raise ProcessError(f"a {name} step of {size:g} % at {when:g} s is not within the {end:g} s simulated; start it earlier")
    return (when, size) if size else None


def _signal(step: Step | None, times: Floats) -> Floats:
    if step is None:
        return np.zeros(times.size)
    return np.where(np.arange(times.size) >= _first(times, step[0]), step[1], 0.0)


def _first(times: Floats, at: float) -> int:
    """Return the first scan at or after a time [s]."""
    return int(np.searchsorted(times, at * (1 - 1e-12)))


def _at_rest(
    settings: Settings, h: float, action: Action, limits: tuple[float, float], initial: tuple[float, float, float]
) -> Controller:
    """Return a controller at rest; where nothing integrates, its bias is such that its output is the initial one there."""
    sp, pv = _own(settings, np.array(initial[:2]))
    output = Scale(settings).output_own(initial[2])
    controller, biased = controller_for(settings, Timing(h), action, limits, initial[2])
    if biased:
        trial, _ = controller_for(settings, Timing(h), action, _UNLIMITED, initial[2])
        trial.rest(sp, pv, output)
        bias = 2 * output - trial.scan(sp, pv)
        own = (Scale(settings).output_own(limits[0]), Scale(settings).output_own(limits[1]))
        controller = Controller(settings, h, action, own, bias=bias, initial_output=output)
    controller.rest(sp, pv, output)
    return controller


def _own(settings: Settings, percent: Floats) -> list[float]:
    """Return setpoints or measurements in the controller's units."""
    found: list[float] = Scale(settings).own(Record(sp=percent, pv=percent)).pv.tolist()
    return found


def _run(
    controller: Controller, plant: Plant, sp: Floats, load: Floats, initial: tuple[float, float, float]
) -> tuple[Floats, Floats]:
    """Close the loop; return measurement and output [%]."""
    settings = controller.settings
    low, high = _own(settings, np.array(_FULL))
    own_sp, rest_pv, rest_output = _own(settings, sp), initial[1], initial[2]
    bottom, top = (Scale(settings).output_own(x) for x in _FULL)
    pv, out = np.empty(sp.size), np.empty(sp.size)
    with np.errstate(over="ignore", invalid="ignore"):
        for i, (r, d) in enumerate(zip(own_sp, load.tolist(), strict=True)):
            y = rest_pv + plant.measure()
            u = controller.scan(r, low + y * ((high - low) / 100))
            pv[i], out[i] = y, (u - bottom) * (100 / (top - bottom))
            plant.move(out[i] - rest_output + d)
    return pv, out
