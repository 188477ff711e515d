"""Least squares over a handful of bounded numbers: Levenberg's and Marquardt's method.

Its work per step is a few evaluations of the residuals and sums over them, so that records of 100,000 samples are fitted within a
second, and nothing heavy has to be imported.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final

import numpy as np

from pidemu.arrays import Floats

_STEP: Final = 1e-7
"""Step of the differences, in the scale of a number."""
_MOST: Final = 60
"""Steps after which the search ends in any case."""
_SMALL: Final = 1e-12
"""Step, in scales, and relative gain below which the search has ended."""


def dot(a: Floats, b: Floats) -> float:
    """Return the sum of products, without the threads of a linear algebra library, which cost more than such a sum."""
    return float(np.einsum("i,i->", a, b))


def least_squares(
    residuals: Callable[[Floats], Floats], start: Floats, low: Floats, high: Floats, scale: Floats
) -> tuple[float, Floats]:
    """Return the sum of squares at a local minimum, and where it is.

    Parameters
    ----------
    residuals : callable
        Returns residuals, shape (n,), at a place of shape (p,).
    start : ndarray of float, shape (p,)
        Where to start.
    low, high : ndarray of float, shape (p,)
        Bounds, which are kept.
    scale : ndarray of float, shape (p,)
        By how much each number changes usually.
    """
    x = np.clip(start, low, high)
    r = residuals(x)
    total, damping = dot(r, r), 1e-3
    for _ in range(_MOST):
        columns = _slopes(residuals, x, r, high, scale)
        gradient = np.array([dot(column, r) for column in columns])
        free = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))) & np.array([c.any() for c in columns])
        if not total > 0 or not free.any():
            break
        normal = np.array([[dot(a, b) for b in columns] for a in columns])[np.ix_(free, free)]
        gained, moved = 0.0, 0.0
        while damping < 1e12:
            damped = normal + damping * np.diag(np.diag(normal))
            step = np.zeros(x.size)
            step[free] = np.linalg.lstsq(damped, -gradient[free], rcond=1e-15)[0] * scale[free]
            there = np.clip(x + step, low, high)
            tried = residuals(there)
            gained, moved = total - dot(tried, tried), float(np.abs((there - x) / scale).max())
            if gained >= 0 or moved < _SMALL:
                break
            damping *= 8
        if gained < 0 or damping >= 1e12:
            break
        x, r, total, damping = there, tried, total - gained, max(damping / 20, 1e-12)
        if moved < _SMALL or gained < _SMALL * total:
            break
    return total, x


def _slopes(residuals: Callable[[Floats], Floats], x: Floats, r: Floats, high: Floats, scale: Floats) -> list[Floats]:
    """Return the derivatives by each number, per scale, by differences within the bounds."""
    found = []
    for i, size in zip(itertools.count(), scale.tolist(), strict=False):
        there = x.copy()
        there[i] += _STEP * size if x[i] + _STEP * size <= high[i] else -_STEP * size
        found.append((residuals(there) - r) * (size / (there[i] - x[i])))
    return found
