"""A loop's settings to the target's, as the plant's rules want it, by `pidemu.convert`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from pidemu.card.load import Card
from pidemu.conversion.convert import convert
from pidemu.conversion.modes import depends_on_mode
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.request import DIGITS
from pidemu.conversion.result import Conversion
from pidemu.errors import PidemuError
from pidemu.plant.conversion_notes import note_conversion, note_refusal
from pidemu.plant.decisions import Decisions, is_nearest_wanted, note_decision
from pidemu.plant.loop_signals import COUNTS
from pidemu.plant.match_source import wanted_options
from pidemu.plant.pv_filter import filter_dial, filter_time, without_filter
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.rules import EXACT_ELSE, LoopRules, PlantRules
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
    lag : float
        A filter of the measurement that has to be put in front of the block [s].
    """

    conversion: Conversion
    options: Mapping[str, str]
    pasted: Mapping[str, float]
    lag: float = 0.0


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
    source = without_filter(settings) if left_out else replace(settings, lag=reading.pv_filter)
    if dropped is not None and left_out:
        note_decision(reading, dropped)
    try:
        options, given = wanted_options(source, rules.target, ruled, reading.mode)
        asked = _asked(reading, rules, ruled, source)
        asked |= {"options": options, "given": given, "allow_approximate": is_nearest_wanted(reading, decisions)}
        found, lag = _converted(source, rules.target, ruled, asked)
    except QuestionError as error:
        for question in error.questions:
            code = _KINDS.get(question.kind) or _code_of_option(source, question.about)
            text, _, _ = question.text.partition("; add for example")
            ranged = question.kind == "range"
            choices = tuple(LoopChoice(a.value, "" if ranged else a.says) for a in question.readings)
            reading.find(code, text, choices=choices)
        return None
    except ConversionRefusedError as error:
        note_refusal(reading, error)
        return None
    except PidemuError as error:
        reading.find("D-refused", str(error))
        return None
    if found.refusal:
        decided = decisions.answer(reading.tag, "D-refused")
        if decided is not None:
            note_decision(reading, decided)
    note_conversion(reading, found, lag, rules, ruled, decisions)
    held = {n: f"{x} ({ruled.origins.get(n, 'match-source')})" for n, x in options.items()}
    return LoopConversion(found, held, _pasted(found), lag)


def _converted(source: Settings, target: Card, ruled: LoopRules, asked: dict[str, Any]) -> tuple[Conversion, float]:
    """Return the conversion, and the filter that is left to be put in front of the target [s]."""
    if ruled.match != EXACT_ELSE:
        found = convert(source, target, match=ruled.match, emulate=False, **asked)
        return found, found.settings.lag
    try:
        found = convert(source, target, match="exact", emulate=False, **{**asked, "allow_approximate": False})
        return found, found.settings.lag
    except QuestionError:
        raise
    except ConversionRefusedError:
        return _by_moments(source, target, asked)


def _by_moments(source: Settings, target: Card, asked: dict[str, Any]) -> tuple[Conversion, float]:
    """Convert by the low-frequency match; a filter of the measurement goes along, and is not absorbed into the dials."""
    lag = filter_time(source)
    dial = filter_dial(target, {n: str(x) for n, x in asked["options"].items()}) if lag else None
    if lag and dial is None:
        return convert(without_filter(source), target, match="low-frequency", emulate=False, **asked), lag
    given = {dial: f"{lag!r} s", **asked["given"]} if dial is not None else asked["given"]
    return convert(source, target, match="low-frequency", emulate=False, **{**asked, "given": given}), 0.0


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


def _code_of_option(source: Settings, option: str) -> str:
    """Return the code for an option that is not stated: equation where units hang on it, form, or structure."""
    variants = [source.card.variant({option: choice}).equation for choice in source.card.options.get(option, ())]
    if len({tuple((n, s.unit) for n, s in v.settings.items()) for v in variants}) > 1:
        return "D-equation"
    return "D-form" if len({v.form for v in variants}) > 1 else "D-structure"


def _pasted(c: Conversion) -> dict[str, float]:
    """Return the target's dials with the source's numbers, converted by their units alone."""
    found: dict[str, float] = {}
    for name, value in c.settings.items():
        own = c.source.by_role(value.role)
        if value.role.value in ("gain", "integral", "derivative") and value.active and own is not None:
            found[name] = from_canonical(value.role, own.canonical, parse_unit(value.unit), FULL)
    return found
