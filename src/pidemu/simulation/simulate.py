"""The closed loop of an emulated controller and a process, scan by scan."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from pidemu.analysis.figures import loop_figures
from pidemu.analysis.load_response import continuous_load_iae, load_iae
from pidemu.analysis.loop_figures import LoopComparison, LoopFigures
from pidemu.arrays import Floats
from pidemu.backends.choice import Choice, checked, for_record, safe_runner
from pidemu.backends.engine_names import Engine
from pidemu.backends.python import starting
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.simulation.experiment import integral_of_error
from pidemu.simulation.noise import Noise
from pidemu.simulation.surroundings import NOTHING_ELSE, Surroundings
from pidemu.simulation.trial import Step, Trial, first_scan, trial
from pidemu.simulation.valve import MovingValve, Valve


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
    engine : Choice
        Which back end ran it, and why.
    initial : tuple of float
        Setpoint, measurement and output before [%].
    note : str
        Why the scan interval is longer than the loop would take; empty where it is not.
    around : Surroundings
        Noise, valve, the load's own way, and how long setpoint and load take to move.
    valve : ndarray of float, shape (n,), or None
        Where the valve stands [%]; ``None`` where there is none, and the output itself reaches the process.
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
    engine: Choice
    initial: tuple[float, float, float] = (50.0, 50.0, 50.0)
    note: str = ""
    around: Surroundings = NOTHING_ELSE
    valve: Floats | None = None

    @property
    def error(self) -> Floats:
        """Setpoint minus measurement [%]."""
        return self.setpoint - self.measurement

    @property
    def iae(self) -> float:
        """Integral of the absolute error [% s], along straight lines between scans: from the load step or from the start."""
        start = 0 if self.load_step is None else first_scan(self.load_step[0], self.scan, self.times.size)
        return integral_of_error(self.error[start:], self.scan)


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
    noise: float | Noise | None = None,
    valve: Valve | None = None,
    load_process: Process | None = None,
    durations: tuple[float, float] = (0.0, 0.0),
    engine: Engine | None = None,
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
        crossover frequency) where that is shorter; not so short that the run has more than 100,000 scans.
    setpoint, load : float or tuple of float
        Size of a setpoint step, and of a load step that adds to the controller's output at the process [%]; or when [s] and size.
        By default after a twentieth of the time, and after half of it. They count from the first scan at or after that time; a size
        of 0 is not a step.
    time : float, optional
        How long [s]; by default long enough for both responses to settle, at most 50,000 scans.
    action : {"reverse", "direct"}, optional
        Control action; by default that of negative feedback.
    output_limits : tuple of float, optional
        Low and high output limit [%]; by default the card's, 0 to 100 where it has none.
    initial : tuple of float
        Setpoint, measurement and output [%] before; the process is at rest there.
    noise : float or Noise, optional
        Noise on the measurement, or the standard deviation of white noise [%]. The figures of a loop are those of the measurement
        as it is read, noise included.
    valve : Valve, optional
        Dead band, stiction, resolution and rate of the valve between output and process.
    load_process : Process, optional
        The load's own way to the measurement; by default the load adds to what reaches the process. ``Process(1)`` is a load at
        the measurement itself.
    durations : tuple of float
        How long setpoint and load take to move [s], along ramps, which stand between scans; 0 for steps.
    engine : {"python", "numpy", "numba", "c"}, optional
        Which back end runs the loop; all give the same bits. By default the quickest for the number of scans.

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
    EngineError
        The engine is not there.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    >>> p = pidemu.Process.from_lags(1.0, lags=[10], delay=2)
    >>> found = pidemu.simulate(s, p, scan=0.1, setpoint=0, load=(10, 5), time=200)
    >>> round(found.iae, 2)  # near 5 Ti/K = 25: the error hardly changes its sign
    25.0
    """
    forced = checked(engine)
    made = trial(
        settings,
        process,
        scan,
        setpoint=setpoint,
        load=load,
        time=time,
        action=action,
        output_limits=output_limits,
        initial=initial,
        noise=noise,
        valve=valve,
        load_process=load_process,
        durations=durations,
    )
    return run_trial(made, forced)


def run_trial(made: Trial, forced: Engine | None = None) -> Simulation:
    """Return a trial with the signals that it made.

    Parameters
    ----------
    made : Trial
        What to run.
    forced : {"python", "numpy", "numba", "c"}, optional
        The engine; by default the quickest.
    """
    program, inputs = made.program(made.controller()), made.inputs
    choice = for_record(program, made.scans, forced)
    under_way = (min(length, made.scans) for length in program.lengths)  # what comes later is not seen
    state = [*starting(program), *(deque([0.0] * length) for length in under_way)]
    with np.errstate(all="ignore"):
        out, pv, *valve = safe_runner(program, choice).run(state, inputs, made.scans)
    if not (np.isfinite(pv).all() and np.isfinite(out).all()):  # what a card does then is the emulator's to know
        out, pv, *valve = run_scan_by_scan(made)
        choice = Choice("python", "scan by scan, as the measurement outgrows all numbers")
    return Simulation(
        made.settings, made.process, made.scan, made.action, made.limits, made.times, made.setpoint, pv, out, made.setpoint_step,
        made.load_step, choice, made.initial, made.note, made.around, valve[0] if valve else None,
    )  # fmt: skip


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


def run_scan_by_scan(made: Trial) -> tuple[Floats, ...]:
    """Run a trial with the emulator; return output, measurement and, where there is a valve, its position [%].

    Parameters
    ----------
    made : Trial
        What to run.
    """
    controller, inputs = made.controller(), made.inputs
    ranges, around, (_, rest_pv, rest) = made.settings.own_ranges, made.around, made.initial
    plant, load_way = _plant(made.process, made), None if around.load_process is None else _plant(around.load_process, made)
    valve = None if around.valve is None else MovingValve(around.valve, rest, made.scan)
    load, noise = (x.tolist() for x in (*inputs[1:], np.zeros(made.scans))[:2])
    rows = []
    with np.errstate(over="ignore", invalid="ignore"):
        for r, d, n in zip(ranges.pv.from_percent(inputs[0]).tolist(), load, noise, strict=True):
            y = rest_pv + plant.measure() + (0.0 if load_way is None else load_way.measure()) + n
            u = ranges.op.in_percent(controller.scan(r, ranges.pv.from_percent(y)))
            reaches = u if valve is None else valve.move(u)
            plant.move(reaches - rest + (d if load_way is None else 0.0))
            if load_way is not None:
                load_way.move(d)
            rows.append((u, y) if valve is None else (u, y, reaches))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def _plant(process: Process, made: Trial) -> Plant:
    model = process.sampled(made.scan)
    return Plant(replace(model, scans=min(model.scans, made.scans)))  # what comes later is not seen
