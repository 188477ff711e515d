"""A trial of a closed loop: what runs, from where, for how long, and what steps when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pidemu.analysis.figures import scan_for, settling_time
from pidemu.analysis.open_loop import low_frequency_sign
from pidemu.arrays import Floats
from pidemu.card.model.card_file import default_scan
from pidemu.controller.bench import Bench, limits_in_percent
from pidemu.controller.controller import Controller
from pidemu.errors import ProcessError
from pidemu.plausible import INTERVAL, LEVEL, TIME, plausible, shown
from pidemu.process.process import Process
from pidemu.program.ir import Program
from pidemu.program.specialise import specialise
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.simulation.closed import closed_loop
from pidemu.simulation.noise import Noise
from pidemu.simulation.surroundings import NOTHING_ELSE, Surroundings
from pidemu.simulation.valve import Valve

Step = tuple[float, float]

_DEFAULT_SCANS: Final = 50_000
"""The default duration ends here."""
_ENOUGH_SCANS: Final = 100_000
"""For more than so many the card's scan interval is not shortened."""
_MOST_SCANS: Final = 20_000_000


@dataclass(frozen=True)
class Trial:
    """A closed loop that can be run; everything is chosen and checked.

    Attributes
    ----------
    settings : Settings
        The controller's settings.
    process : Process
        The process.
    scan : float
        Scan interval [s].
    scans : int
        How many scans, the first at time 0.
    action : {"reverse", "direct"}
        Control action.
    limits : tuple of float
        Output limits [%].
    initial : tuple of float
        Setpoint, measurement and output before [%].
    setpoint_step, load_step : tuple of float or None
        When and how far setpoint and load step [s, %].
    note : str
        Why the scan interval is longer than the loop would take; empty where it is not.
    around : Surroundings
        Noise, valve, the load's own way, and how long setpoint and load take to move.
    """

    settings: Settings
    process: Process
    scan: float
    scans: int
    action: Action
    limits: tuple[float, float]
    initial: tuple[float, float, float]
    setpoint_step: Step | None
    load_step: Step | None
    note: str = ""
    around: Surroundings = NOTHING_ELSE

    @property
    def times(self) -> Floats:
        """Times of the scans [s], shape (scans,)."""
        return np.arange(self.scans, dtype=np.float64) * self.scan

    @property
    def setpoint(self) -> Floats:
        """The setpoint at the scans [%], shape (scans,)."""
        return self.initial[0] + self._signal(self.setpoint_step, self.around.setpoint_time)

    @property
    def load(self) -> Floats:
        """The load at the scans [%], shape (scans,)."""
        return self._signal(self.load_step, self.around.load_time)

    def first(self, at: float) -> int:
        """Return the first scan at or after a time [s]."""
        return first_scan(at, self.scan, self.scans)

    @property
    def inputs(self) -> list[Floats]:
        """What the loop's program reads, in its order, each of shape (scans,)."""
        noise = self.around.noise
        return [self.setpoint, self.load, *([] if noise is None else [noise.at(self.scans, self.scan)])]

    def _signal(self, step: Step | None, duration: float) -> Floats:
        if step is None:
            return np.zeros(self.scans)
        if not duration:
            return np.where(np.arange(self.scans) >= self.first(step[0]), step[1], 0.0)
        return step[1] * np.clip((self.times - step[0]) / duration, 0.0, 1.0)

    def controller(self) -> Controller:
        """Return the controller at rest; where nothing integrates, its bias is such that its output is the initial one there."""
        sp, pv, op = self.initial
        bench = Bench.in_percent(self.settings, self.scan, sp=sp, pv=pv, op=op, limits=self.limits, action=self.action)
        return bench.balanced()

    def program(self, controller: Controller) -> Program:
        """Return the closed loop of a controller at rest (`pidemu.simulation.closed.closed_loop`)."""
        at_rest = replace(controller.program, initial=tuple(controller.state.values()))
        rest = (self.initial[1], self.initial[2])
        return closed_loop(specialise(at_rest), self.process.sampled(self.scan), rest, self.settings.own_ranges, self.around)


def first_scan(at: float, scan: float, scans: int) -> int:
    """Return the first scan at or after a time [s], of so many; their number where there is none.

    Parameters
    ----------
    at : float
        The time [s]; a scan that rounding puts just before it counts.
    scan : float
        Scan interval [s]; scan `n` is at ``n scan``.
    scans : int
        How many scans.
    """
    least = at * (1 - 1e-12)
    n = min(max(0, math.ceil(least / scan) - 1), scans)
    while n < scans and n * scan < least:
        n += 1
    return n


def trial(
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
    noise: float | Noise | None = None,
    valve: Valve | None = None,
    load_process: Process | None = None,
    durations: tuple[float, float] = (0.0, 0.0),
) -> Trial:
    """Choose what is not given, and check what is; the parameters and errors are those of `pidemu.simulate`."""
    process.check_percent()
    if load_process is not None:
        load_process.check_percent()
    own = scan_for(settings, process) if scan is None else plausible("scan interval", scan, INTERVAL, ProcessError)
    if not own > 0:
        raise ProcessError(f"the scan interval {own:g} s is not a positive number; give the time between two scans")
    length = _duration(settings, process, own) if time is None else plausible("time", time, TIME, ProcessError)
    h = own if scan is not None else _affordable(own, default_scan(settings.equation), length)
    if not h <= length < _MOST_SCANS * h:
        raise ProcessError(
            f"a simulation of {length:g} s, scanned every {h:g} s, cannot be run; give a time of a few responses, "
            f"{h:g} s to {_MOST_SCANS * h:g} s"
        )
    sp_step, load_step = _step("setpoint", setpoint, length / 20, length), _step("load", load, length / 2, length)
    real_valve = valve if valve is not None and not valve.is_ideal else None
    around = Surroundings(_noise(noise), real_valve, load_process, *map(_duration_of, ("setpoint", "load"), durations))
    chosen = action or _negative_feedback(settings, process)
    limits = limits_in_percent(settings, output_limits)
    if not limits[0] < limits[1]:  # not a number compares false as well
        raise ProcessError(f"output limits {limits[0]:g} to {limits[1]:g} % are not a range; give low, then high, such as (0, 100)")
    if not limits[0] <= initial[2] <= limits[1]:
        raise ProcessError(
            f"the initial output {initial[2]:g} % is outside the output limits {limits[0]:g} to {limits[1]:g} %; give another, or "
            f"other limits such as output_limits=(0, 100)"
        )
    scans = math.floor(length / h * (1 + 1e-12)) + 1
    note = (
        ""
        if h == own
        else (
            f"a scan interval of {h:g} s is taken, since with the {own:g} s that suit this loop the run would have more than "
            f"{_ENOUGH_SCANS:,} scans; give the interval, or a shorter time"
        )
    )
    return Trial(settings, process, h, scans, chosen, limits, initial, sp_step, load_step, note, around)


def _affordable(h: float, cards: float, length: float) -> float:
    """Return a scan interval that nobody asked for: longer, up to the card's, where the run would have too many scans [s]."""
    least = length / _ENOUGH_SCANS
    if not h < least:
        return h
    digit = 10.0 ** (1 - math.floor(math.log10(least)))
    return min(cards, math.ceil(least * digit - 1e-9) / digit)


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


def _noise(given: float | Noise | None) -> Noise | None:
    """Return noise, or ``None`` where there is none."""
    noise = given if isinstance(given, Noise) or given is None else Noise(given)
    return noise if noise is not None and noise.deviation else None


def _duration_of(name: str, given: float) -> float:
    """Return how long a ramp takes [s]; 0 for a step."""
    duration = plausible(f"the duration of the {name} ramp", given, TIME, ProcessError)
    if duration < 0:
        raise ProcessError(f"the duration of the {name} ramp is {duration:g} s; give 0 or more")
    return duration


def _step(name: str, given: float | Step, at: float, end: float) -> Step | None:
    """Return when and how far a signal steps, or ``None`` where it does not."""
    if isinstance(given, str) or (isinstance(given, Sequence) and len(given) != 2):
        raise ProcessError(f"{name} is {shown(given)}; give the size of the step in %, or (time, size)")
    moment, step = given if isinstance(given, Sequence) else (at, given)
    size = plausible(f"the size of the {name} step", step, LEVEL, ProcessError)
    when = plausible(f"the time of the {name} step", moment, TIME, ProcessError)
    if not 0 <= when < end:
        raise ProcessError(f"a {name} step of {size:g} % at {when:g} s is not within the {end:g} s simulated; start it earlier")
    return (when, size) if size else None
