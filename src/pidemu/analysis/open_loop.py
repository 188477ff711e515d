"""The open loop of a controller and a process, and the frequencies at which it is looked at."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.algorithm.model import Algorithm
from pidemu.analysis.stability import unstable_continuous, unstable_sampled
from pidemu.arrays import Floats
from pidemu.columns.functions import sign_of
from pidemu.law.law import Law
from pidemu.law.rational import Response
from pidemu.process.process import Process

PER_DECADE: Final = 60
_TURN: Final = 0.2
"""Largest turn of the open loop between two neighbouring frequencies [rad]."""
_QUIET: Final = 1e-3
"""A loop gain below this counts only until the phase has come round."""
_DELAY_ENDS: Final = (20.0, 4000.0)
"""At least and at most this much phase of the dead time is looked at [rad]."""
_LIGHT: Final = 0.5
"""Below this damping ratio a pair of poles has a peak of its own."""
_ACROSS: Final = np.linspace(-4.0, 4.0, 81)
"""Where a peak is looked at, in its half width at half its power."""
_NEAR: Final = 0.05
"""So near 1 is a loop gain that may come to 1 between two frequencies."""
_TOUCHES: Final = 4
"""How often the top of such a peak is sought by a parabola: each time the distance is squared, roughly."""
_DAMPING: Final = 1e-6
"""Least damping of a process pole in frequency responses: at an undamped one, these would be infinite."""


@dataclass(frozen=True)
class OpenLoopResponse:
    """The open loop at frequencies between which nothing happens unseen.

    Attributes
    ----------
    w, values : ndarray, shape (n,)
        Frequencies [rad/s], and the open loop there.
    w_beyond, beyond : ndarray, shape (m,)
        The same on to high frequencies, where the dead time turns it more often than is looked at: only the size counts.
    """

    w: Floats
    values: Response
    w_beyond: Floats
    beyond: Response

    @property
    def all_sizes(self) -> tuple[Floats, Floats]:
        """All frequencies and the size of the open loop there."""
        return np.concatenate([self.w, self.w_beyond]), np.abs(np.concatenate([self.values, self.beyond]))


@dataclass(frozen=True)
class OpenLoop:
    """A controller and a process in a row, with negative feedback.

    The control action is taken to be the one with which the feedback is negative, whatever the sign of the controller's gain.

    Attributes
    ----------
    law : Law
        The controller, continuous or at a scan interval.
    process : Process
        The process.
    factor : float
        What the controller's gain is multiplied by for new signal ranges; its sign does not count.
    """

    law: Law
    process: Process
    factor: float = 1.0

    @cached_property
    def gain(self) -> float:
        """The factor, with the sign that makes the feedback negative; 0 for a controller that does nothing."""
        return abs(self.factor) * low_frequency_sign(self.law.algorithm) * self.process.feedback_sign

    @cached_property
    def damped(self) -> Process:
        """The process with poles a hair inside the stable region where they are on its edge, off the origin."""
        poles = [
            complex(-_DAMPING * abs(p), p.imag) if p.imag and abs(p.real) < _DAMPING * abs(p) else p for p in self.process.poles
        ]
        return Process(self.process.gain, poles, self.process.zeros, self.process.delay)

    @cached_property
    def _process_response(self) -> Callable[[npt.ArrayLike], Response]:
        return self.damped.response if self.law.scan is None else self.damped.sampled(self.law.scan).response

    def __call__(self, w: npt.ArrayLike) -> Response:
        """Return the response of the open loop at frequencies [rad/s]."""
        found: Response = self.gain * self.law.response(w) * self._process_response(w)
        return found

    @property
    def integrates(self) -> int:
        """How many integrators the controller and the process have together."""
        a = self.law.algorithm
        return self.process.integrators + int(bool(a.ki) or a.dahlin is not None)

    def unstable(self, picture: OpenLoopResponse, crossovers: Floats) -> bool:
        """Tell whether the closed loop is unstable, or on the edge of it.

        Parameters
        ----------
        picture : OpenLoopResponse
            The open loop.
        crossovers : ndarray, shape (m,)
            Where its gain is 1 [rad/s].
        """
        if self.law.scan is not None:
            if np.any(np.abs(picture.beyond) >= 1):
                return True  # a loop gain above 1 that the dead time has turned round many times
            poles = sum(p.real > 0 for p in self.process.poles)
            return unstable_sampled(picture.values, poles, self.integrates)
        return unstable_continuous(*self.polynomials, self.process.delay, crossovers)

    @property
    def polynomials(self) -> tuple[Floats, Floats]:
        """Numerator and denominator of a continuous open loop without its dead time, coefficients ascending."""
        num, den = self.law.feedback.num, self.law.feedback.den
        if num[0] == den[0] == 0:  # a common factor s of a controller without integral action
            num, den = num[1:], den[1:]
        P = self.process.rational
        return np.convolve(num, P.num) * self.gain, np.convolve(den, P.den)


def low_frequency_sign(a: Algorithm) -> float:
    """Return the sign of a controller's action at low frequencies: of its integral, else proportional, else derivative gain."""
    if a.dahlin is not None:
        return sign_of(a.dahlin.gain)
    return next((sign_of(gain) for gain in (a.ki, a.kp, a.kd) if gain), 0.0)


def _corners(loop: OpenLoop) -> list[float]:
    """Return the frequencies at which controller and process change [rad/s]."""
    a, P = loop.law.algorithm, loop.process
    kp, ki, kd = abs(a.kp), abs(a.ki), abs(a.kd)
    found = [abs(r) for r in (*P.poles, *P.zeros)]
    found += [x / y for x, y in ((ki, kp), (kp, kd)) if y] + ([math.sqrt(ki / kd)] if kd else [])
    times = [P.delay, a.Tf, *(f.seconds for f in a.signal_filters)]
    if a.dahlin is not None:
        times += [a.dahlin.time, a.dahlin.delay, a.dahlin.wanted]
    found += [1 / t for t in times if t]
    return [x for x in found if x] or [ki or 1.0]


def _ends(loop: OpenLoop) -> tuple[float, float]:
    """Return the frequencies between which the loop gain comes down from large to small values [rad/s]."""

    def size(w: float) -> float:
        return float(abs(loop(w)))

    corners, h = _corners(loop), loop.law.scan
    low, high = min(corners) / 100, max(corners) * 100
    if h is not None:
        high = math.pi / h
        low = min(low, high / 1000)
    for _ in range(30):
        if not loop.integrates or size(low) > 100:
            break
        low /= 10
    for _ in range(30):
        if h is not None or size(high) < _QUIET or size(10 * high) > 0.5 * size(high):
            break
        high *= 10
    return low, high


def _resonances(loop: OpenLoop, low: float, high: float) -> Floats:
    """Return frequencies across the peaks and dips that lightly damped poles and zeros of the process make [rad/s]."""
    found = [
        abs(r) * (1 + min(abs(r.real) / abs(r), 1.0) * _ACROSS)
        for r in (*loop.damped.poles, *loop.damped.zeros)
        if r.imag > 0 and abs(r.real) < _LIGHT * abs(r)
    ]
    w = np.concatenate([np.empty(0), *found])
    return w[(low < w) & (w < high)]


def _touches(w: Floats, sizes: Floats) -> Floats:
    """Return where a peak just below a loop gain of 1, or a dip just above it, has its top between the frequencies [rad/s]."""
    around = np.abs(sizes[1:-1] - 1) < _NEAR
    around &= (sizes[1:-1] > sizes[:-2]) == (sizes[1:-1] > sizes[2:])
    if not around.any():
        return w[:0]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = np.log(w), np.log(sizes)
        a, b = (y[1:-1] - y[:-2]) / (x[1:-1] - x[:-2]), (y[2:] - y[1:-1]) / (x[2:] - x[1:-1])
        bend = (b - a) / (x[2:] - x[:-2])
        top = (x[1:-1] + x[:-2]) / 2 - a / (2 * bend)
        near = around & (a * b < 0) & (y[1:-1] * bend > 0) & (x[:-2] < top) & (top < x[2:])
    return np.setdiff1d(np.exp(top[near]), w)


def picture_of(loop: OpenLoop) -> OpenLoopResponse:
    """Return the open loop at enough frequencies."""
    low, high = _ends(loop)
    w = np.geomspace(low, high, math.ceil(PER_DECADE * math.log10(high / low)))
    turn = loop.process.delay + 1.5 * (loop.law.scan or 0.0)
    beyond = w[:0]
    if turn:
        loud = w[np.abs(loop(w)) >= _QUIET]
        least, most = (end / turn for end in _DELAY_ENDS)
        stop = min(high, most, max(loud[-1] if loud.size else 0.0, least))
        even = np.linspace(low, stop, math.ceil((stop - low) * turn / _TURN) + 2)
        w, beyond = np.unique(np.concatenate([w[w < stop], even])), w[w > stop]
    w = np.unique(np.concatenate([low * np.array([1e-4, 1e-2]), w, _resonances(loop, low, w[-1])]))  # from as good as zero on
    values = loop(w)
    for _ in range(24):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a process that lets nothing through has no phase
            ratios = [x[1:] / x[:-1] for x in (values, 1 + values)]
        rough = np.flatnonzero((np.abs(np.angle(ratios)) > 2 * _TURN).any(axis=0))
        if not rough.size or w.size > 200_000:
            break
        between = np.sqrt(w[rough] * w[rough + 1])
        w, values = np.insert(w, rough + 1, between), np.insert(values, rough + 1, loop(between))
    for _ in range(_TOUCHES):
        between = _touches(w, np.abs(values))
        if not between.size:
            break
        w, values = np.concatenate([w, between]), np.concatenate([values, loop(between)])
        order = np.argsort(w)
        w, values = w[order], values[order]
    return OpenLoopResponse(w, values, beyond, loop(beyond))
