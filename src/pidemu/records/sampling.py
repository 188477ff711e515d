"""A record as each of several controllers sees it: in its units, at its scan interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import RecordError
from pidemu.records.files import Record
from pidemu.records.playback import Timing, even_step, modes, spells, times_of, timing
from pidemu.records.standard import Segment, StandardRecord, standard_record
from pidemu.settings.ranges import SignalRanges
from pidemu.settings.settings import Settings

MOST_SAMPLES: Final = 10_000_000
"""Samples that a record can have at another interval than its own."""
_LIKE_PV = ("sp", "pv", "cascade")
_LIKE_OUTPUT = ("manual", "output", "track", "external_reset", "feedforward")


def record_in_percent(record: Record, ranges: SignalRanges) -> Record:
    """Return a record in the units of signal ranges, in percent of them."""
    return _rescaled(record, ranges.pv.in_percent, ranges.op.in_percent)


def record_from_percent(record: Record, ranges: SignalRanges) -> Record:
    """Return a record in percent, in the units of signal ranges."""
    return _rescaled(record, ranges.pv.from_percent, ranges.op.from_percent)


def _rescaled(record: Record, measured: Callable[[Floats], Floats], out: Callable[[Floats], Floats]) -> Record:
    new: dict[str, Any] = {}
    for names, scale in ((_LIKE_PV, measured), (_LIKE_OUTPUT, out)):
        given = {name: getattr(record, name) for name in names}
        new |= {name: scale(x) for name, x in given.items() if x is not None}
    return replace(record, **new)


def sampled(record: Record, path: str | Path, scan: float | None, settings: Settings, default: float) -> tuple[Record, Timing]:
    """Return a record as a controller reads it that scans it at its own interval.

    Where the interval is the record's, or none is given, every sample is a scan. Otherwise each scan reads the sample that was
    recorded last; the standard record is made anew.

    Parameters
    ----------
    record : Record
        The record.
    path : path
        Its file, for messages.
    scan : float or None
        The controller's scan interval, if it is given [s].
    settings : Settings
        The controller's settings.
    default : float
        The interval of a record that does not say [s].

    Raises
    ------
    RecordError
        The record is uneven, no interval is given, and the card does not measure it; or its time goes back, or it has too many
        samples at the interval.
    """
    if isinstance(record, StandardRecord):
        h = default if scan is None else scan
        again = standard_record(h, record.seed, record.characteristic_time, record.size)
        return again, Timing(h)
    step = even_step(record)
    if scan is None or (step is None and scan == default) or (step is not None and abs(scan - step) <= 0.01 * step):
        found = timing(record, path, scan, settings)
        return record, Timing(found.scan or default, found.interval)
    base = default if step is None or math.isnan(step) else step
    steps = None if record.interval is None else np.where(np.isnan(record.interval), base, record.interval)
    times = times_of(record, base, steps)
    between = np.diff(times)
    if not (np.isfinite(times).all() and (between > 0).all()):
        raise RecordError(f"{path}: its time does not increase from line to line, which it must to be read every {scan:g} s")
    end = times[-1] + (float(np.median(between)) if between.size else base)
    count = (end - times[0]) / scan
    if count > MOST_SAMPLES:
        raise RecordError(
            f"{path}: read every {scan:g} s, its {end - times[0]:g} s are {count:.3g} samples, more than {MOST_SAMPLES:,}; "
            f"give a longer scan interval"
        )
    grid = times[0] + np.arange(math.ceil(count - 1e-6)) * scan
    at = np.searchsorted(times, grid + 1e-6 * scan, side="right") - 1
    columns = ("sp", "pv", "auto", "manual", "output", "cascade", "track", "external_reset", "feedforward", "hold")
    given = {name: getattr(record, name) for name in columns}
    held = {name: x[at] for name, x in given.items() if x is not None}
    return replace(record, **held, time=grid, interval=None, rows=()), Timing(scan)


def mode_segments(record: Record, times: Floats, scan: float) -> Iterator[Segment]:
    """Yield the spells of a record in one mode, numbered where a mode comes more than once."""
    seen = modes(record)
    found = sorted((first, last, mode) for mode in set(seen.tolist()) for first, last in spells(seen == mode))
    count: dict[str, int] = {}
    for first, last, mode in found:
        count[mode] = count.get(mode, 0) + 1
        end = times[last + 1] if last + 1 < times.size else times[last] + scan
        yield Segment(mode if count[mode] == 1 else f"{mode} {count[mode]}", float(times[first]), float(end))
