"""How good a fit is: residuals, their size and likeness, and how sure its numbers are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.process.fit.bump import BumpTest
from pidemu.process.fit.optimum import Optimum
from pidemu.process.fit.responses import HeldOutput

Interval = tuple[float, float]
CONFIDENCE: Final = 0.95
_NORMAL: Final = 1.959963984540054
"""Quantile of the normal distribution for it."""
_OPEN: Final = 20.0
"""Logarithm beyond which an interval is open."""
_STEP: Final = 1e-4
"""Step of the derivatives, in lags and in samples."""


@dataclass(frozen=True)
class Goodness:
    """How well a model fits a record.

    Attributes
    ----------
    simulated, residuals : ndarray of float, shape (n,)
        The model's measurement, and what is left of the recorded one.
    rms : float
        Root mean square of the residuals.
    r_squared : float
        Share of the measurement's variance that the model explains.
    correlation : float
        Correlation of neighbouring residuals.
    evidence : float
        How much more the model explains than chance would (an F ratio per sample that counts); 1 where it explains nothing.
    """

    simulated: Floats
    residuals: Floats
    rms: float
    r_squared: float
    correlation: float
    evidence: float


def judge(test: BumpTest, found: Optimum) -> Goodness:
    """Return how well a model fits a record."""
    columns = _columns(test, found)
    simulated = columns @ [found.gain, found.start, found.drift]
    residuals = test.measurement - simulated
    total = test.measurement - test.measurement.mean()
    left, whole = float(residuals @ residuals), float(total @ total)
    correlation = _correlation(residuals)
    free = residuals.size - len(found.lags) - 3
    chance = left / free * _inflation(correlation) if free > 0 else math.inf
    without = test.measurement - _flat(test, drifts=bool(found.drift))
    gained = max(0.0, float(without @ without) - left) / (len(found.lags) + 2)
    return Goodness(
        simulated,
        residuals,
        math.sqrt(left / residuals.size),
        1 - left / whole if whole else 0.0,
        correlation,
        gained / chance if chance > 0 else math.inf,
    )


def intervals(test: BumpTest, found: Optimum, goodness: Goodness) -> dict[str, Interval]:
    """Return intervals that hold the true numbers with a probability of 95 %, where the model is true, by linear theory.

    The noise counts as a first-order autoregression with the correlation of the residuals; lags have intervals of their logarithms.
    Two lags that could as well be equal are no linear case: their intervals are too narrow then.
    """
    slopes = _slopes(test, found)
    names = ["gain", "start", *(["drift"] if found.drift else []), *_lag_names(found), "delay"]
    size = np.sqrt((slopes**2).sum(axis=0))
    if not (size > 0).all():
        return dict.fromkeys(names, (-math.inf, math.inf))
    scaled = slopes / size
    free = max(1, test.time.size - size.size)
    variance = goodness.rms**2 * test.time.size / free * _inflation(goodness.correlation)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(scaled.T @ scaled, rcond=1e-13)), 0.0) * variance) / size
    reach = dict(zip(names, (_student(free) * spread).tolist(), strict=True))
    values = {"gain": found.gain, "start": found.start, "drift": found.drift, "delay": found.delay}
    around = {name: (values[name] - reach[name], values[name] + reach[name]) for name in names if name in values}
    around["delay"] = (max(0.0, around["delay"][0]), around["delay"][1])
    for name, lag in zip(_lag_names(found), found.lags, strict=True):
        wide = reach[name] > _OPEN
        around[name] = (0.0, math.inf) if wide else (lag * math.exp(-reach[name]), lag * math.exp(reach[name]))
    return {name: around[name] for name in names}


def _lag_names(found: Optimum) -> list[str]:
    return ["lag"] if len(found.lags) == 1 else [f"lag {i}" for i in range(1, len(found.lags) + 1)]


def _columns(test: BumpTest, found: Optimum) -> Floats:
    held = HeldOutput.from_samples(test.time, test.output)
    since = test.time - test.time[0]
    return np.column_stack([held.response(test.time - found.delay, found.lags), np.ones(since.size), since])


def _flat(test: BumpTest, *, drifts: bool) -> Floats:
    """Return the best model of a measurement that does not answer the output."""
    since = test.time - test.time[0]
    fixed = np.column_stack([np.ones(since.size), since / since[-1]][: 1 + drifts])
    return np.asarray(fixed @ np.linalg.lstsq(fixed, test.measurement, rcond=None)[0])


def _slopes(test: BumpTest, found: Optimum) -> Floats:
    """Return how the model's measurement changes with each of its numbers, with logarithms of lags."""
    held = HeldOutput.from_samples(test.time, test.output)
    response, flat, since = _columns(test, found).T
    columns = [response, flat, *([since] if found.drift else [])]
    at = test.time - found.delay
    for i, lag in enumerate(found.lags):
        up, down = ([*found.lags[:i], lag * (1 + sign * _STEP), *found.lags[i + 1 :]] for sign in (1, -1))
        columns.append((held.response(at, up) - held.response(at, down)) * (found.gain / (2 * _STEP)))
    step = _STEP * test.spacing
    columns.append((held.response(at - step, found.lags) - held.response(at + step, found.lags)) * (found.gain / (2 * step)))
    return np.column_stack(columns)


def _correlation(residuals: Floats) -> float:
    power = float(residuals @ residuals)
    return float(residuals[1:] @ residuals[:-1]) / power if power else 0.0


def _inflation(correlation: float) -> float:
    """Return how many samples of noise with a correlation of neighbours count as one."""
    rho = min(max(correlation, 0.0), 0.99)
    return (1 + rho) / (1 - rho)


def _student(free: int) -> float:
    """Return the quantile of Student's distribution for the confidence, by its expansion for many degrees of freedom."""
    z = _NORMAL
    return z + (z**3 + z) / (4 * free) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * free**2)
