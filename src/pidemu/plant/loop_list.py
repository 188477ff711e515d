"""All loops of a job's lists, read and not yet converted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from pidemu.errors import ListError
from pidemu.plant.decisions import Decisions
from pidemu.plant.layout import ListLayout, find_layout
from pidemu.plant.lines import LoopLine, SkippedLine, skipped_sheet, split_sheet
from pidemu.plant.loop_cells import LoopCells
from pidemu.plant.mapping import PlantWords
from pidemu.plant.reading import read_loop
from pidemu.plant.reading_model import LoopReading, fault_in_words
from pidemu.plant.sources import LoopSource

Again = Callable[[Decisions], LoopReading]
"""Reads a loop again, with other decisions."""
ReadLoop = tuple[LoopReading, Again]


@dataclass
class PlantList:
    """All loops of a job, read and not yet converted.

    Attributes
    ----------
    loops : list
        Each loop with what reads it again.
    skipped : list of SkippedLine
        The other lines.
    layouts : list of ListLayout
        How the sheets are laid out.
    notes : list of str
        How the files were read.
    files : dict
        SHA-256 by file.
    """

    loops: list[ReadLoop] = field(default_factory=list)
    skipped: list[SkippedLine] = field(default_factory=list)
    layouts: list[ListLayout] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)


def read_lists(sources: Iterable[LoopSource], words: PlantWords, decisions: Decisions) -> PlantList:
    """Read the loops of files.

    Parameters
    ----------
    sources : iterable of LoopSource
        The files.
    words : PlantWords
        What the plant's words mean.
    decisions : Decisions
        What people decided.

    Raises
    ------
    ListError
        No line of a file is a header of loops.
    """
    found = PlantList()
    sources = list(sources)
    for source in sources:
        found.files[source.file] = source.digest
        layouts = list(_layouts(source, words, found))
        for layout in layouts:
            loops, skipped = split_sheet(layout)
            found.skipped += skipped
            found.loops += [_readable(loop, layout, words, decisions) for loop in loops]
        if source.export is None and not layouts:
            raise ListError(
                f"{source.file}: no header was found: a line that names a tag and a gain or an integral setting, and two "
                f"columns more; "
                "name the line and the columns in the mapping (header-lines:, columns:)"
            )
    exports = [source.export for source in sources if source.export is not None]
    if exports:
        from pidemu.plant.l5x.readings import readings_of_exports

        for reading, again in readings_of_exports(exports, decisions):
            found.loops.append((reading, again))
        found.notes += [note for export in exports for note in export.notes]
    return found


def _layouts(source: LoopSource, words: PlantWords, found: PlantList) -> Iterator[ListLayout]:
    for sheet in source.sheets:
        found.notes += [f"{sheet.shown}: {note}" for note in sheet.notes]
        if not words.is_read(sheet.name, sheet.hidden):
            found.skipped += skipped_sheet(sheet, "hidden sheet" if sheet.hidden else "superseded sheet")
            continue
        layout = find_layout(sheet, words.columns_of(sheet.name), words.header_of(sheet.name))
        if layout is None:
            found.skipped += skipped_sheet(sheet, "no list")
            continue
        found.layouts.append(layout)
        yield layout


def _readable(loop: LoopLine, layout: ListLayout, words: PlantWords, decisions: Decisions) -> ReadLoop:
    def again(other: Decisions) -> LoopReading:
        try:
            return read_loop(loop, layout, words, other)
        except Exception as error:  # a fault of one line costs no other
            lost = LoopReading(layout.sheet.file, layout.sheet.name, loop.line.number, LoopCells(loop, layout).text("tag"))
            lost.find("E-program", f"the line could not be read: {fault_in_words(error)}")
            return lost

    return again(decisions), again
