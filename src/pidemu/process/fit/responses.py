"""Exact responses to an output that holds between its moves: a lag, two lags in a row, an integrator, at any times.

Between two moves the state of a lag is an exponential. So its states at the moves are found first, and from them the response at
any time; a dead time moves the times alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pidemu.arrays import Floats

_ALIKE: Final = 1e-6
"""Difference of two rates times a time below which they count as equal, by a series."""


class HeldOutput:
    """An output that moves at some times and holds in between, in deviations from where it rests before the first move.

    Parameters
    ----------
    times : ndarray of float, shape (m,)
        When it moves [s].
    levels : ndarray of float, shape (m,)
        Where it is from then on.
    """

    def __init__(self, times: Floats, levels: Floats) -> None:
        self._times, self._levels = times, levels
        self._holds = np.diff(times)

    @classmethod
    def from_samples(cls, time: Floats, output: Floats) -> HeldOutput:
        """Return the output of samples."""
        at = np.flatnonzero(np.diff(output)) + 1
        return cls(time[at], output[at] - output[0])

    @property
    def count(self) -> int:
        """How many moves there are."""
        return int(self._times.size)

    @property
    def times(self) -> Floats:
        """When the output moves [s]."""
        return self._times

    def response(self, at: Floats, lags: Sequence[float]) -> Floats:
        """Return the response of a process with the gain 1.

        Parameters
        ----------
        at : ndarray of float, shape (n,)
            Times that rise [s].
        lags : sequence of float
            None: an integrator; one or two time constants [s].
        """
        first_after = np.searchsorted(at, self._times, side="left")
        begun = int(first_after[0])
        j = np.repeat(np.arange(self.count), np.diff(first_after, append=at.size))
        found = np.zeros(at.size)
        u, since = self._levels[j], at[begun:] - self._times[j]
        if not lags:
            sums = np.concatenate([[0.0], np.cumsum(self._levels[:-1] * self._holds)])
            found[begun:] = sums[j] + u * since
            return found
        slow, *rest = sorted(lags, reverse=True)
        first = self._after_lag(slow) - self._levels  # the first lag's distance from the output, at the moves
        if not rest:
            found[begun:] = u + first[j] * np.exp(-since / slow)
            return found
        second = self._after_second_lag(slow, rest[0], first) - self._levels
        found[begun:] = u + second[j] * np.exp(-since / rest[0]) + first[j] * _passed_on(since, slow, rest[0])
        return found

    def _after_lag(self, T: float) -> Floats:
        """Return the state of a lag at the moves."""
        left = np.exp(-self._holds / T)
        return _recursion(left, -np.expm1(-self._holds / T) * self._levels[:-1])

    def _after_second_lag(self, slow: float, fast: float, first: Floats) -> Floats:
        """Return the state of the second of two lags at the moves."""
        left = np.exp(-self._holds / fast)
        driven = -np.expm1(-self._holds / fast) * self._levels[:-1] + first[:-1] * _passed_on(self._holds, slow, fast)
        return _recursion(left, driven)


def _passed_on(t: Floats, slow: float, fast: float) -> Floats:
    """Return what a lag has, a time after a state of 1 of the lag before it: equal time constants included."""
    apart = t * (1 / fast - 1 / slow)
    shape = np.where(apart < _ALIKE, 1 - apart / 2, -np.expm1(-apart) / np.maximum(apart, _ALIKE))
    return t / fast * np.exp(-t / slow) * shape


def _recursion(left: Floats, added: Floats) -> Floats:
    """Return ``x`` with ``x[0] = 0``, ``x[k+1] = left[k] x[k] + added[k]``, by doubling."""
    a, b = left.copy(), added.copy()
    reach = 1
    while reach < a.size:
        b[reach:] += a[reach:] * b[:-reach]
        a[reach:] = a[reach:] * a[:-reach]
        reach *= 2
    return np.concatenate([[0.0], b])
