"""Which lines of a sheet are loops, and what the others are: every line is one or the other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pidemu.plant.cells import ListLine, ListSheet
from pidemu.plant.fields import Field, folded
from pidemu.plant.layout import ListLayout

_END: Final = re.compile(
    r"\W*(end "
    r"of|ende\b|total|sum\b|summe|gesamt|anzahl|count|page|seite|continued|fortsetzung|note|hinweis|legend|legende|printed|rev\b)",
    re.IGNORECASE,
)
_AREA: Final = re.compile(r"^[\W_]*(?:(?:area|anlage|unit|plant|section|bereich)\W+)?(.*?)[\W_]*$", re.IGNORECASE)
_HEADING: Final = re.compile(r"\W*(area|anlage|unit|plant|section|bereich|train)\b|[-=*#]{2,}", re.IGNORECASE)
_TAG: Final = re.compile(r"[A-Za-z]{1,6}[A-Za-z0-9\-_./ ]*\d[\w\-./]*")
_TELLING: Final[tuple[Field, ...]] = ("gain", "integral", "derivative", "system", "action", "pv_low", "pv_high", "mode", "scan")
"""Fields one of which a loop has beside its tag."""


@dataclass(frozen=True, slots=True)
class SkippedLine:
    """A line that is no loop.

    Attributes
    ----------
    file, sheet : str
        Where it stands.
    line : int
        Its number, from 1.
    kind : str
        What it is: ``title``, ``header``, ``repeated header``, ``units``, ``area``, ``blank``, ``note``, ``no list``, ``hidden
        sheet``.
    text : str
        What it says.
    """

    file: str
    sheet: str
    line: int
    kind: str
    text: str = ""


@dataclass(frozen=True, slots=True)
class LoopLine:
    """A line that is a loop, with the area heading above it."""

    line: ListLine
    area: str


def split_sheet(layout: ListLayout) -> tuple[list[LoopLine], list[SkippedLine]]:
    """Return the loops of a sheet and its other lines; together they are all lines.

    Parameters
    ----------
    layout : ListLayout
        The sheet with its columns.
    """
    loops: list[LoopLine] = []
    skipped: list[SkippedLine] = []
    area = ""
    for line in layout.sheet.lines:
        kind = _kind(line, layout)
        if kind == "loop":
            loops.append(LoopLine(line, area))
            continue
        if kind == "area":
            area = _area(line)
        skipped.append(SkippedLine(layout.sheet.file, layout.sheet.name, line.number, kind, line.text))
    return loops, sorted([*skipped, *_blank(layout.sheet)], key=lambda s: s.line)


def skipped_sheet(sheet: ListSheet, kind: str) -> list[SkippedLine]:
    """Return all lines of a sheet that holds no loops, or is not to be read."""
    found = [SkippedLine(sheet.file, sheet.name, line.number, kind, line.text) for line in sheet.lines]
    return sorted([*found, *_blank(sheet)], key=lambda s: s.line)


def _blank(sheet: ListSheet) -> Iterator[SkippedLine]:
    written = {line.number for line in sheet.lines}
    for number in range(1, sheet.total + 1):
        if number not in written:
            yield SkippedLine(sheet.file, sheet.name, number, "blank")


def _kind(line: ListLine, layout: ListLayout) -> str:
    if line.number in layout.above:
        return "header"
    if line.number < layout.header:
        return "title"
    if line.number == layout.header:
        return "header"
    if line.number in layout.below:
        return "units"
    if _repeats(line, layout):
        return "repeated header"
    tags = [line.cells[c.index].text for c in layout.columns if c.field == "tag" and c.index in line.cells]
    telling = [c for c in layout.columns if c.field in _TELLING and c.index in line.cells]
    if len(line.cells) > 1 and telling:
        return "loop"
    if _END.match(line.text):
        return "note"
    if len(line.cells) == 1 and _HEADING.match(line.text):
        return "area"
    if tags and (telling or _TAG.fullmatch(tags[0])):
        return "loop"
    return "area" if len(line.cells) == 1 else "note"


def _repeats(line: ListLine, layout: ListLayout) -> bool:
    """Whether a line is the header, or the heading above it, once more."""
    texts = layout.texts
    same = sum(folded(cell.text) == texts.get(column) for column, cell in line.cells.items() if isinstance(cell.value, str))
    return same >= 3 and same * 5 >= len(line.cells) * 4


def _area(line: ListLine) -> str:
    """Return the name of an area heading: ``100`` of ``--- Anlage 100 ---``."""
    match = _AREA.match(line.text)
    return match[1] if match is not None and match[1] else line.text
