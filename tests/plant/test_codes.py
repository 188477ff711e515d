"""What stops a loop and what flags it: every code, from one row that differs from a usual loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pidemu.plant.codes import CODES
from pidemu.plant.converting import convert_loop
from tests.plant.lists import FC19, PLC, TDC, UDC, YOKOGAWA, run, run_one

ERRORS: list[tuple[str, Mapping[str, str]]] = [
    ("E-tag", {"Tag": ""}),
    ("E-card", {"System": "Acme 9000"}),
    ("E-card", {"System": ""}),
    ("E-missing", {"P": ""}),
    ("E-missing", {"I": ""}),
    ("E-number", {"P": "n/a"}),
    ("E-number", {"P": "see DCS"}),
    ("E-number", {"P": "~2"}),
    ("E-number", {"P": "1.5?"}),
    ("E-number", {"I": "3.5*"}),
    ("E-number", {"I": "1/4"}),
    ("E-number", {"I": "1-2"}),
    ("E-number", {"D": "2 .. 3"}),
    ("E-number", {"D": "inf"}),
    ("E-number", {"LRV": "low"}),
    ("E-date", {"I": "06. Sep"}),
    ("E-date", {"I": "9/6/2026"}),
    ("E-date", {"P": "2026-09-06"}),
    ("E-date", {"I": "Mar 4"}),
    ("E-unit", {"P unit": "barg"}),
    ("E-unit", {"I unit": "barg"}),
    ("E-unit", {"I": "4 furlongs"}),
    ("E-unit", {"D": "1", "D unit": "rep/min"}),
    ("E-negative", {"P": "-2"}),
    ("E-negative", {"I": "-4"}),
    ("E-negative", {"D": "-1", "D unit": "min"}),
    ("E-range", {"LRV": "200", "URV": "0"}),
    ("E-range", {"LRV": "100", "URV": "100"}),
    ("E-range", {"OP lo": "100", "OP hi": "0"}),
    ("E-range", {**UDC, "D": "11", "D unit": "min"}),
    ("E-number", {**UDC, "P": "0 %"}),
]
DECISIONS: list[tuple[str, Mapping[str, str]]] = [
    ("D-unit", {"I unit": "min?"}),
    ("D-unit", {"I unit": "m"}),
    ("D-unit", {"I unit": "r"}),
    ("D-unit", {"I unit": "reset"}),
    ("D-unit", {"I unit": "repeats"}),
    ("D-unit", {"I unit": "min"}),
    ("D-unit", {"P unit": "P"}),
    ("D-unit", {"P unit": "gain?"}),
    ("D-unit", {"P": "50 %", "P unit": "gain"}),
    ("D-unit", {"I": "0.7 min", "I unit": "RPM"}),
    ("D-unit", {**UDC, "P": "25", "P unit": ""}),
    ("D-unit", {**UDC, "I": "25", "I unit": ""}),
    ("D-unit", {"D": "1", "D unit": "m"}),
    ("D-unit", {**FC19, "I unit": "rep/min"}),
    ("D-unit", {**PLC, "I unit": "min"}),
    ("D-form", {**TDC, "Form": "", "D": "1", "D unit": "min"}),
    ("D-form", {**TDC, "Form": "ideal?"}),
    ("D-form", {"Form": "ideal"}),
    ("D-equation", {**PLC, "Equation": ""}),
    ("D-equation", {**PLC, "System": "allen-bradley/logix-pid", "Equation": ""}),
    ("D-equation", {**PLC, "System": "allen-bradley/pide", "Equation": ""}),
    ("D-equation", {**TDC, "Equation": "EQX"}),
    ("D-mode", {**YOKOGAWA, "Mode": ""}),
    ("D-mode", {**YOKOGAWA, "Mode": "MAN"}),
    ("D-action", {"Action": ""}),
    ("D-action", {"Action": "?"}),
    ("D-action", {"Action": "REV?"}),
    ("D-action", {"Action": "normal"}),
    ("D-action", {"System": "automationdirect/directlogic", "I unit": "s", "Action": "Direct"}),
    ("D-range", {**FC19, "LRV": "", "URV": ""}),
    ("D-range", {"LRV": "", "URV": "", "New LRV": "0", "New URV": "100", "Re-ranged?": "Y"}),
    ("D-rerange", {"New LRV": "0", "New URV": "100"}),
    ("D-rerange", {"Re-ranged?": "Y"}),
    ("D-update", {"Update [s]": "0.5"}),
    ("D-zero-gain", {"P": "0"}),
    ("D-unused", {"P": "0", "I": "0"}),
    ("D-unused", {"P": "0", "P unit": "PB", "I": "0", "D": "0"}),
    ("D-unused", {"Remarks": "spare"}),
    ("D-unused", {"Remarks": "out of service since 2019"}),
    ("D-default", {**FC19, "P": "1", "I": "0"}),
    ("D-no-integral", {"I": "0"}),
    ("D-no-integral", {"I": "off"}),
    ("D-no-integral", {**TDC, "I": "0"}),
    ("D-nonlinear", {"Options": "GAP 2 %"}),
    ("D-nonlinear", {"Options": "ERRSQ"}),
    ("D-nonlinear", {"Options": "FF from FI-12"}),
    ("D-nonlinear", {"Options": "ratio"}),
    ("D-nonlinear", {"Options": "split range with B"}),
    ("D-nonlinear", {"Options": "characterizer"}),
    ("D-nonlinear", {"Options": "X17"}),
    ("D-nonlinear", {"Remarks": "split range A/B"}),
    ("D-refused", {**UDC, "I": "0.2 min", "D": "1", "D unit": "min", "target": "Series"}),
]
FLAGS: list[tuple[str, Mapping[str, str]]] = [
    ("F-unit-assumed", {"I unit": ""}),
    ("F-unit-assumed", {"D": "0.5"}),
    ("F-unit-other", {"I": "2", "I unit": "min/rep"}),
    ("F-unit-other", {"I": "30", "I unit": "s"}),
    ("F-unit-other", {"P": "50", "P unit": "PB"}),
    ("F-unit-other", {**TDC, "I": "0.5", "I unit": "rep/min"}),
    ("F-td-ti", {"D": "20", "D unit": "s"}),
    ("F-td-ti", {**TDC, "D": "9", "D unit": "min"}),
    ("F-scan-slow", {"I": "20"}),
    ("F-filter-long", {"D": "0.1", "D unit": "min", "PV filter [s]": "20"}),
    ("F-limits", {"OP lo": "10"}),
    ("F-rerange", {"New LRV": "0", "New URV": "100", "Re-ranged?": "Y"}),
    ("F-rescaled", {"New LRV": "0", "New URV": "100", "Re-ranged?": "N"}),
    ("F-approx", {**UDC, "D": "0.1", "D unit": "min"}),
    ("F-structure", {**UDC, "D": "0.1", "D unit": "min"}),
    ("F-manual", {"Mode": "MAN"}),
    ("F-cascade", {"Mode": "CAS"}),
]


@pytest.mark.parametrize(("code", "row"), ERRORS)
def test_a_row_that_cannot_be_read_is_an_error(code: str, row: Mapping[str, str], tmp_path: Path) -> None:
    found = run_one(tmp_path, row)
    assert (found.row_class, code in found.reading.codes, found.settings) == ("error", True, {}), found.reading.findings


@pytest.mark.parametrize(("code", "row"), DECISIONS)
def test_a_row_that_is_in_doubt_waits_for_a_decision(code: str, row: Mapping[str, str], tmp_path: Path) -> None:
    row = dict(row)
    form = row.pop("target", "")
    rules = tmp_path / "rules.yaml"
    rules.write_text(f"target: emerson/deltav\noptions: {{FORM: {form}}}\n" if form else "target: emerson/deltav\n", "utf-8")
    found = run_one(tmp_path, row, target=None, rules=rules)
    assert (found.row_class, code in found.reading.codes, found.settings) == ("decision", True, {}), found.reading.findings


@pytest.mark.parametrize(("code", "row"), FLAGS)
def test_a_row_that_must_be_read_is_flagged(code: str, row: Mapping[str, str], tmp_path: Path) -> None:
    found = run_one(tmp_path, row)
    assert (found.row_class, code in found.reading.codes) == ("converted", True), found.reading.findings


def test_the_usual_loop_has_no_finding(tmp_path: Path) -> None:
    found = run_one(tmp_path, {})
    assert (found.row_class, found.reading.codes) == ("converted", [])
    assert {n: found.settings[n] for n in ("GAIN", "RESET", "RATE")} == {"GAIN": 2.0, "RESET": 15.0, "RATE": 0.0}


def test_a_tag_with_other_contents_waits_and_the_same_contents_count_once(tmp_path: Path) -> None:
    rows, summary = run(tmp_path, {}, {"P": "3"}, {"Tag": "TIC-2"}, {"Tag": "TIC 2"}, {"Tag": "tic-1", "P": "4"})
    assert [row.row_class for row in rows] == ["decision", "decision", "converted", "converted", "decision"]
    rows, summary = run(tmp_path, {}, {"Remarks": "again"})
    assert [row.reading.codes for row in rows] == [[], ["F-repeat"]]
    assert summary.counts["converted"] == 2


def test_a_structure_that_others_state_and_one_does_not_waits(tmp_path: Path) -> None:
    rows, _ = run(tmp_path, TDC, {**TDC, "Tag": "TIC-2", "Equation": ""})
    assert [(row.row_class, row.reading.codes) for row in rows] == [("converted", []), ("decision", ["D-structure"])]


def test_a_filter_goes_along_where_the_target_has_a_place_for_it(tmp_path: Path) -> None:
    row = {"PV filter [s]": "3"}
    assert run_one(tmp_path, row).settings["PV_FTIME"] == 3.0
    found = run_one(tmp_path, row, target="allen-bradley/pide")
    assert (found.row_class, found.reading.codes) == ("decision", ["D-filter"])
    rules = tmp_path / "rules.yaml"
    rules.write_text("target: allen-bradley/pide\npv-filter: leave out\n", "utf-8")
    assert run_one(tmp_path, row, target=None, rules=rules).row_class == "converted"
    rules.write_text("target: allen-bradley/pide\npv-filter: in front\n", "utf-8")
    found = run_one(tmp_path, row, target=None, rules=rules)
    assert found.row_class == "converted"
    assert found.to_dict()["figures"]["lag_on_pv"] == 3.0


MOMENTS = "match: exact-else-low-frequency\noptions: {STRUCTURE: match-source}\n"


@pytest.mark.parametrize("row", [
    {**YOKOGAWA, "D": "10", "D unit": "s", "PV filter [s]": "3"},
    {"System": "foxboro/ia-pid", "P": "50", "P unit": "PB", "I unit": "min", "D": "0.3", "D unit": "min", "PV filter [s]": "3"},
])  # fmt: skip
def test_a_filter_is_not_absorbed_into_the_dials(row: Mapping[str, str], tmp_path: Path) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text(f"target: emerson/deltav\n{MOMENTS}", "utf-8")
    with_it, without = (run_one(tmp_path, {**row, **more}, target=None, rules=rules) for more in ({}, {"PV filter [s]": ""}))
    assert with_it.settings["PV_FTIME"] == 3.0
    assert {**with_it.settings, "PV_FTIME": 0.0} == without.settings
    rules.write_text("target: allen-bradley/pide\nmatch: exact-else-low-frequency\npv-filter: in front\n", "utf-8")
    in_front = run_one(tmp_path, row, target=None, rules=rules)
    assert in_front.to_dict()["figures"]["lag_on_pv"] == 3.0
    rules.write_text("target: allen-bradley/pide\nmatch: exact-else-low-frequency\n", "utf-8")
    assert "D-filter" in run_one(tmp_path, row, target=None, rules=rules).reading.codes


def test_choices_of_one_letter_are_words_of_their_option(tmp_path: Path) -> None:
    row = {"System": "foxboro/ia-pid", "P": "50", "P unit": "PB", "I": "2", "I unit": "min"}
    stated = [run_one(tmp_path, {**row, "Form": mode}).reading.stated for mode in ("P", "PI", "I", "PID", "")]
    assert stated == [{"MODOPT": "P"}, {"MODOPT": "PI"}, {"MODOPT": "I"}, {"MODOPT": "PID"}, {}]
    assert run_one(tmp_path, {**row, "Form": "P"}).reading.codes == ["D-no-integral"]


def test_a_negative_gain_is_none_where_the_card_allows_it(tmp_path: Path) -> None:
    row = {"System": "iec/61131-3-pid", "P": "-2", "I": "15", "I unit": "s", "Action": "direct"}
    assert "E-negative" not in run_one(tmp_path, row).reading.codes


def test_one_broken_row_never_costs_another(tmp_path: Path) -> None:
    broken = [{**row, "Tag": f"X-{n}"} for n, (_, row) in enumerate(ERRORS[3:], 1)]
    mixed = [row for n, one in enumerate(broken) for row in (one, {"Tag": f"TIC-{n + 10}"})]
    rows, summary = run(tmp_path, *mixed)
    assert summary.counts == {"converted": len(broken), "decision": 0, "error": len(broken), "skipped": 1}
    assert all(row.settings == rows[1].settings for row in rows[1::2])


@pytest.mark.parametrize(("row", "unit_from", "reset"), [
    ({"I": "30 s/rep", "I unit": ""}, "cell", 30.0),
    ({"I": "0.5", "I unit": "min/rep"}, "unit column", 30.0),
    ({"I": "2", "I unit": ""}, "card", 30.0),
])  # fmt: skip
def test_the_unit_of_a_setting_has_an_origin(row: Mapping[str, str], unit_from: str, reset: float, tmp_path: Path) -> None:
    found = run_one(tmp_path, row)
    assert found.reading.origins["RESET"].unit_from == unit_from
    assert found.settings["RESET"] == reset


def test_units_in_the_mapping_come_before_the_cards_own(tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text("units: {fisher/provox: {integral: min/rep}}\n", "utf-8")
    found = run_one(tmp_path, {"I": "0.5", "I unit": ""}, mapping=mapping)
    assert (found.reading.origins["RESET"].unit_from, found.settings["RESET"]) == ("mapping", 30.0)


def test_a_blank_unit_is_the_cards_own_where_its_options_only_scale_it(tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text("words: {reverse: [falls]}\n", "utf-8")
    row = {"System": "automationdirect/directlogic", "I": "45", "I unit": "", "Action": "falls"}
    found = run_one(tmp_path, row, mapping=mapping)
    assert (found.row_class, found.reading.codes, found.settings["RESET"]) == ("converted", ["F-unit-assumed"], 45.0)


def test_a_blank_unit_can_be_asked_for(tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text("blank-units: ask\n", "utf-8")
    found = run_one(tmp_path, {"I unit": ""}, mapping=mapping)
    assert (found.row_class, found.reading.codes) == ("decision", ["D-unit"])


def test_the_rules_can_raise_and_lower_a_level(tmp_path: Path) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text("target: emerson/deltav\nlevels: {F-manual: decision, D-nonlinear: flag}\n", "utf-8")
    assert run_one(tmp_path, {"Mode": "MAN"}, target=None, rules=rules).row_class == "decision"
    found = run_one(tmp_path, {"Options": "GAP 2 %"}, target=None, rules=rules)
    assert (found.row_class, found.reading.codes) == ("converted", ["D-nonlinear", "F-lowered"])


def test_a_deviation_beyond_what_the_rules_allow_waits(tmp_path: Path) -> None:
    rules = tmp_path / "rules.yaml"
    rules.write_text("target: emerson/deltav\nallowed-deviation: 0.1\n", "utf-8")
    found = run_one(tmp_path, {**UDC, "D": "0.1", "D unit": "min"}, target=None, rules=rules)
    assert (found.row_class, "D-refused" in found.reading.codes) == ("decision", True)


def test_a_real_interval_is_made_up_for_where_a_person_says_so(tmp_path: Path) -> None:
    row, file = {"Update [s]": "0.5", "Scan [s]": "1"}, tmp_path / "decisions.csv"
    file.write_text("tag,rule,answer\nTIC-1,D-update,real\n", "utf-8")
    assert run_one(tmp_path, row, decisions=file).settings["RESET"] == 30.0
    file.write_text("tag,rule,answer\nTIC-1,D-update,scan\n", "utf-8")
    assert run_one(tmp_path, row, decisions=file).settings["RESET"] == 15.0


def test_another_range_multiplies_the_gain_and_another_scale_does_not(tmp_path: Path) -> None:
    new = {"New LRV": "0", "New URV": "100"}
    assert run_one(tmp_path, {**new, "Re-ranged?": "Y"}).settings["GAIN"] == 1.0
    assert run_one(tmp_path, {**new, "Re-ranged?": "N"}).settings["GAIN"] == 2.0
    assert run_one(tmp_path, {**new, "Re-ranged?": "Y", "EU": ""}).settings["GAIN"] == 1.0
    assert run_one(tmp_path, {**new, "Re-ranged?": "Y", "EU": "%"}).settings["GAIN"] == 1.0


def test_every_code_has_a_test_and_an_explanation() -> None:
    elsewhere = {
        "E-bits", "E-program", "D-structure", "D-duplicate", "D-filter", "F-series-limit", "F-hidden-row", "F-rounding", "F-repeat",
        "F-interval",
        "F-decided", "F-lowered",
    }  # fmt: skip
    assert {code for code, _ in (*ERRORS, *DECISIONS, *FLAGS)} | elsewhere == set(CODES)
    assert all(code.about.endswith(".") for code in CODES.values())
    assert all(code.answers for name, code in CODES.items() if name.startswith("D-"))


def test_a_fault_of_pidemu_costs_its_own_loop_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(reading: Any, *more: Any) -> Any:
        if reading.tag == "TIC-1":
            raise ZeroDivisionError("float division by zero")
        return convert_loop(reading, *more)

    monkeypatch.setattr("pidemu.plant.job.convert_loop", failing)
    rows, _ = run(tmp_path, {}, {"Tag": "TIC-2"})
    assert [(row.row_class, row.reading.codes) for row in rows] == [("error", ["E-program"]), ("converted", [])]
