"""Rows, comments, and cells that a spreadsheet shall not compute."""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pidemu.errors import FleetError
from pidemu.files.tables import split_lines, split_row, text_cell, write_rows, write_table


def test_comments_stand_above_the_header_only_and_what_is_skipped_is_counted() -> None:
    lines = split_lines("# a\n#\n\nsp,pv\n# 1,2\n#REF!,2\n \n1,2\n\n")
    assert lines.comments == ("# a", "#")
    assert lines.rows == ((4, "sp,pv"), (5, "# 1,2"), (6, "#REF!,2"), (8, "1,2"))
    assert lines.skipped == "skipped: 2 comment lines above the header and 3 empty lines"


def test_where_nothing_is_skipped_nothing_is_said() -> None:
    assert split_lines("#sp,pv\n1,2\n").rows == ((1, "#sp,pv"), (2, "1,2"))
    assert split_lines("sp,pv\n1,2").skipped == ""
    assert split_lines("").rows == ()
    assert split_lines("\nsp,pv\n").skipped == "skipped: 1 empty line"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('a,"b', "a quotation mark is not closed; a row is one line, and a mark within a cell is doubled"),
        ("a" * 131_073, "a cell has more than 131,072 characters; shorten it"),
    ],
)
def test_a_line_that_is_no_row_is_refused(line: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        split_row(line)


@pytest.mark.parametrize(
    "cell", ["=1+1", "@SUM(A1)", "+a", "-b", "\tx", "=", "'=1", "''@x", "\uff1d1+1", "--1", "-1_0", "+1,5", "=1+1|' /C calc'!A1"]
)
def test_text_that_a_spreadsheet_would_compute_gets_an_apostrophe(cell: str) -> None:
    assert text_cell(cell) == f"'{cell}"


@pytest.mark.parametrize("cell", ["-1.5", "+2", "-inf", "1e-3", "FIC-1", "", "'x", "a=b", "#REF!", "ü"])
def test_numbers_and_other_text_stay_as_they_are(cell: str) -> None:
    assert text_cell(cell) == cell


def test_what_is_no_text_stays_as_it_is() -> None:
    assert [text_cell(x) for x in (-1.5, None, -math.inf, True)] == [-1.5, None, -math.inf, True]


@given(st.lists(st.text(st.characters(exclude_characters="\n\r", exclude_categories=["Cs"])), min_size=2))
def test_every_cell_reads_back_as_it_was_but_for_blanks_around(cells: list[str]) -> None:
    stream = io.StringIO()
    write_rows(stream, [cells])
    assert split_row(stream.getvalue().removesuffix("\n")) == [cell.strip(" ") for cell in cells]


def test_a_table_has_the_columns_of_its_header(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [{"tag": "=1+1", "x": -0.1, "other": 1}, {"tag": "b", "x": None}]
    write_table(tmp_path / "t.csv", ["tag", "x"], rows, FleetError)
    assert (tmp_path / "t.csv").read_bytes() == b"tag,x\r\n'=1+1,-0.1\r\nb,\r\n"


@pytest.mark.parametrize(
    ("text", "delimiter"),
    [
        ("sp,pv\n1;2\n", ","),
        ("sp;pv\n1,5;2\n", ";"),
        ("# a,b,c\nsp\tpv\n1\t2\n", "\t"),
        ("sep=;\nsp;pv\n", ";"),
        ('"sep=\t"\nsp,pv\n', "\t"),
        ("SEP=,\nsp;a,pv\n", ","),
        ("sp\n1\n", ","),
        ("", ","),
    ],
)
def test_the_header_or_a_line_above_it_says_what_separates_the_cells(text: str, delimiter: str) -> None:
    lines = split_lines(text)
    assert lines.delimiter == delimiter
    assert not any("sep=" in line.casefold() for _, line in lines.rows)


def test_a_row_of_empty_cells_is_skipped_only_where_that_moves_no_other() -> None:
    text = "sp\tpv\n\t\n1\t2\n"
    assert [number for number, _ in split_lines(text).rows] == [1, 2, 3]
    assert [number for number, _ in split_lines(text, skip_empty_rows=True).rows] == [1, 3]
