"""A loop's settings: the numbers of its cells on the dials of its card."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Form
from pidemu.errors import PidemuError, SettingError, UnitError
from pidemu.formatting import exactly
from pidemu.plant.cells import ListCell
from pidemu.plant.decisions import Decisions, note_decision
from pidemu.plant.layout import ListColumn
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.numbers import CellError, CellNumber, cell_number
from pidemu.plant.reading_model import LoopChoice, LoopReading, ValueOrigin
from pidemu.plant.settings_units import UnitReading, ask_unit, is_doubtful_time, is_other, settled_unit, shown_unit, stated_unit
from pidemu.plant.source_options import dial_for, open_equations, unit_choices
from pidemu.plant.unit_words import Setting, unit_of
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings, limits, off_values
from pidemu.units import Dimension, Role, check_unit, is_reciprocal, parse_unit

_ROLES: Final[dict[Setting, Role]] = {"gain": Role.GAIN, "integral": Role.INTEGRAL, "derivative": Role.DERIVATIVE}
_OTHER_READING: Final = {
    "%": "1", "%/%": "%", "min": "s", "s": "min", "min/repeat": "repeat/min", "s/repeat": "min/repeat", "repeat/min": "min/repeat",
    "1/min": "1/s", "1/s": "1/min",
}  # fmt: skip
"""What else a bare number could be."""
_OFF: Final = ("off", "aus", "none", "-", "--", "nil")
_NEVER: Final = ("inf", "infinite", "infinity", "∞")
"""An integral time that is none."""
_TIMES: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT)
_PER_REPEAT: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT, Dimension.REPEATS_PER_TIME)


@dataclass
class SettingCell:
    """A gain, an integral or a derivative as a line states it.

    Attributes
    ----------
    cell, column
        Where it stands.
    number : CellNumber or None
        What it holds; ``None`` where it is switched off.
    unit : UnitReading
        The unit that is stated.
    """

    cell: ListCell
    column: ListColumn
    number: CellNumber | None
    unit: UnitReading


@dataclass
class StatedLoop:
    """What a line states of a loop's settings, before they stand on dials.

    Attributes
    ----------
    options : dict
        Options that it states.
    dials : dict
        Dials that it states by name.
    cells : dict of str to SettingCell
        Gain, integral and derivative.
    pv_range, op_range : SignalRange or None
        The ranges.
    """

    options: dict[str, str]
    dials: dict[str, Any]
    cells: dict[Setting, SettingCell] = field(default_factory=dict)
    pv_range: SignalRange | None = None
    op_range: SignalRange | None = None


def read_settings(reading: LoopReading, cells: LoopCells, words: PlantWords, decisions: Decisions, stated: StatedLoop) -> None:
    """Read gain, integral and derivative, and make settings of them; what cannot be read, or can be read twice, is a finding.

    Parameters
    ----------
    reading : LoopReading
        Gets settings, origins and findings.
    cells : LoopCells
        The line.
    words : PlantWords
        What the plant's words mean.
    decisions : Decisions
        What people decided.
    stated : StatedLoop
        Options, dials and ranges that were read before; gets the cells.
    """
    card = reading.card
    assert card is not None
    for setting in _ROLES:
        found = _cell(reading, cells, setting, decisions)
        if found is not None:
            stated.cells[setting] = found
    if _all_zero(stated):
        reading.find("D-unused", "all settings are zero: nothing was ever set", cells.place("gain"))
        return
    for option, choices in open_equations(card, stated.options):
        decided = _decided_choice(reading, words, decisions, "D-equation", option, choices)
        if decided:
            stated.options[option] = decided
            continue
        text = f"{option} is not stated, and the units of the settings hang on it. Which is it?"
        reading.find("D-equation", text, cells.place("equation") or cells.place("form"), choices=tuple(map(LoopChoice, choices)))
    if reading.stops("error", "decision") and any(
        f.code in ("D-equation", "D-unit") or f.level == "error" for f in reading.findings
    ):
        return
    _choose_units(reading, card, stated, words)
    if reading.stops("error") or any(f.code == "D-unit" for f in reading.findings):
        return
    given = _on_dials(reading, card, stated, words)
    if given is not None:
        _make(reading, card, stated, given)


def _all_zero(stated: StatedLoop) -> bool:
    """Whether gain and integral are stated, and every number is zero."""
    numbers = [found.number for found in stated.cells.values()]
    return len(numbers) >= 2 and all(number is not None and not number.value for number in numbers)


def _cell(reading: LoopReading, cells: LoopCells, setting: Setting, decisions: Decisions) -> SettingCell | None:
    filled = cells.filled(setting)
    if not filled:
        if setting != "derivative":
            reading.find("E-missing", f"the {setting} is blank", cells.place(setting))
        return None
    cell, column = filled[0]
    if len(filled) > 1 and any(other.text != cell.text for other, _ in filled[1:]):
        both = " and ".join(f"{c.text} in {c.place} under '{k.header}'" for c, k in filled)
        reading.find("D-unit", f"two columns hold the {setting}: {both}. Which counts?", cell.place, cell.text)
        return None
    if setting != "gain" and cell.text.casefold() in (*_OFF, *(_NEVER if setting == "integral" else ())):
        return SettingCell(cell, column, None, UnitReading(None, ""))
    try:
        number = cell_number(cell, cells.comma)
    except CellError as error:
        reading.find(error.code, f"{setting}: {error}", cell.place, cell.text)
        return None
    return SettingCell(
        cell,
        column,
        number,
        stated_unit(reading, cells, setting, (cell, column), number, _decided_unit(reading, setting, decisions)),
    )


def _decided_unit(reading: LoopReading, setting: Setting, decisions: Decisions) -> str:
    """Return the unit of a setting that a person decided; ``SETTING: UNIT`` says of which, where it could be another's."""
    found = decisions.answer(reading.tag, "D-unit")
    if found is None:
        return ""
    name, colon, text = found.answer.partition(":")
    if colon and name.strip().casefold() != setting:
        return ""
    unit = unit_of(setting, text if colon else name)
    if unit is None or (not colon and setting == "derivative"):
        return ""
    if not colon and setting == "integral" and unit_of("gain", name) is not None:
        return ""
    note_decision(reading, found)
    return unit


def _decided_choice(
    reading: LoopReading, words: PlantWords, decisions: Decisions, code: str, option: str, choices: tuple[str, ...]
) -> str:
    """Return the choice of an option that a person decided; empty where nobody did."""
    found = decisions.answer(reading.tag, code)
    if found is None or reading.card is None:
        return ""
    meaning = words.options.meaning(reading.card, found.answer)
    choice = meaning[1] if meaning is not None and meaning[0] == option else found.answer
    if choice not in choices:
        return ""
    note_decision(reading, found)
    return choice


def _choose_units(reading: LoopReading, card: Card, stated: StatedLoop, words: PlantWords) -> None:
    """Choose options that only say in which unit a setting stands, by the units that are stated."""
    for option, variants in unit_choices(card, stated.options):
        for setting, role in _ROLES.items():
            units = {choice: _own_unit(variant, role) for choice, variant in variants.items()}
            if len(set(units.values())) < 2 or setting not in stated.cells:
                continue
            found = stated.cells[setting]
            unit = found.unit.unit or words.unit_for(card, setting)
            if unit is None:
                otherwise = len({is_reciprocal(role, parse_unit(own)) for own in units.values() if own}) > 1
                if found.number is not None and (otherwise or words.written.blank_units == "ask"):
                    ask_unit(reading, setting, found.number, "no unit is stated", found.cell, [u for u in units.values() if u])
                elif found.number is not None:
                    stated.options[option] = card.variant({}).chosen[option]
                continue
            same = [
                c
                for c, own in units.items()
                if own and is_reciprocal(role, parse_unit(own)) == is_reciprocal(role, parse_unit(unit))
            ]
            if same:
                stated.options[option] = same[0]


def _own_unit(variant: Variant, role: Role) -> str:
    name = dial_for(variant, role)
    return "" if name is None else variant.equation.settings[name].unit


def _on_dials(reading: LoopReading, card: Card, stated: StatedLoop, words: PlantWords) -> dict[str, Any] | None:
    """Return what is given for each dial, as text with a unit or as a number in the card's own."""
    try:
        variant = card.variant(stated.options)
    except PidemuError as error:
        reading.find("D-structure", str(error))
        return None
    given: dict[str, Any] = {}
    for setting, role in _ROLES.items():
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
    role, model = _ROLES[setting], variant.equation.settings[dial]
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


def _make(reading: LoopReading, card: Card, stated: StatedLoop, given: Mapping[str, Any]) -> None:
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


def note_settings(reading: LoopReading, settings: Settings) -> None:
    """Note what is remarkable about settings: never tuned, without gain, unused, out of proportion.

    Parameters
    ----------
    reading : LoopReading
        Gets the findings.
    settings : Settings
        The settings.
    """
    dials = {role: settings.by_role(role) for role in _ROLES.values()}
    gain, integral, derivative = (dials[role] for role in _ROLES.values())
    values = [v for v in (gain, integral, derivative) if v is not None]
    if values and all(not v.value or v.off for v in values):
        reading.find("D-unused", "all settings are zero: nothing was ever set")
    elif gain is not None and not gain.value:
        reading.find("D-zero-gain", f"{gain.name} is 0, and other settings are not")
    tuned = [v for v in (gain, integral) if v is not None]
    delivered = len(tuned) == 2 and all(v.setting.default is not None and v.value == v.setting.default for v in tuned)
    if delivered and (derivative is None or derivative.off or derivative.value == derivative.setting.default):
        reading.find("D-default", f"the settings are those that {settings.card.id} is delivered with")
    law = settings.algorithm()
    if not law.ki and not {"D-no-integral", "D-unused", "D-zero-gain"} & set(reading.codes):
        reading.find("D-no-integral", "there is no integral action")
    times = times_of(settings)
    if times is not None and times[1] > times[0]:
        reading.find("F-td-ti", f"the derivative time, {times[1]:g} s, is longer than the integral time, {times[0]:g} s")


def times_of(settings: Settings) -> tuple[float, float] | None:
    """Return integral and derivative time [s], those on the dials, or of gains of their own those that these amount to.

    Parameters
    ----------
    settings : Settings
        The settings.

    Returns
    -------
    tuple of float or None
        ``None`` without gain or integral action.
    """
    law = settings.algorithm()
    if not (law.ki and law.kp):
        return None
    integral, derivative = settings.by_role(Role.INTEGRAL), settings.by_role(Role.DERIVATIVE)
    if settings.equation.form is Form.PARALLEL or integral is None:
        return law.kp / law.ki, law.kd / law.kp
    return 1 / integral.canonical, 0.0 if derivative is None else derivative.canonical
