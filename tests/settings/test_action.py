"""What action means on a card, and what contradicts it."""

from __future__ import annotations

import pytest

import pidemu
from pidemu.errors import SettingError
from pidemu.settings.action import ACTIONS, action_line, action_words, carried_action, check_action, read_action, switch_position
from tests.helpers import made_up_card


def settings(name: str, **dials: object) -> pidemu.Settings:
    return pidemu.load_card(name).settings(**dials)


@pytest.mark.parametrize(
    ("name", "reverse", "direct"),
    [  # the bits as the vendors write them, see the cards' evidence
        ("allen-bradley/logix-pid", "CA 0", "CA 1"),
        ("allen-bradley/pide", "ControlAction false", "ControlAction true"),
        ("honeywell/tdc3000", "CTLACTN REVERSE", "CTLACTN DIRECT"),
        ("emerson/deltav", "Direct_Acting off in CONTROL_OPTS", "Direct_Acting on in CONTROL_OPTS"),
        ("yokogawa/fieldbus-pid", "Direct Acting false", "Direct Acting true"),
        ("bailey/fc19", "reverse (S12 = 0)", "direct (S12 = 1)"),
        ("arduino/pid", "DIRECT", "REVERSE"),  # Arduino's words are the other way round
        ("automationdirect/directlogic", "Direct (forward)", "Reverse"),
        ("simple-pid/simple-pid", "positive gains", "negative gains"),
        ("epics/epid", "positive KP", "negative KP"),
        ("oscat/ft-pid", "positive KP", "negative KP"),
        ("iec/61131-3-pid", "negative KP", "positive KP"),  # its error is PV - SP
    ],
)
def test_the_action_is_named_by_its_error_and_by_the_card_s_own_word_or_bit(name: str, reverse: str, direct: str) -> None:
    equation = pidemu.load_card(name).variant({}).equation
    assert action_words(equation, "reverse") == f"reverse acting, SP - PV: {reverse}"
    assert action_words(equation, "direct") == f"direct acting, PV - SP: {direct}"


def test_a_word_that_is_the_formula_is_not_said_twice() -> None:
    equation = pidemu.load_card("allen-bradley/plc5").variant({}).equation
    assert [action_words(equation, a) for a in ACTIONS] == ["reverse acting: error SP - PV", "direct acting: error PV - SP"]


@pytest.mark.parametrize("name", pidemu.cards())
def test_what_the_words_say_is_what_the_emulated_controller_does(name: str) -> None:
    """The example on each card is run by the check of the card; here it has to belong to the same word."""
    action = pidemu.load_card(name).variant({}).equation.action
    assert {action.names["reverse"]: "falls", action.names["direct"]: "rises"}[action.example.name] == action.example.output


@pytest.mark.parametrize(
    ("name", "dials", "action"),
    [
        ("simple-pid/simple-pid", {"Kp": 2}, "reverse"),
        ("simple-pid/simple-pid", {"Kp": -2}, "direct"),
        ("simple-pid/simple-pid", {"Kp": 0, "Ki": -0.5}, "direct"),
        ("simple-pid/simple-pid", {"Kp": 0}, None),
        ("iec/61131-3-pid", {"KP": 2, "TR": 10}, "direct"),
        ("iec/61131-3-pid", {"KP": -2, "TR": 10}, "reverse"),
        ("oscat/ft-pid", {"KP": -2, "TN": 10}, "direct"),
        ("epics/epid", {"KP": 2}, "reverse"),
        ("emerson/deltav", {"GAIN": 2, "RESET": 10}, None),
    ],
)
def test_the_sign_of_the_gain_carries_the_action_where_there_is_no_switch(name: str, dials: dict[str, object], action: str) -> None:
    s = settings(name, **dials)
    assert carried_action(s) == action
    if action is not None:  # and the emulated output moves so, whatever is asked for
        controller = pidemu.Controller(s, 1.0, "reverse", output_limits=(-1e6, 1e6))
        controller.rest(50, 50, 50)
        moved = [controller.scan(50, 51) for _ in range(3)][-1] - 50
        assert (moved > 0) == (action == "direct")


def test_an_action_against_the_sign_of_the_gain_is_a_contradiction_and_named() -> None:
    s = settings("simple-pid/simple-pid", Kp=-2)
    text = check_action(s, "reverse")
    assert "stated as reverse acting (SP - PV)" in text
    assert "these settings are direct acting, PV - SP: negative gains" in text
    assert check_action(s, "direct") == check_action(s, None) == ""
    assert check_action(settings("emerson/deltav", GAIN=2, RESET=10), "direct") == ""  # it has a switch
    ranged = settings("simple-pid/simple-pid", Kp=-2, pv_range=(0, 100), op_range=(0, 100))
    with pytest.raises(pidemu.QuestionError, match="stated as reverse acting") as asked:
        pidemu.convert(ranged, "emerson/deltav", action="reverse")
    [question] = asked.value.questions
    assert (question.kind, [answer.value for answer in question.readings]) == ("action", ["direct", "reverse"])
    gains = [answer.conversion.settings["GAIN"].value for answer in question.readings if answer.conversion is not None]
    assert gains == [2, 2]  # the size of a dial does not depend on it


def test_negative_gains_on_a_card_with_a_switch_turn_what_the_switch_stands_at() -> None:
    card = made_up_card(settings={"kp": {"sets": "gain", "unit": "%/%", "range": [-10, 10]}})
    s = card.settings(kp=-2)
    assert [switch_position(s, a) for a in ACTIONS] == ["direct", "reverse"]
    assert action_words(s, "reverse") == "reverse acting, SP - PV: Direct"


def test_both_actions_are_named_where_it_is_not_known() -> None:
    logix = settings("allen-bradley/logix-pid", KP=2, KI=0.1)
    assert action_line(logix) == "reverse acting, SP - PV: CA 0; direct acting, PV - SP: CA 1"
    assert action_line(logix, "direct") == "direct acting, PV - SP: CA 1"
    assert action_line(settings("epics/epid", KP=-2)) == "direct acting, PV - SP: negative KP"


@pytest.mark.parametrize("target", ["simple-pid/simple-pid", "epics/epid", "iec/61131-3-pid", "oscat/ft-pid"])
@pytest.mark.parametrize("action", ACTIONS)
def test_a_target_whose_gain_carries_the_sign_gets_the_sign_of_the_stated_action(target: str, action: str) -> None:
    source = settings("fisher/provox", GAIN=2, RESET=4, pv_range=(0, 100), op_range=(0, 100))
    wanted = pidemu.convert(source, target)
    found = pidemu.convert(source, target, action=action)
    assert carried_action(found.settings) == found.action == action
    assert found.verdict == wanted.verdict  # run against each other, both act alike
    assert {abs(v.value) for v in found.settings.values()} == {abs(v.value) for v in wanted.settings.values()}
    assert carried_action(wanted.settings) == "reverse"
    assert "direct acting, PV - SP" in wanted.action_text
    assert "convert with --action direct" in wanted.action_text


def test_the_action_does_not_change_the_dials_where_there_is_a_switch() -> None:
    source = settings("honeywell/tdc3000", K=2, T1=1)
    plain, direct = (pidemu.convert(source, "allen-bradley/logix-pid", action=a) for a in (None, "direct"))
    assert {n: v.value for n, v in plain.settings.items()} == {n: v.value for n, v in direct.settings.items()}
    assert plain.action_text == "reverse acting, SP - PV: CA 0; direct acting, PV - SP: CA 1"
    assert direct.action_text == "direct acting, PV - SP: CA 1"


@pytest.mark.parametrize("text", ["Reverse", " direct "])
def test_an_action_is_read_whatever_its_case(text: str) -> None:
    assert read_action(text) == text.strip().casefold()


def test_a_word_that_is_not_an_action_is_refused_with_both_formulas() -> None:
    with pytest.raises(SettingError, match=r"error SP - PV\) or direct \(it rises, error PV - SP\)"):
        read_action("forward")
