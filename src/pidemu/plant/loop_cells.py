"""The cells of one loop, by what they hold."""

from __future__ import annotations

from typing import Final

from pidemu.plant.cells import ListCell
from pidemu.plant.fields import Field
from pidemu.plant.layout import ListColumn, ListLayout
from pidemu.plant.lines import LoopLine

_NOT_CONTENTS: Final[tuple[Field, ...]] = ("number", "remarks", "other", "area", "service")
"""What can differ between two lines of one loop."""
BLANKS: Final = ("", "-", "--", "n/a", "na", "none", "tbd", "nil", "?")
"""What people write into a cell that they leave open, where a number is not always needed."""


class LoopCells:
    """Access to the cells of a line.

    Parameters
    ----------
    loop : LoopLine
        The line.
    layout : ListLayout
        The columns of its sheet.
    """

    def __init__(self, loop: LoopLine, layout: ListLayout) -> None:
        self.line = loop.line
        self.layout = layout
        self.comma = layout.sheet.decimal_comma

    def filled(self, field: Field) -> list[tuple[ListCell, ListColumn]]:
        """Return the cells of a field that say something, with their columns; of hidden columns where no other holds it."""
        columns = self.layout.holding(field)
        return [(self.line.cells[c.index], c) for c in columns if c.index in self.line.cells]

    def cell(self, field: Field) -> ListCell | None:
        """Return the first cell of a field that says something."""
        found = self.filled(field)
        return found[0][0] if found else None

    def text(self, field: Field) -> str:
        """Return what a field says; empty where it says nothing."""
        cell = self.cell(field)
        return "" if cell is None else cell.text

    def place(self, field: Field) -> str:
        """Return the address of a field's cell, or of its column where that is empty."""
        cell = self.cell(field)
        if cell is not None:
            return cell.place
        columns = self.layout.holding(field)
        return f"column '{columns[0].header}'" if columns else ""

    @property
    def hidden(self) -> list[ListColumn]:
        """The hidden columns that were read of this line."""
        fields = {c.field for c in self.layout.columns if c.field is not None}
        columns = [c for f in fields for c in self.layout.holding(f)]
        return [c for c in columns if c.hidden and c.index in self.line.cells and c.field not in _NOT_CONTENTS]

    @property
    def contents(self) -> tuple[tuple[str, str], ...]:
        """What makes two lines of one tag the same: every field but remarks and numbers."""
        found = {
            (c.field, self.line.cells[c.index].text.casefold())
            for c in self.layout.columns
            if c.field is not None and c.field not in _NOT_CONTENTS and c.index in self.line.cells
        }
        return tuple(sorted(found))
