"""The standard record: signals on which two algorithms that differ show where."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import ScanError
from pidemu.plausible import INTERVAL, LEVEL, TIME, plausible
from pidemu.records.files import Record
from pidemu.settings.settings import Settings

REST: Final = 50.0
"""Where setpoint, measurement and output rest [%]."""
LEAST_SCANS: Final = 20
"""The characteristic time is at least this many scans, so that there is something to see between two of them."""
MOST_SCANS: Final = 20_000
"""And at most this many, so that the record has an end."""
_DEFAULT_TIME: Final = 60.0
_PLAN: Final = (
    ("at rest", 1.0),
    ("setpoint steps", 3.0),
    ("PV ramps", 2.5),
    ("PV steps", 2.5),
    ("PV sine sweep", 4.0),
    ("PV noise", 2.0),
    ("large positive error", 2.0),
    ("large negative error", 3.0),
    ("back from the limit", 1.0),
    ("manual", 3.0),
    ("return to automatic", 2.0),
    ("setpoint step again", 2.0),
    ("into a limit, with noise", 3.0),
    ("back from it, with noise", 3.0),
)
"""Segments and how long they last, in characteristic times."""
_NOISE_STEPS: Final = 100
"""Values of the noise per characteristic time."""
_FAINT: Final = 0.25
"""Size of the noise at a limit per size of that in ``PV noise``, where the derivative would drown everything else."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a record.

    Attributes
    ----------
    name : str
        What happens in it.
    start, end : float
        When it begins, and when the next one does [s].
    """

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class StandardRecord(Record):
    """The standard record, sampled at a scan interval, with what `Record` has and the following.

    Attributes
    ----------
    segments : tuple of Segment
        What happens when.
    characteristic_time, size : float
        Time [s] and size [%] that the signals are scaled to.
    seed : int
        Seed of the noise.
    """

    segments: tuple[Segment, ...] = ()
    characteristic_time: float = _DEFAULT_TIME
    size: float = 4.0
    seed: int = 1


def standard_record(scan: float, seed: int = 1, time: float = _DEFAULT_TIME, size: float = 4.0) -> StandardRecord:
    """Return the standard record, in percent, sampled at a scan interval.

    It rests at 50, and moves by `size` in each of these parts, which last as long as stated, in units of `time`:

    ========================  ====  =============================================================================================
    at rest                   1     setpoint and measurement are 50
    setpoint steps            3     the setpoint steps up, from there down to as much below 50, and back; one `time` each
    PV ramps                  2.5   the measurement goes up, down and back along straight lines; then rest
    PV steps                  2.5   the measurement steps up, down and back
    PV sine sweep             4     a sine whose period falls from 2 `time` to `time`/5, exponentially
    PV noise                  2     uniform noise of half the size, a new value every `time`/100
    large positive error      2     setpoint up, measurement down: an error of 8 sizes, as far as 5 to 95 % allow
    large negative error      3     the same with the other sign
    back from the limit       1     both are 50 again
    manual                    3     the operator's output is 60, goes to 40 along a straight line, and stays; the measurement is off
                                    by half the size
    return to automatic       2     automatic, with that error for another `time`; then rest
    setpoint step again       2     the setpoint steps up, and back after one `time`
    into a limit, with noise  3     the measurement rises by 8 sizes, at most to 95, along a straight line in one `time`, and stays;
                                    with noise of an eighth of the size
    back from it, with noise  3     it falls back to the setpoint along a straight line in one `time`, and stays; the same noise
    ========================  ====  =============================================================================================

    Up and down are alike, so that the integral ends each of the first parts about where it began. In the last two parts derivative
    and noise meet an output limit: schemes that agree on steps without noise may differ there. The signals are functions of time:
    another scan interval samples the same ones. The noise is that of the seed, on every machine.

    Parameters
    ----------
    scan : float
        Scan interval [s].
    seed : int
        Seed of the noise.
    time : float
        What all durations are multiples of [s]; an integral time, for example.
    size : float
        Size of the moves [%].

    Returns
    -------
    StandardRecord
        Setpoint, measurement, mode and the operator's output, with the named segments.

    Raises
    ------
    ScanError
        A number is not positive, or the record would be absurdly long.

    Examples
    --------
    >>> record = standard_record(scan=1.0, time=60.0)
    >>> record.sp.size, record.segments[1]
    (2040, Segment(name='setpoint steps', start=60.0, end=240.0))
    >>> record.sp[[59, 60, 120, 180]].tolist()
    [50.0, 54.0, 46.0, 50.0]
    """
    for name, value, quantity in (("scan interval", scan, INTERVAL), ("time", time, TIME), ("size", size, LEVEL)):
        if not plausible(name, value, quantity, ScanError) > 0:
            raise ScanError(f"{name} {value:g} of the standard record is not a positive number")
    if time / scan > 10 * MOST_SCANS:
        raise ScanError(f"a standard record with time {time:g} s, scanned every {scan:g} s, is too long; use a longer interval")
    ends = np.cumsum([length for _, length in _PLAN])
    t = np.arange(math.ceil(ends[-1] * time / scan - 1e-6)) * scan
    x = np.round(t / time, 9)  # a sample on an edge is on it whatever the scan interval
    starts = {name: float(end - length) for (name, length), end in zip(_PLAN, ends, strict=True)}
    sp, pv = _signals(x, starts, size, seed)
    s = x - starts["manual"]
    by_hand = (s >= 0) & (x < starts["return to automatic"])
    manual = np.where(by_hand, np.interp(s, [1.0, 2.0], [60.0, 40.0]), math.nan)
    return StandardRecord(
        sp=sp,
        pv=pv,
        time=t,
        auto=np.where(by_hand, 0.0, 1.0),
        manual=manual,
        segments=tuple(Segment(name, starts[name] * time, float(end) * time) for (name, _), end in zip(_PLAN, ends, strict=True)),
        characteristic_time=time,
        size=size,
        seed=seed,
    )


def _signals(x: Floats, starts: dict[str, float], size: float, seed: int) -> tuple[Floats, Floats]:
    """Return setpoint and measurement at times `x`, in characteristic times."""
    sp, pv = np.full(x.size, REST), np.full(x.size, REST)
    far = min(4 * size, 45.0)  # each of them, from rest
    sp += size * _levels(x - starts["setpoint steps"], (1.0, 1.0), (1.0, -1.0))
    pv += size * np.interp(x - starts["PV ramps"], [0.0, 0.5, 1.5, 2.0], [0.0, 1.0, -1.0, 0.0])
    pv += size * _levels(x - starts["PV steps"], (1.0, 1.0), (1.0, -1.0))
    pv += size * _sweep(x - starts["PV sine sweep"])
    pv += size * _noise(x - starts["PV noise"], 2, seed)
    error = far * _levels(x - starts["large positive error"], (2.0, 3.0), (1.0, -1.0))
    sp += error
    pv -= error
    pv += size * _levels(x - starts["manual"], (4.0,), (0.5,))
    sp += size * _levels(x - starts["setpoint step again"], (1.0,), (1.0,))
    s = x - starts["into a limit, with noise"]
    pv += min(8 * size, 45.0) * np.interp(s, [0.0, 1.0, 3.0, 4.0], [0.0, 1.0, 1.0, 0.0])
    pv += _FAINT * size * _noise(s, 6, seed)
    return sp, pv


def _levels(x: Floats, lengths: tuple[float, ...], levels: tuple[float, ...]) -> Floats:
    """Return levels that last as long as stated, one after the other from ``x = 0``; 0 outside."""
    edges = np.append(0.0, np.cumsum(lengths))
    return np.array([0.0, *levels, 0.0])[np.searchsorted(edges, x, side="right")]


def _sweep(x: Floats) -> Floats:
    """Return a sine over ``0 <= x < 4`` whose frequency grows exponentially from 1/2 to 5; 0 outside."""
    rate = math.log(5 / 0.5) / 4
    inside = np.clip(x, 0.0, 4.0)
    phase = 2 * math.pi * 0.5 * np.expm1(rate * inside) / rate
    return np.where((x >= 0) & (x < 4), np.sin(phase), 0.0)


def _noise(x: Floats, length: int, seed: int) -> Floats:
    """Return uniform noise between -1/2 and 1/2 over ``0 <= x < length``; 0 outside."""
    source = random.Random(seed)  # its random() gives the same numbers in every version
    values = np.array([source.random() - 0.5 for _ in range(length * _NOISE_STEPS)])
    place = np.clip(np.floor(x * _NOISE_STEPS), 0, values.size - 1).astype(int)
    return np.where((x >= 0) & (x < length), values[place], 0.0)


def scale_of(settings: Settings, scan: float) -> tuple[float, float]:
    """Return characteristic time [s] and size [%] of the standard record for a controller.

    The time is the integral time that the controller has at low frequencies, ``m1/m0`` (specs/equations.md, section 2); ``1/m0``
    where nothing is proportional, 60 s without integral; at least 20 and at most 20,000 scans. The size moves the output by about
    8 %, at once or in that time: 8 divided by the larger of ``|m1|`` and ``|m0| time``, at most 20 and at least 0.05.

    Parameters
    ----------
    settings : Settings
        The controller's settings.
    scan : float
        Scan interval [s].
    """
    m0, m1, _ = settings.law().moments()
    time = _DEFAULT_TIME if m0 == 0 else m1 / m0 if m1 / m0 > 0 else 1 / abs(m0)
    time = min(max(time, LEAST_SCANS * scan), MOST_SCANS * scan)
    gain = max(abs(m1), abs(m0) * time)
    return time, min(max(8.0 / gain, 0.05), 20.0) if gain else 4.0
