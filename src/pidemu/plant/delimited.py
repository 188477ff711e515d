"""A loop list as text: comma, semicolon or tab; the usual encodings; line breaks within quotation marks."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Final

from pidemu.errors import ListError
from pidemu.files.kinds import other_encoding
from pidemu.files.tables import untouched
from pidemu.plant.cells import ListCell, ListLine, ListSheet, check_length

_DELIMITERS: Final = ";\t,"
_SAID: Final = re.compile(r'"?sep=([,;\t])"?\s*', re.IGNORECASE)
_WITH_COMMA: Final = re.compile(r"[-+]?(0|[1-9]\d*),\d+(?:[eE][-+]?\d+)?")
_WITH_POINT: Final = re.compile(r"[-+]?(0|[1-9]\d*)\.\d+(?:[eE][-+]?\d+)?")
_THOUSANDS: Final = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
"""Three digits behind the mark: it can separate thousands."""


def read_delimited(data: bytes, file: str) -> ListSheet:
    """Read a list that is text with delimiters.

    Parameters
    ----------
    data : bytes
        The file.
    file : str
        Its name, for messages.

    Raises
    ------
    ListError
        It is no such text: a quotation mark is not closed, or bytes are no characters of any usual encoding.
    """
    text, encoding = _decoded(data, file)
    first, _, rest = text.partition("\n")
    said = _SAID.fullmatch(first.strip("\r\n "))
    delimiter = said[1] if said else _delimiter(text)
    rows = list(_rows(rest if said else text, delimiter, file, 1 if said else 0))
    comma = decimal_comma(cell for _, cells in rows for cell in cells)
    lines = []
    for number, cells in rows:
        found = {column: ListCell(cell, f"line {number}, column {column + 1}") for column, cell in enumerate(cells) if cell.strip()}
        if found:
            lines.append(ListLine(number, found))
            check_length(len(lines), f"{file}:{number}")
    name = {"\t": "tab", ";": "semicolon", ",": "comma"}[delimiter]
    mark = {None: "no number tells", True: "decimal comma", False: "decimal point"}[comma]
    total = sum(1 for _ in io.StringIO(text))
    return ListSheet(file, "", tuple(lines), total, decimal_comma=comma, notes=(f"read as {encoding}, {name}, {mark}",))


def decimal_comma(cells: Iterable[str]) -> bool | None:
    """Tell whether numbers are written with a decimal comma; ``None`` where no cell decides.

    What can be thousands, such as ``1,234``, does not count.
    """
    marks = Counter[bool]()
    for cell in cells:
        number = cell.strip().split(" ")[0]
        if _THOUSANDS.fullmatch(number):
            continue
        if _WITH_COMMA.fullmatch(number):
            marks[True] += 1
        elif _WITH_POINT.fullmatch(number):
            marks[False] += 1
    if not marks:
        return None
    return marks[True] > marks[False]


def _decoded(data: bytes, file: str) -> tuple[str, str]:
    """Return the text and the name of its encoding."""
    wide = other_encoding(data)
    if wide is not None:
        name = wide.split(",")[0].lower()
        codec = name if data[:2] in (b"\xff\xfe", b"\xfe\xff") else f"{name}-{'le' if 'little' in wide else 'be'}"
        try:
            return data.decode(codec), wide.split(",")[0]
        except UnicodeDecodeError as error:
            raise ListError(f"{file}: byte {error.start + 1} is not {wide}; save the list as UTF-8") from None
    if b"\x00" in data[:4096]:
        raise ListError(f"{file}: is not text; give the list as CSV, xlsx, xls, ods or L5X")
    try:
        return data.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError as error:
        try:
            return data.decode("cp1252"), "cp1252 (Windows, Western European)"
        except UnicodeDecodeError:
            line = data.count(b"\n", 0, error.start) + 1
            raise ListError(f"{file}:{line}: bytes that are neither UTF-8 nor cp1252; save the list as UTF-8") from None


def _delimiter(text: str) -> str:
    """Return the delimiter that most lines have, the same number of times."""
    head = [line for line, _ in zip(io.StringIO(text), range(200), strict=False)]
    return max(_DELIMITERS, key=lambda mark: _regularity(line.count(mark) for line in head))


def _regularity(counts: Iterable[int]) -> int:
    """Return how many delimiters stand in lines that have the usual number of them."""
    usual = Counter(n for n in counts if n)
    return max((n * times for n, times in usual.items()), default=0)


def _rows(text: str, delimiter: str, file: str, before: int) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows, each with the line that it begins at."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    start = before + 1
    try:
        for row in reader:
            yield start, [untouched(cell) for cell in row]
            start = before + reader.line_num + 1
    except csv.Error as error:
        raise ListError(f"{file}:{start}: {_cause(error)}") from None


def _cause(error: csv.Error) -> str:
    if "unexpected end" in str(error):
        return "a quotation mark is not closed; close it, or double a mark within a cell"
    if "field larger" in str(error):
        return f"a cell of more than {csv.field_size_limit():,} characters; a quotation mark before it may not be closed"
    return f"not a line of a CSV file ({error}); save the list again as CSV"
