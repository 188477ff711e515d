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
    assert sum(card["status"].values()) == len(variant.statements)


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
        f"error: nobody/bench: {file}:7:7: 'serial' is not one of 'parallel', 'standard', 'series' or 'dahlin' "
        "(did you mean 'series'?)\n"
    )


@pytest.mark.parametrize(("card_id", "options"), _COMBINATIONS, ids=str)
def test_show_prints_every_card_with_every_choice_of_options(card_id: str, options: dict[str, str]) -> None:
    words = [f"{name}={choice}" for name, choice in options.items()]
    text = told("show", card_id, *words)
    assert text.startswith(f"{card_id}   {pidemu.load_card(card_id).title}\n")
    assert [
        h
        for h in ("Equation", "Scan by scan", "At the limits", "Modes and signals", "Settings", "Evidence", "Sources", "Examples")
        if f"\n{h}" not in text
    ] == []
    shown = strict_json(told("show", card_id, *words, "--json"))
    assert (card_id, options) == (shown["card"], shown["options"])


def test_show_prints_equation_settings_and_their_evidence() -> None:
    lines = [line.split() for line in told("show", "fisher/provox").splitlines()]
    assert ["RESET", "integral", "repeat/min", "required", "0", "reset", "rate"] in lines
    assert ["form", "documented", "[beall]", "PROVOX", "PID", "algorithm:", "series"] in lines
    assert "OUT = K [ (SP - L PV) + 1/(Ti s) (SP - L PV) ]" in told("show", "fisher/provox")


def _section(text: str, title: str) -> list[str]:
    """The lines of a section of the data sheet, each with single blanks."""
    [part] = [part for part in text.split("\n\n") if part.startswith(title)]
    return [" ".join(line.split()) for line in part.splitlines()[1:]]


def test_show_prints_a_data_sheet() -> None:
    text = told("show", "iec/61131-3-pid")
    assert _section(text, "Equation") == [
        "OUT = K [ (PV - SP) + 1/(Ti s) (PV - SP) + Td s (PV - SP) ]",
        "K = KP [eu/eu]",
        "Ti = TR [s]",
        "Td = TD [s]",
    ]
    assert _section(text, "Scan by scan") == [
        "form standard",
        "implementation positional: the output is the sum of the terms",
        "integral backward: this scan's error counts at once; the sum is that of e, gain and integral time are",
        "applied afterwards",
        "derivative four-point difference, over three scans",
        "signals engineering units",
        "scan interval 100 ms unless given; uneven scans are computed as if they were even",
        "arithmetic float32, rounded after every operation; operations with a number of the program text are",
        "float64",
    ]
    assert _section(text, "At the limits") == ["output limits none unless given", "at a limit none: the integral goes on"]
    assert _section(text, "Modes and signals") == [
        "action none to choose: the error is PV - SP, so a positive gain is direct acting; reverse is",
        "called 'negative KP', direct 'positive KP'",
        "in manual the output is the operator's number times the gain; the integral follows it; D is 0 and",
        "starts from the present signal",
        "to automatic the integral goes on from where it followed the output",
        "at power-up the integral starts at zero, whatever the output was; D starts from a signal of zero: a",
        "kick",
        "changed settings leave the integral of e as it is; a changed gain or integral time moves the whole sum;",
        "with a gain of 0 its sum and history go on unseen",
        "NaN, infinity in SP or PV: they are computed with",
    ]


@pytest.mark.parametrize(
    ("words", "section", "line"),
    [
        (("yokogawa/fieldbus-pid",), "Equation", "PVf = PV/(1 + Tpv s)"),
        (("yokogawa/fieldbus-pid",), "At the limits", "at a limit velocity: increments start from the limited output"),
        (("ardupilot/ac-pid",), "Equation", "E = (SPf - PV)/(1 + Te s)"),
        (("ardupilot/ac-pid",), "Equation", "Tf = 1/(2 pi FLTD), FLTD [Hz]"),
        (("ardupilot/ac-pid",), "Scan by scan", "filters setpoint backward, error backward"),
        (("ardupilot/ac-pid",), "At the limits", "integral limits -IMAX [eu] to IMAX [eu]"),
        (("ardupilot/ac-pid",), "Modes and signals", "NaN, infinity in SP or PV: the output is 0 and nothing is computed"),
        (("automationdirect/directlogic", "ERROR_TERM=DEADBAND"), "Equation", "S(x) = 0 while |x| < DEADBAND [%]; else x"),
        (
            ("automationdirect/directlogic",),
            "Modes and signals",
            "setpoint follows PV in manual, and stays there until it is changed",
        ),
        (("epics/epid",), "At the limits", "output deadband the output moves only by more than ODEL [eu]"),
        (("epics/epid",), "At the limits", "integral limits those of the output"),
        (("foxboro/ia-pid",), "Scan by scan", "filters measurement backward, second order"),
        (("foxboro/pneumatic",), "Equation", "OUT = K [ L (SP - PV) + 1/(Ti s) L (SP - PV) ]"),
        (("modelica/limpid",), "At the limits", "feedforward FF is added to the sum, before the limits"),
        (("modelica/limpid", "controllerType=P"), "Equation", "OUT = K [ (b SP - PV) ] + bias + kFF FF"),
        (("ni/pid", "ALGORITHM=precise"), "Equation", "S(x) = x (LINEARITY + (1 - LINEARITY) |x|/100)"),
        (("ros/control-toolbox",), "Modes and signals", "in manual the output is 0; the integral is 0"),
        (("toshiba/pid3",), "Scan by scan", "arithmetic integer: 100 counts per percent, 100 per unit of gain, remainders carried"),
        (("generic/dahlin",), "Equation", "N = theta/h, rounded to whole scans"),
        (("generic/dahlin",), "At the limits", "at a limit the recursion goes on from the limited outputs"),
        (("honeywell/tdc3000",), "Modes and signals", "to automatic bumpless: the first scan makes no increment"),
    ],
)
def test_show_says_what_a_card_does(words: tuple[str, ...], section: str, line: str) -> None:
    assert [found for found in _section(told("show", *words), section) if found.startswith(line)] != []


def test_show_states_what_the_card_leaves_open_as_such() -> None:
    assert "NaN, infinity in SP or PV, as the card does not say: the output is held and nothing is computed" in _section(
        told("show", "fisher/provox"), "Modes and signals"
    )


def test_show_prints_gains_and_outputs_of_the_examples() -> None:
    assert _section(told("show", "yokogawa/fieldbus-pid"), "Examples") == [
        "- GAIN=2, RESET=20, RATE=5: kp 2, ki 0.1 1/s, kd 10 s",
        "- GAIN=2, RESET=20, RATE=5: after a setpoint step of 1 the output has moved by 0.1, 0.2, 0.3, scan by scan",
        "(in automatic a setpoint step is answered by integral action alone)",
    ]


def test_show_keeps_within_the_width_of_a_page() -> None:
    for card_id in pidemu.cards():
        assert [line for line in told("show", card_id).splitlines()[1:] if len(line) > 120] == []


def test_show_as_json_holds_the_behaviour() -> None:
    behaviour = strict_json(told("show", "gnc-tools/cpid", "--json"))["behaviour"]
    assert behaviour["to automatic"] == "the algorithm takes over as it ran: a bump"
    assert behaviour["integral"] == "forward: this scan's error counts from the next scan on"


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


def test_show_with_settings_explains_them_and_with_options_alone_it_is_the_data_sheet() -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE="6 s")
    assert told("show", "fisher/provox", "GAIN=2", "RESET=4", "RATE=6 s") == pidemu.explain(settings).text
    assert "\nEvidence\n" in told("show", "emerson/deltav", "FORM=Series")


def test_show_with_a_scan_interval_and_ranges_explains_at_them() -> None:
    settings = pidemu.load_card("bailey/fc19").settings(K=1, KP=2.5, pv_range=(0, 400), op_range=(0, 100))
    words = ("show", "bailey/fc19", "K=1", "KP=2.5", "--pv-range", "0,400", "--op-range", "0,100", "--scan", "0.5 s")
    assert told(*words) == pidemu.explain(settings, 0.5).text
    assert strict_json(told(*words, "--json")) == pidemu.explain(settings, 0.5).to_dict()


def test_show_with_a_setting_that_is_missing_says_so() -> None:
    assert said("show", "fisher/provox", "GAIN=2") == (
        2, "", "error: fisher/provox: RESET: missing; it sets the integral (reset rate), in repeat/min\n",
    )  # fmt: skip
