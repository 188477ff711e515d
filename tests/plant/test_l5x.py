"""Rockwell exports: 26 loops of a made-up plant with every trap, and files that are odd, damaged or hostile."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.errors import ListError
from pidemu.plant.l5x.loops import L5xExport, L5xLoop
from pidemu.plant.l5x.reader import read_l5x
from tests.plant.scoring import DATA

EXPECTED: list[dict[str, Any]] = json.loads((DATA / "plant_a.expected.json").read_text("utf-8"))["loops"]


def read(name: str) -> L5xExport:
    return read_l5x((DATA / name).read_bytes(), name)


@pytest.fixture(scope="module")
def plant() -> dict[tuple[str, str], L5xLoop]:
    return {loop.key: loop for loop in read("plant_a.L5X").loops}


def test_all_loops_are_found_and_no_others(plant: dict[tuple[str, str], L5xLoop]) -> None:
    assert len(EXPECTED) == 26
    assert set(plant) == {(want["scope"], want["path"]) for want in EXPECTED}


@pytest.mark.parametrize("want", EXPECTED, ids=lambda want: f"{want['scope']} {want['path']}")
def test_a_loop_is_as_expected(want: dict[str, Any], plant: dict[tuple[str, str], L5xLoop]) -> None:
    got = plant[want["scope"], want["path"]]
    values = got.values
    assert values.settings == pytest.approx(want["settings"], abs=1e-6) if None not in want["settings"].values() else True
    assert [name for name, value in values.settings.items() if value is None] == [
        n for n, v in want["settings"].items() if v is None
    ]
    assert {
        "block": got.block, "card": got.card, "options": values.options, "pv_range": list(values.pv_range), "action": values.action,
        "interval_s": got.interval_s, "executed": got.executed, "outcome": got.outcome, "flags": sorted(got.flags),
        "values_from": got.values_from,
    } == {
        **{n: want[n] for n in ("block", "card", "options", "pv_range", "action", "interval_s", "executed", "outcome",
        "values_from")},
        "flags": sorted(want["flags"]),
    }  # fmt: skip
    assert got.aliases == want.get("aliases", [])
    assert got.master == want.get("master", "")
    assert values.update == want.get("update_s")
    assert values.setpoint == want.get("sp", values.setpoint)


def test_a_job_of_an_export_converts_what_is_used_and_asks_for_the_rest() -> None:
    rows, summary = pidemu.retrofit(DATA / "plant_a.L5X", target="emerson/deltav")
    classes = {row.reading.tag: row.row_class for row in rows}
    assert len(rows) == sum(summary.counts.values()) == 26
    assert (summary.counts["converted"], summary.counts["decision"], summary.counts["error"]) == (15, 9, 2)
    assert {tag for tag, c in classes.items() if c == "error"} == {"Program:Misc/TIC_506", "Program:Misc/TIC_507"}
    settings = {row.reading.tag: row.settings for row in rows}
    assert {n: settings["TIC_101"][n] for n in ("GAIN", "RESET", "RATE", "ALPHA")} == {
        "GAIN": 2.5, "RESET": 240.0, "RATE": 45.0, "ALPHA": 0.0625,
    }  # fmt: skip
    codes = {row.reading.tag: row.reading.codes for row in rows}
    assert codes["Program:Feed/FIC_102"] == ["D-update"]
    assert codes["Program:Misc/TIC_501"] == ["F-interval"]
    assert codes["Program:Misc/TIC_508"] == ["F-interval", "D-update"]
    assert codes["Program:Misc/TIC_507"] == ["E-bits"]


def test_a_loop_of_two_exports_counts_once_and_other_contents_are_a_decision(tmp_path: Path) -> None:
    files = [DATA / "plant_a_feed_program.L5X", DATA / "plant_a.L5X"]
    rows, _ = pidemu.retrofit(files, target="emerson/deltav")
    codes = {row.reading.tag: row.reading.codes for row in rows}
    assert len(rows) == 26
    assert codes["TIC_101"] == ["F-repeat"]
    assert codes["Program:Feed/FIC_102"] == ["D-duplicate", "D-update"]
    text = next(f.text for row in rows for f in row.reading.findings if f.code == "D-duplicate")
    for said in (
        "plant_a.L5X of Mon Mar 02 08:15:00 2026",
        "plant_a_feed_program.L5X of Tue Jan 06 14:02:11 2026",
        "KP 0.35 and 0.5",
    ):
        assert said in text
    decisions = tmp_path / "decisions.csv"
    decisions.write_text(
        "tag,rule,answer\nProgram:Feed/FIC_102,D-duplicate,plant_a.L5X\nProgram:Feed/FIC_102,D-update,real\n", "utf-8"
    )
    rows, _ = pidemu.retrofit(files, target="emerson/deltav", decisions=decisions)
    decided = next(row for row in rows if row.reading.tag == "Program:Feed/FIC_102")
    assert (decided.row_class, decided.settings["GAIN"]) == ("converted", 0.35)
    assert decided.settings["RESET"] == pytest.approx(0.35 / 0.05 * 0.1 / 0.5)


def test_a_program_export_says_nothing_of_intervals() -> None:
    export = read("plant_a_feed_program.L5X")
    assert [(loop.path, loop.interval_s, "no-tasks" in loop.flags) for loop in export.loops] == [
        ("TIC_101", None, True), ("FIC_102", None, True),
    ]  # fmt: skip
    assert export.notes == [
        "plant_a_feed_program.L5X: a Program export holds no tasks, so how often a block is executed is not known"
    ]


@pytest.mark.parametrize("name", ["l5k_only.L5X", "utf16.L5X"])
def test_values_without_names_are_read_by_position_and_flagged(name: str) -> None:
    (loop,) = read(name).loops
    assert loop.values.settings == {"KP": 2.0, "KI": 3.0, "KD": 0.0}
    assert (loop.values.options["PE"], loop.values.action, loop.values.update) == ("dependent", "direct", 0.5)
    assert "values-in-L5K-only" in loop.flags


def test_a_tag_without_its_members_is_an_error_that_names_them() -> None:
    rows, _ = pidemu.retrofit(DATA / "wrong_members.L5X", target="emerson/deltav")
    assert [(r.row_class, r.reading.codes, r.reading.findings[0].text) for r in rows] == [
        ("error", ["E-missing"], "TIC_8: no KP, KI, KD")
    ]


def cut(folder: Path) -> Path:
    file = folder / "cut.L5X"
    file.write_bytes((DATA / "plant_a.L5X").read_bytes()[:40_000])
    return file


def test_a_file_that_is_cut_off_is_an_error_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ListError, match=r"^cut\.L5X:624:1: unclosed token \(the file is cut off"):
        pidemu.retrofit(cut(tmp_path), target="emerson/deltav")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("bomb.L5X", r"^bomb\.L5X:2: declares a document type or entities"),
        ("external.L5X", r"^external\.L5X:2: declares a document type or entities"),
        ("not_rockwell.L5X", r"^not_rockwell\.L5X:2: the root element is html, not RSLogix5000Content"),
    ],
)
def test_hostile_and_other_files_are_refused(name: str, message: str) -> None:
    with pytest.raises(ListError, match=message):
        pidemu.retrofit(DATA / name, target="emerson/deltav")


def test_an_empty_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "empty.L5X"
    file.write_bytes(b"")
    with pytest.raises(ListError, match=r"^empty\.L5X: is empty"):
        pidemu.retrofit(file, target="emerson/deltav")


def controller(body: str) -> bytes:
    return f'<RSLogix5000Content TargetType="Controller"><Controller Name="C">{body}</Controller></RSLogix5000Content>'.encode()


def user_type(member: str) -> str:
    return f'<DataTypes><DataType Name="T"><Members><Member Name="X" {member}/></Members></DataType></DataTypes>'


def ladder(name: str, text: str) -> str:
    rung = f'<Rung Number="0"><Text>{text}</Text></Rung>'
    return f'<Routines><Routine Name="{name}" Type="RLL"><RLLContent>{rung}</RLLContent></Routine></Routines>'


def test_an_array_of_a_billion_that_holds_no_loops_is_not_gone_through() -> None:
    types = user_type('DataType="REAL" Dimension="999999999"')
    tags = '<Tags><Tag Name="A" DataType="T" Dimensions="999999999"/></Tags>'
    assert read_l5x(controller(types + tags), "x.L5X").loops == []


def test_an_array_of_more_loops_than_a_plant_has_is_refused() -> None:
    with pytest.raises(ListError, match="tag A holds more than 100,000 loops"):
        read_l5x(controller('<Tags><Tag Name="A" DataType="PID" Dimensions="999999999"/></Tags>'), "x.L5X")


def test_types_aliases_and_instructions_that_lead_to_themselves_end() -> None:
    local = '<LocalTags><LocalTag Name="Self" DataType="L"/></LocalTags>'
    definition = f'<AddOnInstructionDefinition Name="L">{local}{ladder("Logic", "L(Self);")}</AddOnInstructionDefinition>'
    aoi = f"<AddOnInstructionDefinitions>{definition}</AddOnInstructionDefinitions>"
    aliases = "".join(f'<Tag Name="{a}" TagType="Alias" AliasFor="{b}"/>' for a, b in ("AB", "BA"))
    tags = f'<Tags>{aliases}<Tag Name="I" DataType="L"/><Tag Name="U" DataType="T"/></Tags>'
    logic = ladder("M", "PID(A,0,0,0,0,0,0)L(I);")
    code = f'<Programs><Program Name="P" MainRoutineName="M">{logic}</Program></Programs>'
    assert read_l5x(controller(user_type('DataType="T"') + aoi + tags + code), "x.L5X").loops == []


@pytest.mark.parametrize("text", ["[1,[2", "[1]]", "1,2", "[[[[[[" * 40, ""])
def test_l5k_text_that_does_not_fit_is_the_loops_error(text: str) -> None:
    tag = f'<Tags><Tag Name="A" DataType="PID"><Data Format="L5K">{text}</Data></Tag></Tags>'
    (loop,) = read_l5x(controller(tag), "x.L5X").loops
    assert (loop.outcome, loop.flags) == ("error", ["no-members"])


def test_elements_nested_too_deeply_are_refused() -> None:
    with pytest.raises(ListError, match="more elements, or deeper ones"):
        read_l5x(controller("<a>" * 300 + "</a>" * 300), "x.L5X")


@pytest.mark.parametrize("encoding", ["UTF-9", "utf-7", "big5", ""])
def test_an_encoding_that_cannot_be_read_is_refused(encoding: str) -> None:
    with pytest.raises(ListError, match=r"^x\.L5X:1"):
        read_l5x(f'<?xml version="1.0" encoding="{encoding}"?>'.encode() + controller(""), "x.L5X")


def test_a_number_beyond_32_bits_is_left_as_it_is() -> None:
    members = "".join(f'<DataValueMember Name="{name}" Value="1e300"/>' for name in ("KP", "KI", "KD"))
    data = f'<Data Format="Decorated"><Structure DataType="PID"><DataValueMember Name="CTL" Value="0"/>{members}</Structure></Data>'
    (loop,) = read_l5x(controller(f'<Tags><Tag Name="A" DataType="PID">{data}</Tag></Tags>'), "x.L5X").loops
    assert loop.values.settings == dict.fromkeys(("KP", "KI", "KD"), 1e300)
