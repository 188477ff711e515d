"""CSV files, damaged; and how many rows one has."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from random import Random

from tools.fuzz.mutate import mutated_bytes
from tools.fuzz.vocabulary import anything, misspelt, text

Rows = list[list[str]]
_LIMIT_OF_A_CELL = 131_072
"""Characters from which on Python's reader gives up."""


def damaged(rng: Random, header: Sequence[str], rows: Rows) -> bytes:
    """Return a CSV file with some cells, lines or bytes that nobody expects."""
    table = [list(header), *rows]
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        _damage(rng, table)
    separator = rng.choice(",,,,,,,,,;\t|")
    lines = [separator.join(_cell(rng, cell, separator) for cell in row) for row in table]
    if rng.random() < 0.25:
        _add_lines(rng, lines)
    end = rng.choice(("\n", "\n", "\n", "\n", "\r\n", "\r\n", "\r"))
    content = (end.join(lines) + rng.choice((end, end, ""))).encode("utf-8", "surrogatepass")
    return mutated_bytes(rng, content) if rng.random() < 0.15 else content


def _damage(rng: Random, table: Rows) -> None:
    """Change one cell, row or heading of a table."""
    at = rng.randrange(len(table))
    row, way = table[at], rng.randrange(16)
    place = rng.randrange(len(row)) if row else 0
    if way == 0:
        table.insert(at, list(row))
    elif way == 1 and len(table) > 1:
        del table[at]
    elif way == 2:
        row.insert(place, anything(rng))
    elif way == 3 and row:
        del row[place]
    elif way == 4 and row:
        row[place] = rng.choice(("#", "# ", "#REF!", "#1 boiler", "=", "+", "-", "@", "\ufeff", "'")) + row[place]
    elif way == 5 and row:
        row[place] = misspelt(rng, row[place])
    elif way == 6 and rng.random() < 0.02 and row:
        row[place] = rng.choice("9a,") * (_LIMIT_OF_A_CELL + 1)
    elif way == 7 and row:
        row[0] = rng.choice(("#REF!", "#1", "# 1", "#", "=1+1"))
    elif row:
        row[place] = anything(rng)


def _cell(rng: Random, cell: str, separator: str) -> str:
    dice = rng.random()
    if separator in cell or '"' in cell or "\n" in cell:
        return cell if dice < 0.1 else '"' + cell.replace('"', '""') + '"'
    return f'"{cell}"' if dice < 0.02 else f" {cell} " if dice < 0.04 else cell


def _add_lines(rng: Random, lines: list[str]) -> None:
    at = rng.choice((0, 0, rng.randrange(len(lines) + 1)))
    lines.insert(at, rng.choice(("", " ", "# comment", "#comment", "# a,b,c", ",,,", ";;", "#", text(rng), '"', "\t", "sep=;")))


def rows_in(content: bytes, is_empty: str) -> set[int]:
    """Return how many rows a file can be said to have; none where it is not text.

    A line ends in a line feed, or in a carriage return where there is no line feed at all. A row is a line that holds something,
    after the header; the header is the first such line that is not a comment. A cell in quotation marks may hold the end of a line,
    so that there is a second count where there are such marks.

    Parameters
    ----------
    content : bytes
        The file.
    is_empty : str
        Characters of which alone a line is empty.
    """
    decoded = content.decode("utf-8-sig", "surrogateescape")  # a byte that is not UTF-8 costs its row
    lines = re.sub("\r+\n", "\n", decoded).split("\n")
    if "\n" not in decoded:
        lines = decoded.split("\r")
    counts = {_count(lines, chars) for chars in (is_empty, " \t")}
    if '"' in decoded:
        try:
            records = csv.reader(io.StringIO(decoded, newline=""))
            counts.add(_count([",".join(r) for r in records], is_empty))
        except csv.Error:
            pass
    return counts


def _count(lines: Sequence[str], is_empty: str) -> int:
    held = [line for line in lines if line.strip(is_empty)]
    while held and (held[0].startswith("# ") or held[0].rstrip() == "#"):
        del held[0]
    if held and re.fullmatch(r"sep=.", held[0].strip()):  # what a spreadsheet writes above the header
        del held[0]
    return max(0, len(held) - 1)
