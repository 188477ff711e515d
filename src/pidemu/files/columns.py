"""Many cells of a table at once: rows without quotation marks are cut quickly, and plain numbers read together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Final, TextIO, overload

import numpy as np

from pidemu.arrays import Floats
from pidemu.files.tables import split_row, write_rows

_PLAIN: Final = "0123456789.+-eE \t"
"""Characters of plain numbers: of these alone, Python reads the same numbers as `pidemu.plausible.plain_number`."""
_SPECIAL: Final = re.compile("[\"'\r]")
"""Characters that mean something to the format, or in front of a cell."""
_LONGEST: Final = 100_000
"""Characters of a line that is cut quickly: the format's own limit is on a cell, and above this."""
AT_ONCE: Final = 8192
"""Rows that are read, or written, together: more would leave a processor's cache."""


class RowsOfText(Sequence[tuple[str, ...]]):
    """The rows of a table as they stand in its file; they are cut into cells when somebody looks.

    Parameters
    ----------
    lines : sequence of str
        The lines.
    delimiter : str
        What separates their cells.
    """

    def __init__(self, lines: Sequence[str], delimiter: str) -> None:
        self._lines, self._delimiter = lines, delimiter

    def __len__(self) -> int:
        return len(self._lines)

    @overload
    def __getitem__(self, index: int) -> tuple[str, ...]: ...

    @overload
    def __getitem__(self, index: slice) -> list[tuple[str, ...]]: ...

    def __getitem__(self, index: int | slice) -> tuple[str, ...] | list[tuple[str, ...]]:
        if isinstance(index, slice):
            return [tuple(row) for row in rows_of(self._lines[index], self._delimiter)]
        return tuple(split_row(self._lines[index], self._delimiter))

    def plain_lines(self, part: slice) -> Sequence[str] | None:
        """Return lines that `write_rows` would write as they stand; ``None`` where one of them has to be looked at by its cells."""
        lines = self._lines[part]
        return None if _to_be_looked_at(self._delimiter).search("\n".join(lines)) else lines

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and len(self) == len(other) and all(x == y for x, y in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]  # as of a list


@cache
def _to_be_looked_at(delimiter: str) -> re.Pattern[str]:
    """Return what finds a cell that is not written as it stands: with blanks, marks, or signs in front of what is not a number."""
    other = "" if delimiter == "\t" else "\t"
    end = rf"(?:{delimiter}|$)"
    number = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
    return re.compile(rf"[\"'\r =@\uff1d\uff0b\uff0d\uff20{other}]|(?:^|{delimiter})[+-](?!{number}{end})|^$", re.MULTILINE)


def rows_of(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    """Return the cells of lines, as `split_row` gives them.

    Raises
    ------
    ValueError
        One is not a row of a CSV file.
    """
    whole = "\n".join(lines)
    if _SPECIAL.search(whole) or max(map(len, lines), default=0) > _LONGEST:
        return [split_row(line, delimiter) for line in lines]
    rows = [line.split(delimiter) for line in lines]
    return [[cell.strip(" ") for cell in row] for row in rows] if " " in whole else rows


def plain_numbers(cells: Sequence[str]) -> Floats | None:
    """Return numbers in plain decimal notation; ``None`` where one is anything else, or larger or smaller than numbers are.

    Examples
    --------
    >>> plain_numbers(["1.5", "-2e3"]).tolist(), plain_numbers(["1.5", "nan"]), plain_numbers(["1e-999"])
    ([1.5, -2000.0], None, None)
    """
    if "".join(cells).strip(_PLAIN):
        return None
    try:
        found = np.array([float(cell) for cell in cells])
    except ValueError:
        return None
    zeros = {cells[int(i)].upper().partition("E")[0] for i in np.flatnonzero(found == 0)}
    return None if np.isinf(found).any() or any(zero.strip("0.+- \t") for zero in zeros) else found


def write_longer(
    stream: TextIO, rows: Sequence[Sequence[str]], columns: Sequence[Sequence[float] | Floats], delimiter: str
) -> None:
    """Write rows with further numbers behind their cells, as `write_rows` writes them.

    Parameters
    ----------
    stream : text stream
        Where to.
    rows : sequence of sequence of str
        The cells.
    columns : sequence of sequence of float, shape (rows,) each
        The numbers behind them, written so that they read back the same.
    delimiter : str
        What separates the cells.
    """
    for start in range(0, len(rows), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        numbers = [map(repr, np.asarray(column[part], dtype=float).tolist()) for column in columns]
        lines = rows.plain_lines(part) if isinstance(rows, RowsOfText) else None
        if lines is not None:
            stream.writelines(f"{delimiter.join(longer)}\n" for longer in zip(lines, *numbers, strict=True))
        else:
            write_rows(stream, ([*row, *more] for row, *more in zip(rows[part], *numbers, strict=True)), delimiter=delimiter)
