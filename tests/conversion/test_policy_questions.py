"""Units, ranges and questions, over all ordered pairs of cards."""

from __future__ import annotations

import math
import re
import shlex
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.target.computed import is_computed
from pidemu.conversion.unstated import unstated
from pidemu.errors import PidemuError, ScanError, SettingError
from pidemu.formatting import json_safe
from pidemu.process.process import parse_process
from pidemu.settings.settings import Settings
from pidemu.units import Role
from tests.cli.helpers import said, strict_json
from tests.conversion.policy import PAIRS, RANGES, convert, converted, drawn, held, numbers, stated
from tests.conversion.support import settings_that_act
from tests.conversion.usual import CARDS
from tests.helpers import dials_of

FACTORS = {"s": 1.0, "min": 60.0, "h": 3600.0}
"""Seconds in a unit, as everybody knows them."""


def otherwise(unit: str, value: float) -> list[str]:
    """A value in every other unit of the same quantity, worked out here: times, repeats per time, times per repeat, rates."""
    for pattern, form, per in (
        (r"(s|min|h)", "{}", 1), (r"(s|min|h)/repeat", "{}/repeat", 1),
        (r"1/(s|min|h)", "1/{}", -1), (r"repeat/(s|min|h)", "repeat/{}", -1),
    ):  # fmt: skip
        match = re.fullmatch(pattern, unit)
        if match:
            found = [f"{value * (FACTORS[match[1]] / x) ** per!r} {form.format(name)}" for name, x in FACTORS.items()]
            if "repeat" in unit and value:
                seconds = (value * FACTORS[match[1]]) if per == 1 else FACTORS[match[1]] / value
                found += [f"{seconds / x!r} {name}/repeat" for name, x in FACTORS.items()]
                found += [f"{x / seconds!r} repeat/{name}" for name, x in FACTORS.items()]
            return found
    return []


@given(data=st.data())
@settings(max_examples=30)
def test_the_same_times_in_another_unit_give_the_same_settings(data: st.DataObject) -> None:
    source, target = drawn(data)
    dials = {n: v for n, v in source.items() if v.given and not v.off and math.isfinite(v.value) and otherwise(v.unit, v.value)}
    assume(dials)
    texts = {n: data.draw(st.sampled_from(otherwise(v.unit, v.value))) for n, v in dials.items()}
    try:
        other = source.changed(texts)
    except SettingError:  # the last digit leads out of the dial's range
        assume(False)
        raise
    one, two = (converted(s, target) for s in (source, other))
    assert one.verdict == two.verdict
    assert one.settings.options == two.settings.options
    # 1e-6: what an optimiser finds from a start that differs in the last digit
    assert numbers(two.settings) == pytest.approx(numbers(one.settings), rel=1e-6, abs=1e-9)


UNITS = [
    ((0, 100, "degC"), (273.15, 373.15, "K"), 1.0),
    ((0, 100, "degC"), (32, 212, "degF"), 5 / 9),
    ((0, 10, "bar"), (0, 1000, "kPa"), 0.01),
]
"""One range in two units, and the gain per the second unit of a gain of 1 per the first."""


@given(data=st.data(), same=st.sampled_from(UNITS))
@settings(max_examples=30)
def test_the_same_range_of_the_target_in_another_unit_changes_a_gain_per_unit_only(data: st.DataObject, same: Any) -> None:
    source, target = drawn(data)
    first, second, factor = same
    source = source.changed({"pv_range": first})
    one, two = (converted(source, target, to_pv_range=r) for r in (first, second))
    assert (one.factor, one.verdict) == (two.factor, two.verdict)
    assert one.settings.options == two.settings.options
    for name, v in one.settings.items():
        if not v.active or name in held(source, target) or not is_computed(one.settings.equation, name, v.role):
            continue
        engineering = one.settings.equation.signals == "engineering"
        gain = v.role is Role.GAIN or (one.settings.equation.form == "parallel" and v.role in (Role.INTEGRAL, Role.DERIVATIVE))
        if gain and not v.off and engineering and v.unit in ("eu/eu", "%/eu", "1/s", "1/min", "s", "min", "1"):
            assert two.settings[name].value == pytest.approx(v.value * factor, rel=1e-6)
        elif not gain and v.role in (Role.INTEGRAL, Role.DERIVATIVE):
            assert two.settings[name].value == pytest.approx(v.value, rel=1e-6)


@given(data=st.data())
@settings(max_examples=50)
def test_a_range_is_asked_for_exactly_where_a_wider_span_changes_a_dial(data: st.DataObject) -> None:
    name, target = data.draw(st.sampled_from([p for p in PAIRS if not any(c.startswith("generic/") for c in p)]))
    ranged = settings_that_act(data, pidemu.load_card(name)).changed(RANGES)
    plain = ranged.card.settings(stated(ranged))
    once = converted(ranged, target)
    options = once.settings.options
    wider = {"pv_range": (0, 200), "op_range": (0, 200)}
    changes = set()
    for which, span in wider.items():
        other = converted(plain.changed({**RANGES, which: span}), target, options=options)
        same = all(
            math.isclose(v.value, other.settings[n].value, rel_tol=1e-5)
            for n, v in once.settings.items()
            if v.active and (v.role is Role.MULTIPLIER or is_computed(once.settings.equation, n, v.role))
        )
        changes |= set() if same else {which}
    try:
        convert(plain, target, options=options, assume=False)
        asked = set()
    except QuestionError as error:
        assume({q.kind for q in error.questions} == {"range"})
        asked = {q.about for q in error.questions}
    percent = [s.equation.output.limits for s in (plain, once.settings) if s.equation.signals == "engineering"]
    if changes - asked == {"op_range"} and percent and all(-10 <= x[0] <= 0 and 100 <= x[1] <= 110 for x in percent):
        return  # limits such as -5 to 105 are in percent
    assert asked == changes


PRODUCTS = [c for c in CARDS if pidemu.load_card(c).data.kind == "product" and pidemu.load_card(c).options]


@given(data=st.data())
@settings(max_examples=40)
def test_an_option_is_asked_for_exactly_where_its_readings_are_ten_percent_apart_and_the_commands_answer(
    data: st.DataObject,
) -> None:
    card = pidemu.load_card(data.draw(st.sampled_from(PRODUCTS)))
    target = data.draw(st.sampled_from(CARDS))
    dials = {n: x for n, x in data.draw(dials_of(card.id)).items() if n not in card.options}
    try:
        source = card.settings({**dials, **RANGES})
    except PidemuError:  # dials that another choice has
        assume(False)
        raise
    assume(any(source.law().moments()))
    expected = set()
    for name in source.defaulted:
        for choice in card.options[name]:
            try:
                read = source.changed({name: choice})
                lost = [x and not y for x, y in zip(gains(source), gains(read), strict=True)]
            except PidemuError:
                continue
            if not any(lost):
                off = apart(source, read)
                assume(abs(off - 0.1) > 0.005)
                expected |= {name} if off > 0.1 else set()
    try:
        convert(source, target, assume=False)
        questions: tuple[Any, ...] = ()
    except QuestionError as error:
        questions = error.questions
    except (ConversionRefusedError, ScanError):
        assume(False)
    assert {q.about for q in questions if q.kind == "option"} == expected
    for question in questions[:1]:
        for answer in question.readings[:2]:
            if answer.conversion is not None and answer.command:
                assert_the_command_gives(answer)


def apart(a: Settings, b: Settings) -> float:
    """Largest deviation of two laws over the loop band of the first, whichever of them counts as the truth."""
    w = np.geomspace(0.01, 5, 3000) / a_time(a)
    x, y = (s.law().response(w) for s in (a, b))
    return float(max(np.max(np.abs(x / y - 1)), np.max(np.abs(y / x - 1))))


def a_time(s: Settings) -> float:
    m0, m1, m2 = s.law().moments()
    return abs(m1 / m0) if m0 and m1 / m0 > 0 else 1 / abs(m0) if m0 else abs(m2 / m1) or 1.0


def gains(s: Settings) -> tuple[float, float, float]:
    a = s.algorithm()
    return a.kp, a.ki, a.kd


def assert_the_command_gives(answer: Any) -> None:
    result = said(*shlex.split(answer.command)[1:], "--assume", "--json")
    assert result.status == 0, result.err
    printed = strict_json(result.out)["to"]
    wanted = json_safe(answer.conversion.settings.to_dict())
    assert printed["options"] == wanted["options"]
    assert {n: d["value"] for n, d in printed["settings"].items()} == {n: d["value"] for n, d in wanted["settings"].items()}


@pytest.mark.parametrize(("reset", "asked"), [("1 min", False), ("0.97 min", False), ("0.4 min", True), ("9 min", True)])
def test_a_time_for_a_dial_that_counts_a_rate_is_asked_about_where_it_matters(reset: str, asked: bool) -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=reset)
    if asked:
        with pytest.raises(QuestionError):
            convert(source, "emerson/deltav", assume=False)
    else:
        assert convert(source, "emerson/deltav", assume=False).certificate.feedback.is_exact


def test_a_time_for_a_rate_that_hardly_matters_is_answered_with_the_other_result_beside() -> None:
    found = convert(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET="0.97 min"), "emerson/deltav", assume=False)
    assert found.settings["RESET"].value == pytest.approx(58.2, rel=1e-12)
    assert [b.settings["RESET"].value for b in found.beside if b.kind == "unstated"] == pytest.approx([61.856], rel=1e-12)


def test_what_the_headline_says_was_assumed_of_a_time_is_what_was_computed() -> None:
    found = convert(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET="0.4 min"), "emerson/deltav")
    assert found.settings["RESET"].value == pytest.approx(24, rel=1e-12)
    assert found.sentence.startswith("Assuming RESET = 0.4 min/repeat, which was not stated.")


@given(data=st.data())
@settings(max_examples=20)
def test_the_reading_that_is_taken_is_the_one_that_is_computed_and_every_other_one_is_another_law(data: st.DataObject) -> None:
    card = pidemu.load_card(data.draw(st.sampled_from(CARDS)))
    dials = {n: x for n, x in data.draw(dials_of(card.id)).items() if n not in card.options}
    try:
        source = card.settings(dials)
    except PidemuError:
        assume(False)
        raise
    for found in unstated(source):
        assert found.taken.settings.algorithm() == source.algorithm()
        assert all(other.settings.algorithm() != source.algorithm() for other in found.others)


TO_ASK: list[tuple[str, str, dict[str, object], str, dict[str, Any]]] = [
    ("range", "bailey/fc19", {"K": 1, "KP": 2.5, "KI": 0.5, "KD": 0.2}, "emerson/deltav", {}),
    ("scale", "fisher/provox", {"GAIN": 2, "RESET": 4, "pv_range": (0, 200)}, "emerson/deltav", {"to_pv_range": (0, 400)}),
    ("action", "simple-pid/simple-pid", {"Kp": 2, "Ki": 0.1, **RANGES}, "emerson/deltav", {"action": "direct"}),
    ("action", "epics/epid", {"KP": -2, "KI": 0.1, "KD": 0, **RANGES}, "oscat/ft-pid", {"action": "reverse"}),
    ("mode", "yokogawa/fieldbus-pid", {"GAIN": 0.6, "RESET": 8}, "emerson/deltav", {}),
    ("unit", "fisher/provox", {"GAIN": 2, "RESET": "0.4 min"}, "allen-bradley/pide", {}),
    ("input", "oscat/ft-pid", {"KP": 2, "TN": 5, **RANGES}, "emerson/deltav", {}),
    ("option", "allen-bradley/pide", {"PGain": 2, "IGain": 0.3, "DGain": 0.1}, "honeywell/tdc3000", {}),
    ("option", "honeywell/tdc3000", {"K": 2, "T1": 0.5, "T2": 0.1}, "emerson/deltav", {}),
]
"""What has to be asked: kind, source with its settings, target, arguments."""
HOW: list[dict[str, Any]] = [
    {},
    {"scan": (0.5, 1.0), "runs_every": 2.0, "process": parse_process("gain=1.5,lag=0.1,delay=7"), "tag": "TIC 101", "digits": 4},
]


@pytest.mark.parametrize("how", HOW, ids=["alone", "with everything else"])
@pytest.mark.parametrize("asked", TO_ASK, ids=lambda x: f"{x[0]} {x[1]}")
def test_the_command_of_every_answer_gives_what_the_answer_shows(asked: Any, how: dict[str, Any]) -> None:
    kind, card, dials, target, arguments = asked
    source = pidemu.load_card(card).settings(dials)
    if source.equation.scan.interval == "measured":
        how = {name: value for name, value in how.items() if name != "runs_every"}
    with pytest.raises(QuestionError) as error:
        pidemu.convert(source, target, **arguments, **how)
    question = next(q for q in error.value.questions if q.kind == kind)
    assert len(question.readings) <= 6
    answered = [a for a in question.readings if a.conversion is not None]
    assert answered
    for answer in answered:
        assert_the_command_gives(answer)
