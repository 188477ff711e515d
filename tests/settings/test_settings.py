"""Dial values on a card: what is read, what is noted, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.card.load import Card
from pidemu.errors import SettingError, UnitError
from pidemu.settings.settings import Settings
from tests.helpers import made_up_card, option_combinations, settings_of

DIALS: dict[str, dict[str, Any]] = {
    "GAIN": {"sets": "gain", "unit": "%/%", "range": [0.1, 100]},
    "RESET": {"sets": "integral", "unit": "repeat/min", "off": 0},
    "RATE": {"sets": "derivative", "unit": "min", "off": 0, "default": 0, "range": [0.01, 10]},
}


def card(form: str = "standard", **dials: dict[str, Any]) -> Card:
    names = DIALS | dials
    return made_up_card(form=form, settings=names, examples=[{"given": {"GAIN": 1}, "canonical": {"kp": 1, "ki": 0, "kd": 0}}])


def given_to(a_card: Card, **values: object) -> Settings:
    return a_card.settings({"GAIN": 2, "RESET": 4} | values)


def refusal(a_card: Card, **values: object) -> str:
    with pytest.raises(SettingError) as caught:
        given_to(a_card, **values)
    return str(caught.value)


@pytest.mark.parametrize("number", [2, 2.0, np.float64(2.0), np.int32(2), "2", " 2.0 ", "2 %/%"])
def test_a_bare_number_is_in_the_dials_own_unit(number: object) -> None:
    settings = given_to(card(), GAIN=number)
    assert settings["GAIN"].value == 2.0
    assert settings.notes == ()


def test_a_text_with_a_unit_is_converted_and_the_conversion_is_noted() -> None:
    settings = given_to(card(), RATE="30 s")
    assert settings["RATE"].value == 0.5
    assert settings.notes == ("RATE: 30 s is 0.5 min",)


def test_an_integral_time_given_to_a_rate_dial_is_noted_as_its_reciprocal() -> None:
    settings = given_to(card(), RESET="0.5 min")
    assert settings["RESET"].value == 2.0
    assert settings.notes == ("RESET: 0.5 min is 2 repeat/min, the reciprocal, since the dial is in repeat/min",)


def test_a_rate_given_in_another_time_base_is_no_reciprocal() -> None:
    assert given_to(card(), RESET="120 repeat/h").notes == ("RESET: 120 repeat/h is 2 repeat/min",)


def test_a_proportional_band_given_to_a_gain_dial_is_its_reciprocal() -> None:
    settings = given_to(card(), GAIN="40 %")
    assert settings["GAIN"].value == 2.5
    assert settings.notes == ("GAIN: 40 % is 2.5 %/%, the reciprocal, since the dial is in %/%",)


@pytest.mark.parametrize("word", ["off", "OFF", " Off "])
def test_off_is_the_dials_first_off_value(word: str) -> None:
    settings = given_to(card(RESET={"sets": "integral", "unit": "min/repeat", "off": ["inf", 0]}), RESET=word)
    assert math.inf == settings["RESET"].value
    assert settings["RESET"].off
    assert settings["RESET"].canonical == 0.0
    assert settings.notes == ("RESET: off is inf min/repeat",)


def test_every_off_value_switches_the_term_off() -> None:
    a_card = card(RESET={"sets": "integral", "unit": "min/repeat", "off": [9999, 0]})
    assert [given_to(a_card, RESET=off).algorithm().ki for off in (9999, 0)] == [0.0, 0.0]
    assert math.inf == given_to(a_card, RESET=9999)["RESET"].to("s/repeat")


def test_a_dial_without_an_off_value_cannot_be_switched_off() -> None:
    assert refusal(card(), GAIN="off") == "nobody/bench: GAIN: cannot be switched off: the card states no off value"


def test_a_dial_that_was_not_given_takes_its_default() -> None:
    rate = given_to(card())["RATE"]
    assert (rate.value, rate.given, rate.off) == (0.0, False, True)


def test_missing_dials_are_refused_all_at_once_with_what_they_set() -> None:
    with pytest.raises(SettingError) as caught:
        card().settings()
    assert str(caught.value).splitlines() == [
        "nobody/bench: GAIN: missing; it sets the gain, in %/%",
        "nobody/bench: RESET: missing; it sets the integral, in repeat/min",
    ]


def test_an_unknown_name_is_refused_with_the_nearest_one() -> None:
    message = refusal(card(), RESETT=4)
    assert message == "nobody/bench: unknown setting 'RESETT' (did you mean 'RESET'?); settings: GAIN, RESET, RATE"


def test_names_may_be_written_in_upper_or_lower_case() -> None:
    assert card().settings(GAIN=2, RESET=4, RATE=1) == card().settings(gain=2, Reset=4, rAtE=1)


def test_the_same_dial_given_twice_is_refused() -> None:
    with pytest.raises(SettingError, match="GAIN"):
        card().settings(GAIN=2, gain=3, RESET=4)


@pytest.mark.parametrize(
    ("name", "written", "dimension"),
    [("GAIN", "2 s", "a time"), ("RESET", "4 %", "a percentage"), ("RATE", "4 repeat/min", "repeats per time")],
)
def test_a_unit_of_the_wrong_dimension_is_refused_at_its_dial(name: str, written: str, dimension: str) -> None:
    message = refusal(card(), **{name: written})
    assert message.startswith(f"nobody/bench: {name}: '{written.split(' ')[1]}' is {dimension} and cannot set ")


@pytest.mark.parametrize("value", [math.nan, "nan", "nan min"])
def test_not_a_number_is_refused(value: object) -> None:
    assert "not a number (NaN)" in refusal(card(), RATE=value)


@pytest.mark.parametrize("value", [math.inf, "inf", "inf repeat/min", -math.inf])
def test_infinity_is_refused_where_it_is_no_off_value(value: object) -> None:
    message = refusal(card(), RESET=value)
    assert message.startswith("nobody/bench: RESET: ")
    assert "infinite" in message or "outside" in message


@pytest.mark.parametrize("value", [True, None.__class__, [2], 1j, {}])
def test_what_is_neither_number_nor_text_is_refused(value: object) -> None:
    assert "is not a number, nor a text such as" in refusal(card(), GAIN=value)


def test_a_number_too_large_for_floating_point_is_refused() -> None:
    assert refusal(card(), GAIN=10**400).startswith("nobody/bench: GAIN: ")


@pytest.mark.parametrize("value", [0.09, 101, -1, "0.9 %"])
def test_a_value_outside_the_range_is_refused_with_the_range(value: object) -> None:
    message = refusal(card(), GAIN=value)
    assert "is outside 0.1 to 100 %/%" in message
    assert ("given as 0.9 %" in message) == (value == "0.9 %")


@pytest.mark.parametrize("value", [0.1, 100])
def test_the_ends_of_the_range_belong_to_it(value: float) -> None:
    assert value == given_to(card(), GAIN=value)["GAIN"].value


def test_an_off_value_may_lie_outside_the_range() -> None:
    assert given_to(card(), RATE=0)["RATE"].value == 0.0
    assert refusal(card(), RATE=0.005).endswith("is outside 0.01 to 10 min; 0 switches it off")


def test_without_a_range_a_negative_value_is_refused() -> None:
    assert refusal(card(), RESET=-1) == "nobody/bench: RESET: -1 repeat/min is outside 0 to inf repeat/min; 0 switches it off"


def test_zero_on_a_reciprocal_dial_would_be_infinite_action() -> None:
    assert "would be infinite action" in refusal(card(RESET={"sets": "integral", "unit": "s/repeat", "off": "inf"}), RESET=0)


def test_several_faults_are_told_at_once() -> None:
    assert [line.split(": ")[1] for line in refusal(card(), GAIN=1000, RATE="x").splitlines()] == ["GAIN", "RATE"]


def test_repeats_are_refused_on_a_parallel_integral_gain() -> None:
    message = refusal(card("parallel", RESET={"sets": "integral", "unit": "1/min"}), RESET="4 repeat/min")
    assert "'4 repeat/min' counts repeats of the proportional action" in message
    assert "write 4 1/min if the gain is meant" in message


def test_a_value_is_shown_in_any_unit_that_fits() -> None:
    reset = given_to(card())["RESET"]
    assert [reset.to(u) for u in ("repeat/min", "s/repeat", "min per repeat", "rep/h")] == [4.0, 15.0, 0.25, 240.0]
    with pytest.raises(UnitError, match="cannot set integral"):
        reset.to("%")


@pytest.mark.parametrize(
    ("unit", "gain", "percent"),
    [("eu/eu", 0.5, 2.0), ("eu", 50.0, 4.0), ("%/eu", 0.5, 1.0), ("%/%", 3.0, 3.0)],
)
def test_signal_ranges_scale_gains_in_engineering_units_only(unit: str, gain: float, percent: float) -> None:
    a_card = card(GAIN={"sets": "gain", "unit": unit})
    settings = given_to(a_card, GAIN=gain, pv_range=(-50, 150), op_range=(0, 50))
    assert percent == settings.algorithm().kp
    assert percent * 4 / 60 == pytest.approx(settings.algorithm().ki, rel=1e-15)  # ki = K/Ti, one product rounded


def test_engineering_gains_stay_as_they_are_in_the_cards_own_units() -> None:
    a_card = made_up_card(
        signals="engineering",
        settings={
            "kp": {"sets": "gain", "unit": "eu/eu"},
            "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0},
            "kd": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
        },
    )
    settings = a_card.settings(kp=3, ki=0.5, kd=2, pv_range=(0, 200), op_range=(0, 50))
    own, percent = settings.algorithm(own_units=True), settings.algorithm()
    assert (own.kp, own.ki, own.kd) == (3.0, 0.5, 2.0)
    assert (percent.kp, percent.ki, percent.kd) == (12.0, 2.0, 8.0)


@pytest.mark.parametrize(
    "value", [(0,), (100, 0), (0, 0), (0, math.inf), (math.nan, 1), "0..", "12", 5, (0, "x"), (0, 1, 2), (False, 1)]
)
@pytest.mark.parametrize("name", ["pv_range", "op_range"])
def test_a_signal_range_must_be_two_rising_numbers(name: str, value: object) -> None:
    assert refusal(card(), **{name: value}).startswith(f"nobody/bench: {name}: ")


def with_option() -> Card:
    return made_up_card(
        options={
            "TYPE": {
                "default": "PB",
                "choices": {
                    "PB": {"settings": {"PB": {"sets": "gain", "unit": "%"}}},
                    "Gain": {"settings": {"G": {"sets": "gain", "unit": "%/%"}}},
                },
            }
        },
        form="standard",
        settings={"Ti": {"sets": "integral", "unit": "s/repeat", "off": "inf"}},
        examples=[{"given": {"PB": 50, "Ti": 10}, "canonical": {"kp": 2, "ki": 0.2, "kd": 0}}],
    )


def test_an_option_takes_its_default_where_the_dials_do_not_speak_against_it() -> None:
    settings = with_option().settings(PB=50, Ti=10)
    assert settings.options == {"TYPE": "PB"}
    assert settings.notes == ()


def test_dials_that_exist_under_one_choice_only_imply_it_and_say_so() -> None:
    settings = with_option().settings(G=2, Ti=10)
    assert settings.options == {"TYPE": "Gain"}
    assert settings.notes == ("TYPE=Gain, since G, Ti are its settings",)


def test_an_option_and_its_choice_may_be_written_in_lower_case() -> None:
    assert with_option().settings(type="gain", g=2, ti=10).options == {"TYPE": "Gain"}


def test_a_dial_of_another_choice_is_refused_with_the_choice_made() -> None:
    with pytest.raises(SettingError, match="PB is not a setting with TYPE=Gain; settings: G, Ti"):
        with_option().settings(TYPE="Gain", G=2, PB=50, Ti=10)


def test_an_unknown_choice_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(SettingError, match=r"option TYPE has no choice 'Gian' \(did you mean 'Gain'\?\); choices: PB, Gain"):
        with_option().settings(TYPE="Gian", G=2, Ti=10)


def test_an_unknown_option_of_a_variant_is_refused() -> None:
    with pytest.raises(SettingError, match=r"unknown option 'TIPE' \(did you mean 'TYPE'\?\); options: TYPE"):
        with_option().variant({"TIPE": "PB"})


def test_a_udc_takes_the_option_that_its_gain_or_proportional_band_implies_and_says_so() -> None:
    udc = pidemu.load_card("honeywell/udc")
    band, gain = udc.settings(PB=50, RSET=1), udc.settings(GAIN=2, RSET=1)
    assert band.algorithm() == gain.algorithm()
    assert dict(band.options) != dict(gain.options)
    implied = [note for settings in (band, gain) for note in settings.notes]
    (note,) = implied  # one of the two is the default, and needs none
    assert note.endswith((", since PB, RSET are its settings", ", since GAIN, RSET are its settings"))


def test_settings_print_their_active_dials() -> None:
    assert repr(given_to(card())) == "<Settings nobody/bench: GAIN=2 %/%, RESET=4 repeat/min, RATE=0 min>"


@pytest.mark.parametrize("name", pidemu.cards())
def test_every_example_of_a_card_amounts_to_what_it_says(name: str) -> None:
    a_card = pidemu.load_card(name)
    for example in a_card.data.examples:
        want = example.canonical
        if want is None:
            continue  # it states outputs, which the rules of cards run
        n0, n1, n2, d1, _ = a_card.settings(example.given).law().coefficients()
        kp = n1 - n0 * d1  # specs/equations.md, section 3, exact conversion to parallel
        # the card prints six digits
        assert (want.ki, want.kp, want.kd, want.Tf) == pytest.approx((n0, kp, n2 - kp * d1, d1), rel=5e-6, abs=5e-6)


@pytest.mark.parametrize("name", pidemu.cards())
@given(data=st.data())
def test_settings_of_every_card_say_the_same_in_upper_and_lower_case(name: str, data: st.DataObject) -> None:
    a_card = pidemu.load_card(name)
    settings = settings_of(data, a_card)
    names = {n: v.value for n, v in settings.items()} | dict(settings.options)
    if len({n.casefold() for n in names}) == len(names):  # otherwise case is what tells two dials apart
        names = {n.swapcase(): v for n, v in names.items()}
    again = a_card.settings(names)
    assert dict(settings.options) == dict(again.options)
    assert {n: v.value for n, v in settings.items()} == {n: v.value for n, v in again.items()}


@pytest.mark.parametrize("name", pidemu.cards())
@given(data=st.data())
def test_settings_of_every_card_are_the_same_algorithm_when_written_in_other_units(name: str, data: st.DataObject) -> None:
    a_card = pidemu.load_card(name)
    settings = settings_of(data, a_card)
    other = {"s": "min", "min": "s", "repeat/min": "repeat/h", "min/repeat": "s/repeat", "s/repeat": "min/repeat", "1/s": "1/min"}
    given: dict[str, object] = dict(settings.options)
    for dial, value in settings.items():
        unit = other.get(value.unit)
        # a value at an end of its range, or off, may be rounded past it by the conversion
        inside = value.setting.range is None or value.setting.range[0] * 1.001 < value.value < value.setting.range[1] * 0.999
        exact = unit is None or value.off or not inside
        given[dial] = value.value if exact else f"{value.to(str(unit))!r} {unit}"
    algorithm, again = settings.algorithm(), a_card.settings(given).algorithm()
    for number in ("kp", "ki", "kd", "Tf", "b", "c"):
        # a few roundings on the way out and in; kd of a lead-lag is a difference, kp (Td - Tf)
        scale = abs(algorithm.kp) * abs(algorithm.Tf) if number == "kd" else 0.0
        assert getattr(algorithm, number) == pytest.approx(getattr(again, number), rel=1e-14, abs=1e-14 * scale)


@pytest.mark.parametrize("name", pidemu.cards())
def test_every_choice_of_options_of_every_card_has_settings(name: str) -> None:
    a_card = pidemu.load_card(name)
    for options in option_combinations(a_card):
        assert options == a_card.variant(options).chosen


def test_settings_that_are_changed_are_still_executed_as_before() -> None:
    declared = pidemu.load_card("allen-bradley/plc5").settings(EQUATION="ISA", KC=2, TI=1, TD=0.1)
    run_too_often = replace(declared, pace=0.1, lag=2.0)
    changed = run_too_often.changed({"DERIVATIVE": "error"})
    assert (changed.pace, changed.lag) == (0.1, 2.0)
    assert changed.law().feedback == run_too_often.law().feedback  # the option is about the setpoint only
