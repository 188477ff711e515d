"""Which unit a setting is in: that of the cell, its column, the header, the mapping, the card, in this order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pidemu.plant.cells import ListCell
from pidemu.plant.fields import Field, folded
from pidemu.plant.layout import ListColumn
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.numbers import CellNumber
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.unit_words import Setting, readings_of, unit_of
from pidemu.units import Dimension, Unit, parse_unit

UNIT_FIELDS: Final[dict[Setting, Field]] = {"gain": "gain_unit", "integral": "integral_unit", "derivative": "derivative_unit"}
_BANDS: Final = ("pb", "pband", "propband", "proportionalband", "xp")
_GAINS: Final = ("gain", "k", "kc", "kp", "pgain", "cfgpgain")
_TIMES: Final = ("ti", "tn", "t1", "int", "integraltime", "nachstellzeit")
_TIMELIKE: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT)
_RATES: Final = (Dimension.REPEATS_PER_TIME, Dimension.PER_TIME)
_ABSOLUTE: Final = (Dimension.OP_PER_PV, Dimension.PERCENT_PER_PV, Dimension.PV_UNITS)
_SAYS: Final = {
    "%": "a proportional band in %",
    "1": "a gain",
    "%/%": "a gain in % per %",
    "min/repeat": "an integral time in minutes",
    "s/repeat": "an integral time in seconds",
    "repeat/min": "a reset rate in repeats per minute",
    "repeat/s": "a reset rate in repeats per second",
}


@dataclass(frozen=True, slots=True)
class UnitReading:
    """The unit of a setting.

    Attributes
    ----------
    unit : str or None
        The unit; ``None`` where it is open.
    source : str
        Where it comes from: ``cell``, ``unit column``, ``header``, ``mapping``, ``card``, ``decision``.
    """

    unit: str | None
    source: str


def stated_unit(
    reading: LoopReading, cells: LoopCells, setting: Setting, found: tuple[ListCell, ListColumn], number: CellNumber, decided: str
) -> UnitReading:
    """Return the unit that cell, unit column or header state; with findings where they contradict or can mean two things.

    Parameters
    ----------
    reading : LoopReading
        Gets the findings.
    cells : LoopCells
        The line.
    setting : str
        The setting.
    found : tuple
        Its cell and column.
    number : CellNumber
        What the cell holds.
    decided : str
        The unit that a person decided; empty where nobody did.
    """
    cell, column = found
    if decided:
        return UnitReading(decided, "decision")
    beside = cells.cell(UNIT_FIELDS[setting])
    said = [(text, place, where) for text, place, where in (
        (number.unit, cell.place, "cell"), ("" if beside is None else beside.text, "" if beside is None else beside.place,
        "unit column"),
    ) if text]  # fmt: skip
    units = []
    for text, place, where in said:
        several = readings_of(setting, text)
        if not several:
            reading.find("E-unit", f"'{text}' is not a unit of {_a(setting)}; write for example {_such(setting)}", place, text)
            return UnitReading(None, where)
        units.append((several, text, place, where))
    clear = [(several[0], where) for several, _, _, where in units if len(several) == 1]
    if len(clear) == 2 and not _alike(clear[0][0], clear[1][0]):
        texts = " and ".join(f"'{text}' in {place}" for _, text, place, _ in units)
        _ask(reading, setting, number, f"cell and unit column contradict each other: {texts}", cell, [u for u, _ in clear])
        return UnitReading(None, "cell")
    if clear:
        return UnitReading(*clear[0])
    if units:
        several, text, place, _ = units[0]
        _ask(reading, setting, number, f"the unit '{text}' in {place} can be read in two ways", cell, list(several))
        return UnitReading(None, "unit column")
    return _of_header(column, setting)


def _of_header(column: ListColumn, setting: Setting) -> UnitReading:
    """Return the unit that a header states: behind its name, or by the name itself (PB, GAIN)."""
    units = {unit_of(setting, name.unit) for name in column.names if name.unit} - {None}
    if len(units) == 1 and len(column.names) == 1:
        return UnitReading(units.pop(), "header")
    words = {folded(name.word) for name in column.names}
    if setting == "gain" and words and words <= set(_BANDS):
        return UnitReading("%", "header")
    if setting == "gain" and words and words <= set(_GAINS):
        return UnitReading("1", "header")
    return UnitReading(None, "")


def header_unit_for(column: ListColumn, setting: Setting, dial: str, own: Unit) -> str | None:
    """Return the unit that a header with several names states for a dial: ``KI [1/s] / TI [min]`` for KI.

    Parameters
    ----------
    column : ListColumn
        The column.
    setting : str
        The setting.
    dial : str
        The dial of the card.
    own : Unit
        Its own unit.
    """
    for name in column.names:
        unit = unit_of(setting, name.unit) if name.unit else None
        if unit is not None and folded(name.word) == folded(dial) and _same_kind(parse_unit(unit), own):
            return unit
    return None


def settled_unit(
    reading: LoopReading, words: PlantWords, setting: Setting, stated: UnitReading, column: ListColumn, dial: str, own: Unit
) -> UnitReading:
    """Return the unit of a dial: the stated one, the mapping's, or the card's own, which is flagged."""
    unit, source = stated.unit, stated.source
    if unit is None:
        unit = header_unit_for(column, setting, dial, own)
        source = "header"
    if unit is None and reading.card is not None:
        unit = words.unit_for(reading.card, setting)
        source = "mapping"
    if unit is None:
        return UnitReading(own.name, "card")
    if unit == "1" and own.dimension in _ABSOLUTE[:2]:  # "gain" on a card whose gain is in other units
        return UnitReading(own.name, source)
    return UnitReading(unit, source)


def says_time(column: ListColumn) -> bool:
    """Whether the header names an integral time, and nothing that could be a rate."""
    words = {folded(name.word) for name in column.names}
    return bool(words) and words <= set(_TIMES)


def is_doubtful_time(unit: Unit, own: Unit, column: ListColumn) -> bool:
    """Whether minutes, without "per", are stated for a dial that counts per minute: many lists leave the "per" out."""
    return (
        unit.dimension is Dimension.TIME
        and own.dimension in _RATES
        and unit.name == own.name.partition("/")[2]
        and not says_time(column)
    )


def is_other(unit: str, own: Unit) -> bool:
    """Whether a unit is another one than the card's: a plain ratio is a gain in % per %, a time is one per repeat."""
    return not _alike(unit, own.name) and not (unit == "1" and own.dimension not in (Dimension.PERCENT, *_ABSOLUTE))


def _alike(a: str, b: str) -> bool:
    one, other = parse_unit(a), parse_unit(b)
    if one.name == other.name:
        return True
    if {one.name, other.name} <= {"1", "%/%", "eu/eu"} and "1" in (one.name, other.name):
        return True
    return _same_kind(one, other) and one.factor == other.factor


def _same_kind(one: Unit, other: Unit) -> bool:
    return (
        any(one.dimension in kinds and other.dimension in kinds for kinds in (_TIMELIKE, _RATES))
        or one.dimension is other.dimension
    )


def _ask(reading: LoopReading, setting: Setting, number: CellNumber, text: str, cell: ListCell, units: list[str]) -> None:
    named = "derivative: " if setting == "derivative" else ""  # a time alone would be that of the integral
    choices = tuple(
        LoopChoice(f"{named}{unit}", f"{number.value:g} is {_SAYS.get(unit, f'{_a(setting)} in {unit}')}") for unit in units
    )
    reading.find("D-unit", f"{setting}: {text}. Which is it?", cell.place, cell.text, choices=choices)


def shown_unit(unit: str) -> str:
    """Return a unit as it is told: a plain ratio is a gain."""
    return "gain" if unit == "1" else unit


def ask_unit(reading: LoopReading, setting: Setting, number: CellNumber, text: str, cell: ListCell, units: list[str]) -> None:
    """Note that a unit is open; `units` are its readings."""
    _ask(reading, setting, number, text, cell, units)


def _a(setting: Setting) -> str:
    return {"gain": "a gain or band", "integral": "an integral setting", "derivative": "a derivative time"}[setting]


def _such(setting: Setting) -> str:
    return {"gain": "gain or PB %", "integral": "min/rep, rep/min or s", "derivative": "min or s"}[setting]
