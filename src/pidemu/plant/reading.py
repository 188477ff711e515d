"""A line of a list to a loop: card, options, settings, signals, and everything that was found on the way."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from pidemu.certificate.models import EXACT
from pidemu.conversion.modes import depends_on_mode
from pidemu.errors import PidemuError
from pidemu.plant.decisions import Decisions, note_decision, pass_over
from pidemu.plant.layout import ListLayout
from pidemu.plant.lines import LoopLine
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.loop_settings import read_settings
from pidemu.plant.loop_signals import (
    read_action,
    read_filter,
    read_intervals,
    read_limits,
    read_mode,
    read_new_range,
    read_op_range,
    read_pv_range,
)
from pidemu.plant.mapping import PlantWords
from pidemu.plant.reading_model import LoopChoice, LoopReading
from pidemu.plant.settings_notes import note_settings
from pidemu.plant.source_options import decisive, stated_options
from pidemu.plant.stated_loop import StatedLoop
from pidemu.plant.words import beyond_pid, says_unused
from pidemu.settings.settings import Settings
from pidemu.units import Role


def read_loop(loop: LoopLine, layout: ListLayout, words: PlantWords, decisions: Decisions) -> LoopReading:
    """Read a line of a list.

    Parameters
    ----------
    loop : LoopLine
        The line.
    layout : ListLayout
        The columns of its sheet.
    words : PlantWords
        What the plant's words mean.
    decisions : Decisions
        What people decided.
    """
    cells = LoopCells(loop, layout)
    reading = LoopReading(
        layout.sheet.file,
        layout.sheet.name,
        loop.line.number,
        cells.text("tag"),
        cells.text("service"),
        cells.text("area") or loop.area,
        cells.text("system") or words.system_of(layout.sheet.name),
        contents=cells.contents,
    )
    if loop.line.hidden:
        reading.find("F-hidden-row", "the line is hidden in the spreadsheet", f"line {loop.line.number}")
    for column in cells.hidden:
        reading.find(
            "F-hidden-row", f"the column '{column.header}' is hidden in the spreadsheet", cells.line.cells[column.index].place
        )
    if not reading.tag:
        reading.find("E-tag", "the tag is blank", cells.place("tag"))
    _read_card(reading, cells, words)
    _read_remarks(reading, cells)
    read_mode(reading, cells)
    read_intervals(reading, cells, decisions)
    read_limits(reading, cells)
    reading.pv_range = read_pv_range(reading, cells, decisions)
    read_new_range(reading, cells, decisions)
    if reading.card is not None:
        read_action(reading, cells, words, decisions, reading.card)
        options, dials = stated_options(reading, reading.card, cells, words)
        stated = StatedLoop(options, dials, {}, reading.pv_range, read_op_range(reading, cells))
        _put_filter(reading, stated, read_filter(reading, cells))
        read_settings(reading, cells, words, decisions, stated)
        reading.stated = stated.options
    if reading.settings is not None:
        note_settings(reading, reading.settings)
        _ask_form(reading, words, decisions)
        ask_mode(reading, decisions)
        take_bias(reading, decisions)
    pass_over(reading, decisions)
    return reading


def _read_card(reading: LoopReading, cells: LoopCells, words: PlantWords) -> None:
    try:
        reading.card = words.card_of(reading.system) if reading.system else None
    except PidemuError as error:
        reading.find("E-card", str(error), cells.place("system"), reading.system)
        return
    if reading.card is None:
        what = f"'{reading.system}' is not a card, nor a word of the mapping" if reading.system else "the system is blank"
        where = "systems:" if reading.system else "sheet-systems:"
        text = f"{what}; name it in the mapping under {where} (pidemu cards lists the cards)"
        reading.find("E-card", text, cells.place("system"), reading.system)


def _read_remarks(reading: LoopReading, cells: LoopCells) -> None:
    options, remarks = cells.text("options"), cells.text("remarks")
    more = beyond_pid(options, remarks)
    if more:
        place = cells.place("options") if options else cells.place("remarks")
        reading.find("D-nonlinear", f"the loop has {more}. What becomes of it?", place, options or remarks)
    unused = says_unused(remarks, reading.service)
    if unused:
        reading.find("D-unused", f"the list says '{unused}'", cells.place("remarks"), remarks)


def _put_filter(reading: LoopReading, stated: StatedLoop, time: float) -> None:
    """Put a filter of the measurement on the card's own dial, or in front of the block."""
    if not time or reading.card is None:
        return
    dial = next(
        (
            n
            for n, s in reading.card.all_settings().items()
            if s.sets == Role.FILTER_TIME.value and "measurement" in (s.about or "")
        ),
        None,
    )
    if dial is not None:
        stated.dials[dial] = f"{time!r} s"
    else:
        reading.pv_filter = time


def _ask_form(reading: LoopReading, words: PlantWords, decisions: Decisions) -> None:
    """Ask for options that make another form and are not stated, where derivative is used."""
    card, settings = reading.card, reading.settings
    if card is None or settings is None or not settings.algorithm().kd:
        return
    for option in card.options:
        if option in reading.stated or not decisive(card, reading.stated, option):
            continue
        if not _take_choice(reading, words, decisions, "D-form", option):
            text = f"{option} is not stated, and with derivative it makes another controller. Which is it?"
            reading.find("D-form", text, choices=_choices(settings, option))


def _take_choice(reading: LoopReading, words: PlantWords, decisions: Decisions, code: str, option: str) -> bool:
    """Set an option that a person decided; return whether one did."""
    found = decisions.answer(reading.tag, code)
    if found is None or reading.card is None or reading.settings is None:
        return False
    meaning = words.options.meaning(reading.card, found.answer)
    choice = meaning[1] if meaning is not None and meaning[0] == option else found.answer
    if choice not in reading.card.options[option]:
        return False
    note_decision(reading, found)
    reading.stated[option] = choice
    reading.settings = reading.settings.changed({option: choice})
    return True


def _choices(settings: Settings, option: str) -> tuple[LoopChoice, ...]:
    """Return the choices of an option, each with what the gain of the controller becomes against the first."""
    found = []
    base = settings.algorithm()
    for choice in settings.card.options[option]:
        try:
            a = settings.changed({option: choice}).algorithm()
        except PidemuError:
            continue
        found.append(
            LoopChoice(choice, f"kp {a.kp:.4g}, ki {a.ki:.4g} 1/s, kd {a.kd:.4g} s", ratio=a.kp / base.kp if base.kp else 1.0)
        )
    return tuple(found)


def ask_mode(reading: LoopReading, decisions: Decisions) -> None:
    """Ask for the mode where the equation follows it and it is not known."""
    if (
        reading.settings is None
        or reading.card is None
        or reading.mode in ("auto", "cascade")
        or not depends_on_mode(reading.settings)
    ):
        return
    decided = decisions.answer(reading.tag, "D-mode")
    if decided is not None and decided.answer.casefold() in ("auto", "cascade"):
        note_decision(reading, decided)
        reading.mode = decided.answer.casefold()
        return
    choices = (LoopChoice("auto", "the operator sets the setpoint"), LoopChoice("cascade", "another controller sets the setpoint"))
    text = f"on {reading.card.id} other terms see the setpoint in cascade, and the mode is {reading.mode or 'not stated'}. "
    "Which is it?"
    reading.find("D-mode", text, choices=choices)


def take_bias(reading: LoopReading, decisions: Decisions) -> None:
    """Take the bias that a person chose for a loop without integral action."""
    decided = decisions.answer(reading.tag, "D-no-integral")
    if decided is None or "D-no-integral" not in reading.codes:
        return
    try:
        reading.bias = float(decided.answer.removesuffix("%").replace(",", "."))
    except ValueError:
        return
    reading.findings[:] = [f for f in reading.findings if f.code != "D-no-integral"]
    note_decision(reading, decided)


def ask_structures(readings: Iterable[LoopReading], words: PlantWords, decisions: Decisions) -> None:
    """Ask which terms see the setpoint, where a list states it for other loops of the same card.

    Parameters
    ----------
    readings : iterable of LoopReading
        All loops of the job.
    words : PlantWords
        What the plant's words mean.
    decisions : Decisions
        What people decided.
    """
    readings = list(readings)
    stated: dict[str, set[str]] = defaultdict(set)
    for reading in readings:
        if reading.card is not None:
            stated[reading.card.id] |= set(reading.stated)
    for reading in readings:
        if reading.card is None or reading.settings is None:
            continue
        for option in sorted(stated[reading.card.id] - set(reading.stated)):
            if not _matters(reading.settings, option) or _take_choice(reading, words, decisions, "D-structure", option):
                continue
            if "D-form" in reading.codes and decisive(reading.card, reading.stated, option):
                continue
            text = f"{option} is not stated, though the list states it for other loops of {reading.card.id}. Which is it?"
            reading.find("D-structure", text, choices=_choices(reading.settings, option))


def _matters(settings: Settings, option: str) -> bool:
    """Whether the choices of an option make other laws, for measurement or setpoint, out of the same settings."""
    base = settings.algorithm()
    numbers = (base.kp, base.ki, base.kd, base.b if base.kp else 0.0, base.c if base.kd else 0.0)
    for choice in settings.card.options[option]:
        try:
            a = settings.changed({option: choice}).algorithm()
        except PidemuError:
            continue
        if (base.kp and not a.kp) or (base.ki and not a.ki) or (base.kd and not a.kd):
            continue
        other = (a.kp, a.ki, a.kd, a.b if a.kp else 0.0, a.c if a.kd else 0.0)
        if any(abs(x - y) > EXACT * max(abs(x), abs(y)) for x, y in zip(numbers, other, strict=True)):
            return True
    return False
