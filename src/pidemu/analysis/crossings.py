"""Where functions of the frequency are zero: found between samples of different signs, all at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_RESOLUTION: Final = 4e-15
"""How near a zero is found; on a logarithmic scale a few units in the last place."""


def crossings(w: Floats, values: Floats, function: Callable[[Floats], Floats], among: npt.ArrayLike = True) -> Floats:
    """Return the frequencies at which a function is zero, between values of different signs, in the intervals `among`.

    Parameters
    ----------
    w, values : ndarray, shape (n,)
        Frequencies [rad/s], and the function there.
    function : callable
        The function.
    among : array_like of bool, shape (n - 1,)
        The intervals that count.
    """
    at = np.flatnonzero(((values[1:] < 0) != (values[:-1] < 0)) & among)
    x = np.log(w)
    return np.exp(zeros(x[at], x[at + 1], values[at], values[at + 1], lambda x: function(np.exp(x))))


def zeros(low: Floats, high: Floats, at_low: Floats, at_high: Floats, function: Callable[[Floats], Floats]) -> Floats:
    """Return the zero in each of several intervals, by Chandrupatla's method.

    Inverse quadratic interpolation where that is safe, else bisection.

    Parameters
    ----------
    low, high : ndarray, shape (n,)
        Ends of the intervals, of which one contains a zero each.
    at_low, at_high : ndarray, shape (n,)
        The function there: of different signs.
    function : callable
        From one number in each interval, in their order, to the function there.
    """
    x1, x2, f1, f2 = high, low, at_high, at_low
    share = np.full(low.size, 0.5)
    for _ in range(60 if low.size else 0):
        x = x1 + share * (x2 - x1)
        f = function(x)
        same = (f < 0) == (f1 < 0)
        x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
        x2, f2 = np.where(same, x2, x1), np.where(same, f2, f1)
        x1, f1 = x, f
        least = _RESOLUTION / np.maximum(np.abs(x2 - x1), _RESOLUTION)
        if np.all((least >= 0.5) | (f1 == 0)):
            break
        share = np.clip(_interpolated(x1, x2, x3, f1, f2, f3), least, 1 - least)
    return np.where(np.abs(f1) < np.abs(f2), x1, x2)


def _interpolated(x1: Floats, x2: Floats, x3: Floats, f1: Floats, f2: Floats, f3: Floats) -> Floats:
    """Return how far from `x1` to `x2` the zero is, by inverse quadratic interpolation where that stays between, else a half."""
    with np.errstate(all="ignore"):
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        found = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        safe = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi) & np.isfinite(found)
    return np.where(safe, found, 0.5)
