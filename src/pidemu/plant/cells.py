"""What a reader makes of a file: sheets of cells, each with its place."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from pidemu.errors import ListError

CellValue = str | float | bool | datetime.date | datetime.time | datetime.timedelta | None
"""What a cell holds: a number and a date only where the file says that it is one."""

_LETTERS: Final = 26
_MOST_LINES: Final = 250_000
"""Lines that a list can have; the largest plants have a tenth of these loops."""


@dataclass(frozen=True, slots=True)
class ListCell:
    """A cell that says something.

    Attributes
    ----------
    value : CellValue
        What it holds.
    place : str
        Its address: ``F12`` in a sheet, ``line 12, column 6`` in a text file.
    hidden : bool
        Whether its column is hidden.
    """

    value: CellValue
    place: str
    hidden: bool = False

    @property
    def text(self) -> str:
        """The cell as text, without blanks around; a number as it is shortest."""
        if isinstance(self.value, str):
            return self.value.replace("\xa0", " ").replace("\u202f", " ").strip()
        if isinstance(self.value, bool):
            return str(self.value).lower()
        if isinstance(self.value, float):
            return f"{self.value:.15g}"
        return "" if self.value is None else str(self.value)

    @property
    def is_date(self) -> bool:
        """Whether the file says that it is a date or a time."""
        return isinstance(self.value, datetime.date | datetime.time | datetime.timedelta)


@dataclass(frozen=True, slots=True)
class ListLine:
    """A line of a list that is not empty.

    Attributes
    ----------
    number : int
        Its line in sheet or file, from 1.
    cells : dict of int to ListCell
        Cell by column, from 0; those that are empty are left out.
    hidden : bool
        Whether the line is hidden.
    """

    number: int
    cells: Mapping[int, ListCell]
    hidden: bool = False

    @property
    def text(self) -> str:
        """The line as one text."""
        return " | ".join(cell.text for cell in self.cells.values())


@dataclass(frozen=True, slots=True)
class ListSheet:
    """A sheet of a file; a text file is one sheet without a name.

    Attributes
    ----------
    file, name : str
        The file as it was named, and the sheet.
    lines : tuple of ListLine
        The lines that hold something.
    total : int
        Lines of the sheet, the empty ones as well.
    hidden : bool
        Whether the sheet is hidden.
    merged : tuple of tuple of int
        Merged cells: first and last line from 1, first and last column from 0.
    decimal_comma : bool or None
        Whether numbers are written with a decimal comma; ``None`` where no cell tells.
    notes : tuple of str
        How the file was read, in words.
    """

    file: str
    name: str
    lines: tuple[ListLine, ...]
    total: int
    hidden: bool = False
    merged: tuple[tuple[int, int, int, int], ...] = ()
    decimal_comma: bool | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def shown(self) -> str:
        """The sheet as messages name it."""
        return f"{self.file}, sheet {self.name}" if self.name else self.file


def address(line: int, column: int) -> str:
    """Return the address of a cell as spreadsheets write it; the line from 1, the column from 0.

    Examples
    --------
    >>> address(12, 27)
    'AB12'
    """
    letters, rest = "", column + 1
    while rest:
        rest, digit = divmod(rest - 1, _LETTERS)
        letters = chr(ord("A") + digit) + letters
    return f"{letters}{line}"


def check_length(lines: int, place: str) -> None:
    """Refuse a list that is longer than any plant's; `place` is where it stands."""
    if lines > _MOST_LINES:
        raise ListError(f"{place}: more than {_MOST_LINES:,} lines, which is too much for a loop list; split it")
