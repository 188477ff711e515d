"""Two or more controllers on the same signals, and how far their outputs are apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pidemu.arrays import Floats
from pidemu.card.model.card_file import default_scan
from pidemu.controller.bench import limits_in_percent
from pidemu.errors import ScanError
from pidemu.formatting import json_safe
from pidemu.plausible import INTERVAL, plausible
from pidemu.records.files import Record, read_record
from pidemu.records.playback import even_step
from pidemu.records.sampling import mode_segments, record_in_percent
from pidemu.records.side_by_side import Difference, Run, bumps, common_notes, difference, labels, run_on
from pidemu.records.standard import REST, Segment, StandardRecord, scale_of, standard_record
from pidemu.settings.action import Action
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings


@dataclass(frozen=True)
class Comparison:
    """Controllers on the same signals.

    Attributes
    ----------
    runs : tuple of Run
        Every controller, the first one being what the others are compared with.
    segments : tuple of Segment
        Parts of the record: those of the standard record, else the spells in one mode.
    differences : tuple of Difference
        Every controller after the first, against the first, at the first one's scans; outputs hold between scans.
    record : Record
        The record, as the first controller saw it.
    notes : tuple of str
        What was taken for granted, and what was left out.
    """

    runs: tuple[Run, ...]
    segments: tuple[Segment, ...]
    differences: tuple[Difference, ...]
    record: Record
    notes: tuple[str, ...] = ()

    @property
    def times(self) -> Floats:
        """The first controller's scans [s], shape (n,)."""
        return self.runs[0].playback.times

    @property
    def outputs(self) -> dict[str, Floats]:
        """Outputs by label, at the first controller's scans [% of the output span], each of shape (n,)."""
        return {run.label: run.output_at(self.times) for run in self.runs}

    def transfers(self) -> list[tuple[str, float, tuple[float, ...]]]:
        """Return every transfer of the first controller: what, when [s], and the bump of every controller [%].

        Where another controller has no such transfer, as its scans miss a short spell, its bump is NaN.
        """
        found = [bumps(run) for run in self.runs]
        return [
            (text, float(self.times[scan]), tuple(other.get((text, n), (0, math.nan))[1] for other in found))
            for (text, n), (scan, _) in found[0].items()
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu compare --json``."""
        standard = self.record if isinstance(self.record, StandardRecord) else None
        plain = {
            "record": {"time": standard.characteristic_time, "size": standard.size, "seed": standard.seed} if standard else None,
            "segments": [{"name": s.name, "start": s.start, "end": s.end} for s in self.segments],
            "controllers": [
                {
                    "label": run.label,
                    **run.settings.to_dict(),
                    "scan": run.scan,
                    "limits": list(run.limits),
                    "outputs": run.output_at(self.times).tolist(),
                    **run.playback.to_dict(),
                    "seconds_in_saturation": {limit: run.playback.saturated(limit) for limit in ("low", "high")},
                }
                for run in self.runs
            ],
            "times": self.times.tolist(),
            "differences": [
                {
                    "label": d.label,
                    "largest": d.largest,
                    "rms": d.rms,
                    "time": d.time,
                    "segment": d.segment,
                    "by_segment": {s.name: x for s, x in zip(self.segments, d.by_segment, strict=True)},
                }
                for d in self.differences
            ],
            "notes": list(self.notes),
        }
        safe: dict[str, Any] = json_safe(plain)
        return safe


def compare(
    settings: Sequence[Settings],
    record: Record | str | Path | None = None,
    scan: float | Sequence[float] | None = None,
    *,
    action: Action = "reverse",
    output_limits: tuple[float, float] | None = None,
    initial_output: float | None = None,
) -> Comparison:
    """Run two or more controllers on the same signals and compare their outputs with the first one's.

    Signals go to every controller in its own units: percent, or, with ``signals: engineering``, those of its ranges, 0 to 100
    where none is given. A recorded file is in the units of the first controller.

    Parameters
    ----------
    settings : sequence of Settings
        The controllers' settings, two or more.
    record : Record or path, optional
        Recorded signals; by default the standard record (`pidemu.records.standard.standard_record`), scaled to the first
        controller.
    scan : float or sequence of float, optional
        Scan interval of all, or of each [s]; by default the record's, else that of the first card. A controller whose interval is
        not the record's reads what was recorded last.
    action : {"reverse", "direct"}
        Control action of all.
    output_limits : tuple of float, optional
        Output limits of all [as the first card's]; by default each card's own, and the first one's where a card has none.
    initial_output : float, optional
        Output before the first scan [as the first card's]; by default the first recorded one, else 0; with the standard record
        50 %. It is also the bias of a controller that integrates nothing.

    Returns
    -------
    Comparison
        Outputs, differences by segment, bumps at transfers, time in saturation.

    Raises
    ------
    ScanError
        There are fewer than two controllers, or scan intervals or limits cannot be used.
    RecordError
        The record cannot be used.

    Examples
    --------
    >>> import pidemu
    >>> card = pidemu.load_card("generic/standard")
    >>> found = pidemu.compare([card.settings(K=2, Ti=10), card.settings(K=2, Ti=10, b=0)])
    >>> found.segments[1].name, round(found.differences[0].by_segment[1], 9)  # K times a step of 2 %
    ('setpoint steps', 4.0)
    """
    if isinstance(settings, Settings):
        raise ScanError("compare takes a list of settings: pidemu.compare([first, second])")
    if len(settings) < 2:
        raise ScanError(f"a comparison needs two controllers or more, {len(settings)} given")
    path = "record" if record is None or isinstance(record, Record) else record
    first = settings[0].own_ranges
    scans = _scans(scan, len(settings))
    own = even_step(record) if isinstance(record, StandardRecord) else None
    default = scans[0] or own or default_scan(settings[0].equation)
    if record is None:
        base: Record = standard_record(default, 1, *scale_of(settings[0], default))
    else:
        base = record if isinstance(record, Record) else read_record(record)
        base = base if isinstance(base, StandardRecord) else record_in_percent(base, first)
    given = None if output_limits is None else first.op.limits_in_percent(output_limits)
    instead = limits_in_percent(settings[0], given)
    start = _start(first.op, base, initial_output)
    notes: list[str] = []
    runs = []
    for s, h, label in zip(settings, scans, labels(settings), strict=True):
        limits = limits_in_percent(s, given, instead)
        runs.append(run_on(base, path, s, label, (h, default), action, limits, start, notes))
    notes += common_notes(runs, path, default if record is not None else None)
    segments = runs[0].record.segments if isinstance(runs[0].record, StandardRecord) else None
    segments = segments or tuple(mode_segments(runs[0].record, runs[0].playback.times, runs[0].scan))
    found = tuple(difference(runs[0], other, segments) for other in runs[1:])
    return Comparison(tuple(runs), segments, found, runs[0].record, tuple(notes))


def _scans(given: float | Sequence[float] | None, count: int) -> tuple[float | None, ...]:
    if given is None:
        return (None,) * count
    several = (given,) if isinstance(given, int | float) else given
    if len(several) not in (1, count):
        raise ScanError(f"{len(several)} scan intervals for {count} controllers; give one for all, or one for each")
    found = tuple(plausible("scan interval", h, INTERVAL, ScanError) for h in several)
    wrong = next((h for h in found if h <= 0), None)
    if wrong is not None:
        raise ScanError(f"scan interval {wrong:g} s is not a positive number")
    return found * count if len(found) == 1 else found


def _start(out: SignalRange, record: Record, given: float | None) -> float:
    """Return the output before the first scan [%]."""
    if given is not None:
        return out.in_percent(float(given))
    if isinstance(record, StandardRecord):
        return REST
    recorded = math.nan if record.output is None else float(record.output[0])
    return recorded if math.isfinite(recorded) else out.in_percent(0.0)
