"""Source and target emulated on the same signals, scan by scan: point 3 of the certificate (specs/equations.md, section 9)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.card.model.card_file import default_scan
from pidemu.certificate.linear import time_scale
from pidemu.certificate.models import EXACT, ScanByScan
from pidemu.controller.bench import Bench
from pidemu.errors import ScanError
from pidemu.records.files import Record
from pidemu.records.sampling import record_from_percent
from pidemu.records.standard import MOST_SCANS, REST, Segment, StandardRecord, scale_of, standard_record
from pidemu.settings.action import Action, acting_alike
from pidemu.settings.settings import Settings

_LINEAR_UNTIL: Final = "large positive error"
"""The first part of the standard record that is meant to reach a limit."""
_FINEST: Final = 2000
"""Scans per characteristic time: more would take long and show nothing new."""
_ENOUGH, _COARSEST = 200, 20
"""The same where the interval is ours to take: as many as show what there is, and fewer would leave nothing to see."""
_HAIR: Final = 1e-6
_TRIES: Final = 6


def common_interval(source: Settings, target: Settings) -> float:
    """Return a scan interval for both controllers where none was given [s].

    It is the source card's, made to suit the settings: between a 200th and a 20th of the effective integral time, and short enough
    for the filters of both. Where a dial counts in scans it is the interval at which that was read.

    Raises
    ------
    ScanError
        No interval suits both.
    """
    counted = [s.scan for s in (source, target) if s.counts_scans and s.scan is not None]
    if counted:
        source.law(counted[0]), target.law(counted[0])
        return counted[0]
    time = time_scale(source.law())
    h = min(max(default_scan(source.equation), time / _ENOUGH), time / _COARSEST)
    for _ in range(_TRIES):
        with suppress(ScanError):
            source.law(h), target.law(h)
            return h
        h /= 4
    source.law(h), target.law(h)
    return h


def record_for(source: Settings, h: float) -> StandardRecord:
    """Return the part of the standard record that is meant to reach no limit, scaled to a controller, scanned every `h` [s]."""
    time, size = scale_of(source, h)
    return _linear_part(standard_record(h, 1, min(time, _FINEST * h), size))


def _times(record: Record) -> Floats:
    assert record.time is not None  # the standard record has it
    return record.time


def _linear_part(record: StandardRecord) -> StandardRecord:
    kept = tuple(s for s in record.segments if s.start < next(s.start for s in record.segments if s.name == _LINEAR_UNTIL))
    times = _times(record)
    n = int(np.searchsorted(times, kept[-1].end * (1 - 1e-9)))
    return replace(record, sp=record.sp[:n], pv=record.pv[:n], time=times[:n], auto=None, manual=None, segments=kept)


def emulated(
    source: Settings,
    target: Settings,
    scans: tuple[float, float],
    factor: float = 1.0,
    *,
    taken: bool = False,
    in_cascade: bool = False,
) -> ScanByScan:
    """Run both controllers on the linear part of the standard record and compare their outputs.

    Parameters
    ----------
    source, target : Settings
        The settings.
    scans : tuple of float
        Scan intervals of source and target [s].
    factor : float
        What the source's gain is multiplied by for new signal ranges; negative where the action changes.
    taken : bool
        Whether these intervals were taken, as none was given.
    in_cascade : bool
        Whether the setpoint is a remote one.

    Raises
    ------
    ScanError
        A controller cannot be run at its interval, scans so slowly that it would not scan once, or so much faster than the other
        one that the comparison would take seconds.
    """
    record = record_for(source, scans[0])
    many = record.characteristic_time / scans[1]
    if many > MOST_SCANS:
        raise ScanError(
            f"the new controller, which scans every {scans[1]:g} s, does {many:,.0f} scans in the "
            f"{record.characteristic_time:.6g} s in which the old one moves, too many to run both for a comparison; give intervals "
            f"that are less far apart"
        )
    other = record if scans[0] == scans[1] else _again(record, scans[1])
    mine_at, theirs_at = _times(record), _times(other)
    if not theirs_at.size:
        raise ScanError(f"a scan interval of {scans[1]:g} s is longer than the whole record, {mine_at[-1]:.6g} s")
    at = np.searchsorted(theirs_at, mine_at + _HAIR * scans[0], side="right") - 1
    actions = acting_alike(target, factor)
    mine, theirs = (_Emulated(s, h, action, in_cascade) for s, h, action in zip((source, target), scans, actions, strict=True))
    ours = REST + abs(factor) * (mine.outputs(record) - REST)
    apart = _apart(ours, theirs.outputs(other)[at])
    exact = bool(np.max(apart) <= EXACT * 100)  # then they agree on the measurement alone as well
    still = (
        apart if exact else _apart(REST + abs(factor) * (mine.outputs(_still(record)) - REST), theirs.outputs(_still(other))[at])
    )
    worst = int(np.argmax(apart))
    when = float(mine_at[worst])
    return ScanByScan(
        scan=scans,
        taken=taken,
        largest=float(apart[worst]),
        largest_at=when,
        segment=_segment_at(record.segments, when + _HAIR * scans[0]),
        on_measurement=float(np.max(still)),
        size=float(np.max(np.abs(ours - REST))),
        same_rules=scans[0] == scans[1] and _rules(source) == _rules(target),
    )


def _rules(settings: Settings) -> tuple[object, ...]:
    """Return what makes a sequence of outputs out of a law: scan rules, order of things within a scan."""
    a = settings.algorithm()
    lags = (a.setpoint.filter, a.measurement.filter, a.error.filter)
    mixed = bool(a.ki and a.kd) and a.integral.rule is not a.derivative.rule  # then a product of both is not a sum of both
    return (
        mixed and a.series,
        a.integral.rule if a.ki else None,
        a.derivative.rule if a.kd else None,
        a.filter_rule if a.Tf else None,
        a.measurement.previous_scan,
        a.arithmetic.type,
        *(lag and lag.rule for lag in lags),
    )


def _again(record: StandardRecord, h: float) -> StandardRecord:
    return _linear_part(standard_record(h, record.seed, record.characteristic_time, record.size))


def _segment_at(segments: tuple[Segment, ...], when: float) -> str:
    return next((s.name for s in segments if s.start <= when < s.end), segments[-1].name)


def _still(record: StandardRecord) -> StandardRecord:
    return replace(record, sp=np.full_like(record.sp, REST))


def _apart(ours: Floats, theirs: Floats) -> Floats:
    apart: Floats = np.nan_to_num(np.abs(theirs - ours), nan=np.inf)
    return apart


class _Emulated:
    """A controller that begins every record at rest, without output limits."""

    def __init__(self, settings: Settings, h: float, action: Action, in_cascade: bool) -> None:
        self._in_cascade = in_cascade
        self._ranges = settings.own_ranges
        self._bench = Bench.in_percent(settings, h, sp=REST, pv=REST, op=REST, action=action)

    def outputs(self, record: Record) -> Floats:
        """Return the outputs on a record [%]."""
        own = record_from_percent(record, self._ranges)
        remote = own.sp if self._in_cascade else None
        return self._ranges.op.in_percent(self._bench.at_rest().run(own.sp, own.pv, cascade=remote))
