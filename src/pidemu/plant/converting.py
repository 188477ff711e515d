"""A loop's settings to the target's, as the plant's rules want it, by `pidemu.convert`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from pidemu.card.load import Card, match_name
from pidemu.card.model.card_file import Equation
from pidemu.conversion.convert import convert
from pidemu.conversion.modes import depends_on_mode
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import DIGITS
from pidemu.conversion.result import Conversion
from pidemu.errors import PidemuError
from pidemu.plant.decisions import Decisions, note_decision
from pidemu.plant.loop_settings import times_of
from pidemu.plant.loop_signals import COUNTS
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.rules import EXACT_ELSE, FREE, MATCH_SOURCE, LoopRules, PlantRules, option_text
from pidemu.settings.quantities import measure_of
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings
from pidemu.units import FULL, from_canonical, parse_unit

_KINDS: Final = {
    "unit": "D-unit",
    "range": "D-range",
    "scale": "D-rerange",
    "action": "D-action",
    "mode": "D-mode",
    "input": "E-missing",
}
_TERMS: Final = ("proportional", "integral", "derivative")
_MOVED: Final = 1e-3
"""Share of a setting that rounding may move it by without a word."""


@dataclass(frozen=True)
class LoopConversion:
    """A loop, converted.

    Attributes
    ----------
    conversion : Conversion
        What `pidemu.convert` says.
    options : dict
        Options that the rules held, with the line of the rules.
    pasted : dict
        The target's dials if the source's numbers were carried over by their units alone.
    """

    conversion: Conversion
    options: Mapping[str, str]
    pasted: Mapping[str, float]


def convert_loop(reading: LoopReading, rules: PlantRules, decisions: Decisions) -> LoopConversion | None:
    """Convert a loop; ``None`` where it stops, with a finding that says why.

    Parameters
    ----------
    reading : LoopReading
        The loop; gets the findings.
    rules : PlantRules
        The target and how it is to be set.
    decisions : Decisions
        What people decided.
    """
    settings = reading.settings
    assert settings is not None
    ruled = rules.for_loop(settings.card.id, reading.tag, reading.area)
    dropped = decisions.answer(reading.tag, "D-filter")
    left_out = ruled.pv_filter == "leave out" or (dropped is not None and dropped.answer.casefold() == "leave out")
    source = replace(settings, lag=reading.pv_filter) if reading.pv_filter and not left_out else settings
    if dropped is not None and left_out:
        note_decision(reading, dropped)
    try:
        options, given = _wanted(source, rules.target, ruled, reading.mode)
        asked = _asked(reading, rules, ruled, source)
        found = _converted(source, rules.target, ruled, {**asked, "options": options, "given": given}, _nearest(reading, decisions))
    except QuestionError as error:
        for question in error.questions:
            code = _KINDS.get(question.kind) or _code_of_option(source, question.about)
            text, _, _ = question.text.partition("; add for example")
            ranged = question.kind == "range"
            choices = tuple(LoopChoice(a.value, "" if ranged else a.says) for a in question.readings)
            reading.find(code, text, choices=choices)
        return None
    except ConversionRefusedError as error:
        _note_refusal(reading, error)
        return None
    except PidemuError as error:
        reading.find("D-refused", str(error))
        return None
    if found.refusal:
        decided = decisions.answer(reading.tag, "D-refused")
        if decided is not None:
            note_decision(reading, decided)
    _note_conversion(reading, found, rules, ruled, decisions)
    return LoopConversion(found, {n: f"{x} ({ruled.origins.get(n, 'match-source')})" for n, x in options.items()}, _pasted(found))


def _nearest(reading: LoopReading, decisions: Decisions) -> bool:
    found = decisions.answer(reading.tag, "D-refused")
    return found is not None and found.answer.casefold() == "nearest"


def _converted(source: Settings, target: Card, ruled: LoopRules, asked: dict[str, Any], nearest: bool) -> Conversion:
    if ruled.match != EXACT_ELSE:
        return convert(source, target, match=ruled.match, allow_approximate=nearest, emulate=False, **asked)
    try:
        return convert(source, target, match="exact", emulate=False, **asked)
    except QuestionError:
        raise
    except ConversionRefusedError:
        return convert(source, target, match="low-frequency", allow_approximate=nearest, emulate=False, **asked)


def _asked(reading: LoopReading, rules: PlantRules, ruled: LoopRules, source: Settings) -> dict[str, Any]:
    """Return the arguments of a conversion that the list states."""
    goal = rules.scan_of(reading.tag)
    asked: dict[str, Any] = {"action": reading.action, "digits": ruled.digits or DIGITS, "bias": reading.bias, "tag": reading.tag}
    asked["compensate"] = rules.compensates and reading.scan is not None
    if reading.scan is not None:
        asked["scan"] = (reading.computes_with or reading.scan, goal or reading.scan)
        if reading.computes_with is not None:
            asked["runs_every"] = (reading.scan, goal or reading.scan)
    if reading.limits is not None and reading.limits[0] >= -10 and reading.limits[1] <= 110 and reading.limits != (0, 100):
        asked["limits"] = reading.limits
    if depends_on_mode(source) and reading.mode in ("auto", "cascade"):
        asked["mode"] = reading.mode
    if reading.new_range is not None:
        asked["to_pv_range"] = reading.new_range
    return asked


def as_ranged(reading: LoopReading) -> None:
    """Write the two ranges of a loop so that they mean what the list says: the same signal on another scale, or another range."""
    old, new, settings = reading.pv_range, reading.new_range, reading.settings
    if old is None or new is None or settings is None or not reading.rerange:
        return
    if reading.rerange == "same signal":
        own = SignalRange(old.low, old.high, COUNTS)
        reading.settings = settings.changed({"pv_range": own})
        return
    unit = old.unit if measure_of(old.unit).is_quantity else "eu"  # a unit that could be a raw scale is not meant as one
    reading.settings = settings.changed({"pv_range": SignalRange(old.low, old.high, unit)})
    reading.new_range = SignalRange(new.low, new.high, unit)


def _wanted(source: Settings, target: Card, ruled: LoopRules, mode: str | None) -> tuple[dict[str, str], dict[str, object]]:
    """Return options and dials of the target that the rules fix."""
    options: dict[str, str] = {}
    given: dict[str, object] = {}
    for name, value in ruled.options.items():
        option = match_name(name, target.data.options)
        text = option_text(value)
        if text == FREE or (option and text == MATCH_SOURCE):
            continue
        if option:
            options[option] = text
        else:
            given[name] = value
    for name, value in ruled.options.items():
        option = match_name(name, target.data.options)
        if option and option_text(value) == MATCH_SOURCE:
            choice = matching_choice(source, target, option, options, mode)
            if choice is not None:
                options[option] = choice
    return options, given


def matching_choice(source: Settings, target: Card, option: str, fixed: Mapping[str, str], mode: str | None) -> str | None:
    """Return the choice of an option with which the target does as the source does: its form, and which terms see the setpoint.

    Parameters
    ----------
    source : Settings
        The source.
    target : Card
        The target.
    option : str
        The option.
    fixed : mapping
        Options that are fixed.
    mode : str or None
        The mode that counts.

    Returns
    -------
    str or None
        ``None`` where no choice does as the source does.
    """
    variants = {choice: target.variant({**fixed, option: choice}).equation for choice in target.options[option]}
    own = source.equation
    a = source.algorithm()
    used = {"proportional": a.kp, "integral": a.ki, "derivative": a.kd}
    varied = [t for t in _TERMS if used[t] and len({_acts_on(v, t) for v in variants.values()}) > 1]
    forms = len({v.form for v in variants.values()}) > 1
    if not varied and not forms:
        varied = [t for t in _TERMS if len({_acts_on(v, t) for v in variants.values()}) > 1]
    delivered = target.variant(fixed).equation
    fits = []
    for choice, equation in variants.items():
        if forms and equation.form is not own.form:
            continue
        if all(_matches(own, equation, term, bool(used[term]), mode) for term in varied) and not _extra(equation, used):
            likeness = sum(_acts_on(equation, t) == _acts_on(delivered, t) for t in _TERMS)
            fits.append((-likeness, choice))
    return min(fits, key=lambda f: f[0])[1] if fits else None


def _acts_on(equation: Equation, term: str) -> str:
    return str(getattr(equation, term).on)


def _matches(own: Equation, equation: Equation, term: str, used: bool, mode: str | None) -> bool:
    """Whether a term of the target acts on what the source's acts on; one that is not used can be either way."""
    if not used:
        return True
    acts = _acts_on(own, term)
    if term == "proportional" and mode == "cascade" and own.cascade is not None and own.cascade.proportional is not None:
        acts = str(own.cascade.proportional.on)
    return _acts_on(equation, term) == acts


def _extra(equation: Equation, used: Mapping[str, float]) -> bool:
    """Whether the target has a proportional term that cannot be set to zero and that the source has not."""
    return not used["proportional"] and equation.proportional.on != "none" and equation.form.value != "parallel"


def _code_of_option(source: Settings, option: str) -> str:
    """Return the code for an option that is not stated: equation where units hang on it, form, or structure."""
    variants = [source.card.variant({option: choice}).equation for choice in source.card.options.get(option, ())]
    if len({tuple((n, s.unit) for n, s in v.settings.items()) for v in variants}) > 1:
        return "D-equation"
    return "D-form" if len({v.form for v in variants}) > 1 else "D-structure"


def _note_refusal(reading: LoopReading, error: ConversionRefusedError) -> None:
    choices: tuple[LoopChoice, ...] = ()
    measure = math.inf
    if error.nearest is not None:
        near = error.nearest
        measure = near.certificate.headline.loop_band.max_deviation
        dials = ", ".join(f"{n} {v.value:.4g}" for n, v in near.settings.items() if v.active and (v.given or not v.off))
        choices = (LoopChoice("nearest", f"{dials}: {100 * measure:.3g} % off in the loop band"),)
    reading.find("D-refused", str(error), choices=choices, measure=measure)


def _note_conversion(reading: LoopReading, c: Conversion, rules: PlantRules, ruled: LoopRules, decisions: Decisions) -> None:
    """Note what has to be known of a conversion."""
    off = c.certificate.headline.loop_band.max_deviation
    if c.verdict == "approximate":
        reading.find("F-approx", f"not exact: {100 * off:.3g} % off in the loop band", measure=off)
        allowed = rules.written.allowed_deviation
        if allowed is not None and 100 * off > allowed and not _nearest(reading, decisions):
            text = f"{100 * off:.3g} % off in the loop band, and the rules allow {allowed:g} %"
            reading.find("D-refused", text, choices=(LoopChoice("nearest", "accept it"),), measure=off)
    _note_unfiltered(reading, c)
    kick = c.certificate.setpoint_kick
    if not math.isclose(kick.source, kick.target, rel_tol=1e-3, abs_tol=1e-9):
        text = f"a setpoint step moves the output by {kick.target:.3g} at once, before it was {kick.source:.3g} (% per %)"
        reading.find("F-structure", text, measure=abs(kick.target - kick.source))
    if c.settings.lag:
        decided = decisions.answer(reading.tag, "D-filter")
        text = f"the source filters its measurement with {c.settings.lag:.4g} s, and {c.settings.card.id} has nowhere to put it"
        if decided is not None or ruled.pv_filter == "in front":
            if decided is not None:
                note_decision(reading, decided)
        else:
            choices = (LoopChoice("in front", "a filter outside the block, of the same time"), LoopChoice("leave out", "no filter"))
            reading.find("D-filter", text + ". What becomes of it?", choices=choices, measure=c.settings.lag)
    moved = [d for d in c.certificate.dials if d.exact and abs(d.rounded - d.exact) > _MOVED * abs(d.exact)]
    for dial in moved:
        reading.find("F-rounding", f"{dial.name}: {dial.exact:.6g} is rounded to {dial.rounded:g}")
    _note_ranges(reading, c)
    _note_times(reading, c)


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
    lag = reading.pv_filter or _own_filter(c.source)
    if td and lag > td:
        reading.find("F-filter-long", f"the filter of the measurement, {lag:.4g} s, is longer than the derivative time, {td:.4g} s")


def _own_filter(source: Settings) -> float:
    found = source.algorithm().measurement.filter
    return 0.0 if found is None or found.time is None else float(found.time)


def _pasted(c: Conversion) -> dict[str, float]:
    """Return the target's dials with the source's numbers, converted by their units alone."""
    found: dict[str, float] = {}
    for name, value in c.settings.items():
        own = c.source.by_role(value.role)
        if value.role.value in ("gain", "integral", "derivative") and value.active and own is not None:
            found[name] = from_canonical(value.role, own.canonical, parse_unit(value.unit), FULL)
    return found
