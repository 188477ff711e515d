"""Least squares of all samples: gain, start and drift by linear algebra, time constants and dead time by search.

Where a dead time ends on a sample, the sum of squares has a kink for every move of the output, and with noise a local minimum at
many of them: a gradient method stops in one. So the dead time is cut at these kinks, and the best of the smooth pieces around it
counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.process.fit.bump import BumpTest
from pidemu.process.fit.minimise import dot, least_squares
from pidemu.process.fit.optimum import Optimum
from pidemu.process.fit.responses import HeldOutput

_SPANS: Final = 24
"""Sums of lags and dead time that are tried first."""
_SHARES: Final = (0.02, 0.25, 0.5, 0.75, 0.95)
"""Shares of the dead time in them."""
_SPLITS: Final = (0.05, 0.25, 0.5)
"""Shares of the second lag in both that are tried first."""
_STARTS: Final = 3
"""How many of the best are followed."""
_LONGEST: Final = 100.0
"""Longest lag, in lengths of the record."""
_SHORTEST: Final = 0.01
"""Shortest lag, in times between samples."""
_NONE: Final = 1e-9
"""Dead time, in times between samples, that is rounding."""
_FEW_MOVES: Final = 10
"""Moves of the output up to which the kinks are far apart."""
_PIECES: Final = 6
"""Pieces between kinks that are searched, on either side, in a record of usual length."""
_USUAL: Final = 20_000
"""Samples of a record of usual length."""
_ENOUGH: Final = 2000
"""Samples from which the search starts, evenly over the record, and as many after its first moves."""


class LeastSquaresSearch:
    """The sum of squares of a record under a model of so many lags, as a function of lags and dead time alone.

    Parameters
    ----------
    test : BumpTest
        The record.
    order : {0, 1, 2}
        How many lags; none for an integrator.
    drifts : bool
        Whether the measurement drifts.
    at : ndarray of int, optional
        The samples of the measurement that count; by default all.
    """

    def __init__(self, test: BumpTest, order: int, drifts: bool, at: npt.NDArray[np.intp] | None = None) -> None:
        self.order, self.drifts, self._test = order, drifts, test
        self._held = HeldOutput.from_samples(test.time, test.output)
        self._time, self._measurement = (test.time, test.measurement) if at is None else (test.time[at], test.measurement[at])
        since = self._time - test.time[0]
        self._fixed = np.column_stack([np.ones(since.size), since][: 1 + drifts])
        self._basis = np.ascontiguousarray(np.linalg.qr(self._fixed / np.abs(self._fixed).max(axis=0))[0].T)
        self._measured = self._without_fixed(self._measurement - self._measurement[0])
        self._shortest, self._longest = _SHORTEST * test.spacing, _LONGEST * float(since[-1])

    def optimum(self) -> Optimum:
        """Return the best model."""
        few = self if self._time.size <= 2 * _ENOUGH else LeastSquaresSearch(self._test, self.order, self.drifts, _some(self._test))
        _, start = min((few._follow(x, 0.0, self._test.duration) for x in few._starts()), key=lambda x: x[0])
        best = self._follow(start, 0.0, self._test.duration)
        for low, high in self._pieces(float(best[1][-1])):
            found = self._follow(np.array([*best[1][:-1], (low + high) / 2]), low, high)
            best = min(best, found, key=lambda x: x[0])
        return self._at(best[1])

    def columns(self, lags: Sequence[float], delay: float) -> Floats:
        """Return the responses of a model with the gain 1, and those of start and drift: shape (n, 2) or (n, 3)."""
        return np.column_stack([self._held.response(self._time - delay, lags), self._fixed])

    def _without_fixed(self, values: Floats) -> Floats:
        for column in self._basis:
            values = values - column * dot(column, values)
        return values

    def _residuals(self, x: Floats) -> Floats:
        """Return what is left of the measurement with the best gain, start and drift, for logarithms of lags and a dead time."""
        response = self._without_fixed(self._held.response(self._time - x[-1], np.exp(x[:-1]).tolist()))
        power = dot(response, response)
        return np.asarray(self._measured - response * (dot(response, self._measured) / power)) if power > 0 else self._measured

    def _starts(self) -> list[Floats]:
        """Return the best of a grid of lags and dead times."""
        spans = np.geomspace(self._test.spacing, 2 * self._test.duration, _SPANS)
        tried: list[Floats] = []
        for span in spans:
            for share in _SHARES:
                left = (1 - share) * span
                if self.order == 0:
                    tried.append(np.array([share * span]))
                elif self.order == 1:
                    tried.append(np.array([math.log(left), share * span]))
                else:
                    tried += [np.array([math.log(left * (1 - s)), math.log(left * s), share * span]) for s in _SPLITS]
        tried = [x for x in tried if x[-1] < self._test.duration]
        return sorted(tried, key=self._sum_of_squares)[:_STARTS]

    def _sum_of_squares(self, x: Floats) -> float:
        r = self._residuals(x)
        return dot(r, r)

    def _follow(self, start: Floats, low: float, high: float) -> tuple[float, Floats]:
        """Return the local minimum near a start, the dead time between two bounds, and its sum of squares."""
        below = np.array([*[math.log(self._shortest)] * self.order, low])
        above = np.array([*[math.log(self._longest)] * self.order, high])
        usual = float(np.exp(start[:-1]).sum() + start[-1])
        scale = np.array([*[1.0] * self.order, max(min(high - low, usual), self._test.spacing)])
        return least_squares(self._residuals, start, below, above, scale)

    def _pieces(self, delay: float) -> Iterator[tuple[float, float]]:
        """Yield the pieces between the kinks near a dead time."""
        if self.order == 2 or self._held.count > _FEW_MOVES:
            return
        time = self._time
        kinks = np.unique(np.concatenate([[0.0], *(_near(time - move, delay, _PIECES + 2) for move in self._held.times)]))
        kinks = kinks[(kinks >= 0) & (kinks <= self._test.duration)]
        around = int(np.searchsorted(kinks, delay))
        reach = max(1, min(_PIECES, _PIECES * _USUAL // time.size))
        near = kinks[max(0, around - reach - 1) : around + reach + 1]
        yield from ((low, high) for low, high in zip(near[:-1].tolist(), near[1:].tolist(), strict=True) if high - low > 1e-9)

    def _at(self, x: Floats) -> Optimum:
        lags = tuple(sorted(np.exp(x[:-1]).tolist(), reverse=True))
        delay = float(x[-1]) if x[-1] > _NONE * max(1.0, self._test.spacing) else 0.0
        columns = self.columns(lags, delay)
        size = np.abs(columns).max(axis=0)
        size[size == 0] = 1.0
        first = self._measurement[0]
        weights = np.linalg.lstsq(columns / size, self._measurement - first, rcond=None)[0] / size
        gain, start, drift = (*weights.tolist(), 0.0)[:3]
        return Optimum(gain, lags, delay, start + float(first), drift)


def _some(test: BumpTest) -> npt.NDArray[np.intp]:
    """Return some samples of a long record: evenly over it, and ever farther apart after each of its first moves."""
    n = test.time.size
    moves = np.flatnonzero(np.diff(test.output))[:_FEW_MOVES] + 1
    after = np.geomspace(1, n, _ENOUGH // moves.size)
    kept = [np.linspace(0, n - 1, _ENOUGH), *(move + after for move in moves)]
    return np.unique(np.clip(np.concatenate(kept).astype(np.intp), 0, n - 1))


def _near(candidates: Floats, x: float, most: int) -> Floats:
    """Return the members of a rising list that are next to a number."""
    at = int(np.searchsorted(candidates, x))
    return candidates[max(0, at - most) : at + most]
