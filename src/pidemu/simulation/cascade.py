"""A cascade: the output of the outer controller is the remote setpoint of the inner one, in percent of its range.

Between scans both processes are exact: what the outer measurement has of the inner output goes through both in one model, and what
it has of its own load through the outer process alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.backends.choice import Choice
from pidemu.errors import ProcessError
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.simulation.noise import Noise
from pidemu.simulation.simulate import Simulation
from pidemu.simulation.trial import Step, Trial, trial
from pidemu.simulation.valve import MovingValve, Valve

_EVERY: Final = 1e-9
"""A scan interval within this share of a multiple is one."""


@dataclass(frozen=True)
class CascadeRun:
    """A cascade of two loops that ran.

    Attributes
    ----------
    outer, inner : Simulation
        The loops. The inner one's setpoint is the outer one's output. The load step of the outer one is its own, and where it has
        none the inner one's, which it answers as well.
    """

    outer: Simulation
    inner: Simulation


def simulate_cascade(
    outer: Settings,
    inner: Settings,
    outer_process: Process,
    inner_process: Process,
    scan: float | tuple[float, float] | None = None,
    *,
    setpoint: float | Step = 10.0,
    load: float | Step = 10.0,
    outer_load: float | Step = 0.0,
    time: float | None = None,
    actions: tuple[Action | None, Action | None] = (None, None),
    output_limits: tuple[float, float] | None = None,
    noise: float | Noise | None = None,
    valve: Valve | None = None,
) -> CascadeRun:
    """Run two emulated controllers in cascade, from rest at 50 %.

    The inner controller scans in cascade mode, as its card has it; the outer one in automatic. In a scan of both the outer one
    comes first. The outer one is not told when the inner one's output is at a limit: what its integral does then is its own.

    Parameters
    ----------
    outer, inner : Settings
        Card and settings of the controllers.
    outer_process, inner_process : Process
        The processes: from the inner measurement to the outer one, and from the inner output to the inner measurement [%/%].
    scan : float or tuple of float, optional
        Scan interval [s], or those of the outer and of the inner controller: the outer one's is a multiple of the inner one's. By
        default that which `pidemu.simulate` takes for the inner loop, for both.
    setpoint : float or tuple of float
        Size of a step of the outer setpoint [%], or when [s] and size; by default after a twentieth of the time.
    load, outer_load : float or tuple of float
        Steps that add to what enters the inner process, and to what enters the outer one [%]; by default after half of the time.
    time : float, optional
        How long [s]; by default long enough for both loops to settle.
    actions : tuple
        Control actions of the outer and the inner controller; by default those of negative feedback.
    output_limits : tuple of float, optional
        Limits of the inner output [%]; by default the card's. The outer output goes from 0 to 100 %, the inner one's range.
    noise : float or Noise, optional
        Noise on the outer measurement.
    valve : Valve, optional
        The valve behind the inner output.

    Returns
    -------
    CascadeRun
        Both loops, each with the signals at its own scans.

    Raises
    ------
    ProcessError
        The outer scan interval is not a multiple of the inner one, or what `pidemu.simulate` refuses.
    ScanError
        A controller cannot be run as asked.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("generic/standard").settings
    >>> jacket, reactor = pidemu.Process.from_lags(1, [10], delay=1), pidemu.Process.from_lags(1, [120, 20])
    >>> one = pidemu.simulate_cascade(s(K=3, Ti=120, Td=0), s(K=4, Ti=10, Td=0), reactor, jacket, 1.0, setpoint=0)
    >>> single = pidemu.Process.from_lags(1, [120, 20, 10], delay=1)
    >>> alone = pidemu.simulate(s(K=3, Ti=120, Td=0), single, 1.0, setpoint=0, load=one.inner.load_step, time=one.outer.times[-1])
    >>> bool(one.outer.iae < alone.iae / 5)
    True
    """
    slow_h, fast_h = scan if isinstance(scan, tuple) else (scan, scan)
    fast = trial(inner, inner_process, fast_h, setpoint=0, load=0, action=actions[1], output_limits=output_limits)
    h = fast.scan
    slow_h = h if slow_h is None else slow_h
    every = round(slow_h / h)
    if not (every >= 1 and math.isclose(every * h, slow_h, rel_tol=_EVERY)):
        raise ProcessError(
            f"the outer controller scans every {slow_h:g} s, not a multiple of the inner one's {h:g} s; give one that is"
        )
    if time is None:
        slow = trial(outer, outer_process, slow_h, setpoint=0, load=0, action=actions[0])
        time = (fast.scans - 1) * h + (slow.scans - 1) * slow_h
    asked: dict[str, Any] = {"setpoint": setpoint, "load": outer_load, "time": time, "action": actions[0]}
    slow = trial(outer, outer_process, slow_h, **asked, output_limits=(0, 100), noise=noise)
    asked = {"setpoint": 0, "load": load, "time": time, "action": actions[1]}
    fast = trial(inner, inner_process, h, **asked, output_limits=output_limits, valve=valve)
    return _run(slow, fast, every)


def _run(slow: Trial, fast: Trial, every: int) -> CascadeRun:
    """Close both loops."""
    outer, inner = slow.controller(), fast.controller()
    outside, inside = slow.settings.own_ranges, fast.settings.own_ranges
    both, second, own_way = (_plant(p, fast) for p in (_in_a_row(slow.process, fast.process), fast.process, slow.process))
    rest = remote = 50.0
    valve = None if fast.around.valve is None else MovingValve(fast.around.valve, rest, fast.scan)
    noise = np.zeros(slow.scans) if slow.around.noise is None else slow.around.noise.at(slow.scans, slow.scan)
    outer_load = replace(slow, scan=fast.scan, scans=fast.scans).load  # it enters at any scan of the inner loop
    signals = {name: np.empty(fast.scans) for name in ("outer", "remote", "inner", "output", "valve")}
    with np.errstate(over="ignore", invalid="ignore"):
        for i, (load, d) in enumerate(zip(fast.load.tolist(), outer_load.tolist(), strict=True)):
            pv, inner_pv = rest + both.measure() + own_way.measure(), rest + second.measure()
            k, off = divmod(i, every)
            if not off and k < slow.scans:
                pv += float(noise[k])
                u = outer.scan(outside.pv.from_percent(float(slow.setpoint[k])), outside.pv.from_percent(pv))
                remote = outside.op.in_percent(u)
            own = inside.pv.from_percent(remote)
            output = inside.op.in_percent(inner.scan(own, inside.pv.from_percent(inner_pv), cascade=own))
            reaches = output if valve is None else valve.move(output)
            for name, x in zip(signals, (pv, remote, inner_pv, output, reaches), strict=True):
                signals[name][i] = x
            for plant in (both, second):
                plant.move(reaches - rest + load)
            own_way.move(d)
    at = slice(None, every * slow.scans, every)
    return CascadeRun(
        _ran(replace(slow, load_step=slow.load_step or fast.load_step), slow.setpoint, signals["outer"][at], signals["remote"][at]),
        _ran(fast, signals["remote"], signals["inner"], signals["output"], signals["valve"] if valve else None),
    )


def _in_a_row(one: Process, other: Process) -> Process:
    """Return two processes in a row as one."""
    return Process(one.gain * other.gain, [*one.poles, *other.poles], [*one.zeros, *other.zeros], one.delay + other.delay)


def _plant(process: Process, fast: Trial) -> Plant:
    model = process.sampled(fast.scan)
    return Plant(replace(model, scans=min(model.scans, fast.scans)))  # what comes later is not seen


def _ran(made: Trial, setpoint: Floats, pv: Floats, out: Floats, valve: Floats | None = None) -> Simulation:
    choice = Choice("python", "two controllers, scan by scan")
    return Simulation(
        made.settings, made.process, made.scan, made.action, made.limits, made.times, setpoint, pv, out, made.setpoint_step,
        made.load_step, choice, made.initial, made.note, made.around, valve,
    )  # fmt: skip
