"""The signals of the standard cases: each begins in manual, from where any controller can be brought to the same start."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from math import nan
from typing import Final

Columns = dict[str, list[float]]
START: Final = 6
"""Scans in manual at the beginning, so that what went before is forgotten."""
ABSENT: Final = {"auto": 1.0, "feedforward": nan, "hold": 0.0}


@dataclass(frozen=True)
class Places:
    """Where signals rest and how far they move.

    Attributes
    ----------
    middle, size, far : float
        Rest of setpoint and measurement, a small move and a large one [units of the measurement].
    output, output_span : float
        Where the output begins, and the span of the output limits [units of the output].
    scan : float
        Scan interval [s].
    """

    middle: float
    size: float
    far: float
    output: float
    output_span: float
    scan: float


@dataclass
class CaseSignals:
    """Columns under way; what is not set is absent."""

    places: Places
    scans: int
    columns: Columns = field(default_factory=dict)

    def __post_init__(self) -> None:
        middle = [self.places.middle] * self.scans
        self.columns = {"sp": list(middle), "pv": list(middle), "auto": [1.0] * self.scans, "manual": [nan] * self.scans}
        self.put("auto", 0, START, 0.0)
        self.put("manual", 0, START, self.places.output)

    def put(self, name: str, start: int, end: int, value: float | Callable[[int], float]) -> None:
        """Set a signal from a scan to before another; `value` may be a function of the scan."""
        column = self.columns.setdefault(name, [ABSENT.get(name, nan)] * self.scans)
        for n in range(start, min(end, self.scans)):
            column[n] = value(n) if callable(value) else value

    def move(self, name: str, start: int, end: int, by: float | Callable[[int], float]) -> None:
        """Add to setpoint or measurement."""
        column = self.columns[name]
        for n in range(start, min(end, self.scans)):
            column[n] += by(n) if callable(by) else by


def _noise(s: CaseSignals, seed: int, start: int, end: int, size: float) -> None:
    """Add noise to the measurement; a multiple of 1/64 of the size, the same on every machine."""
    source = random.Random(seed)
    s.move("pv", start, end, lambda _: size * (source.randrange(65) - 32) / 64)


def _small_moves(s: CaseSignals, seed: int) -> None:
    size = s.places.size
    s.move("sp", 10, 30, size)
    s.move("sp", 30, 50, -size)
    s.move("pv", 55, 65, lambda n: size * (n - 55) / 10)
    s.move("pv", 65, 75, lambda n: size * (75 - n) / 10)
    s.move("pv", 80, 90, -size)
    _noise(s, seed, 95, 120, size)


def _linear(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 120)
    _small_moves(s, seed)
    return s


def _saturation(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 130)
    for start, end, sign in ((10, 35, 1.0), (35, 70, -1.0), (95, 105, 1.0)):
        s.move("sp", start, end, sign * places.far / 2)
        s.move("pv", start, end, -sign * places.far / 2)
    _noise(s, seed, 95, 130, places.size)
    return s


def _manual(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 100)
    span = places.output_span
    s.move("sp", 10, 100, places.size)
    s.put("auto", 20, 40, 0.0)
    s.put("manual", 22, 30, lambda n: places.output + span * (n - 22) / 64)  # before and after, the output is held
    s.move("pv", 30, 60, places.size / 2)
    s.put("auto", 60, 70, 0.0)
    s.put("manual", 60, 61, places.output - span / 8)
    s.move("sp", 65, 100, -places.size)  # while in manual
    _noise(s, seed, 70, 100, places.size)
    return s


def _cascade(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 100)
    s.put("cascade", 15, 45, lambda n: places.middle + places.size * (1 if n < 30 else -0.5))
    s.put("cascade", 55, 80, lambda n: places.middle + places.size * (n - 55) / 32)
    s.put("auto", 60, 66, 0.0)  # a remote setpoint does not count in manual
    s.move("sp", 35, 100, places.size / 2)
    _noise(s, seed, 70, 100, places.size)
    return s


def _tracking(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 100)
    s.put("track", 20, 35, lambda n: places.output + places.output_span * (n - 24) / 64)
    s.put("track", 55, 65, places.output + places.output_span / 8)
    s.put("auto", 50, 60, 0.0)  # from manual to tracking, and from tracking to automatic
    s.move("pv", 15, 50, places.size)
    s.move("sp", 60, 100, places.size)
    _noise(s, seed, 70, 100, places.size)
    return s


def _faults(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 100)
    s.move("sp", 10, 100, places.size)
    _noise(s, seed, 10, 100, places.size)
    for name, start, end, value in (
        ("pv", 20, 23, nan), ("pv", 30, 31, math.inf), ("sp", 40, 42, nan), ("pv", 50, 51, -math.inf), ("pv", 60, 61, 1e31),
    ):  # fmt: skip
        s.put(name, start, end, value)
    s.put("auto", 70, 76, 0.0)
    s.put("pv", 72, 74, nan)
    s.put("hold", 85, 90, 1.0)
    return s


def _intervals(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 80)
    _noise(s, seed, 10, 80, places.size)
    s.put("interval", 0, 80, places.scan)
    for start, factor in ((20, 2.0), (30, 0.5), (40, 0.0), (50, 1.5)):
        s.put("interval", start, start + 1, factor * places.scan)
    return s


def _external_reset(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 80)
    s.put("external_reset", 15, 50, lambda n: places.output + places.output_span * (1 if n < 30 else -1) / 8)
    _noise(s, seed, 10, 80, places.size)
    return s


def _feedforward(places: Places, seed: int) -> CaseSignals:
    s = CaseSignals(places, 80)
    s.put("feedforward", 15, 40, places.output_span / 16)
    s.put("feedforward", 40, 60, -places.output_span / 32)
    _noise(s, seed, 10, 80, places.size)
    return s


CASES: Final[dict[str, tuple[str, Callable[[Places, int], CaseSignals]]]] = {
    "linear": ("small steps of the setpoint, ramps, a step and noise of the measurement; no output limit is reached", _linear),
    "saturation": ("large errors, up to an output limit, to the other, and back", _saturation),
    "manual": ("spells in manual: the operator sets the output, or it is held; the setpoint moves meanwhile", _manual),
    "cascade": ("a remote setpoint comes and goes, also in manual", _cascade),
    "tracking": ("the output follows another signal, from automatic and from manual", _tracking),
    "faults": ("NaN, infinity and 1e31 in setpoint and measurement, in automatic and in manual; a hold", _faults),
    "intervals": ("twice, half and no time between two scans, for a card that measures it", _intervals),
    "external-reset": ("the integral follows an external signal", _external_reset),
    "feedforward": ("a feedforward signal steps up and down", _feedforward),
    "changed-settings": ("the dials are changed one after the other while small moves go on", _linear),
}
"""What happens in each case, and its signals."""
