"""A record as each of several controllers sees it: in its units, at its scan interval."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pidemu.arrays import Floats
from pidemu.controller.controller import Controller
from pidemu.errors import RecordError
from pidemu.records.files import Record
from pidemu.records.playback import Timing, even_step, modes, spells, times_of, timing
from pidemu.records.standard import Segment, StandardRecord, standard_record
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings

_LIKE_PV = ("sp", "pv", "cascade")
_LIKE_OUTPUT = ("manual", "output", "track", "external_reset", "feedforward")
_NO_LIMIT = 1e6
"""Output limits beyond this [%] are none."""


class Scale:
    """From the units of a controller's signals to percent of their ranges and back.

    Parameters
    ----------
    settings : Settings
        The controller's settings: of a card with ``signals: engineering``, the ranges count; 0 to 100 where none is given.
    """

    def __init__(self, settings: Settings) -> None:
        self._pv, self._op = (r.ends for r in settings.own_ranges)

    @property
    def spans(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """What 0 and 100 % of setpoint and measurement, and of the output, are in the controller's units."""
        return self._pv, self._op

    def signals_own(self, x: Floats) -> Floats:
        """Return setpoints or measurements in percent in the controller's units."""
        return _linear(x, self._pv, back=True)

    def percent(self, record: Record) -> Record:
        """Return a record in percent."""
        return self._scaled(record, back=False)

    def own(self, record: Record) -> Record:
        """Return a record in percent in the controller's units."""
        return self._scaled(record, back=True)

    def output_percent(self, x: Floats) -> Floats:
        """Return outputs, or limits, in percent."""
        return _linear(x, self._op, back=False)

    def limits_percent(self, limits: tuple[float, float]) -> tuple[float, float]:
        """Return output limits in percent."""
        low, high = self.output_percent(np.array(limits)).tolist()
        return low, high

    def output_own(self, x: float) -> float:
        """Return an output of so many percent in the controller's units."""
        return float(_linear(np.array(x), self._op, back=True))

    def _scaled(self, record: Record, back: bool) -> Record:
        new: dict[str, Any] = {}
        for names, span in ((_LIKE_PV, self._pv), (_LIKE_OUTPUT, self._op)):
            given = {name: getattr(record, name) for name in names}
            new |= {name: _linear(x, span, back=back) for name, x in given.items() if x is not None}
        return replace(record, **new)


def _linear(x: Floats, span: tuple[float, float], *, back: bool) -> Floats:
    low, high = span
    if span == (0.0, 100.0):
        return x
    return low + x * ((high - low) / 100) if back else (x - low) * (100 / (high - low))


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
        The record is uneven, no interval is given, and the card does not measure it; or its time goes back.
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
    grid = times[0] + np.arange(math.ceil((end - times[0]) / scan - 1e-6)) * scan
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


def limits_for(settings: Settings, given: tuple[float, float] | None, instead: tuple[float, float]) -> tuple[float, float]:
    """Return output limits [%]: the given ones, else the card's own, or `instead` where the card has none."""
    if given is not None:
        return given
    low, high = Scale(settings).output_percent(np.array(settings.equation.output.limits)).tolist()
    return (low, high) if abs(low) < _NO_LIMIT and abs(high) < _NO_LIMIT else instead


def controller_for(
    settings: Settings, timing: Timing, action: Action, limits: tuple[float, float], initial_output: float
) -> tuple[Controller, bool]:
    """Return a controller with limits and initial output given in percent, and whether that output is its bias.

    One that integrates nothing gets it as bias: what its output is at zero error.
    """
    scale, a = Scale(settings), settings.algorithm()
    start = scale.output_own(initial_output)
    biased = not (a.ki or a.velocity or a.dahlin or a.start == "load-output" or a.bias) and start != 0
    own = (scale.output_own(limits[0]), scale.output_own(limits[1]))
    controller = Controller(settings, timing.scan, action, own, bias=start if biased else 0.0, initial_output=start)
    return controller, biased
