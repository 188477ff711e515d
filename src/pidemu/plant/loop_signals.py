"""A loop's ranges, limits, intervals, filter, action and mode."""

from __future__ import annotations

import re
from typing import Final

from pidemu.card.load import Card
from pidemu.errors import SettingError
from pidemu.plant.cells import ListCell
from pidemu.plant.decisions import Decisions, note_decision
from pidemu.plant.fields import Field
from pidemu.plant.layout import ListColumn
from pidemu.plant.loop_cells import BLANKS, LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.numbers import CellError, cell_number
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.unit_words import unit_of
from pidemu.plant.words import mode_named, range_change
from pidemu.settings.action import ACTIONS, FORMULA, Action
from pidemu.settings.ranges import SignalRange, read_range

_ONE_CELL: Final = re.compile(
    r"\s*([-+]?\d+(?:[.,]\d+)?)\s*(?:\.\.+|-|–|…|to|bis|/)\s*([-+]?\d+(?:[.,]\d+)?)\s*(\D.*)?", re.IGNORECASE
)
_SECONDS: Final = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_OTHER_ACTION: Final[dict[Action, Action]] = {"reverse": "direct", "direct": "reverse"}
COUNTS: Final = "counts"


def read_pv_range(reading: LoopReading, cells: LoopCells, decisions: Decisions) -> SignalRange | None:
    """Return the measurement's range, where the line states one; a decision comes first."""
    decided = decisions.answer(reading.tag, "D-range")
    if decided is not None:
        try:
            found = read_range(decided.answer)
        except SettingError as error:
            reading.find("D-range", f"the decision '{decided.answer}' cannot be read: {error}", decided.place)
            return None
        note_decision(reading, decided)
        return found
    return _range(reading, cells, ("pv_low", "pv_high", "pv_range"), "the measurement")


def read_op_range(reading: LoopReading, cells: LoopCells) -> SignalRange | None:
    """Return the output's range, where the line states one."""
    return _range(reading, cells, ("out_low", "out_high", None), "the output")


def read_new_range(reading: LoopReading, cells: LoopCells, decisions: Decisions) -> None:
    """Read the range that the measurement gets, and whether it is the same signal on another scale."""
    new = _range(reading, cells, ("new_low", "new_high", "new_range"), "the new measurement")
    said = range_change(cells.text("reranged"))
    decided = decisions.answer(reading.tag, "D-rerange")
    if decided is not None and range_change(decided.answer):
        said = range_change(decided.answer)
        note_decision(reading, decided)
    place = cells.place("new_low") or cells.place("new_range")
    if new is None:
        if said == "other range" and not reading.stops("error"):
            reading.find("D-rerange", "the range is said to be another one, and no new range is stated", cells.place("reranged"))
        return
    old = reading.pv_range
    if old is not None and old.ends == new.ends:
        return
    reading.new_range, reading.rerange = new, said
    if not said:
        choices = (
            LoopChoice("same signal", f"{old} becomes {new}: the same signal on another scale, the gain stays"),
            LoopChoice("other range", f"{old} becomes {new}: another range, the gain changes with the span"),
        )
        reading.find(
            "D-rerange", f"the new range is {new}, and not whether it is the same signal. Which is it?", place, choices=choices
        )
    elif old is None:
        reading.find("D-range", f"the measurement gets the range {new}, and its range now is not stated", cells.place("pv_low"))


def _range(reading: LoopReading, cells: LoopCells, fields: tuple[Field, Field, Field | None], what: str) -> SignalRange | None:
    low, high = (_number(reading, cells, field) for field in fields[:2])
    unit = cells.text("pv_unit") if what != "the output" else "%"
    place = cells.place(fields[0])
    if low is None and high is None and fields[2] is not None and cells.text(fields[2]):
        match = _ONE_CELL.fullmatch(cells.text(fields[2]))
        place = cells.place(fields[2])
        if match is None:
            reading.find(
                "E-range", f"'{cells.text(fields[2])}' is not a range; write it such as 0..250 °C", place, cells.text(fields[2])
            )
            return None
        low, high = (float(x.replace(",", ".")) for x in match.groups()[:2])
        unit = (match[3] or unit).strip()
    if low is None or high is None:
        return None
    if not low < high:
        text = f"the range of {what} is {low:g} to {high:g}; its low end is not below its high end"
        reading.find("E-range", text, place, f"{low:g} to {high:g}")
        return None
    return SignalRange(low, high, unit)


def _number(reading: LoopReading, cells: LoopCells, field: Field) -> float | None:
    """Return the number of a cell that may be left open."""
    cell = cells.cell(field)
    if cell is None or cell.text.casefold() in BLANKS:
        return None
    try:
        return cell_number(cell, cells.comma).value
    except CellError as error:
        reading.find(error.code, f"{field.replace('_', ' ')}: {error}", cell.place, cell.text)
        return None


def read_limits(reading: LoopReading, cells: LoopCells) -> None:
    """Read the output limits."""
    low, high = (_number(reading, cells, field) for field in ("out_limit_low", "out_limit_high"))
    if low is None or high is None:
        return
    place = cells.place("out_limit_low")
    if not low < high:
        reading.find("E-range", f"the output limits are {low:g} and {high:g}; the low one is not below the high one", place)
        return
    reading.limits = (low, high)
    if (low, high) != (0, 100):
        reading.find("F-limits", f"the output limits are {low:g} and {high:g}: set them on the target, in its units", place)


def read_intervals(reading: LoopReading, cells: LoopCells, decisions: Decisions) -> None:
    """Read the interval of execution and the one that the block computes with; where they differ, a person decides."""
    reading.scan = _time(reading, cells, "scan")
    update = _time(reading, cells, "update")
    if update is None or reading.scan is None or update == reading.scan:
        reading.scan = reading.scan if reading.scan is not None else update
        return
    decided = decisions.answer(reading.tag, "D-update")
    if decided is not None and decided.answer.casefold() in ("scan", "real"):
        note_decision(reading, decided)
        reading.computes_with = update if decided.answer.casefold() == "real" else None
        return
    text = f"the block is executed every {reading.scan:g} s and computes with {update:g} s. Which is right?"
    choices = (
        LoopChoice("scan", f"it computes with {reading.scan:g} s; the update time in the list is wrong"),
        LoopChoice("real", f"its times are {reading.scan / update:g} times those on its dials, and that shall be kept"),
    )
    reading.find("D-update", text, cells.place("update"), cells.text("update"), choices=choices, measure=update / reading.scan)


def read_filter(reading: LoopReading, cells: LoopCells) -> float:
    """Return the time of a filter of the measurement [s]; 0 where there is none."""
    cell = cells.cell("pv_filter")
    if cell is not None and cell.text.casefold() in ("off", "aus"):
        return 0.0
    found = _time(reading, cells, "pv_filter")
    return 0.0 if found is None else found


def _time(reading: LoopReading, cells: LoopCells, field: Field) -> float | None:
    filled = cells.filled(field)
    if not filled or filled[0][0].text.casefold() in BLANKS:
        return None
    cell, column = filled[0]
    try:
        number = cell_number(cell, cells.comma)
    except CellError as error:
        reading.find(error.code, f"{field.replace('_', ' ')}: {error}", cell.place, cell.text)
        return None
    unit = _time_unit(number.unit, column)
    if unit is None or number.value < 0 or (number.value == 0 and field != "pv_filter"):
        reading.find(
            "E-unit" if unit is None else "E-number", f"{field.replace('_', ' ')}: '{cell.text}' is not a time", *_at(cell)
        )
        return None
    return number.value * unit


def _at(cell: ListCell) -> tuple[str, str]:
    return cell.place, cell.text


def _time_unit(text: str, column: ListColumn) -> float | None:
    """Return a time unit in seconds; seconds where neither cell nor header state one."""
    stated = text or next((name.unit for name in column.names if name.unit), "s")
    return _SECONDS.get(unit_of("derivative", stated) or "")


def read_action(reading: LoopReading, cells: LoopCells, words: PlantWords, decisions: Decisions, card: Card) -> None:
    """Read the control action; a word that means the opposite on this card is open unless the mapping says what it means."""
    cell = cells.cell("action")
    text = "" if cell is None else cell.text
    decided = decisions.answer(reading.tag, "D-action")
    if decided is not None and (meant := words.actions.meaning(decided.answer)):
        note_decision(reading, decided)
        reading.action = meant
        return
    action = words.actions.meaning(text) if text else None
    if card.data.action.fixed and not text:
        return
    if action is not None and not _is_crossed(card, action, text, words):
        reading.action = action
        return
    names = card.data.action.names
    choices = tuple(LoopChoice(a, f"error {FORMULA[a]}: {names[a]}") for a in ACTIONS)
    said = f"'{text}' is not a word for an action" if action is None and text else "the action is blank"
    if action is not None:
        said = f"on {card.id} '{text}' is {names[_OTHER_ACTION[action]]}, which acts the other way; the mapping does not "
        "say what it means"
    place, own = ("", "") if cell is None else _at(cell)
    reading.find(
        "D-action",
        f"{said}. Does the output fall or rise when the measurement rises?",
        place or cells.place("action"),
        own,
        choices=choices,
    )


def _is_crossed(card: Card, action: Action, text: str, words: PlantWords) -> bool:
    """Whether the card's own word for the other action is what was written."""
    if words.actions.is_mapped(text):
        return False
    own, other = (card.data.action.names[a].casefold() for a in (action, _OTHER_ACTION[action]))
    return action in other and action not in own


def read_mode(reading: LoopReading, cells: LoopCells) -> None:
    """Read the mode; manual and cascade are told."""
    text = cells.text("mode")
    reading.mode = mode_named(text) if text else None
    if reading.mode == "manual":
        reading.find("F-manual", "the loop was in manual when the list was made", cells.place("mode"), text)
    if reading.mode == "cascade":
        reading.find("F-cascade", "the loop is in cascade, and the list does not name its master", cells.place("mode"), text)
