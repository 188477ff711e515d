"""The command that converts settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.card.library import card_files
from tests.checks.bench import VALID, written
from tests.cli.helpers import answer, said, strict_json, told

PROVOX = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")
PI = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "emerson/deltav")
REFUSED = (
    "convert",
    "honeywell/tdc3000",
    "K=1",
    "T1=1",
    "T2=30",
    "FORM=interactive",
    "--to",
    "emerson/deltav",
    "--set",
    "FORM=Standard",
)
HOPELESS = (*PI, "--set", "STRUCTURE=4")


def converted(*words: str) -> Any:
    return strict_json(told(*words, "--json"))


def dials(*words: str) -> dict[str, float]:
    return {name: v["value"] for name, v in converted(*words)["to"]["settings"].items()}


def sections(text: str) -> dict[str, list[list[str]]]:
    """Words of every line, by the heading above."""
    found: dict[str, list[list[str]]] = {}
    heading = ""
    for line in text.splitlines():
        if line and not line.startswith(" "):
            heading = line.split(":")[0]
            found[heading] = []
        elif line:
            found[heading].append(line.split())
    return found


def test_convert_prints_both_sides_the_verdict_and_the_figures() -> None:
    text = told(*PROVOX)
    parts = sections(text)
    assert text.startswith("fisher/provox  ->  emerson/deltav\n")
    assert parts["From"] == [
        ["GAIN", "2", "%/%"],
        ["RESET", "4", "repeat/min", "=", "15", "s/repeat"],
        ["RATE", "0.1", "min", "=", "6", "s"],
    ]
    assert parts["To"][0] == [
        "chosen", "automatically:", "FORM=Series", "(--set", "to", "change,", "--explain", "for", "why)"
    ]  # fmt: skip
    assert [row[:3] for row in parts["To"][2:5]] == [["GAIN", "2", "%/%"], ["RESET", "15", "s/repeat"], ["RATE", "5.25", "s"]]
    assert parts["To"][5][:3] == ["ALPHA", "0.14286", "0.125"]  # 1/7, and what the textbook's rule leaves
    assert parts["Verdict"][0][0] == "exact:"
    assert ["feedback", "(PV)", "loop", "band"] in [row[:4] for row in parts["Figures"]]


def test_convert_as_json_holds_what_programs_need() -> None:
    found = converted(*PROVOX)
    assert {"from", "to", "verdict", "certificate", "warnings"} <= set(found)
    assert found["from"] == {
        "card": "fisher/provox",
        "settings": {
            "GAIN": {"value": 2.0, "unit": "%/%"},
            "RESET": {"value": 4.0, "unit": "repeat/min"},
            "RATE": {"value": 0.1, "unit": "min"},
        },
        "options": {},
    }
    assert {"card", "settings", "options", "lag_on_pv"} == set(found["to"])
    assert found["to"]["options"] == {"FORM": "Series", "STRUCTURE": "1", "FRSIPID_OPTS": "none"}
    assert found["chosen"] == {"FORM": "Series"}
    assert found["to"]["settings"]["ALPHA"] == {"value": 0.14286, "unit": "1", "unrounded": pytest.approx(1 / 7, rel=1e-12)}
    assert found["verdict"] == "exact"
    assert {"feedback", "setpoint"} <= set(found["certificate"])


def test_convert_as_json_is_what_the_function_gives() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    assert answer(pidemu.convert(source, "emerson/deltav", digits=5).to_dict()) == answer(converted(*PROVOX))


def test_infinite_settings_are_words_in_json() -> None:
    found = converted("convert", "generic/standard", "K=2", "Ti=off", "--to", "emerson/deltav", "--set", "STRUCTURE=1")
    assert found["to"]["settings"]["RESET"] == {"value": "inf", "unit": "s/repeat", "unrounded": "inf"}


def test_infinite_settings_are_words_in_the_json_of_a_question() -> None:
    """DeltaV's limits of the reset are infinite unless set."""
    status, out, _ = said("convert", "emerson/deltav", "GAIN=2", "RESET=60", "RATE=15", "--to", "emerson/deltav", "--json")
    [question] = strict_json(out)["questions"]
    assert (status, question["kind"], question["about"]) == (1, "option", "FORM")
    assert [r["settings"]["ARW_HI_LIM"]["value"] for r in question["readings"]] == ["inf", "inf"]


def test_a_value_may_have_a_unit() -> None:
    assert dials(*PI) == dials("convert", "fisher/provox", "GAIN=2", "RESET=15 s/repeat", "--to", "emerson/deltav")


def test_what_was_read_in_another_unit_is_stated() -> None:
    text = told("convert", "fisher/provox", "GAIN=2", "RESET=15 s/repeat", "--to", "emerson/deltav")
    assert "15 s/repeat is 4 repeat/min, the reciprocal, since the dial is in repeat/min" in " ".join(text.split())


def test_spaces_around_the_equals_sign_do_no_harm() -> None:
    assert dials(*PI) == dials("convert", "fisher/provox", "GAIN = 2", "RESET= 4", "--to", "emerson/deltav")


def test_names_are_found_in_upper_or_lower_case() -> None:
    assert dials(*PI) == dials("convert", "fisher/provox", "gain=2", "reset=4", "--to", "emerson/deltav")


def test_an_option_of_the_target_is_set() -> None:
    found = converted(*PROVOX, "--set", "FORM=Series", "--set", "structure=0")
    assert found["to"]["options"] == {"FORM": "Series", "STRUCTURE": "0", "FRSIPID_OPTS": "none"}


def test_a_dial_of_the_target_keeps_the_value_it_is_set_to() -> None:
    assert dials(*PROVOX, "--set", "ALPHA=0.1")["ALPHA"] == 0.1


def test_one_scan_interval_counts_for_both() -> None:
    found = converted(*PROVOX, "--scan", "0.5")
    assert found["scan"] == [0.5, 0.5]
    assert found["certificate"]["feedback_at_scan"] is not None
    assert "feedback, at the scans" in told(*PROVOX, "--scan", "0.5")


def test_two_scan_intervals_are_source_and_target() -> None:
    assert converted(*PROVOX, "--scan", "1,0.5")["scan"] == [1.0, 0.5]


def test_without_a_scan_interval_there_are_no_figures_at_the_scans() -> None:
    found = converted(*PROVOX)
    assert (found["scan"], found["certificate"]["feedback_at_scan"]) == (None, None)


@pytest.mark.parametrize(
    ("match", "dial"),
    [("exact", ()), ("textbook", ()), ("low-frequency", ("--set", "ALPHA=0.1"))],
    ids=["exact", "textbook", "low"],
)
def test_the_match_is_the_one_asked_for(match: str, dial: tuple[str, ...]) -> None:
    assert converted(*PROVOX, "--match", match, *dial)["match"] == match


def test_a_refusal_says_why_and_what_would_be_nearest() -> None:
    status, out, err = said(*REFUSED)
    first, second, *rest = err.splitlines()
    assert (status, out) == (1, "")
    assert first == (
        "error: refused: emerson/deltav cannot do what honeywell/tdc3000 does: RATE would have to be negative, -115.714 s: "
        "with these filters no positive one fits; other options would do: --set FORM=Series --set STRUCTURE=0: exact"
    )
    assert second == "nearest settings, which 'pidemu convert --allow-approximate' gives:"
    assert [line.split(" = ")[0].strip() for line in rest[:-1]][:4] == ["GAIN", "RESET", "RATE", "ALPHA"]
    assert rest[-1].startswith("their cost in the loop band: up to ")


def test_a_refusal_without_any_useful_settings_offers_none() -> None:
    status, out, err = said(*HOPELESS)
    assert (status, out) == (1, "")
    assert err == (
        "error: refused: emerson/deltav cannot do what fisher/provox does: the source has integral action, "
        "emerson/deltav (FORM=Standard, STRUCTURE=4, FRSIPID_OPTS=none) has none; no settings of it come near; "
        "other options would do: --set FORM=Series --set STRUCTURE=1: exact\n"
    )
    assert strict_json(said(*HOPELESS, "--json").out)["verdict"] == "refused"


def test_a_refusal_prints_plain_ratios_without_a_unit() -> None:
    assert "  ALPHA = 0.125" in said(*REFUSED).err.splitlines()


def test_a_refusal_as_json_has_the_verdict_refused_and_the_nearest_settings() -> None:
    status, out, err = said(*REFUSED, "--json")
    found = strict_json(out)
    assert status == 1
    assert found["verdict"] == "refused"
    assert err == f"error: refused: {found['reason']}\n"
    assert found["nearest"]["to"]["settings"]["RATE"] == {"value": 0.0, "unit": "s", "unrounded": 0.0}


def test_the_nearest_settings_are_given_where_approximation_is_allowed() -> None:
    found = converted(*REFUSED, "--allow-approximate")
    assert (found["match"], found["verdict"]) == ("constrained", "approximate")
    assert found["warnings"][0].startswith("These are only the nearest settings: ")


def test_dials_are_rounded_to_the_target_s_resolution_and_the_effect_is_stated() -> None:
    words = ("convert", "generic/standard", "K=2", "Ti=100", "Td=10", "--to", "honeywell/udc")
    dials = converted(*words)["certificate"]["dials"]
    assert {d["name"]: (d["rounded"], d["to_resolution"]) for d in dials} == {"RSET": (1.67, True), "RATE": (0.17, True)}
    assert "rounded to 5 digits, RSET, RATE to the dial's resolution: within 1 %" in " ".join(told(*words).split())


@pytest.mark.parametrize(("digits", "gain"), [(3, 2.67), (5, 2.6667), (9, 2.66666667)])
def test_dials_without_a_resolution_are_rounded_to_the_digits_asked_for(digits: int, gain: float) -> None:
    words = ("convert", "generic/series", "K=2", "Ti=15", "Td=5", "--to", "generic/standard", "--digits", str(digits))
    assert dials(*words)["K"] == gain  # 8/3
    assert converted(*words)["to"]["settings"]["K"]["unrounded"] == pytest.approx(8 / 3, rel=1e-12)


def test_other_ranges_on_the_target_rescale_the_gain() -> None:
    ranges = ("--pv-range", "0,200 K", "--op-range", "0,100 l/h", "--to-pv-range", "0,400 K", "--to-op-range", "0,50 l/h")
    assert dials(*PI, *ranges)["GAIN"] == 8.0
    assert converted(*PI, *ranges)["gain_factor"] == 4.0


def test_the_target_takes_the_source_s_ranges() -> None:
    words = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "arduino/pid", "--pv-range", "0,200", "--op-range", "0,255")
    assert dials(*words)["Kp"] == pytest.approx(2 * 255 / 200)


def test_a_range_may_start_below_zero() -> None:
    assert dials(*PI, "--pv-range", "-50,150 degC", "--to-pv-range=-50,350 degC")["GAIN"] == 4.0


LOOP = """\
about: reactor temperature, TIC-101
card: fisher/provox
settings: {GAIN: 2, RESET: 4, RATE: 6 s}
to: emerson/deltav
set: {FORM: Series, ALPHA: 0.1}
scan: [1, 0.5]
"""


def test_a_loop_file_says_what_the_command_line_would(folder: Path) -> None:
    (folder / "loop.yaml").write_text(LOOP, encoding="utf-8")
    by_hand = (
        "convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=6 s", "--to", "emerson/deltav",
        "--set", "FORM=Series", "--set", "ALPHA=0.1", "--scan", "1,0.5",
    )  # fmt: skip
    assert answer(converted(*by_hand)) == answer(converted("convert", "--loop", "loop.yaml"))


def test_the_command_line_overrides_a_loop_file(folder: Path) -> None:
    (folder / "loop.yaml").write_text(LOOP.replace("set: {FORM: Series, ALPHA: 0.1}\n", ""), encoding="utf-8")
    found = converted("convert", "--loop", "loop.yaml", "--to", "generic/parallel", "--scan", "2")
    assert (found["to"]["card"], found["scan"]) == ("generic/parallel", [2.0, 2.0])


def test_one_scan_interval_in_a_loop_file_counts_for_both(folder: Path) -> None:
    (folder / "loop.yaml").write_text(LOOP.replace("[1, 0.5]", "[2]"), encoding="utf-8")
    assert converted("convert", "--loop", "loop.yaml")["scan"] == [2.0, 2.0]


def test_both_cards_may_be_files_or_come_from_a_folder(folder: Path) -> None:
    file = str(written(folder, VALID))
    words = ("GAIN=2", "RESET=60", "--to")
    by_file = dials("convert", file, *words, file)
    assert by_file == dials("convert", "nobody/bench", *words, "nobody/bench", "--vendors", ".")
    assert (by_file["GAIN"], by_file["RESET"]) == (2.0, 60.0)


@pytest.mark.parametrize("card_id", card_files())
def test_every_example_of_every_card_converts_to_the_standard_form_or_is_refused_or_asked_about(card_id: str) -> None:
    card = pidemu.load_card(card_id)
    for example in card.data.examples:
        words = [f"{name}={value}" for name, value in example.given.items()]
        status, out, err = said("convert", card_id, *words, "--to", "generic/standard", "--json")
        found = strict_json(out)
        words_of = {"refused": "error: refused: ", "question": "question: "}
        assert (status, err[: len(words_of.get(found["verdict"], ""))]) == (
            int(found["verdict"] in words_of), words_of.get(found["verdict"], "")
        )  # fmt: skip


@pytest.mark.parametrize("card_id", card_files())
def test_an_example_whose_options_are_all_stated_leaves_no_option_open(card_id: str) -> None:
    card = pidemu.load_card(card_id)
    for example in card.data.examples:
        stated = {**card.settings(example.given).options, **example.given}
        words = [f"{name}={value}" for name, value in stated.items()]
        found = strict_json(said("convert", card_id, *words, "--to", "generic/standard", "--json").out)
        assert [q for q in found.get("questions", ()) if q["kind"] == "option"] == []
