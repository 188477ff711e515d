"""A fleet as a CSV file: what its cells mean, and rows that make no loop."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.card.library import builtin_folder
from pidemu.errors import CardNotFoundError, FleetError
from pidemu.fleet import rows as reading
from pidemu.fleet import table
from pidemu.fleet.result import HEADER
from pidemu.fleet.table import LoopTable, read_loops
from pidemu.settings.ranges import SignalRange
from tests.checks.bench import VALID, edited, written

HEAD = "tag,card,settings,process,scan,action,limits,setpoint,load,time"
GOOD = 'FIC-1,generic/standard,K=2; Ti=10,"gain=1,lag=10,delay=2",0.5,,,0,"10,5",100'
PROCESS = pidemu.Process.from_lags(1.0, lags=[10], delay=2)


def read(folder: Path, *rows: str, head: str = HEAD) -> LoopTable:
    (folder / "loops.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return read_loops(folder / "loops.csv")


def reason(folder: Path, row: str, head: str = HEAD) -> str:
    """Why a row makes no loop, after one that does."""
    table = read(folder, GOOD if head == HEAD else "", row, head=head)
    (wrong,) = table.wrong
    return wrong.reason


def test_every_cell_says_what_the_attribute_of_a_loop_says(tmp_path: Path) -> None:
    row = 'T-2,emerson/deltav,GAIN=2; RESET=0.5 min/repeat; structure=2;,"gain=-1, lag=1 min",500 ms,Direct,"5,95",8,"1 min,-3",2 h'
    (loop,) = read(tmp_path, row).loops
    assert loop == pidemu.Loop(
        "T-2",
        pidemu.load_card("emerson/deltav").settings(GAIN="2", RESET="0.5 min/repeat", STRUCTURE="2"),
        pidemu.Process.from_lags(-1.0, lags=[60]),
        scan=0.5,
        setpoint=8.0,
        load=(60.0, -3.0),
        time=7200.0,
        action="direct",
        output_limits=(5.0, 95.0),
    )
    assert loop.settings["RESET"].to("s/repeat") == 30


def test_what_an_empty_cell_or_a_missing_column_does_not_say_is_left_to_the_fleet(tmp_path: Path) -> None:
    settings = pidemu.load_card("generic/standard").settings(K="2", Ti="10")
    bare = pidemu.Loop("A", settings, pidemu.Process(1.0))
    assert read(tmp_path, "A,generic/standard,K=2; Ti=10,gain=1,,,,,,").loops == (bare,)
    assert read(tmp_path, "A,generic/standard,K=2; Ti=10,gain=1", head="tag,card,settings,process").loops == (bare,)


def test_semicolons_may_separate_the_cells(tmp_path: Path) -> None:
    semicolons = 'FIC-1;generic/standard;"K=2; Ti=10";gain=1,lag=10,delay=2;0.5;;;0;10,5;100'
    assert read(tmp_path, GOOD).loops == read(tmp_path, semicolons, head=HEAD.replace(",", ";")).loops


def test_columns_stand_in_any_order_and_case_with_blanks_around(tmp_path: Path) -> None:
    turned = "Process , SETTINGS,card, Tag"
    (loop,) = read(tmp_path, '"gain=1,lag=10,delay=2" , K=2 ;Ti=10 , generic/standard , FIC-1 ', head=turned).loops
    assert (loop.tag, loop.process, loop.settings["Ti"].value) == ("FIC-1", PROCESS, 10.0)


def test_signal_ranges_stand_among_the_settings(tmp_path: Path) -> None:
    (loop,) = read(tmp_path, 'A,bailey/fc19,"KP=2; pv_range=0,200",gain=1,,,,,,').loops
    assert loop.settings.pv_range == SignalRange(0, 200)


def test_lines_are_counted_as_an_editor_counts_them(tmp_path: Path) -> None:
    text = "\ufeff# a plant\r\n\r\n" + HEAD + "\r\n" + GOOD + "\r\n,,,,,,,,,\r\nLIC-2,no/card,,gain=1,,,,,,\r\n"
    (tmp_path / "loops.csv").write_bytes(text.encode())
    table = read_loops(tmp_path / "loops.csv")
    assert table.lines == (4,)
    assert [(w.line, w.tag, w.card) for w in table.wrong] == [(6, "LIC-2", "no/card")]
    assert table.skipped == "skipped: 1 comment line above the header and 2 empty lines"


def test_a_tag_may_begin_with_a_number_sign(tmp_path: Path) -> None:
    table = read(tmp_path, GOOD.replace("FIC-1", "#1 boiler"), GOOD.replace("FIC-1", "# 2"))
    assert [loop.tag for loop in table.loops] == ["#1 boiler", "# 2"]
    assert table.skipped == ""


WRONG = {
    ",generic/standard,K=2; Ti=10,gain=1,,,,,,": "no tag; every loop needs one",
    "A,,K=2; Ti=10,gain=1,,,,,,": "no card; every loop needs one",
    "A,generic/standard,K=2; Ti=10,,,,,,,": "no process; every loop needs one",
    "FIC-1,generic/standard,K=2; Ti=10,gain=1,,,,,,": "line 2 has this tag already; give each loop its own",
    "A,generic/standrd,K=2; Ti=10,gain=1,,,,,,": (
        "no card 'generic/standrd' (did you mean 'generic/standard'?); 'pidemu cards' lists them"
    ),
    "A,generic/standard,K=2; Ti=10; T=3,gain=1,,,,,,": (
        "generic/standard: unknown setting 'T' (did you mean 'Ti'?); settings: K, Ti, Td, Tf, b, c, INTEGRAL_RULE, DERIVATIVE_RULE"
    ),
    "A,fisher/provox,,gain=1,,,,,,": (
        "fisher/provox: GAIN: missing; it sets the gain (% output per % PV), in %/%; "
        "fisher/provox: RESET: missing; it sets the integral (reset rate), in repeat/min"
    ),
    "A,generic/standard,K=2; K=3,gain=1,,,,,,": "K is given twice, 2 and 3; give it once",
    "A,generic/standard,K 2,gain=1,,,,,,": "'K 2' is not NAME=VALUE; write for example GAIN=2; RESET=20 s/repeat",
    "A,bailey/fc19,pv_range=5,gain=1,,,,,,": ("'5' is not a range; write low and high with a unit, such as \"0,400 degC\""),
    "A,generic/standard,K=2; Ti=10,lag=3,,,,,,": "'lag=3' has no gain; add gain=1.5, for example",
    "A,generic/standard,K=2; Ti=10,gain=1,fast,,,,,": (
        "scan: 'fast' is not a time; write seconds, such as 0.5, or a unit too, such as 10 min"
    ),
    'A,generic/standard,K=2; Ti=10,gain=1,"0,5",,,,,': (
        "scan: '0,5' is not a time; write seconds, such as 0.5, or a unit too, such as 10 min"
    ),
    "A,generic/standard,K=2; Ti=10,gain=1,,revers,,,,": (
        "action: 'revers' is neither reverse nor direct (did you mean 'reverse'?); leave the cell empty for negative feedback"
    ),
    "A,generic/standard,K=2; Ti=10,gain=1,,,100,,,": "limits: '100' is not two numbers such as 0,200",
    'A,generic/standard,K=2; Ti=10,gain=1,,,,"1,2,3",,': (
        "setpoint: '1,2,3' is not a step; write its size in %, such as 5, or its time and size, such as 60,5"
    ),
    "A,generic/standard,K=2; Ti=10,gain=1,,,,,5 %,": (
        "load: '5 %' is not a step; write its size in %, such as 5, or its time and size, such as 60,5"
    ),
    "A,generic/standard,K=2; Ti=10,gain=1,,,,,,1 %": (
        "time: '1 %' is not a time; write seconds, such as 0.5, or a unit too, such as 10 min"
    ),
    "A,generic/standard,K=2; Ti=10,gain=1,lag=10,,,,,,": (
        "11 cells, the header has 10; put a cell that holds ',' in quotation marks"
    ),
    "A,generic/standard": "2 cells, the header has 10; put a cell that holds ',' in quotation marks",
    'A,generic/standard,"K=2': ("a quotation mark is not closed; a row is one line, and a mark within a cell is doubled"),
}

WRONG["A" * 200_000] = "a cell has more than 131,072 characters; shorten it"
WRONG["# FIC-2 is out of service"] = "1 cell, the header has 10; comments stand above the header"
WRONG["#REF!,generic/standard,K=2; Ti=10,,,,,,,"] = "no process; every loop needs one"
WRONG["A\x00,generic/standard,K=2; Ti=10,gain=1,,,,,,"] = "column tag: character 2: U+0000, NUL, stands in the text; remove it"
WRONG["A,generic/standard,K=2; Ti=10,gain=1,,,,,,\u2028B,,"] = (
    "column time: character 1: U+2028, a line separator, stands in the text; remove it"
)


@pytest.mark.parametrize(("row", "message"), WRONG.items(), ids=range(len(WRONG)))
def test_a_wrong_row_is_said_with_cause_and_remedy_and_the_others_are_loops(row: str, message: str, tmp_path: Path) -> None:
    table = read(tmp_path, GOOD, row)
    assert [(w.line, w.reason) for w in table.wrong] == [(3, message)]
    assert [loop.tag for loop in table.loops] == ["FIC-1"]


def test_a_card_of_one_s_own_that_is_wrong_is_said_in_one_line(tmp_path: Path) -> None:
    written(tmp_path, edited(VALID, ("form: standard", "form: serial")))
    (tmp_path / "loops.csv").write_text(f"{HEAD}\nA,nobody/bench,GAIN=1,gain=1,,,,,,\n", encoding="utf-8")
    (wrong,) = read_loops(tmp_path / "loops.csv", vendors=[tmp_path]).wrong
    assert wrong.reason.endswith("bench.yaml:7:7: 'serial' is not one of 'parallel', 'standard', 'series' or 'dahlin' "
                                 "(did you mean 'series'?)")  # fmt: skip


HEADERS = {
    "tag,card,settngs,process,proces": (
        "1: unknown columns 'settngs' (did you mean 'settings'?), 'proces' (did you mean 'process'?); columns: "
        "tag, card, settings, process, scan, action, limits, setpoint, load, time"
    ),
    "tag,card,settings,process,unit": (
        "1: unknown column 'unit'; columns: tag, card, settings, process, scan, action, limits, setpoint, load, time"
    ),
    "tag,card,settings": "1: no column 'process'; tag, card, settings, process are needed",
    "tag,card,settings,process,Tag": "1: the column 'tag' comes twice; keep one",
    'tag,"card': "1: a quotation mark is not closed; a row is one line, and a mark within a cell is doubled",
}


@pytest.mark.parametrize(("head", "message"), HEADERS.items())
def test_a_wrong_header_is_refused(head: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FleetError) as error:
        read(tmp_path, GOOD, head=head)
    assert str(error.value) == f"{tmp_path / 'loops.csv'}:{message}"


def test_a_file_without_loops_or_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "loops.csv"
    with pytest.raises(FleetError, match="no loops; the file has a header line such as tag,card,settings,process and one"):
        read(tmp_path)
    path.write_text("tag,card,settings,process\nA,a/b,,gain=1\n", encoding="utf-16")
    with pytest.raises(FleetError, match="text in UTF-16, little-endian; save the file as UTF-8"):
        read_loops(path)
    with pytest.raises(FleetError, match="cannot be read: No such file or directory"):
        read_loops(tmp_path / "none.csv")
    with pytest.raises(CardNotFoundError, match="no folder 'nowhere'"):
        read_loops(path, vendors=["nowhere"])


def test_a_tag_that_a_spreadsheet_would_compute_is_written_as_text_and_read_as_it_was(tmp_path: Path) -> None:
    tags = ["=1+1", "-101-FIC", "+a", "@b", "'=c", "FIC-1"]
    table = read(tmp_path, *(GOOD.replace("FIC-1", tag) for tag in tags))
    assert [loop.tag for loop in table.loops] == ["=1+1", "-101-FIC", "+a", "@b", "=c", "FIC-1"]
    table.write(tmp_path / "out.csv", pidemu.Fleet(table.loops).simulate(engine="python"))
    with (tmp_path / "out.csv").open(encoding="utf-8", newline="") as file:
        assert [row["tag"] for row in csv.DictReader(file)] == ["'=1+1", "'-101-FIC", "'+a", "'@b", "'=c", "FIC-1"]


def test_the_table_is_not_written_onto_the_file_of_loops(tmp_path: Path) -> None:
    table = read(tmp_path, GOOD)
    before = (tmp_path / "loops.csv").read_bytes()
    with pytest.raises(FleetError, match=r"loops\.csv: is read, too, as .*; give another file for the result"):
        table.write(tmp_path / "loops.csv", pidemu.Fleet(table.loops).simulate(engine="python"))
    assert (tmp_path / "loops.csv").read_bytes() == before


def test_the_written_table_has_every_row_of_the_file_in_its_order(tmp_path: Path) -> None:
    table = read(tmp_path, GOOD, "A,no/card,,gain=1,,,,,,", GOOD.replace("FIC-1", "FIC-2"))
    result = pidemu.Fleet(table.loops).simulate(engine="python")
    table.write(tmp_path / "out.csv", result)
    with (tmp_path / "out.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(HEADER)
    assert [(row["tag"], row["status"]) for row in rows] == [("FIC-1", "done"), ("A", "failed"), ("FIC-2", "done")]
    assert rows[1]["reason"] == "no card 'no/card'; 'pidemu cards' lists them"
    assert [row["line"] for row in table.rows(result)] == [2, 3, 4]
    assert [float(rows[i]["iae"]) for i in (0, 2)] == result.columns["iae"].tolist()


def test_where_no_row_makes_a_loop_the_table_has_the_failures(tmp_path: Path) -> None:
    table = read(tmp_path, "A,no/card,,gain=1,,,,,,")
    assert table.loops == ()
    assert [(row["tag"], row["status"], row["iae"]) for row in table.rows(None)] == [("A", "failed", None)]


def test_a_table_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    table = read(tmp_path, "A,no/card,,gain=1,,,,,,")
    with pytest.raises(FleetError, match=r"nowhere/out\.csv: cannot be written: No such file or directory"):
        table.write(tmp_path / "nowhere" / "out.csv", None)


@pytest.mark.parametrize("error", [RecursionError("too deep"), KeyError("Ti"), OSError(36, "File name too long")])
def test_whatever_a_row_raises_costs_that_row(error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = pidemu.load_card

    def load_card(name: str, *rest: Any) -> Any:
        if name == "emerson/deltav":
            raise error
        return real(name, *rest)

    monkeypatch.setattr(reading, "load_card_by_id", load_card)
    path = tmp_path / "loops.csv"
    rows = ('A,generic/standard,K=1; Ti=10,"gain=1,lag=9"', 'B,emerson/deltav,GAIN=1,"gain=1,lag=9"')
    path.write_text("tag,card,settings,process\n" + "\n".join(rows) + "\n", encoding="utf-8")
    found = table.read_loops(path)
    assert [loop.tag for loop in found.loops] == ["A"]
    assert [(row.tag, row.line) for row in found.wrong] == [("B", 3)]
    assert found.wrong[0].reason.startswith(f"internal error of this loop ({type(error).__name__}: {error})")


def test_a_list_names_cards_by_id_and_no_file_is_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evil = tmp_path / "evil" / "fisher" / "provox.yaml"
    evil.parent.mkdir(parents=True)
    evil.write_bytes((builtin_folder() / "fisher" / "provox.yaml").read_bytes())
    monkeypatch.chdir(tmp_path)
    for name in ("evil/fisher/provox.yaml", str(evil), "not/there.yml", "//host/share/provox.yaml"):
        expected = f"'{name}' is a file, not the id of a card; name its folder with --vendors"
        assert reason(tmp_path, f'FIC-2,{name},GAIN=2; RESET=4,"gain=1,lag=10",,,,,,') == expected
    (loop,) = read_loops(tmp_path / "loops.csv", [tmp_path / "evil"]).loops
    assert loop.settings.card.id == "generic/standard"


def test_a_byte_that_is_not_utf_8_costs_its_row(tmp_path: Path) -> None:
    bad = GOOD.replace("FIC-1", "Störung").encode("latin-1")
    (tmp_path / "loops.csv").write_bytes(b"\n".join([HEAD.encode(), GOOD.encode(), bad, GOOD.replace("FIC-1", "Kühler").encode()]))
    table = read_loops(tmp_path / "loops.csv")
    assert [loop.tag for loop in table.loops] == ["FIC-1", "Kühler"]
    (wrong,) = table.wrong
    assert (wrong.line, wrong.reason) == (3, "column tag: character 3: not UTF-8 text (byte 0xF6); save the file as UTF-8")


def test_a_byte_that_is_not_utf_8_in_the_header_is_said_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "loops.csv").write_bytes(HEAD.encode() + b",\xf6\n" + GOOD.encode())
    with pytest.raises(FleetError, match=r":1: column 11: character 1: not UTF-8 text \(byte 0xF6\); save the file as UTF-8$"):
        read_loops(tmp_path / "loops.csv")


@pytest.mark.parametrize("settings", ["K=2, Ti=10", "K=2 Ti=10", "K=2,Ti=10"])
def test_settings_that_are_not_separated_by_semicolons_are_told_so(settings: str, tmp_path: Path) -> None:
    expected = f"'{settings}' is more than one setting; separate them by semicolons, such as GAIN=2; RESET=20"
    assert reason(tmp_path, GOOD.replace("FIC-1", "FIC-2").replace("K=2; Ti=10", f'"{settings}"')) == expected


@pytest.mark.parametrize("process", ["gain=1;lag=10", "gain=1 lag=10"])
def test_parts_of_a_process_that_are_not_separated_by_commas_are_told_so(process: str, tmp_path: Path) -> None:
    expected = f"'{process}' is more than one part; separate them by commas, such as gain=1.5,lag=10,delay=3"
    assert reason(tmp_path, GOOD.replace("FIC-1", "FIC-2").replace("gain=1,lag=10,delay=2", process)) == expected


def test_a_row_with_a_hidden_character_keeps_its_tag_made_visible(tmp_path: Path) -> None:
    hidden = GOOD.replace("FIC-1", "FIC\x07-2"), GOOD.replace("FIC-1", "FIC-3").replace("Ti", "T\x1bi")
    table = read(tmp_path, GOOD, *hidden, GOOD.replace("FIC-1", "\x0cFIC-4\x85"))
    assert [(w.tag, w.card, w.reason) for w in table.wrong] == [
        ("FIC\\x07-2", "generic/standard", "column tag: character 4: U+0007, a control character, stands in the text; remove it"),
        ("FIC-3", "generic/standard", "column settings: character 7: U+001B, an escape, stands in the text; remove it"),
        ("FIC-4", "generic/standard", "column tag: character 1: U+000C, a form feed, stands in the text; remove it"),
    ]
    assert [loop.tag for loop in table.loops] == ["FIC-1"]


def test_blanks_that_do_not_break_are_no_part_of_a_cell(tmp_path: Path) -> None:
    assert [loop.tag for loop in read(tmp_path, GOOD.replace("FIC-1", "\xa0FIC-1\xa0")).loops] == ["FIC-1"]


@pytest.mark.parametrize(("said", "shown"), [("sep=;", "';'"), ("sep=\t", "a tab")])
def test_a_first_line_that_the_header_contradicts_is_the_cause(said: str, shown: str, tmp_path: Path) -> None:
    (tmp_path / "loops.csv").write_text(f"{said}\n{HEAD}\n{GOOD}\n", encoding="utf-8")
    cause = f"the file says that {shown} separates its cells (sep=), but its header is separated by ','; remove that line"
    with pytest.raises(FleetError) as caught:
        read_loops(tmp_path / "loops.csv")
    assert str(caught.value) == f"{tmp_path / 'loops.csv'}:2: {cause}"
