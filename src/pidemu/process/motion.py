"""How a process without its dead time moves under an input that holds: exact at any times, with its slope."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.process.hold import chain, expm1, outputs
from pidemu.process.process import Process

_HALVINGS: Final = 200
"""Steps after which a crossing has been found in any case."""


class Motion:
    """The states of a process, in deviations from where it rests.

    Parameters
    ----------
    process : Process
        The process; its dead time is not in the motion.
    """

    def __init__(self, process: Process) -> None:
        self._A, self._B = chain(process.poles)
        row, through = outputs(process.poles, process.zeros)
        self._row, self._through = process.gain * row, process.gain * through
        self.states: Floats = np.zeros(self._B.size)

    def after(self, times: Floats, u: float) -> Floats:
        """Return the states after some times under an input, shape (times, states); the motion itself stands."""
        growth, drive = expm1(self._A, self._B, times.tolist())
        return np.asarray(self.states + growth @ self.states + drive * u)

    def move(self, time: float, u: float) -> None:
        """Go on for a time under an input."""
        if time > 0:
            self.states = self.after(np.array([time]), u)[0]

    def values(self, states: Floats, u: float) -> Floats:
        """Return the measurement of states under an input."""
        return np.asarray(states @ self._row + self._through * u)

    def slopes(self, states: Floats, u: float) -> Floats:
        """Return how fast the measurement moves."""
        return np.asarray((states @ self._A.T + self._B * u) @ self._row)

    def crossing(self, of: Callable[[Floats, float], Floats], u: float, level: float, low: float, high: float) -> float:
        """Return when a value of the states crosses a level between two times, to the last digit.

        Parameters
        ----------
        of : callable
            `values` or `slopes`.
        u : float
            The input.
        level : float
            The level.
        low, high : float
            Times on both sides of the crossing [s].
        """

        def beyond(time: float) -> float:
            return float(of(self.after(np.array([time]), u), u)[0]) - level

        first, last = beyond(low), beyond(high)
        side = 0
        for _ in range(_HALVINGS):
            if not last or not first or high - low <= 4 * np.spacing(high):
                break
            middle = high - last * (high - low) / (last - first) if last != first else low  # a secant, after Illinois
            if not low < middle < high:
                middle = (low + high) / 2
            value = beyond(middle)
            if (value > 0) == (last > 0):
                high, last = middle, value
                first = first / 2 if side == 1 else first
                side = 1
            else:
                low, first = middle, value
                last = last / 2 if side == -1 else last
                side = -1
        return high if abs(last) <= abs(first) or not last else low if not first else high
