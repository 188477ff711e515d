"""Reaction curves and relay cycles with known answers, and records made of known processes."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.process.process import Process

Floats = npt.NDArray[np.float64]
DATA: Final = Path(__file__).parents[1] / "data"
FILES: Final = {"01-fopdt": "curve_01_fopdt.csv", "05-fopdt-noisy": "curve_05_fopdt_noisy.csv", "09-integ": "curve_09_integ.csv"}


@cache
def reference() -> Any:
    """Return the numbers of tests/data/process_fits.json."""
    return json.loads((DATA / "process_fits.json").read_text(encoding="utf-8"))


def curve(name: str) -> tuple[Floats, Floats, Floats]:
    """Return time, output and measurement of a reaction curve."""
    table = np.loadtxt(DATA / FILES[name], delimiter=",", skiprows=1)
    return table[:, 0], table[:, 1], table[:, 2]


def measured(process: Process, time: Floats, output: Floats, start: float = 40.0) -> Floats:
    """Return the measurement of a process after the steps of an output, from closed forms of its step response."""
    found = np.full(time.size, float(start))
    at = np.flatnonzero(np.diff(output)) + 1
    for when, size in zip(time[at], np.diff(output)[at - 1], strict=True):
        found += size * step_response(process, time - when - process.delay)
    return found


def step_response(process: Process, t: Floats) -> Floats:
    """Return the step response without dead time, 0 before the step: an integrator, distinct lags, or two equal ones."""
    after: Floats = np.maximum(t, 0.0)
    if process.integrators:
        return np.asarray(process.gain * after, dtype=np.float64)
    lags = [-1 / p.real for p in process.poles]
    if len(lags) == 2 and lags[0] == lags[1]:
        return np.asarray(process.gain * (1 - (1 + after / lags[0]) * np.exp(-after / lags[0])), dtype=np.float64)
    found = np.ones(t.size)
    for T in lags:
        others = math.prod(T - x for x in lags if x != T)
        found -= T ** (len(lags) - 1) / others * np.exp(-after / T)
    return np.asarray(process.gain * found, dtype=np.float64)


def held(time: Floats, steps: Sequence[tuple[float, float]], rest: float = 50.0) -> Floats:
    """Return an output that steps at some times by some sizes."""
    return np.asarray(rest + sum((size * (time >= when) for when, size in steps), np.zeros(time.size)), dtype=np.float64)
