"""The loop of a relay and a process, until it oscillates evenly: exact between the switches, or looking every scan."""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import ProcessError
from pidemu.process.hold import Plant
from pidemu.process.motion import Motion
from pidemu.process.process import Process

_PERIODS: Final = 200
"""Periods after which an oscillation that has not become even is none."""
_EVEN: Final = 1e-9
"""Relative difference of two periods that are alike."""
_POINTS: Final = 64
"""Points between two events at which a crossing is looked for."""
_WAIT: Final = 60.0
"""Times of the process after which a relay that has not switched never will."""
SCANS: Final = 10
"""Periods over which the oscillation of a relay that is scanned is averaged."""
_SETTLING: Final = 30
"""Periods before them."""
_KICK: Final = 0.3
"""Times of a process without dead time for which the relay holds at first."""
_FAR: Final = 1e9
"""Measurement, in those of the relay's swing, from which on a process has run away."""
_GRID: Final = np.unique(np.concatenate([[0.0], np.geomspace(1e-5, 1, _POINTS // 2), np.linspace(0, 1, _POINTS // 2)]))
"""Where a crossing is looked for between two events: closer after the first."""


@dataclass(frozen=True)
class Relay:
    """What the relay does: to the output, and at which error; all in deviations from rest."""

    high: float
    low: float
    hysteresis: float
    sign: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Cycle:
    """An even oscillation.

    Attributes
    ----------
    period : float
        Its period [s].
    top, bottom : float
        Largest and smallest measurement in it, with the sign of the process's gain taken out.
    time, output, measurement : ndarray of float, shape (n,)
        The last periods.
    """

    period: float
    top: float
    bottom: float
    time: Floats
    output: Floats
    measurement: Floats

    @property
    def swing(self) -> float:
        """From the smallest measurement to the largest."""
        return self.top - self.bottom


class RelayLoop:
    """The loop of relay and process, from one event to the next: the relay switches, or a switch arrives behind the dead time."""

    def __init__(self, process: Process, relay: Relay) -> None:
        self._process, self._relay, self._motion = process, relay, Motion(process)
        self._now, self._up = 0.0, True
        self._input = relay.high if not process.delay else 0.0
        self._arriving = deque([(process.delay, relay.high)] if process.delay else [])
        self._signals: list[tuple[Floats, Floats, float]] = []
        turns = [abs(p.imag) for p in process.poles if p.imag]
        self._chunk, self._longest = self._scale, 1 / max(turns) if turns else math.inf
        if not process.delay:  # away from rest, where a relay without hysteresis would not know what to do
            self._motion.move(_KICK * self._scale, self._input)

    @property
    def _scale(self) -> float:
        """A time in which the loop moves [s]."""
        p, relay = self._process, self._relay
        ramp = relay.hysteresis / (abs(p.gain) * min(relay.high, -relay.low)) if p.integrators else 0.0
        return (p.time + ramp) or 1.0

    def cycle(self) -> Cycle:
        """Return the oscillation once it is even."""
        last = (math.nan, math.nan, math.nan)
        self._half(first=True)
        for _ in range(_PERIODS):
            begun = self._now
            kept = len(self._signals)
            extremes = np.concatenate([self._half(), self._half()])
            found = (self._now - begun, float(extremes.max()), float(extremes.min()))
            if all(abs(a - b) <= _EVEN * max(abs(a), abs(b)) for a, b in zip(found, last, strict=True)):
                return Cycle(*found, *self._recorded())
            last = found
            self._signals = self._signals[kept:]
        raise ProcessError(
            f"the oscillation of {self._process} under a relay does not become even within {_PERIODS} periods; a relay does not "
            f"hold this process"
        )

    def _recorded(self) -> tuple[Floats, Floats, Floats]:
        """Return the signals of the last two periods, from 0 on."""
        times, values = (np.concatenate(parts) for parts in zip(*((t, y) for t, y, _ in self._signals), strict=True))
        outputs = np.concatenate([np.full(t.size, u) for t, _, u in self._signals])
        return times - times[0], outputs, values

    def _half(self, *, first: bool = False) -> Floats:
        """Go on until the relay switches; return the extremes of the measurement, with the sign of the gain taken out."""
        begun, found = self._now, [np.empty(0)]
        patience = _WAIT * (self._scale + self._process.delay) * (1 + len(self._process.poles))
        while True:
            until = self._arriving[0][0] - self._now if self._arriving else math.inf
            length = min(until, max(self._chunk, self._now - begun), self._longest)
            at, switches = self._look(length)
            found.append(self._extremes(at))
            self._motion.move(at, self._input)
            self._now += at
            if at == until and not switches:
                self._now, self._input = self._arriving.popleft()
            if switches:
                self._switch(math.inf if first else self._now - begun)
                return np.concatenate(found)
            if self._now - begun > patience:
                raise _waiting(patience, self._process)

    def _switch(self, waited: float) -> None:
        if waited <= _EVEN * (self._scale + self._process.delay) and not self._process.delay:
            raise ProcessError(
                f"the relay would switch without end: {self._process} answers at once; give it its dead time and small lags, or "
                f"give a hysteresis"
            )
        self._up = not self._up
        level = self._relay.high if self._up else self._relay.low
        if self._process.delay:
            self._arriving.append((self._now + self._process.delay, level))
        else:
            self._input = level

    def _look(self, length: float) -> tuple[float, bool]:
        """Return when the relay switches within a time, or that time, and whether it does."""
        times = length * _GRID
        states = self._motion.after(times, self._input)
        y = self._motion.values(states, self._input)
        _check_near(float(np.abs(y).max()), self._process, self._relay)
        sign = self._relay.sign if self._up else -self._relay.sign
        beyond = np.flatnonzero(sign * y > self._relay.hysteresis)
        if not beyond.size:
            self._keep(times, y)
            return length, False
        k = int(beyond[0])
        at = 0.0
        if k:
            level = sign * self._relay.hysteresis
            at = self._motion.crossing(self._motion.values, self._input, level, float(times[k - 1]), float(times[k]))
        self._keep(np.append(times[:k], at), np.append(y[:k], self._value(at)))
        return at, True

    def _value(self, time: float) -> float:
        return float(self._motion.values(self._motion.after(np.array([time]), self._input), self._input)[0])

    def _keep(self, times: Floats, y: Floats) -> None:
        self._signals.append((self._now + times, y, self._relay.high if self._up else self._relay.low))

    def _extremes(self, length: float) -> Floats:
        """Return the measurement at both ends of a time and where its slope changes sign, times the sign of the gain."""
        times = length * _GRID if length else np.zeros(1)
        states = self._motion.after(times, self._input)
        slopes = self._motion.slopes(states, self._input)
        turns = np.flatnonzero(slopes[:-1] * slopes[1:] < 0)
        places = [self._motion.crossing(self._motion.slopes, self._input, 0.0, float(times[k]), float(times[k + 1])) for k in turns]
        at = np.array([0.0, *places, length])
        return np.asarray(self._relay.sign * self._motion.values(self._motion.after(at, self._input), self._input))


def _check_near(size: float, process: Process, relay: Relay) -> None:
    if not size < _FAR * (abs(process.gain) * relay.high + relay.hysteresis):
        raise ProcessError(f"{process} runs away from the relay; a relay does not hold it")


def _waiting(patience: float, process: Process) -> ProcessError:
    return ProcessError(f"the relay does not switch within {patience:.3g} s; a relay cannot make {process} oscillate like this")


def scanned_cycle(process: Process, relay: Relay, scan: float) -> Cycle:
    """Return the oscillation of a relay that looks at the measurement every scan only, averaged over some periods."""
    plant, up = Plant(process.sampled(scan)), True
    switched: list[int] = []
    y: list[float] = []
    u: list[float] = []
    patience = _WAIT * (1 + len(process.poles)) * (process.time + process.delay + scan)
    while len(switched) < 2 * _SETTLING + 2 * SCANS + 1:
        value = plant.measure()
        if relay.sign * value * (1 if up else -1) > relay.hysteresis:
            up = not up
            switched.append(len(y))
        y.append(value)
        u.append(relay.high if up else relay.low)
        plant.move(u[-1])
        _check_near(abs(value), process, relay)
        if (len(y) - (switched[-1] if switched else 0)) * scan > patience:
            raise _waiting(patience, process)
    first, last = switched[-1 - 2 * SCANS], switched[-1]
    values: Floats = relay.sign * np.array(y[first:last])
    ends = np.array(switched[-1 - 2 * SCANS :: 2]) - first
    periods = [values[a:b] for a, b in itertools.pairwise(ends.tolist())]
    top, bottom = (float(np.mean([pick(part) for part in periods])) for pick in (np.max, np.min))
    time: Floats = np.arange(last - first, dtype=np.float64) * scan
    return Cycle((last - first) * scan / SCANS, top, bottom, time, np.array(u[first:last]), np.array(y[first:last]))
