"""The commands that list, show and check cards."""

from __future__ import annotations

from pathlib import Path

import pytest

import pidemu
from pidemu.card.library import ENVIRONMENT, card_files
from tests.checks.bench import VALID, edited, written
from tests.cli.helpers import said, strict_json, told
from tests.helpers import option_combinations

_COMBINATIONS = [(i, o) for i in card_files() for o in option_combinations(pidemu.load_card(i))]


def test_cards_lists_every_card_on_a_line_of_its_own() -> None:
    header, *lines = told("cards").splitlines()
    words = header.split()
    assert (words[0], words[-4:]) == ("card", ["documented", "measured", "inferred", "assumed"])
    assert pidemu.cards() == [line.split()[0] for line in lines]


def test_cards_finds_a_word_in_id_or_title_in_any_case() -> None:
    assert [line.split()[0] for line in told("cards", "FISHER").splitlines()[1:]] == ["fisher/provox"]
    assert [line.split()[0] for line in told("cards", "deltav").splitlines()[1:]] == ["emerson/deltav"]


def test_cards_counts_the_statements_by_status() -> None:
    variant = pidemu.load_card("fisher/provox").variant()
    [card] = strict_json(told("cards", "provox", "--json"))
    assert (card["card"], card["title"]) == ("fisher/provox", variant.card.title)
    assert list(card["status"]) == ["documented", "measured", "inferred", "assumed"]
    assert sum(card["status"].values()) == len(variant.statements())


def test_cards_as_json_holds_every_card() -> None:
    assert pidemu.cards() == [card["card"] for card in strict_json(told("cards", "--json"))]


def test_cards_lists_those_of_a_folder_as_well(folder: Path) -> None:
    written(folder, VALID)
    assert "nobody/bench" in [line.split()[0] for line in told("cards", "--vendors", ".").splitlines()]


def test_cards_lists_those_of_the_environment(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(folder, VALID)
    monkeypatch.setenv(ENVIRONMENT, str(folder))
    assert told("cards", "bench").splitlines()[1].startswith("nobody/bench  Nobody test bench: PID")


def test_a_broken_card_is_named_and_the_others_are_listed(folder: Path) -> None:
    file = written(folder, edited(VALID, ("form: standard", "form: serial")))
    status, out, err = said("cards", "--vendors", str(folder))
    assert status == 1
    assert len(out.splitlines()) == 1 + len(pidemu.cards())
    assert err == (
        f"error: nobody/bench: {file}:7:7: 'serial' is not one of 'parallel', 'standard' or 'series' (did you mean 'series'?)\n"
    )


@pytest.mark.parametrize(("card_id", "options"), _COMBINATIONS, ids=str)
def test_show_prints_every_card_with_every_choice_of_options(card_id: str, options: dict[str, str]) -> None:
    words = [f"{name}={choice}" for name, choice in options.items()]
    text = told("show", card_id, *words)
    assert text.startswith(f"{card_id}   {pidemu.load_card(card_id).title}\n")
    assert [h for h in ("Equation", "Scan by scan", "Settings", "Evidence", "Sources", "Examples") if f"\n{h}" not in text] == []
    shown = strict_json(told("show", card_id, *words, "--json"))
    assert (card_id, options) == (shown["card"], shown["options"])


def test_show_prints_equation_settings_and_their_evidence() -> None:
    lines = [line.split() for line in told("show", "fisher/provox").splitlines()]
    assert ["RESET", "integral", "repeat/min", "required", "0", "reset", "rate"] in lines
    assert ["form", "documented", "[beall]", "PROVOX", "PID", "algorithm:", "series"] in lines
    assert "OUT = K [ (SP - L PV) + 1/(Ti s) (SP - L PV) ]" in told("show", "fisher/provox")


def test_show_marks_a_dial_that_the_options_leave_unused() -> None:
    [line] = [line for line in told("show", "emerson/deltav", "STRUCTURE=4").splitlines() if line.startswith("  RESET ")]
    assert "not used with these options" in line


def test_show_takes_a_file(folder: Path) -> None:
    assert told("show", str(written(folder, VALID))).startswith("nobody/bench   Nobody test bench: PID\n")


def test_check_finds_nothing_in_the_built_in_cards() -> None:
    assert told("check") == f"{len(pidemu.cards())} cards, 0 problems\n"


def test_check_of_a_file_says_so_in_the_singular(folder: Path) -> None:
    written(folder, VALID)
    assert told("check", "nobody/bench.yaml") == "1 card, 0 problems\n"


def test_check_of_a_folder_takes_every_card_below(folder: Path) -> None:
    written(folder / "a", VALID)
    written(folder / "b" / "c", VALID)
    assert told("check", "a", "b") == "2 cards, 0 problems\n"


def test_check_with_vendors_takes_those_and_the_built_in_cards(folder: Path) -> None:
    written(folder, VALID)
    assert told("check", "--vendors", ".") == f"{len(pidemu.cards()) + 1} cards, 0 problems\n"


def test_check_prints_every_problem_with_its_place_and_fails(folder: Path) -> None:
    written(folder, edited(VALID, ("output: falls", "output: rises"), ("limits: [0, 100]", "limits: [100, 0]")))
    assert said("check", "nobody") == (
        1,
        "1 card, 2 problems\n",
        "nobody/bench.yaml:26:3: with reverse action the output falls, the example says it rises\n"
        "  25 |   names: {reverse: Reverse, direct: Direct}\n"
        "  26 |   example: {name: Reverse, sp: 50, pv: 51, output: rises}\n"
        "     |   ^^^^^^^\n"
        "  27 | scan: {default: 1 s}\n"
        "nobody/bench.yaml:28:18: output limits 100 to 0 do not ascend\n"
        "  27 | scan: {default: 1 s}\n"
        "  28 | output: {limits: [100, 0]}\n"
        "     |                  ^\n"
        "  29 | evidence:\n",
    )


def test_check_as_json_lists_the_problems(folder: Path) -> None:
    written(folder, edited(VALID, ("limits: [0, 100]", "limits: [100, 0]")))
    status, out, err = said("check", "nobody", "--json")
    assert (status, err) == (1, "")
    assert strict_json(out) == [
        {"path": "nobody/bench.yaml", "line": 28, "column": 18, "message": "output limits 100 to 0 do not ascend"}
    ]


def test_check_as_json_of_a_good_card_is_an_empty_list(folder: Path) -> None:
    written(folder, VALID)
    assert strict_json(told("check", "nobody", "--json")) == []


def test_the_version_is_the_package_s() -> None:
    assert told("--version") == f"pidemu {pidemu.__version__}\n"


@pytest.mark.parametrize("command", ["cards", "show", "check", "convert", "run", "code"])
def test_every_command_has_help(command: str) -> None:
    assert told(command, "--help").startswith(f"Usage: pidemu {command} ")
    assert f"\n  {command} " in told("--help")
