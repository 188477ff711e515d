"""Loop lists in workbooks: what is hidden, merged, dated; and files that are damaged or made to do harm."""

from __future__ import annotations

import datetime
import io
import zipfile
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.errors import ListError
from pidemu.plant.layout import find_layout
from pidemu.plant.rows import RetrofitRow
from pidemu.plant.sources import read_source
from tests.plant.lists import HEADER

pytest.importorskip("python_calamine")
xlsxwriter = pytest.importorskip("xlsxwriter")

LOOP = [*HEADER.values()]


def cells(*changed: tuple[str, Any]) -> list[Any]:
    """Return the usual loop with numbers as numbers, and what is changed."""
    found: dict[str, Any] = {n: float(v) if v.replace(".", "", 1).isdigit() else v for n, v in HEADER.items()}
    return list({**found, **dict(changed)}.values())


def write(path: Path, lines: list[list[Any]], hide: Any = None, sheet: str = "Loops") -> Path:
    book = xlsxwriter.Workbook(path)
    page = book.add_worksheet(sheet)
    date = book.add_format({"num_format": "dd-mmm"})
    for n, line in enumerate(lines):
        for column, value in enumerate(line):
            if isinstance(value, datetime.date):
                page.write_datetime(n, column, value, date)
            else:
                page.write(n, column, value)
    if hide is not None:
        hide(book, page)
    book.close()
    return path


def rows_of(path: Path) -> list[RetrofitRow]:
    return pidemu.retrofit(path, target="emerson/deltav").rows


def test_hidden_rows_are_read_and_flagged(tmp_path: Path) -> None:
    lines = [list(HEADER), cells(), cells(("Tag", "TIC-2"))]
    path = write(tmp_path / "list.xlsx", lines, lambda _, page: page.set_row(2, None, None, {"hidden": True}))
    assert [row.reading.codes for row in rows_of(path)] == [[], ["F-hidden-row"]]


def test_a_hidden_column_never_wins_over_a_visible_one(tmp_path: Path) -> None:
    old = ["Gain", 99.0, 99.0]
    lines = [[old[n], *line] for n, line in enumerate([list(HEADER), cells(), cells(("Tag", "TIC-2"))])]
    path = write(tmp_path / "list.xlsx", lines, lambda _, page: page.set_column(0, 0, 8, None, {"hidden": True}))
    assert [(row.settings["GAIN"], row.reading.codes) for row in rows_of(path)] == [(2.0, []), (2.0, [])]


def test_a_hidden_column_that_is_the_only_one_is_read_and_flagged(tmp_path: Path) -> None:
    path = write(tmp_path / "list.xlsx", [list(HEADER), cells()], lambda _, page: page.set_column(3, 3, 8, None, {"hidden": True}))
    assert [(row.settings["GAIN"], row.reading.codes) for row in rows_of(path)] == [(2.0, ["F-hidden-row"])]


def test_two_visible_columns_that_differ_wait_for_a_decision(tmp_path: Path) -> None:
    lines = [["Gain", *list(HEADER)], [3.0, *cells()], [2.0, *cells(("Tag", "TIC-2"))]]
    assert [row.reading.codes for row in rows_of(write(tmp_path / "list.xlsx", lines))] == [["D-unit"], []]


def test_a_hidden_sheet_is_not_read_unless_it_is_named(tmp_path: Path) -> None:
    def hide(book: Any, page: Any) -> None:
        other = book.add_worksheet("Cover")
        other.write(0, 0, "Loop list")
        other.activate()
        page.hide()

    path = write(tmp_path / "list.xlsx", [list(HEADER), cells()], hide)
    with pytest.raises(ListError, match="no header was found"):
        rows_of(path)
    mapping = tmp_path / "map.yaml"
    mapping.write_text("sheets: [Loops]\n", "utf-8")
    assert len(pidemu.retrofit(path, target="emerson/deltav", mapping=mapping).rows) == 1


def test_a_date_in_a_number_cell_is_an_error_that_names_its_address(tmp_path: Path) -> None:
    path = write(tmp_path / "list.xlsx", [list(HEADER), cells(("I", datetime.date(2026, 9, 6)))])
    (row,) = rows_of(path)
    assert [(f.code, f.place) for f in row.reading.findings] == [("E-date", "F2")]


def test_two_line_headers_units_below_repeated_headers_and_areas(tmp_path: Path) -> None:
    def merge(_: Any, page: Any) -> None:
        page.merge_range(2, 3, 2, 5, "SETTINGS")
        page.merge_range(2, 6, 2, 7, "PV RANGE")
        page.merge_range(2, 8, 2, 9, "OUTPUT")

    header = ["Tag", "Service", "System", "P", "I", "D", "low", "high", "low", "high", "Action", "Mode", "Scan"]
    loop = ["TIC-1", "Reactor", "fisher/provox", 2.0, 0.25, 0.1, 0.0, 200.0, 0.0, 100.0, "reverse", "AUTO", 1.0]
    lines: list[list[Any]] = [
        ["Loop list"], [], [], header, ["", "", "", "gain", "min/rep", "min", "degC", "degC", "%", "%", "", "", "s"], ["AREA 7"],
        loop,
        [], header, ["TIC-2", *loop[1:]], ["Total loops: 2"], ["END OF LIST"],
    ]  # fmt: skip
    path = write(tmp_path / "list.xlsx", lines, merge)
    rows, summary = pidemu.retrofit(path, target="emerson/deltav")
    assert [(r.reading.tag, r.reading.area, r.row_class, r.reading.line) for r in rows] == [
        ("TIC-1", "7", "converted", 7), ("TIC-2", "7", "converted", 10),
    ]  # fmt: skip
    assert rows[0].settings["RESET"] == pytest.approx(15)
    assert [s.kind for s in summary.skipped] == [
        "title", "blank", "header", "header", "units", "area", "blank", "repeated header", "note", "note",
    ]  # fmt: skip
    layout = find_layout(read_source(path).sheets[0])
    assert layout is not None
    assert [c.field for c in layout.columns][6:10] == ["pv_low", "pv_high", "out_limit_low", "out_limit_high"]


def packed(parts: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return data.getvalue()


def parts_of(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def refused(path: Path, data: bytes, message: str) -> None:
    path.write_bytes(data)
    with pytest.raises(ListError, match=message):
        rows_of(path)


def test_a_zip_bomb_is_refused_without_being_kept(tmp_path: Path) -> None:
    parts = parts_of(write(tmp_path / "list.xlsx", [list(HEADER), cells()]))
    bomb = packed({**parts, "xl/media/a.bin": bytes(2**28 + 1)})
    assert len(bomb) < 2**19
    refused(tmp_path / "bomb.xlsx", bomb, r"^bomb\.xlsx: unpacks to more than 256 MB \(in xl/media/a\.bin\)")


def test_a_cell_far_out_is_refused_before_a_table_is_made(tmp_path: Path) -> None:
    parts = parts_of(write(tmp_path / "list.xlsx", [list(HEADER), cells()]))
    far = parts["xl/worksheets/sheet1.xml"].replace(
        b"</sheetData>", b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>'
    )
    message = r"sheet1\.xml\): 1,048,576 rows and 16,384 columns are more"
    refused(tmp_path / "far.xlsx", packed({**parts, "xl/worksheets/sheet1.xml": far}), message)


def test_entities_in_a_workbook_are_refused(tmp_path: Path) -> None:
    parts = parts_of(write(tmp_path / "list.xlsx", [list(HEADER), cells()]))
    sheet = parts["xl/worksheets/sheet1.xml"].replace(b"<worksheet", b'<!DOCTYPE x [<!ENTITY a "b">]><worksheet', 1)
    refused(tmp_path / "x.xlsx", packed({**parts, "xl/worksheets/sheet1.xml": sheet}), "declares a document type or entities")


def test_an_encoding_that_there_is_not_is_refused(tmp_path: Path) -> None:
    parts = parts_of(write(tmp_path / "list.xlsx", [list(HEADER), cells()]))
    sheet = parts["xl/worksheets/sheet1.xml"].replace(b"UTF-8", b"UTF-9", 1)
    refused(tmp_path / "x.xlsx", packed({**parts, "xl/worksheets/sheet1.xml": sheet}), "unknown encoding: UTF-9")


@pytest.mark.parametrize("keep", [100, 1000, 3000])
def test_a_workbook_that_is_cut_off_is_refused(keep: int, tmp_path: Path) -> None:
    data = write(tmp_path / "list.xlsx", [list(HEADER), cells()]).read_bytes()
    refused(tmp_path / "cut.xlsx", data[:keep], r"^cut\.xlsx: a damaged workbook")


def test_compressed_data_that_is_damaged_is_refused(tmp_path: Path) -> None:
    data = bytearray(write(tmp_path / "list.xlsx", [list(HEADER), cells()]).read_bytes())
    at = data.index(b"xl/worksheets/sheet1.xml") + 60
    data[at : at + 40] = bytes(range(40))
    refused(tmp_path / "x.xlsx", bytes(data), r"^x\.xlsx: a damaged workbook")


def ods(rows: str) -> bytes:
    parts = (("office", "office"), ("table", "table"), ("text", "text"), ("xlink", "xlink"))
    names = "".join(f' xmlns:{short}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"' for short, name in parts)
    sheet = f'<office:spreadsheet><table:table table:name="Loops">{rows}</table:table></office:spreadsheet>'
    content = f"<office:document-content{names}><office:body>{sheet}</office:body></office:document-content>"
    manifest = '<manifest:manifest xmlns:manifest="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"></manifest:manifest>'
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    return packed({"mimetype": kind.encode(), "META-INF/manifest.xml": manifest.encode(), "content.xml": content.encode()})


def ods_row(texts: list[str], more: str = "") -> str:
    found = "".join(f'<table:table-cell office:value-type="string"><text:p>{text}</text:p></table:table-cell>' for text in texts)
    return f"<table:table-row{more}>{found}</table:table-row>"


def test_an_ods_file_is_read_with_its_hidden_rows(tmp_path: Path) -> None:
    path = tmp_path / "list.ods"
    path.write_bytes(ods(ods_row(list(HEADER)) + ods_row(LOOP) + ods_row(["TIC-2", *LOOP[1:]], ' table:visibility="collapse"')))
    assert [(row.reading.line, row.reading.codes) for row in rows_of(path)] == [(2, []), (3, ["F-hidden-row"])]


def test_an_ods_file_that_repeats_its_cells_a_million_times_is_refused(tmp_path: Path) -> None:
    cell = '<table:table-cell table:number-columns-repeated="16384" office:value-type="float" office:value="1"/>'
    wide = f'<table:table-row table:number-rows-repeated="1048576">{cell}'
    refused(tmp_path / "x.ods", ods(ods_row(list(HEADER)) + wide + "</table:table-row>"), "rows and 16,384 columns are more")


def test_a_zip_without_a_workbook_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "x.xlsx", packed({"a.txt": b"hello"}), "a zip archive without a workbook in it")


def test_an_old_workbook_that_is_none_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "x.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "a damaged workbook")
