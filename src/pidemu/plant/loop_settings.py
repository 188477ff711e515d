"""A loop's settings: the numbers of its cells on the dials of its card."""

from __future__ import annotations

from typing import Final

from pidemu.card.load import Card, Variant
from pidemu.plant.decisions import Decisions, note_decision
from pidemu.plant.dials import make_settings_of, on_dials
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.numbers import CellError, cell_number
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.settings_units import UnitReading, ask_unit, stated_unit
from pidemu.plant.source_options import dial_for, open_equations, unit_choices
from pidemu.plant.stated_loop import ROLES, SettingCell, StatedLoop
from pidemu.plant.unit_words import Setting, unit_of
from pidemu.units import Role, is_reciprocal, parse_unit

_OFF: Final = ("off", "aus", "none", "-", "--", "nil")
_NEVER: Final = ("inf", "infinite", "infinity", "∞")
"""An integral time that is none."""


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
    for setting in ROLES:
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
    given = on_dials(reading, card, stated, words)
    if given is not None:
        make_settings_of(reading, card, stated, given)


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
        for setting, role in ROLES.items():
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
