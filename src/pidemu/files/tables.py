"""What records and tables share: the comments above their header, their rows, and cells that are text in a spreadsheet, too."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TextIO

from pidemu.errors import PidemuError
from pidemu.files.writing import beside
from pidemu.plausible import plain_number

_FORMULA: Final = re.compile("'*[=+\\-@\t\r\uff1d\uff0b\uff0d\uff20]")
"""A cell that a spreadsheet may compute; behind apostrophes it is text."""


_DELIMITERS: Final = ",;\t"
_SEPARATOR: Final = re.compile(f'"?sep=([{_DELIMITERS}])"?[{_DELIMITERS}]*', re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of a file with a header.

    Attributes
    ----------
    comments : tuple of str
        The lines above the header that begin with ``# ``, or are just ``#``.
    rows : tuple of (int, str)
        The header and the rows, with their lines in the file, counted from 1.
    blank : int
        How many empty lines stand among them.
    delimiter : str
        What separates the cells: a comma, a semicolon or a tab, whichever the header has most of, or what a first line such as
        ``sep=;`` says, which spreadsheets write.
    said : str
        This first line, where there is one.
    """

    comments: tuple[str, ...]
    rows: tuple[tuple[int, str], ...]
    blank: int
    delimiter: str = ","
    said: str = ""

    @property
    def contradiction(self) -> str:
        """Where the header has other delimiters than the first line says: this, with the remedy; else empty."""
        header = self.rows[0][1] if self.rows else ""
        other = max(_DELIMITERS, key=header.count)
        if not self.said or self.delimiter in header or other not in header:
            return ""
        says, has = (shown_delimiter(x) for x in (self.delimiter, other))
        return f"the file says that {says} separates its cells (sep=), but its header is separated by {has}; remove that line"

    @property
    def skipped(self) -> str:
        """What is not read, in words; empty where everything is."""
        parts = []
        if self.comments:
            parts.append(f"{counted(len(self.comments), 'comment line')} above the header")
        if self.blank:
            parts.append(counted(self.blank, "empty line"))
        return f"skipped: {' and '.join(parts)}" if parts else ""


def split_lines(text: str, *, skip_empty_rows: bool = False) -> Lines:
    """Return the lines of a text: comments, header and rows; only above the header a line can be a comment.

    Parameters
    ----------
    text : str
        The text, as `pidemu.files.reading.read_text` returns it.
    skip_empty_rows : bool
        Whether rows of which no cell says anything are skipped, as empty lines are.
    """
    comments: list[str] = []
    rows: list[tuple[int, str]] = []
    blank = 0
    delimiter, empty, first = "", " \t", ""
    for number, line in enumerate(text.removesuffix("\n").split("\n") if text else (), 1):
        if number == 1 and (said := _SEPARATOR.fullmatch(line)):
            delimiter, first = said[1], line
        elif not rows and (line.startswith("# ") or line.rstrip() == "#"):
            comments.append(line)
        elif line.strip(empty):
            if not rows:
                delimiter = delimiter or max(_DELIMITERS, key=line.count)
                empty = f" \t{_DELIMITERS}" if skip_empty_rows else empty.replace(delimiter, "")
            rows.append((number, line))
        else:
            blank += 1
    return Lines(tuple(comments), tuple(rows), blank, delimiter or _DELIMITERS[0], first)


def shown_delimiter(delimiter: str) -> str:
    """Return a delimiter, as a message names it."""
    return "a tab" if delimiter == "\t" else f"'{delimiter}'"


def split_row(line: str, delimiter: str = ",") -> list[str]:
    """Return the cells of a row, as they were before `text_cell`, without blanks around.

    Raises
    ------
    ValueError
        It is not a row of a CSV file; the message has cause and remedy.
    """
    if line.count('"') % 2:
        raise ValueError("a quotation mark is not closed; a row is one line, and a mark within a cell is doubled")
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        if "limit" in str(error):
            raise ValueError(f"a cell has more than {csv.field_size_limit():,} characters; shorten it") from None
        raise ValueError(f"not a row of a CSV file ({error}); save the table as CSV text") from None
    return [untouched(cell.strip(" ")) for cell in cells]


def text_cell(value: Any) -> Any:
    """Return a cell that a spreadsheet shows, and does not compute: text such as ``=1+1`` gets an apostrophe in front.

    Numbers, also those that are written as text, stay as they are. `split_row` takes the apostrophe away again.

    Examples
    --------
    >>> [text_cell(x) for x in ("=1+1", "-1.5", -1.5, "-101-FIC", "'=x", "FIC-1")]
    ["'=1+1", '-1.5', -1.5, "'-101-FIC", "''=x", 'FIC-1']
    """
    if not isinstance(value, str) or not _FORMULA.match(value) or _is_number(value):
        return value
    return f"'{value}"


def write_rows(stream: TextIO, rows: Iterable[Iterable[Any]], end: str = "\n", delimiter: str = ",") -> None:
    """Write rows as CSV, each cell through `text_cell`; numbers are written so that they read back the same.

    Parameters
    ----------
    stream : text stream
        Where to.
    rows : iterable of iterable
        Cells; ``None`` is an empty one.
    end : str
        What ends a line.
    delimiter : str
        What separates the cells.
    """
    writer = csv.writer(stream, lineterminator=end, delimiter=delimiter)
    for row in rows:
        writer.writerow([text_cell(cell) for cell in row])


def write_table(
    path: str | Path,
    header: Sequence[str],
    rows: Iterable[Mapping[str, Any]],
    error: type[PidemuError],
    inputs: Iterable[str | Path] = (),
) -> None:
    """Write the columns of a header as a CSV file.

    Parameters
    ----------
    path : str or Path
        The file.
    header : sequence of str
        The columns; what else is in a row is left out.
    rows : iterable of mapping
        Value by column; ``None`` is an empty cell.
    error : class
        What is raised.
    inputs : iterable of path
        Files that are read, and must not be written.

    Raises
    ------
    PidemuError
        Of the class `error`: the file cannot be written.
    """
    with beside(path, error, inputs) as stream:
        write_rows(stream, [header], "\r\n")
        write_rows(stream, ([row.get(name) for name in header] for row in rows), "\r\n")


def untouched(cell: str) -> str:
    """Return a cell as it was before `text_cell`."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def _is_number(text: str) -> bool:
    try:
        plain_number(text, words=True)
    except ValueError:
        return False
    return True


def counted(n: int, what: str) -> str:
    """Return a number of things in words: ``1 cell``, ``2,000 cells``."""
    return f"{n:,} {what}{'' if n == 1 else 's'}"
