"""The small list of a made-up plant: every row as expected, from workbook and text, for two targets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.plant.converting import as_ranged
from pidemu.plant.decisions import Decisions
from pidemu.plant.job import RetrofitResult, attempt
from pidemu.plant.loop_list import read_lists
from pidemu.plant.mapping import read_mapping
from pidemu.plant.rules import read_rules
from pidemu.plant.sources import read_sources
from tests.plant.scoring import DATA, MAP, RULES, TARGETS, expected_rows, faults


def small(kind: str, target: str) -> RetrofitResult:
    if kind == "xlsx":
        pytest.importorskip("python_calamine")
    return pidemu.retrofit(DATA / f"plant_small.{kind}", rules=RULES, mapping=MAP, target=TARGETS[target])


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("kind", ["xlsx", "csv"])
def test_every_row_is_as_expected(kind: str, target: str) -> None:
    rows, _ = small(kind, target)
    assert faults([json.loads(json.dumps(row.to_dict())) for row in rows], kind, target) == []


@pytest.mark.parametrize(("kind", "lines"), [("xlsx", 8 + 67 + 38 + 33 + 13), ("csv", 55)])
def test_every_line_is_accounted_for(kind: str, lines: int) -> None:
    rows, summary = small(kind, "deltav")
    assert sum(summary.counts.values()) == summary.lines == lines
    places = [(r.reading.sheet, r.reading.line) for r in rows] + [(s.sheet, s.line) for s in summary.skipped]
    assert len(places) == len(set(places)) == lines


def test_what_is_no_loop_is_named(tmp_path: Path) -> None:
    _, summary = small("csv", "deltav")
    kinds = {s.line: s.kind for s in summary.skipped}
    assert [kinds[n] for n in (1, 2, 3, 4, 14, 22, 36, 44, 46, 50)] == [
        "title", "title", "header", "area", "area", "area", "area", "area", "area", "blank",
    ]  # fmt: skip


def test_area_headings_are_the_areas_of_the_loops_below() -> None:
    pytest.importorskip("python_calamine")
    rows, summary = small("xlsx", "deltav")
    areas = {row.reading.tag: row.reading.area for row in rows}
    assert (areas["TIC-7002"], areas["LIC-7030"], areas["PIC-7070"]) == ("100", "300", "200")
    assert {s.text for s in summary.skipped if s.kind == "note"} == {
        "Total loops: 30", "Total loops: 7", "Total loops: 3", "END OF LIST",
    }  # fmt: skip


def test_a_conversion_is_that_of_convert_row_by_row() -> None:
    words, rules = read_mapping(MAP), read_rules(RULES)
    listed = read_lists(read_sources([DATA / "plant_small.csv"]), words, Decisions())
    compared = 0
    for reading, _ in listed.loops:
        found = attempt(reading, rules, Decisions())
        if found is None:
            continue
        c = found.conversion
        as_ranged(reading)
        request = c.request
        again = pidemu.convert(
            c.source, request_card(c), options=request.options, given=request.given, scan=c.scan, mode=request.mode,
            action=request.action, match=request.match, to_pv_range=request.to_pv_range, limits=request.limits,
            digits=request.digits,
            tag=request.tag, emulate=False,
        )  # fmt: skip
        assert {n: v.value for n, v in again.settings.items()} == {n: v.value for n, v in c.settings.items()}
        assert again.settings.options == c.settings.options
        assert again.verdict == c.verdict
        compared += 1
    assert compared == 26  # the two duplicates convert as well


def request_card(c: Any) -> Any:
    return c.settings.card


def test_naive_readings_differ() -> None:
    """Taken at their word, by units that the list does not state, many of the rows that stop would be converted wrongly."""
    stopping = [row for row in expected_rows() if row["class"] != "converted"]
    rows, _ = small("csv", "deltav")
    with_two_readings = [
        r for r in rows for f in r.reading.findings if f.code in ("D-unit", "D-equation", "D-form") and f.measure > 1.01
    ]
    assert len(stopping) == 16
    assert {r.reading.tag for r in with_two_readings} == {"FIC-7017", "TIC-7019", "FIC-7044", "LIC-7060", "FIC-7074"}


def test_the_result_is_the_same_twice() -> None:
    one, other = (json.dumps([row.to_dict() for row in small("csv", "deltav").rows]) for _ in range(2))
    assert one == other


def test_decisions_convert_what_stopped(tmp_path: Path) -> None:
    answers = {
        ("FIC-7007", "D-duplicate"): "8", ("FIC-7017", "D-unit"): "repeat/min", ("TIC-7019", "D-unit"): "1",
        ("FIC-7034", "D-nonlinear"): "convert", ("TIC-7036", "D-action"): "reverse", ("FIC-7044", "D-form"): "ideal",
        ("FIC-7049", "D-range"): "0..45 t/h", ("FIC-7054", "D-default"): "convert", ("FIC-7054", "D-no-integral"): "50",
        ("LIC-7060", "D-equation"): "ISA", ("LIC-7063", "D-zero-gain"): "skip", ("LIC-7072", "D-refused"): "nearest",
        ("FIC-7074", "D-unit"): "%",
    }  # fmt: skip
    file = tmp_path / "decisions.csv"
    lines = [f"{tag},{rule},{answer},M. Roth,2026-11-30,looked" for (tag, rule), answer in answers.items()]
    file.write_text("\n".join(["tag,rule,answer,name,date,reason", *lines, "FIC-1,D-unit,%,,,"]), "utf-8")
    rows, summary = pidemu.retrofit(DATA / "plant_small.csv", rules=RULES, mapping=MAP, decisions=file)
    assert summary.counts == {"converted": 35, "decision": 0, "error": 3, "skipped": 17}
    settings = {row.reading.tag: row.settings for row in rows if row.row_class == "converted"}
    assert settings["FIC-7017"]["RESET"] == 16.22
    assert settings["TIC-7019"]["GAIN"] == 2.5
    assert settings["FIC-7074"]["GAIN"] == 4
    decided = next(row for row in rows if row.reading.tag == "FIC-7017")
    assert [(d.name, d.answer) for d in decided.reading.decisions] == [("M. Roth", "repeat/min")]
    assert [note for note in summary.notes if "FIC-1 " in note] == [
        f"{file}:15: FIC-1 D-unit was not asked, or '%' is not an answer to it"
    ]
