"""Many linear controllers with one process, each in its exact sampled loop: responses and sensitivities side by side."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.law.law import Law
from pidemu.law.rational import Rational, Response
from pidemu.process.process import Process

_FREQUENCIES: Final = 400
_LOWEST: Final = 0.02
"""The lowest frequency, in radians over the length of the run."""
_HUGE: Final = 1e9
"""A response beyond this is one that runs away [% per % of step]."""


@dataclass(frozen=True)
class LoopResponses:
    """What loops did after a step of 1 %.

    Attributes
    ----------
    scan : float
        Scan interval [s].
    error, output : ndarray of float, shape (scans, loops)
        Setpoint minus measurement, and the controller's output, both from rest [%].
    """

    scan: float
    error: Floats
    output: Floats


class SampledLoops:
    """Linear controllers and one process, scanned together.

    Parameters
    ----------
    process : Process
        The process; its gain counts by its size, as the action is that of negative feedback.
    scan : float
        Scan interval [s].
    scans : int
        How long a run is.
    laws : sequence of Law
        The controllers' laws at this scan interval.
    """

    def __init__(self, process: Process, scan: float, scans: int, laws: Sequence[Law]) -> None:
        self.scan, self.scans = scan, scans
        self._model = process.sampled(scan)
        self._sign = process.feedback_sign
        self._feedback = _stacked([law.feedback for law in laws])
        self._setpoint = _stacked([law.setpoint for law in laws])
        self._loops = len(laws)

    def responses(self, disturbance: str) -> LoopResponses:
        """Return the responses to a step of 1 % of the load at the process input, or of the setpoint, in the first scan."""
        with np.errstate(all="ignore"):  # what runs away is told by its size
            return LoopResponses(self.scan, *self._run(float(disturbance == "setpoint"), float(disturbance == "load")))

    def _run(self, setpoint: float, load: float) -> tuple[Floats, Floats]:
        m = self._model
        error, output = np.empty((self.scans, self._loops)), np.empty((self.scans, self._loops))
        forward = _Filter(*self._setpoint) if setpoint else None
        back = _Filter(*self._feedback)
        x, was = np.zeros((m.row.size, self._loops)), np.zeros(self._loops)
        late = deque([np.zeros(self._loops)] * m.scans)
        target = np.full(self._loops, setpoint)
        for n in range(self.scans):
            y = self._sign * (m.row @ x + m.through * was)
            u = (forward.next(target) if forward is not None else 0.0) - back.next(y)
            u = np.clip(u, -_HUGE, _HUGE)
            error[n], output[n] = setpoint - y, u
            late.append(u + load)
            arrived = late.popleft()
            x = x + m.growth @ x + np.outer(m.early, was) + np.outer(m.late, arrived)
            was = arrived
        return error, output

    def sensitivities(self) -> tuple[Floats, Floats]:
        """Return the largest sensitivity and complementary sensitivity of each loop, shape (loops,)."""
        w = np.geomspace(_LOWEST / (self.scans * self.scan), math.pi / self.scan * (1 - 1e-9), _FREQUENCIES)
        turn = np.exp(-1j * w * self.scan)
        num, den = self._feedback
        with np.errstate(all="ignore"):
            loop = _polynomials(num, turn) / _polynomials(den, turn) * (self._sign * self._model.response(w))
            return np.max(1 / np.abs(1 + loop), axis=1), np.max(np.abs(loop / (1 + loop)), axis=1)

    def impulse(self, samples: int = 64) -> Floats:
        """Return the largest output that one measurement which is off by 1 % makes, shape (loops,) [%/%]."""
        back, largest = _Filter(*self._feedback), np.zeros(self._loops)
        with np.errstate(all="ignore"):
            for n in range(samples):
                largest = np.maximum(largest, np.abs(back.next(np.full(self._loops, float(n == 0)))))
        return largest


class _Filter:
    """Difference equations side by side.

    Parameters
    ----------
    num, den : ndarray, shape (loops, n)
        Coefficients in ``q``, those of `den` begin with 1.
    """

    def __init__(self, num: Floats, den: Floats) -> None:
        self._num, self._den = num.T.copy(), den.T.copy()
        self._rest = np.zeros((max(len(self._num), len(self._den)), num.shape[0]))

    def next(self, x: Floats) -> Floats:
        """Return the output for the next input, each of shape (loops,)."""
        y: Floats = self._rest[0] + self._num[0] * x
        self._rest[:-1] = self._rest[1:]
        self._rest[-1] = 0.0
        self._rest[: len(self._num) - 1] += self._num[1:] * x
        self._rest[: len(self._den) - 1] -= self._den[1:] * y
        return y


def _stacked(paths: Sequence[Rational]) -> tuple[Floats, Floats]:
    """Return numerators and denominators of paths, the latter beginning with 1."""
    num, den = (np.zeros((len(paths), max(len(getattr(p, part)) for p in paths))) for part in ("num", "den"))
    for i, path in enumerate(paths):
        num[i, : len(path.num)] = np.array(path.num) / path.den[0]
        den[i, : len(path.den)] = np.array(path.den) / path.den[0]
    return num, den


def _polynomials(coefficients: Floats, q: Response) -> Response:
    """Return the values of polynomials, shape (loops, frequencies)."""
    value = np.zeros((coefficients.shape[0], q.size), dtype=np.complex128)
    for column in coefficients.T[::-1]:
        value = value * q + column[:, None]
    return value
