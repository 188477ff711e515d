"""Tags that stand in the lists more than once: with the same contents they count once, with others a person decides."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from pidemu.plant.decisions import Decisions, note_decision
from pidemu.plant.reading_model import LoopChoice, LoopReading


def note_duplicates(readings: Sequence[LoopReading], decisions: Decisions) -> set[int]:
    """Note tags that stand in the lists more than once; return the lines that a person dropped, by identity."""
    by_tag: dict[str, list[LoopReading]] = defaultdict(list)
    for reading in readings:
        if reading.tag:
            by_tag["".join(str(reading.facts.get("key") or reading.tag).split()).casefold()].append(reading)
    dropped: set[int] = set()
    for same in by_tag.values():
        if len(same) < 2:
            continue
        if len({r.contents for r in same}) == 1:
            for other in same[1:]:
                other.find("F-repeat", f"the same as {_where(same[0])}; it counts once")
            continue
        decided = decisions.answer(same[0].tag, "D-duplicate")
        chosen = [r for r in same if decided is not None and decided.answer.strip() in _names(r)]
        if decided is not None and len(chosen) == 1:
            note_decision(chosen[0], decided)
            dropped |= {id(r) for r in same if r is not chosen[0]}
            continue
        for reading in same:
            others = ", ".join(_where(r) for r in same if r is not reading)
            choices = tuple(LoopChoice(_names(r)[0], _where(r)) for r in same)
            text = f"{reading.tag} stands with other contents in {others}. Which counts?"
            reading.find("D-duplicate", text, f"line {reading.line}", choices=choices)
    return dropped


def _names(reading: LoopReading) -> tuple[str, ...]:
    """Return what names a line in an answer."""
    line = str(reading.line)
    return (f"{reading.sheet}:{line}" if reading.sheet else line, line, f"{reading.file}:{line}")


def _where(reading: LoopReading) -> str:
    return f"{reading.file}{f', {reading.sheet}' if reading.sheet else ''}, line {reading.line}"
