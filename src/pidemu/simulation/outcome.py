"""How a trial of a closed loop ended: whether the loop is stable, and whether the measurement had settled."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from pidemu.analysis.figures import loop_figures
from pidemu.analysis.loop_figures import LoopFigures
from pidemu.analysis.open_loop import OpenLoop, low_frequency_sign
from pidemu.errors import PidemuError
from pidemu.simulation.trial import Trial

LATE: Final = 5
"""A measurement is settled by what it does in the last of so many parts of the run."""
SETTLED: Final = 0.05
"""The error of a settled loop moves over less than this share of the largest error then."""
_FEWEST: Final = 10
"""Scans in the last part, at least."""
_AS_GOOD_AS_ZERO: Final = 1e-6
"""A frequency, times the times of process and scan."""
_NOTHING: Final = 1e-9
"""A swing below this is rounding [%]."""


def late_scan(scans: int) -> int:
    """Return the first scan of the last part of a run of so many scans."""
    return max(0, scans - max(_FEWEST, math.ceil(scans / LATE)))


def has_settled(swing: float, peak: float) -> bool:
    """Tell whether a measurement had settled at the end of its run.

    Parameters
    ----------
    swing : float
        What the error moves over in the last fifth of the run, from its lowest to its highest value [%].
    peak : float
        The largest absolute error [%].
    """
    return bool(math.isfinite(swing) and swing <= SETTLED * peak + _NOTHING)


def settled_by(trial: Trial, figures: Mapping[str, float]) -> bool | None:
    """Return whether a trial had settled at its end; ``None`` where it ends before the process has answered the last step.

    Parameters
    ----------
    trial : Trial
        What ran.
    figures : mapping of str to float
        Its figures, ``swing`` and ``peak`` among them [%].
    """
    return settled((trial.scans - 1) * trial.scan, last_answer(trial), figures["swing"], figures["peak"])


def last_answer(trial: Trial) -> float:
    """Return when the process begins to answer the last step of a trial [s]; minus infinity where there is none."""
    steps = [step[0] for step in (trial.setpoint_step, trial.load_step) if step is not None]
    return max(steps) + trial.process.delay if steps else -math.inf


def settled(end: float, answer: float, swing: float, peak: float) -> bool | None:
    """Return whether a run had settled at its end; ``None`` where it ends before the process has answered.

    Parameters
    ----------
    end, answer : float
        The last scan, and what `last_answer` returns [s].
    swing, peak : float
        As in `has_settled` [%].
    """
    return None if end <= answer else has_settled(swing, peak)


def feedback_is_negative(trial: Trial) -> bool:
    """Tell whether a trial's control action makes the feedback negative."""
    reverse = trial.process.feedback_sign * low_frequency_sign(trial.settings.algorithm()) >= 0
    return reverse if trial.settings.equation.action.fixed else reverse == (trial.action == "reverse")


def margins_of(trial: Trial) -> LoopFigures | None:
    """Return the figures of a trial's sampled loop within its limits; ``None`` where it has none: the feedback is positive.

    Parameters
    ----------
    trial : Trial
        What runs.
    """
    if not feedback_is_negative(trial):
        return None
    return loop_figures(trial.settings.law(trial.scan), trial.process)


def stability_of(trial: Trial, margins: LoopFigures | None) -> bool | None:
    """Return whether a trial's loop is stable; ``None`` where that is not known.

    With positive feedback a loop whose gain is 1 or more at zero frequency, as an integral's is, has a real unstable pole:
    ``1 - L`` is not above zero there and goes to 1 at high frequencies.

    Parameters
    ----------
    trial : Trial
        What runs.
    margins : LoopFigures or None
        What `margins_of` found.
    """
    if margins is not None:
        return margins.stable
    if feedback_is_negative(trial):
        return None
    loop = OpenLoop(trial.settings.law(trial.scan), trial.process)
    at_rest = abs(complex(loop(_AS_GOOD_AS_ZERO / (trial.process.time + trial.process.delay + trial.scan))))
    return False if at_rest >= 1 - 1e-9 else None  # rounding, and a frequency that is not quite zero


def margins_if_any(trial: Trial) -> LoopFigures | None:
    """Return `margins_of` a trial, or ``None`` where they cannot be computed: one loop of thousands stops no other."""
    try:
        return margins_of(trial)
    except (PidemuError, np.linalg.LinAlgError, ArithmeticError):
        return None
