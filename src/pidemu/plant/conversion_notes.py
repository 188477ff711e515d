"""What has to be known of a conversion: how near it is, what a setpoint step does, what scans and rounding cost."""

from __future__ import annotations

import math
from typing import Final

from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.plant.decisions import Decisions, is_nearest_wanted, note_decision
from pidemu.plant.pv_filter import filter_time
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.rules import LoopRules, PlantRules
from pidemu.plant.settings_notes import times_of

_MOVED: Final = 1e-3
"""Share of a setting that rounding may move it by without a word."""


def note_refusal(reading: LoopReading, error: ConversionRefusedError) -> None:
    """Note that the target refuses, with the nearest settings and what they cost."""
    choices: tuple[LoopChoice, ...] = ()
    measure = math.inf
    if error.nearest is not None:
        near = error.nearest
        measure = near.certificate.headline.loop_band.max_deviation
        dials = ", ".join(f"{n} {v.value:.4g}" for n, v in near.settings.items() if v.active and (v.given or not v.off))
        choices = (LoopChoice("nearest", f"{dials}: {100 * measure:.3g} % off in the loop band"),)
    reading.find("D-refused", str(error), choices=choices, measure=measure)


def note_conversion(
    reading: LoopReading, c: Conversion, lag: float, rules: PlantRules, ruled: LoopRules, decisions: Decisions
) -> None:
    """Note what has to be known of a conversion."""
    off = c.certificate.headline.loop_band.max_deviation
    if c.verdict == "approximate":
        reading.find("F-approx", f"not exact: {100 * off:.3g} % off in the loop band", measure=off)
        allowed = rules.written.allowed_deviation
        if allowed is not None and 100 * off > allowed and not is_nearest_wanted(reading, decisions):
            text = f"{100 * off:.3g} % off in the loop band, and the rules allow {allowed:g} %"
            reading.find("D-refused", text, choices=(LoopChoice("nearest", "accept it"),), measure=off)
    _note_unfiltered(reading, c)
    kick = c.certificate.setpoint_kick
    if not math.isclose(kick.source, kick.target, rel_tol=1e-3, abs_tol=1e-9):
        text = f"a setpoint step moves the output by {kick.target:.3g} at once, before it was {kick.source:.3g} (% per %)"
        reading.find("F-structure", text, measure=abs(kick.target - kick.source))
    if lag:
        _note_filter(reading, c, lag, ruled, decisions)
    moved = [d for d in c.certificate.dials if d.exact and abs(d.rounded - d.exact) > _MOVED * abs(d.exact)]
    for dial in moved:
        reading.find("F-rounding", f"{dial.name}: {dial.exact:.6g} is rounded to {dial.rounded:g}")
    _note_ranges(reading, c)
    _note_times(reading, c)


def _note_filter(reading: LoopReading, c: Conversion, lag: float, ruled: LoopRules, decisions: Decisions) -> None:
    """Note a filter of the measurement that the target has no place for; a person or the rules put it in front of the block."""
    decided = decisions.answer(reading.tag, "D-filter")
    if decided is not None:
        note_decision(reading, decided)
    elif ruled.pv_filter != "in front":
        text = f"the source filters its measurement with {lag:.4g} s, and {c.settings.card.id} has nowhere to put it"
        choices = (LoopChoice("in front", "a filter outside the block, of the same time"), LoopChoice("leave out", "no filter"))
        reading.find("D-filter", text + ". What becomes of it?", choices=choices, measure=lag)


def _note_unfiltered(reading: LoopReading, c: Conversion) -> None:
    """Note a derivative without a filter whose scan interval changes: equal as continuous laws, it is not so scan by scan."""
    a, at_scan, kick = c.source.algorithm(), c.certificate.feedback_at_scan, c.certificate.setpoint_kick_at_scan
    if c.verdict == "approximate" or not a.kd or a.Tf or a.measurement.filter is not None or c.scan is None or at_scan is None:
        return
    if c.scan[0] == c.scan[1] or c.settings.algorithm().Tf:
        return
    text = (
        f"exact as a continuous law; nothing filters the derivative, so that with {c.scan[1]:g} s in place of {c.scan[0]:g} "
        f"s the two are "
        f"{100 * at_scan.loop_band.max_deviation:.3g} % apart in the loop band"
    )
    if kick is not None and not math.isclose(kick.source, kick.target, rel_tol=1e-3):
        text += f", and a setpoint step moves the output by {kick.target:.3g} in the first scan, before it was {kick.source:.3g}"
    reading.find("F-approx", text, measure=at_scan.loop_band.max_deviation)


def _note_ranges(reading: LoopReading, c: Conversion) -> None:
    if reading.new_range is None or reading.pv_range is None:
        return
    old, new = reading.pv_range, reading.new_range
    if reading.rerange == "same signal":
        reading.find("F-rescaled", f"{old} becomes {new}: the same signal on another scale, gain times {abs(c.factor):.6g}")
        return
    expected = new.span / old.span
    reading.find("F-rerange", f"{old} becomes {new}: the gain is multiplied by {expected:.6g}", measure=abs(math.log(expected)))
    if not math.isclose(abs(c.factor), expected, rel_tol=1e-9):
        text = f"another range multiplies the gain by {expected:.6g}, and the conversion has {abs(c.factor):.6g}; state the "
        "unit of both"
        reading.find("D-rerange", text)


def _note_times(reading: LoopReading, c: Conversion) -> None:
    times = times_of(c.source)
    if times is None:
        return
    ti, td = times
    a = c.source.algorithm()
    if reading.scan is not None and reading.scan > ti / 10:
        text = f"executed every {reading.scan:g} s with an integral time of {ti:.4g} s: less than ten times"
        reading.find("F-scan-slow", text, measure=reading.scan / ti)
    if a.kd and a.kd / a.kp > a.kp / a.ki / 4 and c.settings.equation.form.value == "series":
        reading.find("F-series-limit", f"the integral time, {ti:.4g} s, is less than four derivative times of {td:.4g} s")
    lag = filter_time(c.source) or reading.pv_filter
    if td and lag > td:
        reading.find("F-filter-long", f"the filter of the measurement, {lag:.4g} s, is longer than the derivative time, {td:.4g} s")
