"""Recorded signals: what the columns mean, and what is refused."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from pidemu.errors import RecordError
from pidemu.records.files import Record, read_record, write_record

NAN = float("nan")
ONLY = "is not a number; write digits and a decimal point only, such as 10 or 1.5e-3"


def read(folder: Path, text: str) -> Record:
    (folder / "record.csv").write_text(text, encoding="utf-8")
    return read_record(folder / "record.csv")


def values(x: object) -> list[float]:
    assert isinstance(x, np.ndarray)
    found: list[float] = x.tolist()
    return found


@pytest.mark.parametrize(
    ("header", "name"),
    [
        ("cascade", "cascade"),
        ("Cas", "cascade"),
        ("REMOTE_SP", "cascade"),
        ("rsp", "cascade"),
        ("Track", "track"),
        ("tracking", "track"),
        ("external_reset", "external_reset"),
        ("Reset_Signal", "external_reset"),
        ("ext_reset", "external_reset"),
        ("feedforward", "feedforward"),
        ("FF", "feedforward"),
    ],
)
def test_signals_are_found_by_any_of_their_names_and_empty_cells_are_none(tmp_path: Path, header: str, name: str) -> None:
    record = read(tmp_path, f"sp,pv,{header}\n1,2,\n1,2,3.5\n1,2,nan\n")
    np.testing.assert_array_equal(getattr(record, name), [NAN, 3.5, NAN])
    assert list(record.signals) == [name]
    assert record.names == {"sp": "sp", "pv": "pv", name: header}


def test_a_signal_that_is_empty_throughout_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, "sp,pv,cas,ff\n1,2,,\n1,2,,\n").signals == {}


def test_hold_is_a_yes_or_no_and_empty_is_no(tmp_path: Path) -> None:
    record = read(tmp_path, "sp,pv,hold\n" + "".join(f"1,2,{word}\n" for word in ("1", "0", "", "yes", "False")))
    assert values(record.hold) == [1, 0, 0, 1, 0]


@pytest.mark.parametrize("header", ["interval", "dt", "DT"])
def test_an_interval_may_be_empty_zero_negative_or_infinite(tmp_path: Path, header: str) -> None:
    record = read(tmp_path, f"{header},sp,pv\n,1,2\n0.5,1,2\n0,1,2\n-1,1,2\ninf,1,2\n")
    np.testing.assert_array_equal(record.interval, [NAN, 0.5, 0, -1, np.inf])


def test_setpoint_and_measurement_may_be_no_numbers(tmp_path: Path) -> None:
    record = read(tmp_path, "sp,pv\nnan,1\nNaN,-inf\nInf,infinity\n")
    np.testing.assert_array_equal(record.sp, [NAN, NAN, np.inf])
    np.testing.assert_array_equal(record.pv, [1, -np.inf, np.inf])


def test_timestamps_count_from_the_first_one_and_across_a_change_of_clocks(tmp_path: Path) -> None:
    stamps = ("2026-03-29T01:59:58.5", "2026-03-29T02:00:00", "2026-03-29 03:00:00")
    assert values(read(tmp_path, "t,sp,pv\n" + "".join(f"{s},1,2\n" for s in stamps)).time) == [0, 1.5, 3601.5]
    zones = ("2026-03-29T01:00:00+01:00", "2026-03-29T00:00:01+00:00")
    assert values(read(tmp_path, "t,sp,pv\n" + "".join(f"{s},1,2\n" for s in zones)).time) == [0, 1]


def test_seconds_are_kept_as_they_stand(tmp_path: Path) -> None:
    assert values(read(tmp_path, "time,sp,pv\n100.5,1,2\n101,1,2\n").time) == [100.5, 101]


def test_without_a_column_the_recorded_output_is_the_operator_s(tmp_path: Path) -> None:
    record = read(tmp_path, "sp,pv,out\n1,2,3\n")
    assert record.by_hand is record.output
    record = read(tmp_path, "sp,pv,out,man\n1,2,3,4\n")
    assert values(record.by_hand) == [4]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sp,pv\n1,2\n1,\n", ":3: column pv: empty; every sample needs a number"),
        ("sp,pv\n,2\n", ":2: column sp: empty; every sample needs a number"),
        ("sp,pv\nbad,2\n", ":2: column sp: 'bad' is not a number"),
        ("sp,pv\n1,2\n#REF!,2\n", ":3: column sp: '#REF!' is not a number"),
        ("sp,pv\n1,2\n# 1,2\n", ":3: column sp: '# 1' is not a number"),
        ("sp,pv\n1,2\n# out of service\n", ":3: 1 cell, the header has 2; comments stand above the header"),
        ("sp,pv\n1,1_0\n", f":2: column pv: '1_0' {ONLY}"),
        ("sp,pv\n1,٣\n", f":2: column pv: '٣' {ONLY}"),
        ("sp,pv\n1,0x10\n", ":2: column pv: '0x10' is not a number"),
        ("sp,pv\n1,1e999\n", ":2: column pv: '1e999' is too large a number"),
        ("t,sp,pv\n1_0,1,2\n", ":2: column t: '1_0' is neither a number of seconds nor a timestamp such as 2026-11-22T08:00:05"),
        ("sp,pv\n1,2\x0b1,2\n", ":2:4: U+000B, a vertical tab, stands in the text; remove it"),
        ("sp,pv\n1,2\u20281,2\n", ":2:4: U+2028, a line separator, stands in the text; remove it"),
        ("\ufeff\ufeffsp,pv\n1,2\n", ":1:1: U+FEFF, a byte order mark that is not the first, stands in the text; remove it"),
        ("sp,pv\n1," + "2" * 131_073, ":2: a cell has more than 131,072 characters; shorten it"),
        ("sp,pv\n1," + "x" * 1000, f":2: column pv: '{40 * 'x'}…{20 * 'x'}' is not a number"),
        ('sp,pv,note\n1,2,"a\nb"\n', ":2: a quotation mark is not closed; a row is one line, and a mark within a cell is doubled"),
        ("sp,pv,FF\n1,2,inf\n", ":2: column FF: 'inf' is not a finite number; leave the cell empty where there is no signal"),
        ("sp,pv,cas\n1,2,on\n", ":2: column cas: 'on' is not a number"),
        ("sp,pv,hold\n1,2,maybe\n", ":2: column hold: 'maybe' is neither 1 (hold) nor 0 (no hold)"),
        ("sp,pv,auto\n1,2,\n", ":2: column auto: '' is neither 1 (automatic) nor 0 (manual)"),
        ("sp,pv,dt\n1,2,nan\n", ":2: column dt: 'nan' is not an interval; leave the cell empty for the nominal one"),
        ("sp,pv,cas,RSP\n1,2,3,4\n", ":1: columns cas, RSP all mean cascade; keep one"),
        (
            "t,sp,pv\n0,1,2\n2026-01-01,1,2\n",
            ":3: column t: '2026-01-01' is not like the cells above; write seconds or timestamps throughout",
        ),
        (
            "t,sp,pv\nnan,1,2\n",
            ":2: column t: 'nan' is neither a number of seconds nor a timestamp such as 2026-11-22T08:00:05",
        ),
    ],
)
def test_a_cell_that_cannot_be_used_is_refused_at_its_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RecordError) as caught:
        read(tmp_path, text)
    assert str(caught.value) == f"{tmp_path / 'record.csv'}{message}"


def test_comments_above_the_header_are_counted_and_kept(tmp_path: Path) -> None:
    record = read(tmp_path, "\ufeff# TIC-101, Kühler\n#\n\nsp,pv\n1,2\n\n3,4\n")
    assert record.comments == ("# TIC-101, Kühler", "#")
    assert record.skipped == "skipped: 2 comment lines above the header and 2 empty lines"
    stream = io.StringIO()
    write_record(record, {"x": [5, 6]}, stream)
    assert stream.getvalue() == "# TIC-101, Kühler\n#\nsp,pv,x\n1,2,5.0\n3,4,6.0\n"
    assert read(tmp_path, stream.getvalue()).comments == record.comments


def test_text_that_a_spreadsheet_would_compute_is_written_as_text_and_numbers_as_numbers(tmp_path: Path) -> None:
    record = read(tmp_path, "sp,pv,note,+x\n-1.5,-inf,=1+1,@a\n+2,nan,'=b,-\n")
    assert record.header == ("sp", "pv", "note", "+x")
    assert record.rows == (("-1.5", "-inf", "=1+1", "@a"), ("+2", "nan", "=b", "-"))
    stream = io.StringIO()
    write_record(record, {"-y": [-0.5, -float("inf")]}, stream)
    assert stream.getvalue() == "sp,pv,note,'+x,'-y\n-1.5,-inf,'=1+1,'@a,-0.5\n+2,nan,'=b,'-,-inf\n"
    again = read(tmp_path, stream.getvalue())
    assert [row[:4] for row in again.rows] == list(record.rows)


def test_new_columns_are_written_behind_the_cells_as_they_stand(tmp_path: Path) -> None:
    record = read(tmp_path, 'sp,pv,note\n1.50,2,"a, b"\n1,2,\n')
    stream = io.StringIO()
    write_record(record, {"x": [0.1, 1 / 3], "y": [1, np.float64(2)]}, stream)
    assert stream.getvalue() == f'sp,pv,note,x,y\n1.50,2,"a, b",0.1,1.0\n1,2,,{1 / 3!r},2.0\n'


@pytest.mark.parametrize("text", ["sp;pv\n1.5;2\n", "sp\tpv\n1.5\t2\n", "sep=;\nsp;pv\n1.5;2\n"])
def test_semicolons_and_tabs_separate_cells_as_in_lists_of_loops(tmp_path: Path, text: str) -> None:
    record = read(tmp_path, text)
    assert (values(record.sp), values(record.pv)) == ([1.5], [2])


def test_a_decimal_comma_between_semicolons_is_named_with_its_remedy(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r":2: column sp: '1,5' has a comma; write a decimal point$"):
        read(tmp_path, "sp;pv\n1,5;2,5\n3,5;2\n")


def test_a_header_behind_a_comment_sign_is_told_to_lose_it(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r":1: no column 'sp' among #sp, pv; remove the # of '#sp'$"):
        read(tmp_path, "#sp,pv\n1,2\n")


@pytest.mark.parametrize(
    "text",
    ["sp;pv;note\n1;2;a,b\n", "sp\tpv\tnote\n1\t2\ta;b\n", 'sep=;\n# a comment\nsp;pv;note\n1;2;"c;d"\n', "sp,pv,note\n1,2,a;b\n"],
)
def test_a_record_is_written_with_the_delimiter_it_was_read_with(text: str, tmp_path: Path) -> None:
    record, stream = read(tmp_path, text), io.StringIO()
    write_record(record, {}, stream)
    assert stream.getvalue() == text
    stream = io.StringIO()
    write_record(record, {"emulated": [0.5]}, stream)
    head, row = stream.getvalue().splitlines()[-2:]
    assert (head, row) == tuple(
        f"{line}{record.delimiter}{x}" for line, x in zip(text.splitlines()[-2:], ("emulated", "0.5"), strict=True)
    )


@pytest.mark.parametrize(
    ("text", "says", "has"), [("sep=;\nsp,pv\n1,2\n", "';'", "','"), ("sep=,\nsp\tpv\n1\t2\n", "','", "a tab")]
)
def test_a_first_line_that_the_header_contradicts_is_the_cause(text: str, says: str, has: str, tmp_path: Path) -> None:
    cause = f"the file says that {says} separates its cells \\(sep=\\), but its header is separated by {has}; remove that line"
    with pytest.raises(RecordError, match=rf":2: {cause}$"):
        read(tmp_path, text)


@pytest.mark.parametrize("name", ["time", "interval"])
@pytest.mark.parametrize("time", ["1.7976931348623157e308", "-1e300", "1e-300"])
def test_a_time_that_no_loop_has_is_refused_with_its_place(tmp_path: Path, name: str, time: str) -> None:
    with pytest.raises(RecordError) as caught:
        read(tmp_path, f"sp,pv,{name}\n1,2,0\n1,2,{time}\n")
    assert str(caught.value) == (
        f"{tmp_path / 'record.csv'}:3: column {name}: {float(time):g} s is not a time that a loop has, 1e-30 to 1e+15 s in size; "
        "check the number and its unit"
    )
