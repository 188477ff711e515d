"""Loops of exports as loops of a job: those that stand in several exports count once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Final

from pidemu.card.library import load_card
from pidemu.errors import PidemuError
from pidemu.plant.decisions import Decisions, note_decision, pass_over
from pidemu.plant.l5x.execution import CONTROLLER
from pidemu.plant.l5x.loops import L5xExport, L5xLoop
from pidemu.plant.reading import take_bias
from pidemu.plant.reading_model import LoopChoice, LoopReading, ValueOrigin
from pidemu.plant.settings_notes import note_settings
from pidemu.settings.ranges import SignalRange

_FAULTS: Final = {"not-a-number": "E-number", "bits-contradict-CTL": "E-bits", "no-members": "E-missing"}
_IDLE: Final = {
    "not-executed": "nothing executes it",
    "routine-not-called": "its routine is not called",
    "task-inhibited": "its task is inhibited",
    "program-disabled": "its program is disabled",
    "oversample": "its OversampleDT is 0, which switches it off",
}
_UNKNOWN: Final = {
    "conditional-rung": "something on its rung decides whether it is executed",
    "executed-twice": "it is called more than once",
    "continuous-task": "its task is continuous",
    "event-task": "its task waits for an event",
    "no-tasks": "the export holds no tasks",
    "protected-routine": "it may be executed by a protected routine",
}
_COMPUTES: Final = ("continuous-task", "event-task", "executed-twice")
"""Why a PID is executed otherwise than it computes."""


def readings_of_exports(
    exports: Sequence[L5xExport], decisions: Decisions
) -> Iterator[tuple[LoopReading, Callable[[Decisions], LoopReading]]]:
    """Yield the loops of exports, each with what reads it again; the same loop of several exports once.

    Parameters
    ----------
    exports : sequence of L5xExport
        The exports of a job.
    decisions : Decisions
        What people decided.
    """
    found: dict[tuple[str, str, str], list[tuple[L5xExport, L5xLoop]]] = defaultdict(list)
    for export in exports:
        for loop in export.loops:
            found[export.controller, loop.scope, loop.path].append((export, loop))
    several = len({export.controller for export in exports}) > 1
    for same in found.values():
        same.sort(key=lambda s: not s[0].has_tasks)  # the one that says what executes it
        export, loop = same[0]
        chosen = _chosen(same, several, decisions)
        if chosen is not None:
            export, loop = chosen
        known = {path for other in exports if other.controller == export.controller for path in (x.path for x in other.loops)}
        others = [(e, x) for e, x in same if _contents(x) != _contents(loop)] if chosen is None else []

        fixed = partial(_reading, export, loop, others, known, several, len(same))

        yield fixed(decisions), fixed


def _chosen(same: Sequence[tuple[L5xExport, L5xLoop]], several: bool, decisions: Decisions) -> tuple[L5xExport, L5xLoop] | None:
    """Return the export that a person decided for; ``None`` where nobody did."""
    decided = decisions.answer(_tag(*same[0], several), "D-duplicate")
    return None if decided is None else next((s for s in same if s[0].file == decided.answer.strip()), None)


def _tag(export: L5xExport, loop: L5xLoop, several: bool) -> str:
    """Return the tag of a loop: its path, with the scope where that is a program, and the controller where there are several."""
    scope = "" if loop.scope == CONTROLLER else f"{loop.scope}/"
    return f"{export.controller}:{scope}{loop.path}" if several else f"{scope}{loop.path}"


def _contents(loop: L5xLoop) -> tuple[Any, ...]:
    v = loop.values
    return loop.block, tuple(v.settings.items()), tuple(v.options.items()), v.pv_range, v.limits, v.action, v.update, v.fault


def _reading(
    export: L5xExport,
    loop: L5xLoop,
    others: Sequence[tuple[L5xExport, L5xLoop]],
    known: set[str],
    several: bool,
    times: int,
    decisions: Decisions,
) -> LoopReading:
    tag = _tag(export, loop, several)
    reading = LoopReading(export.file, loop.scope, loop.line, tag, loop.description, export.controller, loop.block)
    reading.contents = _contents(loop)
    reading.facts = {
        "key": f"{export.controller}/{loop.scope}/{loop.path}",
        "path": loop.path,
        "executed": list(loop.executed),
        "aliases": list(loop.aliases),
        "master": loop.master,
        "flags": list(loop.flags),
        "values_from": loop.values_from,
        "update_s": loop.values.update,
        "setpoint": loop.values.setpoint,
        "outcome": loop.outcome,
    }
    place = f"line {loop.line}"
    if others:
        _note_difference(reading, export, loop, others, place)
    elif times > 1 and (decided := decisions.answer(tag, "D-duplicate")):
        note_decision(reading, decided)
    elif times > 1:
        reading.find("F-repeat", f"stands in {times} exports with the same contents; it counts once", place)
    if loop.values.fault:
        reading.find(_FAULTS[loop.values.fault], f"{loop.path}: {loop.values.why}", place)
    else:
        _read(reading, loop, decisions, place, known)
    pass_over(reading, decisions)
    return reading


def _note_difference(
    reading: LoopReading, export: L5xExport, loop: L5xLoop, others: Sequence[tuple[L5xExport, L5xLoop]], place: str
) -> None:
    for other, found in others:
        names = [n for n, v in loop.values.settings.items() if v != found.values.settings.get(n)]
        what = ", ".join(
            f"{n} {loop.values.settings[n]:g} and {found.values.settings.get(n)}"
            for n in names
            if loop.values.settings[n] is not None
        )
        text = (
            f"{loop.path} has other contents in {export.file} of {export.date} and in {other.file} of {other.date}"
            f"{f': {what}' if what else ''}. Which counts?"
        )
        reading.find("D-duplicate", text, place, choices=(LoopChoice(export.file, export.date), LoopChoice(other.file, other.date)))


def _read(reading: LoopReading, loop: L5xLoop, decisions: Decisions, place: str, known: set[str]) -> None:
    values = loop.values
    reading.card = load_card(loop.card)
    reading.action, reading.limits = values.action, values.limits
    if values.limits != (0.0, 100.0):
        reading.find(
            "F-limits", f"the output limits are {values.limits[0]:g} and {values.limits[1]:g} %: set them on the target", place
        )
    low, high = values.pv_range
    if low < high:
        reading.pv_range = SignalRange(low, high)
    else:
        reading.find(
            "E-range", f"the range of the measurement is {low:g} to {high:g}; its low end is not below its high end", place
        )
        return
    _read_interval(reading, loop, decisions, place)
    given = {name: value for name, value in values.settings.items() if value is not None}
    if any(value < 0 for value in given.values()):
        negative = ", ".join(f"{n} is {v:g}" for n, v in given.items() if v < 0)
        reading.find("E-negative", f"{negative}; on {loop.card} it is not negative", place)
        return
    try:
        reading.settings = reading.card.settings({**given, **values.options, "pv_range": reading.pv_range})
    except PidemuError as error:
        reading.find("E-range", str(error), place)
        return
    reading.stated = dict(values.options)
    reading.origins = {
        name: ValueOrigin(f"{place}, {name}", f"{value:.9g}", reading.settings[name].unit, "card") for name, value in given.items()
    }
    note_settings(reading, reading.settings)
    for flag, why in _IDLE.items():
        if flag in loop.flags and loop.outcome == "not executed":
            reading.find("D-unused", f"{why}: is it used?", place)
    if values.deadband:
        reading.find("D-nonlinear", f"the loop has a deadband of {values.deadband:g} in the error. What becomes of it?", place)
    if values.cascade and not loop.master:
        reading.find("F-cascade", "the tag says that it is the inner loop of a cascade, and no call names its master", place)
    elif loop.master and loop.master not in known:
        reading.find("F-cascade", f"its master, {loop.master}, is not in the list", place)
    take_bias(reading, decisions)


def _read_interval(reading: LoopReading, loop: L5xLoop, decisions: Decisions, place: str) -> None:
    """Read the interval; a PID computes with its update time, whatever executes it."""
    update = loop.values.update if loop.block == "PID" else None
    reading.scan = loop.interval_s
    why = [text for flag, text in _UNKNOWN.items() if flag in loop.flags]
    decided = decisions.answer(reading.tag, "D-update")
    answer = "" if decided is None else decided.answer.casefold()
    if loop.interval_s is None:
        if why:
            reading.find("F-interval", f"how often it is executed is not known: {'; '.join(why)}", place)
        reading.scan = update
        doubtful = loop.block == "PID" and loop.outcome == "loop" and any(flag in loop.flags for flag in _COMPUTES)
        if "conditional-rung" in loop.flags and "executed-twice" not in loop.flags:
            doubtful = False  # a timer on the rung is how a PID is executed at its update time in a continuous task
        if doubtful and update is not None and answer != "scan":
            text = f"the block computes with {update:g} s and {'; '.join(why)}. Is it executed every {update:g} s?"
            reading.find("D-update", text, place, choices=(LoopChoice("scan", f"it is, every {update:g} s"),))
        elif doubtful and decided is not None:
            note_decision(reading, decided)
        return
    if update is None or update == loop.interval_s:
        return
    if decided is not None and answer in ("scan", "real"):
        note_decision(reading, decided)
        reading.computes_with = update if answer == "real" else None
        return
    ratio = loop.interval_s / update
    choices = (
        LoopChoice("real", f"its times are {ratio:g} times those of its members, and that shall be kept"),
        LoopChoice("scan", f"the update time shall be {loop.interval_s:g} s: its members are taken at their word"),
    )
    text = f"it is executed every {loop.interval_s:g} s and computes with {update:g} s. What counts?"
    reading.find("D-update", text, place, choices=choices, measure=max(ratio, 1 / ratio))
