"""Numbers of a line on the dials of the loop's card, and the settings that they make."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Form
from pidemu.errors import PidemuError, SettingError, UnitError
from pidemu.formatting import exactly
from pidemu.plant.mapping import PlantWords
from pidemu.plant.reading_model import LoopReading, ValueOrigin
from pidemu.plant.settings_units import ask_unit, is_doubtful_time, is_other, settled_unit, shown_unit
from pidemu.plant.source_options import dial_for
from pidemu.plant.stated_loop import ROLES, SettingCell, StatedLoop
from pidemu.plant.unit_words import Setting
from pidemu.settings.settings import limits, off_values
from pidemu.units import Dimension, check_unit, is_reciprocal, parse_unit

_OTHER_READING: Final = {
    "%": "1", "%/%": "%", "min": "s", "s": "min", "min/repeat": "repeat/min", "s/repeat": "min/repeat", "repeat/min": "min/repeat",
    "1/min": "1/s", "1/s": "1/min",
}  # fmt: skip
"""What else a bare number could be."""
_PER_REPEAT: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT, Dimension.REPEATS_PER_TIME)


def on_dials(reading: LoopReading, card: Card, stated: StatedLoop, words: PlantWords) -> dict[str, Any] | None:
    """Return what is given for each dial, as text with a unit or as a number in the card's own."""
    try:
        variant = card.variant(stated.options)
    except PidemuError as error:
        reading.find("D-structure", str(error))
        return None
    given: dict[str, Any] = {}
    for setting, role in ROLES.items():
        dial = dial_for(variant, role)
        found = stated.cells.get(setting)
        if dial is None or found is None:
            continue
        value = _dial_value(reading, words, variant, setting, dial, found)
        if value is None:
            return None
        given[dial] = value
    return given


def _dial_value(
    reading: LoopReading, words: PlantWords, variant: Variant, setting: Setting, dial: str, found: SettingCell
) -> str | float | None:
    role, model = ROLES[setting], variant.equation.settings[dial]
    own, cell = parse_unit(model.unit), found.cell
    off = off_values(model)
    if found.number is None or (setting == "integral" and not found.number.value):
        if setting == "integral":
            reading.find("D-no-integral", f"{dial} is '{cell.text}': there is no integral action", cell.place, cell.text)
            reading.origins[dial] = ValueOrigin(cell.place, cell.text, "off", "cell")
            return off[0] if off else None
        reading.origins[dial] = ValueOrigin(cell.place, cell.text, "off", "cell")
        return off[0] if off else 0.0
    number = found.number.value
    if number < 0 <= limits(model)[0]:
        reading.find("E-negative", f"{dial} is {number:g}; on {variant.card.id} it is not negative", cell.place, cell.text)
        return None
    unit = settled_unit(reading, words, setting, found.unit, found.column, dial, own)
    assert unit.unit is not None
    try:
        written = parse_unit(unit.unit)
        check_unit(role, written)
    except UnitError:
        reading.find("E-unit", f"'{unit.unit}' is not a unit of {dial}", cell.place, cell.text)
        return None
    if unit.source == "card" and number and words.written.blank_units == "ask":
        other = _OTHER_READING.get(own.name, own.name)
        ask_unit(reading, setting, found.number, "no unit is stated", cell, list(dict.fromkeys([own.name, other])))
        return None
    if unit.source != "decision" and _is_doubtful(reading, variant, setting, dial, found, unit.unit):
        return None
    if setting == "gain" and number == 0 and is_reciprocal(role, written):
        reading.find("E-number", f"{dial}: a proportional band of 0 is no band; find out what it is", cell.place, cell.text)
        return None
    reading.origins[dial] = ValueOrigin(cell.place, cell.text, unit.unit, unit.source)
    if unit.source == "card" and number:
        reading.find("F-unit-assumed", f"{dial}: no unit is stated, {own.name} was taken, the card's own", cell.place, cell.text)
    elif is_other(unit.unit, own) and number:
        reading.find(
            "F-unit-other", f"{dial} is stated in {shown_unit(unit.unit)}, the dial is in {own.name}", cell.place, cell.text
        )
    if not number or unit.unit == own.name or (unit.unit == "1" and own.dimension in (Dimension.RATIO, Dimension.OP_PER_PV)):
        return number
    text = "s/repeat" if unit.unit == "s" and setting == "integral" and own.dimension is Dimension.REPEATS_PER_TIME else unit.unit
    text = "min/repeat" if unit.unit == "min" and setting == "integral" and own.dimension is Dimension.REPEATS_PER_TIME else text
    return f"{exactly(number)} {text}"


def _is_doubtful(reading: LoopReading, variant: Variant, setting: Setting, dial: str, found: SettingCell, unit: str) -> bool:
    """Ask about an integral setting whose unit does not say which of two things it is."""
    own, written = parse_unit(variant.equation.settings[dial].unit), parse_unit(unit)
    if setting != "integral" or found.number is None:
        return False
    if is_doubtful_time(written, own, found.column):
        units = [f"{unit}/repeat", own.name]
        ask_unit(reading, setting, found.number, f"'{unit}' stands for a dial that counts {own.name}", found.cell, units)
        return True
    parallel = variant.equation.form is Form.PARALLEL and own.dimension not in _PER_REPEAT
    if parallel and written.dimension in _PER_REPEAT:
        text = f"{unit} goes with the gain, but {dial} of {reading.card and reading.card.id} is a gain of its own, in {own.name}"
        ask_unit(reading, setting, found.number, text, found.cell, [own.name, unit])
        return True
    return False


def make_settings_of(reading: LoopReading, card: Card, stated: StatedLoop, given: Mapping[str, Any]) -> None:
    """Make settings of what is given for the dials; what the card refuses is a finding."""
    ranges = {"pv_range": stated.pv_range, "op_range": stated.op_range}
    everything = {**stated.options, **stated.dials, **given, **{k: v for k, v in ranges.items() if v is not None}}
    try:
        reading.settings = card.settings(everything)
    except (SettingError, UnitError) as error:
        for line in str(error).splitlines():
            reading.find(*_classified(line.removeprefix(f"{card.id}: ")), *_origin(reading, line))


def _origin(reading: LoopReading, text: str) -> tuple[str, str]:
    """Return place and text of the cell of the dial that a message is about."""
    found = next((origin for dial, origin in reading.origins.items() if f" {dial}: " in f" {text}"), None)
    return ("", "") if found is None else (found.place, found.cell)


def _classified(message: str) -> tuple[str, str]:
    """Return the code of what is wrong with settings."""
    if "must be given" in message:
        return "D-range", message
    if "missing" in message:
        return "E-missing", message
    if "infinite action" in message:
        return "E-number", message
    return ("E-unit" if "unit" in message and "outside" not in message else "E-range"), message
