"""Many cells at once are read and written as cell by cell."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pidemu.files.columns import RowsOfText, plain_numbers, rows_of, write_longer
from pidemu.files.tables import split_row, write_rows
from pidemu.plausible import plain_number

NUMBERS = st.one_of(st.floats().map(repr), st.integers().map(str), st.text("0123456789.+-eE \t_,infa", max_size=8))
CELLS = st.one_of(
    NUMBERS,
    st.sampled_from(["", " ", "=1+1", "'=1", "-101-FIC", "+", "-", "@x", "a b", 'say "x"', "\uff1d1", "auto", "2026-11-22"]),
    st.text("abc=+-@'\"\t 12.", max_size=6),
)


def one_by_one(cells: list[str]) -> list[float] | None:
    try:
        return [plain_number(cell) for cell in cells]
    except ValueError:
        return None


@given(cells=st.lists(NUMBERS, min_size=1, max_size=4))
@example(cells=["1e-999"])
@example(cells=["0.0", "-0"])
@example(cells=["1e999"])
@example(cells=["1_0"])
def test_numbers_read_together_are_those_read_alone(cells: list[str]) -> None:
    together, alone = plain_numbers(cells), one_by_one(cells)
    assert (None if together is None else together.tolist()) == alone
    if together is not None and alone is not None:
        assert [math.copysign(1, x) for x in together] == [math.copysign(1, x) for x in alone]


@given(rows=st.lists(st.lists(CELLS, min_size=2, max_size=3), min_size=1, max_size=4), delimiter=st.sampled_from(",;\t"))
def test_rows_cut_together_are_those_cut_alone(rows: list[list[str]], delimiter: str) -> None:
    text = io.StringIO()
    write_rows(text, rows, delimiter=delimiter)
    lines = [line for line in text.getvalue().split("\n")[:-1] if line.count('"') % 2 == 0]
    assert rows_of(lines, delimiter) == [split_row(line, delimiter) for line in lines]
    assert RowsOfText(lines, delimiter) == tuple(tuple(split_row(line, delimiter)) for line in lines)


@given(lines=st.lists(st.lists(CELLS, min_size=2, max_size=2), min_size=1, max_size=4), delimiter=st.sampled_from(",;\t"))
@example(lines=[["-101-FIC", "1"]], delimiter=",")
@example(lines=[["-1", "+2e5"]], delimiter=";")
@example(lines=[["", ""]], delimiter=",")
def test_longer_rows_are_written_as_row_by_row(lines: list[list[str]], delimiter: str) -> None:
    texts = [delimiter.join(cells) for cells in lines]
    texts = [text for text in texts if text.count('"') % 2 == 0 and len(split_row(text, delimiter)) == 2]
    values = [0.1 * i for i in range(len(texts))]
    together, alone = io.StringIO(), io.StringIO()
    write_longer(together, RowsOfText(texts, delimiter), [values, np.array(values)], delimiter)
    write_rows(
        alone, ([*split_row(t, delimiter), repr(v), repr(v)] for t, v in zip(texts, values, strict=True)), delimiter=delimiter
    )
    assert together.getvalue() == alone.getvalue()


def test_rows_of_text_are_a_sequence() -> None:
    rows = RowsOfText(["1, 2", "'=3,4"], ",")
    assert rows[0] == ("1", "2")
    assert rows[1:] == [("=3", "4")]
    assert len(rows) == 2
    assert rows == (("1", "2"), ("=3", "4"))
    assert rows != (("1", "2"),)
    with pytest.raises(TypeError):
        hash(rows)
