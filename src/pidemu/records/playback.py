"""A record played to a controller, and what happened: transfers with their bumps, saturation, bad signals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Flags, Floats
from pidemu.controller.controller import Controller
from pidemu.controller.signals import SIGNALS, Event
from pidemu.errors import RecordError, ScanError
from pidemu.plausible import SIGNAL, TIME
from pidemu.records.files import Record
from pidemu.settings.settings import Settings

_UNEVEN: Final = 0.01
"""Relative jitter of a time column that counts as none."""
NO_BUMP: Final = 1e-9
"""Bump that counts as none [as output limits]."""


@dataclass(frozen=True, slots=True)
class Timing:
    """When the scans of a record happen.

    Attributes
    ----------
    scan : float or None
        Nominal scan interval [s]; ``None`` where neither the record nor the user says.
    interval : ndarray of float, shape (n,), or None
        Time since the last scan [s], where the scans come unevenly and the controller measures it.
    """

    scan: float | None
    interval: Floats | None = None


@dataclass(frozen=True, slots=True)
class Saturation:
    """A spell of automatic scans at an output limit.

    Attributes
    ----------
    first, last : int
        The scans, counted from 0.
    limit : {"low", "high"}
        Which limit.
    """

    first: int
    last: int
    limit: Literal["low", "high"]


@dataclass(frozen=True, slots=True)
class Playback:
    """What a controller did with a record.

    Attributes
    ----------
    outputs : ndarray of float, shape (n,)
        Output of every scan [as output limits].
    times : ndarray of float, shape (n,)
        When [s].
    events : tuple of Event
        Transfers, and what was wrong with signals and intervals.
    saturations : tuple of Saturation
        Spells at a limit, in automatic.
    """

    outputs: Floats
    times: Floats
    events: tuple[Event, ...]
    saturations: tuple[Saturation, ...]

    def saturated(self, limit: Literal["low", "high"]) -> float:
        """Return the time spent at a limit [s]; the last scan lasts as long as the one before."""
        ends = np.append(self.times[1:], self.times[-1] + (self.times[-1] - self.times[-2] if self.times.size > 1 else 0.0))
        return float(sum(ends[s.last] - self.times[s.first] for s in self.saturations if s.limit == limit))

    def to_dict(self) -> dict[str, Any]:
        """Return events and saturations as plain values."""
        return {
            "events": [{"scan": e.scan, "kind": e.kind, "text": e.text, "bump": e.bump} for e in self.events],
            "saturations": [{"from": s.first, "to": s.last, "limit": s.limit} for s in self.saturations],
        }


def timing(record: Record, path: str | Path, given: float | None, settings: Settings) -> Timing:
    """Return the scan interval of a record: the given one, else that of its interval or time column.

    A card that measures the interval (``scan.interval: measured``) runs with uneven steps as they are; one that does not refuses
    them.

    Parameters
    ----------
    record : Record
        The record.
    path : path
        Its file, for messages.
    given : float or None
        What the user says [s].
    settings : Settings
        Settings of the card that shall run.

    Raises
    ------
    RecordError
        The column is uneven and the card does not measure the interval, or the column contradicts `given`.
    """
    steps, what = _steps(record)
    between = steps[1:] if steps.size > 1 else steps  # before the first sample there is nothing
    step, uneven = _median(between)
    if step is None:
        return Timing(given)
    if not step > 0 or (uneven and settings.equation.scan.interval == "nominal"):
        worst = int(np.nanargmax(np.abs(between - (step if step > 0 else 0.0))))
        elsewhere = f", elsewhere by {step:g} s" if step > 0 else ""
        remedy = "one line per scan is needed, in the order of time"
        if settings.equation.scan.interval == "nominal":
            remedy = (
                f"one line per scan is needed, since {settings.card.id} computes with a fixed interval: bring the record to even "
                "steps, or, if every line is a scan of the controller, leave the column out and give --scan"
            )
        raise RecordError(
            f"{path}: the {what} goes on by {between[worst]:g} s after sample {worst} (counted from 0){elsewhere}; {remedy}"
        )
    if given is not None and abs(given - step) > _UNEVEN * step:
        raise RecordError(f"{path}: the {what} has a step of {step:g} s, --scan says {given:g} s; leave --scan out, or the column")
    scan = step if given is None else given
    measured = settings.equation.scan.interval == "measured" and (uneven or record.interval is not None)
    return Timing(scan, np.where(np.isnan(steps), scan, steps) if measured else None)


def even_step(record: Record) -> float | None:
    """Return the interval of a record with even steps [s], NaN where they are uneven, ``None`` where it is not known."""
    steps, _ = _steps(record)
    step, uneven = _median(steps[1:] if steps.size > 1 else steps)
    return math.nan if uneven else step


def _median(steps: Floats) -> tuple[float | None, bool]:
    """Return the usual step, ``None`` where there is none and NaN where none is positive, and whether others differ from it."""
    if np.isnan(steps).all():
        return None, False
    known = steps[np.isfinite(steps) & (steps > 0)]
    if not known.size:
        return math.nan, True
    step = float(np.median(known))
    return step, bool((np.abs(steps - step) > _UNEVEN * step).any())


def _steps(record: Record) -> tuple[Floats, str]:
    """Return the time since the last sample [s], NaN where it is not known, and the column it stands in."""
    if record.interval is not None:
        return record.interval, f"column {record.names.get('interval', 'interval')}"
    if record.time is None:
        return np.full(record.sp.size, math.nan), ""
    furthest = float(np.abs(record.time).max())
    if not TIME.has(furthest):
        raise RecordError(f"time column: {TIME.refusal(f'{furthest:g} s')}")
    digits = int(-math.log10(2 * np.spacing(max(1.0, furthest))))
    steps: Floats = np.round(np.diff(record.time, prepend=math.nan), digits)
    return steps, "time column"


def times_of(record: Record, scan: float, interval: Floats | None = None) -> Floats:
    """Return the time of every scan [s]: the time column, else the sum of the intervals, from 0."""
    if record.time is not None:
        return record.time
    times: Floats = np.arange(record.sp.size, dtype=np.float64) * scan
    if interval is not None:
        times[1:] = np.cumsum(interval[1:])
    return times


def play(controller: Controller, record: Record, path: str | Path, interval: Floats | None = None) -> Playback:
    """Run a controller on a record, one scan per sample.

    Parameters
    ----------
    controller : Controller
        The controller, before its first scan.
    record : Record
        The record.
    path : path
        Its file, for messages.
    interval : ndarray of float, shape (n,), optional
        Time since the last scan [s].

    Raises
    ------
    RecordError
        The controller has no use for a signal of the record, or refuses a value.
    """
    for signal, reason in controller.settings.without_use_for(record.signals).items():
        raise RecordError(f"{path}: column {record.names.get(signal, signal)}: {reason}; leave the column out")
    try:
        outputs = controller.run(record.sp, record.pv, record.auto, record.by_hand, **record.signals, interval=interval)
    except ScanError as error:
        raise RecordError(f"{path}: {error}") from None
    low, high = limits_of(controller)
    automatic = modes(record) == "automatic"
    found = [Saturation(start, end, "low") for start, end in spells((outputs <= low) & automatic)]
    found += [Saturation(start, end, "high") for start, end in spells((outputs >= high) & automatic)]
    return Playback(
        outputs,
        times_of(record, controller.interval, interval),
        tuple(controller.events),
        tuple(sorted(found, key=lambda s: s.first)),
    )


def far_out(record: Record) -> Iterator[str]:
    """Yield, for every signal of a record, how often and where first it is larger than any signal."""
    for name in ("sp", "pv", "manual", "output", *SIGNALS):
        values = getattr(record, name)
        places = np.flatnonzero(np.abs(values) > SIGNAL) if values is not None else np.array([], dtype=int)
        places = places[np.isfinite(values[places])] if places.size else places
        if places.size:
            more = f", and {places.size - 1} more" if places.size > 1 else ""
            yield (
                f"column {record.names.get(name, name)}: {values[places[0]]:g} in sample {places[0]} (counted from 0){more}: "
                f"larger than any signal, {SIGNAL:g}"
            )


def limits_of(controller: Controller) -> tuple[float, float]:
    """Return the output limits in force, as the program rounds them [as output limits]."""
    program = controller.program
    values = {q.name: v for q, v in zip(program.coefficients, program.values, strict=True)}
    low, high = values.get("low", -math.inf), values.get("high", math.inf)
    return (float(np.float32(low)), float(np.float32(high))) if program.precision == "float32" else (low, high)


def modes(record: Record) -> npt.NDArray[np.str_]:
    """Return automatic, manual, tracking or hold for every sample; cascade is automatic."""
    found = np.full(record.sp.size, "automatic", dtype="U9")
    if record.auto is not None:
        found[record.auto == 0] = "manual"
    if record.track is not None:
        found[~np.isnan(record.track)] = "tracking"
    if record.hold is not None:
        found[record.hold > 0] = "hold"
    return found


def spells(mask: Flags) -> Iterator[tuple[int, int]]:
    """Yield first and last place of every stretch that is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int))).tolist()
    yield from ((start, end - 1) for start, end in zip(edges[::2], edges[1::2], strict=True))
