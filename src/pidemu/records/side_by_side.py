"""One controller's part in a comparison, and its difference from another's."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pidemu.arrays import Floats
from pidemu.controller.bench import Bench
from pidemu.records.files import Record
from pidemu.records.playback import Playback, far_out, play
from pidemu.records.sampling import record_from_percent, sampled
from pidemu.records.standard import Segment
from pidemu.settings.action import Action
from pidemu.settings.ranges import Limits, are_limits
from pidemu.settings.settings import Settings

_HAIR = 1e-6
"""Share of a scan interval by which two times may differ and be the same."""


@dataclass(frozen=True)
class Run:
    """One controller's part in a comparison.

    Attributes
    ----------
    label : str
        The card's id; with a number where the card comes twice.
    settings : Settings
        Its settings.
    scan : float
        Nominal scan interval [s].
    limits : tuple of float
        Output limits [%].
    record : Record
        The record as it was sampled for this controller [%].
    playback : Playback
        Outputs [%], times, events and saturation.
    """

    label: str
    settings: Settings
    scan: float
    limits: Limits
    record: Record
    playback: Playback

    def output_at(self, times: Floats) -> Floats:
        """Return the output at other times [%]: held from scan to scan."""
        at = np.searchsorted(self.playback.times, times + _HAIR * self.scan, side="right") - 1
        return self.playback.outputs[np.clip(at, 0, None)]


@dataclass(frozen=True)
class Difference:
    """How far a controller's output is from the first one's.

    Attributes
    ----------
    label : str
        The controller.
    largest, rms : float
        Largest and root mean square difference [% of the output span]; infinite where only one of the outputs is a number.
    time : float
        When the largest is first reached [s].
    segment : str
        In which segment.
    by_segment : tuple of float
        Largest difference in every segment [% of the output span]; NaN where no scan falls into it.
    """

    label: str
    largest: float
    rms: float
    time: float
    segment: str
    by_segment: tuple[float, ...]


def dials(s: Settings) -> str:
    """Return dials and options in one line."""
    shown = [f"{n}={v.value:g} {v.unit}".removesuffix(" 1") for n, v in s.items() if v.active]
    return ", ".join([*shown, *(f"{n}={c}" for n, c in s.options.items())])


def labels(settings: Sequence[Settings]) -> list[str]:
    """Return the id of every card, with a number from the second time on."""
    seen: Counter[str] = Counter()
    out = []
    for s in settings:
        seen[s.card.id] += 1
        out.append(s.card.id if seen[s.card.id] == 1 else f"{s.card.id} ({seen[s.card.id]})")
    return out


def run_on(
    record: Record,
    path: str | Path,
    settings: Settings,
    label: str,
    scan: tuple[float | None, float],
    action: Action,
    limits: Limits,
    initial_output: float,
    notes: list[str],
) -> Run:
    """Run a controller on a record.

    Parameters
    ----------
    record : Record
        The record [%].
    path : path
        Its file, for messages.
    settings : Settings
        The controller's settings.
    label : str
        Its name.
    scan : tuple
        Its scan interval, or ``None`` for the record's; and the interval of a record that does not say [s].
    action : {"reverse", "direct"}
        Control action.
    limits : tuple of float
        Output limits [%].
    initial_output : float
        Output before the first scan [%].
    notes : list of str
        What is taken for granted is added here.
    """
    ranges = settings.own_ranges
    seen, timing = sampled(record, path, scan[0], settings, scan[1])
    for signal, reason in settings.without_use_for(seen.signals).items():
        notes.append(f"{label}: column {seen.names.get(signal, signal)} is left out: {reason}")
        gone: dict[str, Any] = {signal: None}
        seen = replace(seen, **gone)
    bench = Bench.in_percent(
        settings, timing.scan, sp=float(seen.sp[0]), pv=float(seen.pv[0]), op=initial_output, limits=limits, action=action
    )
    if bench.is_biased:
        notes.append(f"{label}: without integral action its output at zero error is a bias, {initial_output:g} %")
    if action == "direct" and settings.equation.action.fixed:
        notes.append(f"{label}: there is no choice of action: the sign of the gain decides")
    notes += [f"{label}: {note}" for note in settings.notes]
    resting = math.isfinite(bench.sp) and math.isfinite(bench.pv) and (seen.auto is None or seen.auto[0] > 0)
    controller = bench.at_rest() if resting else bench.before_first_scan()
    if not are_limits(settings.equation.output.limits):
        notes.append(f"{label}: the card has no output limits of its own; it has {limits[0]:g} to {limits[1]:g} % here")
    played = play(controller, record_from_percent(seen, ranges), path, timing.interval)
    outputs = ranges.op.in_percent(played.outputs)
    events = tuple(replace(e, bump=ranges.op.change_in_percent(e.bump)) for e in played.events)
    return Run(label, settings, controller.interval, limits, seen, replace(played, outputs=outputs, events=events))


def common_notes(runs: Sequence[Run], path: str | Path, default: float | None) -> Iterator[str]:
    """Yield what concerns several controllers: limits and intervals that differ, units, an interval that nobody states."""
    if len({run.limits for run in runs}) > 1:
        each = ", ".join(f"{run.label} {run.limits[0]:g} to {run.limits[1]:g}" for run in runs)
        yield f"the output limits differ: {each} %; --limits sets the same for all"
    plain = [run for run in runs if run.settings.equation.signals == "engineering" and not run.settings.op_range]
    if plain and len(plain) < len(runs):
        names = ", ".join(run.label for run in plain)
        yield f"computed in engineering units, of which 0 to 100 is taken for the span: {names}"
    first = runs[0].record
    yield from far_out(first)
    for run in runs:
        lost = next((e for e in run.playback.events if e.kind == "state"), None)
        if lost is not None:
            yield f"{run.label}: {lost.text}, in scan {lost.scan} (counted from 0)"
    if default is not None and first.time is None and first.interval is None:
        yield f"{path} has no time column; its lines are taken to be {default:g} s apart"
    by_hand = first.auto is not None and bool((first.auto == 0).any())
    if by_hand and first.manual is None and first.output is not None:
        yield "in manual the recorded output is taken for the operator's: the record has no column 'manual'"


def difference(first: Run, other: Run, segments: Sequence[Segment]) -> Difference:
    """Return how far a controller's output is from the first one's, at the first one's scans."""
    times, a = first.playback.times, first.playback.outputs
    b = other.output_at(times)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        apart = np.where(same, 0.0, np.abs(b - a))
    apart[np.isnan(apart)] = math.inf
    at = times + _HAIR * first.scan
    inside = [(at >= s.start) & (at < s.end) for s in segments]
    worst = int(np.argmax(apart))
    return Difference(
        other.label,
        largest=float(apart[worst]),
        rms=float(np.sqrt(np.mean(apart**2))),
        time=float(times[worst]),
        segment=next((s.name for s, mask in zip(segments, inside, strict=True) if mask[worst]), ""),
        by_segment=tuple(float(apart[mask].max()) if mask.any() else math.nan for mask in inside),
    )


def bumps(run: Run) -> dict[tuple[str, int], tuple[int, float]]:
    """Return scan and bump [%] of every transfer, by what it is and how many there were before."""
    seen: Counter[str] = Counter()
    found = {}
    for event in run.playback.events:
        if event.kind == "transfer":
            found[event.text, seen[event.text]] = (event.scan, event.bump)
            seen[event.text] += 1
    return found
