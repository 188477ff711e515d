"""A trial as a program that needs nothing from outside: it makes its steps and measures itself."""

from __future__ import annotations

from pidemu.program.ir import Program
from pidemu.simulation.experiment import Measuring, Steps, experiment
from pidemu.simulation.outcome import late_scan
from pidemu.simulation.trial import Trial


def measured(trial: Trial) -> Program:
    """Return a trial as a program that makes its own steps and figures; errors count from the load step on, or from the start."""
    at, sizes = [], []
    for step in (trial.setpoint_step, trial.load_step):
        at.append(trial.scans if step is None else trial.first(step[0]))
        sizes.append(0.0 if step is None else step[1])
    start = 0 if trial.load_step is None else at[1]
    measuring = Measuring(trial.scan, start, late_scan(trial.scans), trial.initial[2], trial.limits)
    loop = trial.program(trial.controller())
    return experiment(loop, Steps(trial.initial[0], sizes[0], at[0], sizes[1], at[1]), measuring)
