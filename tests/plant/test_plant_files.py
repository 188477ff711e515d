"""Mapping, rules and decisions: what they say, and where they are wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from pidemu.card.library import load_card
from pidemu.errors import ListError
from pidemu.plant.decisions import read_decisions
from pidemu.plant.draft import draft_mapping
from pidemu.plant.mapping import PlantWords, read_mapping
from pidemu.plant.match_source import matching_choice
from pidemu.plant.rules import loop_type, read_rules
from pidemu.plant.sources import read_sources
from tests.plant.lists import TDC, run_one, write_list
from tests.plant.scoring import DATA, MAP, RULES


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("systems: {acme/pid: [X]}", r"map\.yaml:1:11: no card 'acme/pid'"),
        ("systems: [X]", r"map\.yaml:1:10: expected a mapping"),
        ("system: {}", r"map\.yaml:1:1: unknown key 'system' \(did you mean 'systems'\?\)"),
        ("options: {honeywell/udc: {ALG: {A: [x]}}}", "honeywell/udc has no option 'ALG'"),
        ("options: {honeywell/udc: {ALGO: {C: [x]}}}", "ALGO is one of A, B"),
        ("blank-units: never", r"map\.yaml:1:14"),
        ("a: &x 1", "anchor is not used in mappings"),
    ],
)
def test_a_wrong_mapping_is_an_error_with_its_place(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(text + "\n", "utf-8")
    with pytest.raises(ListError, match=message):
        read_mapping(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("options: {FORM: Standard}", "no target is stated"),
        ("target: emerson/deltav\noptions: {FROM: Standard}", "has no option 'FROM' .did you mean 'FORM'"),
        ("target: emerson/deltav\noptions: {FORM: Ideal}", "FORM is 'Ideal'; it is one of Standard, Series, match-source"),
        ("target: emerson/deltav\nlevels: {F-sow: decision}", "unknown rule 'F-sow'"),
        ("target: emerson/deltav\nstop: [no-integal]", "unknown rule 'no-integal' .did you mean 'no-integral'"),
        ("target: emerson/deltav\nmatch: best", "best"),
        ("target: emerson/deltav\nscan-classes: {FIC: soon}", "'soon' is not a time"),
        ("target: emerson/deltav\ndigits: 0", r"rules\.yaml:2:9"),
        ("target: emerson/deltav\nby-source: {fisher/provox: {FORM: Ideal}}", "by-source: fisher/provox: FORM is 'Ideal'"),
    ],
)
def test_wrong_rules_are_an_error(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "rules.yaml"
    file.write_text(text + "\n", "utf-8")
    with pytest.raises(ListError, match=message):
        read_rules(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tag,answer\nX,1\n", "no column 'rule'"),
        ("tag,rule,answer\nX,D-sow,1\n", r"decisions\.csv:2: unknown rule 'D-sow'"),
        ("tag,rule,answer\nX,D-unit,%\nX,D-unit,1\n", r"decisions\.csv:3: X D-unit is answered '1', and '%' in .*decisions\.csv:2"),
    ],
)
def test_wrong_decisions_are_an_error_with_their_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "decisions.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(ListError, match=message):
        read_decisions(file)


def test_the_last_rule_that_matches_wins_and_is_named(tmp_path: Path) -> None:
    file = tmp_path / "rules.yaml"
    file.write_text(
        "target: emerson/deltav\noptions: {FORM: Standard}\nby-source: {fisher/provox: {FORM: Series}}\n"
        "by-type: {TIC: {digits: 3}}\n"
        'by-tag: {"TIC-70*": {FORM: Standard}}\n',
        "utf-8",
    )
    rules = read_rules(file)
    one, other, third = (
        rules.for_loop(*x) for x in (("fisher/provox", "FIC-1", ""), ("fisher/provox", "TIC-7001", ""), ("x", "tic-1", ""))
    )
    assert (one.options["FORM"], one.origins["FORM"], one.digits) == ("Series", "by-source: fisher/provox", None)
    assert (other.options["FORM"], other.origins["FORM"], other.digits) == ("Standard", "by-tag: TIC-70*", 3)
    assert (third.options["FORM"], third.origins["FORM"], third.digits) == ("Standard", "options", 3)


def test_the_second_target_has_options_of_its_own() -> None:
    rules = read_rules(RULES, "allen-bradley/pide")
    found = rules.for_loop("fisher/provox", "FIC-1", "")
    assert found.options == {"DependIndepend": "false", "DSmoothing": "false", "PVEProportional": "match-source"}
    assert (rules.scan_of("FIC-1"), rules.scan_of("LIC-1"), rules.scan_of("XIC-1")) == (0.5, 1.0, None)


@pytest.mark.parametrize(("tag", "kind"), [("FIC-1", "FIC"), ("10-TIC-7006", "TIC"), ("77", "")])
def test_the_loop_type_is_the_letters_of_the_tag(tag: str, kind: str) -> None:
    assert loop_type(tag) == kind


@pytest.mark.parametrize(
    ("source", "option", "choice"),
    [
        ({"card": "fisher/provox", "GAIN": 2, "RESET": 4, "RATE": 0.1}, "STRUCTURE", "1"),
        ({"card": "fisher/provox", "GAIN": 2, "RESET": 4, "RATE": 0.1}, "FORM", "Series"),
        ({"card": "honeywell/tdc3000", "K": 2, "T1": 4, "FORM": "ideal", "CTEQN": "D"}, "STRUCTURE", "6"),
        ({"card": "honeywell/tdc3000", "K": 2, "T1": 4, "T2": 1, "FORM": "ideal", "CTEQN": "C"}, "STRUCTURE", "2"),
        ({"card": "honeywell/tdc3000", "K": 2, "T1": 4, "T2": 1, "FORM": "ideal", "CTEQN": "A"}, "STRUCTURE", "0"),
        ({"card": "honeywell/tdc3000", "K": 2, "T1": 4, "FORM": "ideal", "CTEQN": "A"}, "FORM", "Standard"),
        ({"card": "allen-bradley/pide", "PGain": 2, "IGain": 4, "DGain": 1}, "FORM", None),
    ],
)
def test_match_source_is_the_choice_that_does_as_the_source_does(
    source: dict[str, object], option: str, choice: str | None
) -> None:
    card, given = str(source["card"]), {n: v for n, v in source.items() if n != "card"}
    assert matching_choice(load_card(card).settings(given), load_card("emerson/deltav"), option, {}, None) == choice


def test_match_source_follows_the_mode() -> None:
    s = load_card("yokogawa/fieldbus-pid").settings(GAIN=1.3, RESET=216, RATE=10)
    target = load_card("emerson/deltav")
    assert [matching_choice(s, target, "STRUCTURE", {}, mode) for mode in ("auto", "cascade")] == ["2", "1"]


def test_a_drafted_mapping_can_be_read_and_explains_itself(tmp_path: Path) -> None:
    text = draft_mapping(read_sources([DATA / "plant_small.csv"]), PlantWords())
    file = tmp_path / "map.yaml"
    file.write_text(text, "utf-8")
    words = read_mapping(file)
    card = words.card_of("PROVOX")
    assert card is not None
    assert card.id == "fisher/provox"
    for said in (
        "#   Kp / Xp: gain (name)", "#   PV-Filter [s]: pv-filter (name; PV-Filter in s)", "read as cp1252",
        "header in line 3, 40 loops", "# honeywell/udc: [UDC3300]      # 3 loops; a guess, take the # away if it is right",
        "not known, so that these loops stop: ?",
        "integral: 'min?' (1 loops) is open: min/repeat or repeat/min",
    ):  # fmt: skip
        assert said in text, said


def test_columns_that_are_not_known_are_drafted_with_samples(tmp_path: Path) -> None:
    file = write_list(tmp_path, {"Remarks": "x: [1]"})
    file.write_text(file.read_text("utf-8").replace('"Remarks"', '"Colour: a"'), "utf-8")
    text = draft_mapping(read_sources([file]), PlantWords())
    assert "'Colour: a': other      # not known; such as x: [1]" in text
    (tmp_path / "map.yaml").write_text(text, "utf-8")
    assert read_mapping(tmp_path / "map.yaml").columns_of("") == {"Colour: a": "other"}


def test_words_of_the_mapping_come_before_the_usual_ones(tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(
        "systems: {honeywell/tdc3000: [Old DCS]}\nwords: {reverse: [D], form: {ideal: [ni]}}\n"
        "options: {honeywell/tdc3000: {CTEQN: {C: [typ 3]}}}\n",
        "utf-8",
    )
    row = {**TDC, "System": "OLD-dcs", "Form": "NI", "Equation": "Typ 3", "Action": "D"}
    found = run_one(tmp_path, row, mapping=file)
    assert (found.row_class, found.reading.action, found.reading.stated) == (
        "converted",
        "reverse",
        {"FORM": "ideal", "CTEQN": "C"},
    )


def test_words_of_the_small_plant_say_what_they_mean() -> None:
    words = read_mapping(MAP)
    tdc = load_card("honeywell/tdc3000")
    assert [words.options.meaning(tdc, w) for w in ("NONINTER", "EQB", "nonsense")] == [("FORM", "ideal"), ("CTEQN", "B"), None]
    assert [words.actions.meaning(w) for w in ("INC-DEC", "d", "?")] == ["reverse", "direct", None]


def test_the_mapping_names_the_system_of_a_sheet_that_names_none(tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    file.write_text('sheet-systems: {"*": fisher/provox}\n', "utf-8")
    found = run_one(tmp_path, {"System": ""}, mapping=file)
    assert (found.row_class, found.reading.system) == ("converted", "fisher/provox")
