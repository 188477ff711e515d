"""Loop lists as text: encodings, delimiters, decimal marks, line breaks; and files that are none."""

from __future__ import annotations

from pathlib import Path

import pytest

import pidemu
from pidemu.errors import ListError
from pidemu.plant.cells import ListCell
from pidemu.plant.numbers import CellError, cell_number
from tests.plant.lists import HEADER, run_one, write_list


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
@pytest.mark.parametrize("delimiter", [";", ",", "\t"])
def test_every_usual_encoding_and_delimiter_is_read(encoding: str, delimiter: str, tmp_path: Path) -> None:
    file = write_list(tmp_path, {"Service": "Kühler °C"})
    file.write_bytes(file.read_text("utf-8").replace(";", delimiter).encode(encoding))
    rows, summary = pidemu.retrofit(file, target="emerson/deltav")
    assert [(row.row_class, row.reading.service) for row in rows] == [("converted", "Kühler °C")]
    assert len(summary.notes) == 1


def test_a_first_line_may_say_the_delimiter(tmp_path: Path) -> None:
    rows, _ = pidemu.retrofit(write_list(tmp_path, {}, above="sep=;\n"), target="emerson/deltav")
    assert [(row.row_class, row.reading.line) for row in rows] == [("converted", 3)]


def test_line_breaks_within_quotation_marks_are_part_of_the_cell_and_count_as_lines(tmp_path: Path) -> None:
    rows, _ = pidemu.retrofit(write_list(tmp_path, {"Service": "two\nlines"}, {"Tag": "TIC-2"}), target="emerson/deltav")
    assert [(row.reading.tag, row.reading.line) for row in rows] == [("TIC-1", 2), ("TIC-2", 4)]


@pytest.mark.parametrize(
    ("text", "comma", "value", "unit"),
    [
        ("0,22 min", None, 0.22, "min"), ("38,5 %", None, 38.5, "%"), ("1.5E-001", None, 0.15, ""), ("1\xa0200", None, 1200.0, ""),
        ("2,950", True, 2.95, ""), ("0,476", None, 0.476, ""), ("0.476", True, 0.476, ""), ("1.234,5", True, 1234.5, ""),
        ("1,234.5", False, 1234.5, ""), (" -3 ", None, -3.0, ""), ("2.500", False, 2.5, ""), ("4,17 rpm", None, 4.17, "rpm"),
    ],
)  # fmt: skip
def test_numbers_are_read_as_the_file_writes_them(text: str, comma: bool | None, value: float, unit: str) -> None:
    found = cell_number(ListCell(text, "A1"), comma)
    assert (found.value, found.unit) == (value, unit)


@pytest.mark.parametrize(
    ("text", "comma"), [("1,234", None), ("1.234", None), ("2,950", False), ("1.234", True), ("1.2.3", None), ("", None)]
)
def test_a_number_that_can_be_two_is_none(text: str, comma: bool | None) -> None:
    with pytest.raises(CellError):
        cell_number(ListCell(text, "A1"), comma)


def test_the_decimal_mark_is_decided_per_file_and_stated(tmp_path: Path) -> None:
    file = write_list(tmp_path, {"P": "2,5", "I": "1,250"})
    rows, summary = pidemu.retrofit(file, target="emerson/deltav")
    assert summary.notes == ("list.csv: read as UTF-8, semicolon, decimal comma",)
    assert (rows[0].settings["GAIN"], rows[0].settings["RESET"]) == (2.5, 48.0)


def test_a_cell_guarded_against_formulas_is_read_as_it_was(tmp_path: Path) -> None:
    assert run_one(tmp_path, {"Service": "'=1+1"}).reading.service == "=1+1"


def refused(file: Path, data: bytes, message: str) -> None:
    file.write_bytes(data)
    with pytest.raises(ListError, match=message):
        pidemu.retrofit(file, target="emerson/deltav")


def test_a_quotation_mark_that_is_not_closed_is_an_error_with_its_line(tmp_path: Path) -> None:
    text = write_list(tmp_path, {}).read_text("utf-8") + 'x;"y\n'
    refused(tmp_path / "x.csv", text.encode(), r"^x\.csv:3: a quotation mark is not closed")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"), (b"  \n\n", "is empty"), (bytes(range(256)), "is not text"),
        (b"%PDF-1.7", "a PDF file, not a loop list"),
        (b"hello\nworld\n", "no header was found"), (b"\x81\x8d\xff;\n", "neither UTF-8 nor cp1252"),
        (b"<html><body/></html>", "the root element is html"),
    ],
)  # fmt: skip
def test_what_is_no_list_is_refused(data: bytes, message: str, tmp_path: Path) -> None:
    refused(tmp_path / "x.csv", data, message)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ListError, match="cannot be read: No such file"):
        pidemu.retrofit(tmp_path / "none.csv", target="emerson/deltav")
    with pytest.raises(ListError, match="it is a folder"):
        pidemu.retrofit(tmp_path, target="emerson/deltav")


@pytest.mark.parametrize("ending", [".fhx", ".EB"])
def test_formats_without_a_reader_say_so(ending: str, tmp_path: Path) -> None:
    refused(tmp_path / f"x{ending}", b"MODULE", "is not read yet")


def test_a_header_is_found_below_titles_and_its_columns_in_any_order(tmp_path: Path) -> None:
    titles = "".join(f"Plant{';' * n}\n" for n in range(5))
    file = write_list(tmp_path, {}, above=titles)
    lines = file.read_text("utf-8").splitlines()
    turned = [";".join(reversed(line.split(";"))) if line.startswith('"') else line for line in lines]
    file.write_text("\n".join(turned), "utf-8")
    rows, _ = pidemu.retrofit(file, target="emerson/deltav")
    assert [(row.row_class, row.reading.line) for row in rows] == [("converted", 7)]


def test_the_mapping_names_columns_and_the_line_of_the_header(tmp_path: Path) -> None:
    file = write_list(tmp_path, {})
    file.write_text(file.read_text("utf-8").replace('"Tag"', '"Kennung"').replace('"P"', '"Verst"'), "utf-8")
    with pytest.raises(ListError, match="no header was found"):
        pidemu.retrofit(file, target="emerson/deltav")
    mapping = tmp_path / "map.yaml"
    mapping.write_text('columns: {"*": {Kennung: tag, Verst: gain}}\nheader-lines: {"*": 1}\n', "utf-8")
    rows, _ = pidemu.retrofit(file, target="emerson/deltav", mapping=mapping)
    assert [(row.reading.tag, row.row_class) for row in rows] == [("TIC-1", "converted")]
    assert len(HEADER) == 26
