"""What loops are optimised for, and what may bound them: figures of many responses at once, per 1 % of step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import TuningError, suggest
from pidemu.plausible import number, shown
from pidemu.tuning.sampled_loops import LoopResponses, SampledLoops

CRITERIA: Final = {
    "iae": "integral of the absolute error [% s]",
    "ise": "integral of the squared error [%^2 s]",
    "itae": "integral of time times absolute error, from the step on [% s^2]",
    "ie": "integral of the error [% s]: the reciprocal of the integral gain",
}
"""What a tuning can be best by, and its unit; the step is 1 %."""
LIMITS: Final = {
    "Ms": "largest sensitivity",
    "Mt": "largest complementary sensitivity",
    "overshoot": "overshoot of the measurement after a setpoint step, as a part of the step",
    "output_overshoot": "how far the output goes beyond where it ends, as a part of that",
    "decay_ratio": "third swing of the error over the first",
    "noise_gain": "output per measurement that is off for one scan [%/%]",
    "travel": "what the output moves by in all [% per % of step]",
}
"""What can be bounded from above."""
_LEFT: Final = 1e-3
"""A part of the largest error below which none is left."""
DISTURBANCES: Final = ("load", "setpoint")


def read_limits(limits: Mapping[str, object] | None) -> dict[str, float]:
    """Return limits as numbers.

    Raises
    ------
    TuningError
        One is unknown, or not a number above zero.
    """
    found = {}
    for name, value in (limits or {}).items():
        if name not in LIMITS:
            raise TuningError(f"no limit '{name}'{suggest(name, LIMITS)}; limits: {', '.join(LIMITS)}")
        try:
            found[name] = number(value)
        except ValueError:
            found[name] = -1.0
        if not found[name] > 0 or (name in ("Ms", "Mt") and found[name] <= 1):
            least = 1 if name in ("Ms", "Mt") else 0
            raise TuningError(f"the limit {name} is {shown(value)}; give a number above {least}")
    return found


def criterion_of(name: str, r: LoopResponses) -> Floats:
    """Return a criterion of each loop, shape (loops,); infinite where the response is not finite.

    Errors go along straight lines between the scans. One that is left at the end of the run counts as if it lasted for another.
    """
    h, e = r.scan, r.error
    a, b = e[:-1], e[1:]
    with np.errstate(all="ignore"):
        if name == "ise":
            found = np.sum((a * a + a * b + b * b) / 3, axis=0) * h
        elif name == "ie":
            found = np.abs(np.sum((a + b) / 2, axis=0) * h)
        else:
            crosses = a * b < 0
            area = np.where(crosses, (a * a + b * b) / (2 * np.where(crosses, np.abs(a - b), 1.0)), np.abs(a + b) / 2)
            times = (np.arange(len(a)) + 0.5)[:, None] * h if name == "itae" else 1.0
            found = np.sum(area * times, axis=0) * h
        length = len(e) * h
        left = np.where(np.abs(e[-1]) > _LEFT * np.max(np.abs(e), axis=0), np.abs(e[-1]), 0.0)
        found = found + left * length * (length if name == "itae" else 1.0)
    return np.where(np.isfinite(found), found, np.inf)


def bounded(name: str, loops: SampledLoops, response: LoopResponses, setpoint: LoopResponses | None) -> Floats:
    """Return what a limit bounds, of each loop, shape (loops,)."""
    if name in ("Ms", "Mt"):
        Ms, Mt = loops.sensitivities()
        return Ms if name == "Ms" else Mt
    if name == "noise_gain":
        return loops.impulse()
    if name == "travel":
        return np.asarray(np.abs(response.output[0]) + np.sum(np.abs(np.diff(response.output, axis=0)), axis=0))
    if name == "overshoot":
        assert setpoint is not None
        return np.asarray(np.maximum(-np.min(setpoint.error, axis=0), 0.0))
    if name == "output_overshoot":
        end = response.output[-1]
        with np.errstate(all="ignore"):
            return np.asarray(np.max(response.output * np.sign(end), axis=0) / np.abs(end) - 1)
    return _decay_ratios(response.error)


def is_stable(r: LoopResponses) -> Floats:
    """Tell which loops are stable, as far as a run shows it: what is left at its end is less than half of the largest error."""
    late = np.max(np.abs(r.error[-max(1, len(r.error) // 5) :]), axis=0)
    return np.asarray(np.isfinite(late) & (late < 0.5 * np.max(np.abs(r.error), axis=0)))


def _decay_ratios(error: Floats) -> Floats:
    """Return the third lobe of each error over the first; 0 where there are not so many."""
    found = np.zeros(error.shape[1])
    for i, e in enumerate(error.T):
        ends = np.flatnonzero(e[:-1] * e[1:] < 0) + 1
        if ends.size >= 2:
            first, third = np.max(np.abs(e[: ends[0]])), np.max(np.abs(e[ends[1] : ends[2] if ends.size > 2 else None]))
            found[i] = third / first
    return found
