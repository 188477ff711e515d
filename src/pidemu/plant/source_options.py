"""Options of a loop's card: what its cells state, and what they leave open."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Final

from pidemu.card.load import Card, Variant, match_name
from pidemu.errors import PidemuError
from pidemu.plant.fields import Field
from pidemu.plant.loop_cells import BLANKS, LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.option_words import form_named
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.units import Role

OPTION_FIELDS: Final[tuple[Field, ...]] = ("form", "equation", "structure", "derivative_of")
"""Columns whose words are choices of options."""
_CODE: Final[dict[Field, str]] = {
    "form": "D-form",
    "equation": "D-equation",
    "structure": "D-structure",
    "derivative_of": "D-structure",
}
_ASSIGNMENT: Final = re.compile(r"([A-Za-z_]\w*)\s*[=:]\s*([^\s,;]+)")
_ROLES: Final = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)


def stated_options(reading: LoopReading, card: Card, cells: LoopCells, words: PlantWords) -> tuple[dict[str, str], dict[str, str]]:
    """Return the options that a line states, and dials that stand among them (``K=1``); unknown words are findings.

    Parameters
    ----------
    reading : LoopReading
        Gets the findings.
    card : Card
        The card.
    cells : LoopCells
        The line.
    words : PlantWords
        What the plant's words mean.
    """
    options: dict[str, str] = {}
    dials: dict[str, str] = {}
    unknown: list[tuple[Field, str, str]] = []
    for field in OPTION_FIELDS:
        for cell, _ in cells.filled(field):
            text = cell.text
            if text.casefold() in BLANKS[:-1]:
                continue
            meaning = words.options.meaning(card, text)
            if meaning is not None:
                _state(reading, options, meaning, field, cell.place, text)
                continue
            assigned = _assigned(card, text)
            if assigned is not None:
                (options if match_name(assigned[0], card.data.options) else dials)[assigned[0]] = assigned[1]
            else:
                unknown.append((field, text, cell.place))
    for field, text, place in unknown:
        if not _agrees(card, options, field, text):
            reading.find(
                _CODE[field], f"'{text}' is not a word for an option of {card.id}; add it to the mapping, or correct it",
                place, text,
                choices=tuple(LoopChoice(c, o) for o, choices in card.options.items() for c in choices)[:6],
            )  # fmt: skip
    return options, dials


def _state(reading: LoopReading, options: dict[str, str], meaning: tuple[str, str], field: Field, place: str, text: str) -> None:
    option, choice = meaning
    if options.setdefault(option, choice) != choice:
        choices = (LoopChoice(options[option]), LoopChoice(choice))
        reading.find(_CODE[field], f"{option} is stated twice, {options[option]} and {choice}", place, text, choices=choices)


def _assigned(card: Card, text: str) -> tuple[str, str] | None:
    """Return a dial or option that a cell sets: ``K=1``."""
    match = _ASSIGNMENT.fullmatch(text)
    if match is None:
        return None
    name = match_name(match[1], card.all_settings()) or match_name(match[1], card.data.options)
    return None if name is None else (name, match[2].replace(",", "."))


def _agrees(card: Card, options: Mapping[str, str], field: Field, text: str) -> bool:
    """Whether a word only says what the card does anyway: its form, or what its derivative acts on."""
    equation = card.variant(options).equation
    if field == "derivative_of":
        return {"pv": "pv", "measurement": "pv", "error": "error", "e": "error"}.get(text.casefold()) == equation.derivative.on
    form = form_named(text)
    return form is not None and form is equation.form


def open_equations(card: Card, stated: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the options that are not stated and on which both the form and the units of the settings hang, with their choices."""
    for option, choices in card.options.items():
        if option in stated:
            continue
        variants = [card.variant({**stated, option: choice}) for choice in choices]
        if len({v.equation.form for v in variants}) > 1 and len({unit_key(v) for v in variants}) > 1:
            yield option, choices


def unit_choices(card: Card, stated: Mapping[str, str]) -> Iterator[tuple[str, dict[str, Variant]]]:
    """Yield the options that are not stated and only say in which unit or dial a setting stands, with the variants they make."""
    for option, choices in card.options.items():
        if option in stated:
            continue
        variants = {choice: card.variant({**stated, option: choice}) for choice in choices}
        same_form = len({v.equation.form for v in variants.values()}) == 1
        if same_form and len({unit_key(v) for v in variants.values()}) > 1:
            yield option, variants


def unit_key(variant: Variant) -> tuple[tuple[str, str, str], ...]:
    """Return dials and units of gain, integral and derivative."""
    settings = variant.equation.settings.items()
    return tuple(sorted((s.sets, name, s.unit) for name, s in settings if s.sets in _ROLES))


def dial_for(variant: Variant, role: Role) -> str | None:
    """Return the dial that sets a role; ``None`` where the variant has none."""
    return next((name for name, s in variant.equation.settings.items() if s.sets == role), None)


def decisive(card: Card, stated: Mapping[str, str], option: str) -> bool:
    """Whether the choices of an option differ in form, so that it matters once derivative is used."""
    forms = set()
    for choice in card.options[option]:
        try:
            equation = card.variant({**stated, option: choice}).equation
        except PidemuError:
            continue
        if "none" not in (equation.derivative.on, equation.proportional.on):
            forms.add(equation.form)
    return len(forms) > 1
