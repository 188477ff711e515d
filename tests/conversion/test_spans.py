"""Ranges in conversions: counts, pulse widths and re-ranged transmitters, and which ranges have to be asked for."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.conversion.spans import range_questions, ranges_needed, signals_note
from pidemu.matrix.typical import held_dials, typical_settings
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings
from tests.cli.helpers import strict_json, told
from tests.helpers import made_up_card


def load(card: str, **given: object) -> Settings:
    return pidemu.load_card(card).settings(given)


def convert(source: Settings, target: str, **how: Any) -> pidemu.Conversion:
    return pidemu.convert(source, target, emulate=False, **how)


def dials(conversion: pidemu.Conversion, *names: str) -> list[float]:
    return [conversion.settings[name].value for name in names]


def test_counts_shown_as_degrees_are_the_same_signal() -> None:
    ranges: dict[str, object] = {"pv_range": "0,16383 counts", "op_range": "0,16383 counts"}
    source = load("allen-bradley/plc5", EQUATION="ISA", KC=20, TI=1.4, **ranges)
    new = {"to_pv_range": (0, 1000, "degF"), "to_op_range": (0, 100, "%")}
    found = convert(source, "allen-bradley/logix-pid", options={"PE": "dependent"}, **new)
    assert (found.verdict, found.factor) == ("exact", 1.0)
    assert dials(found, "KP", "KI") == pytest.approx([20, 1.4], rel=1e-12)


def test_a_heater_of_255_steps_is_that_of_a_duty_from_0_to_1() -> None:
    source = load("arduino/pid", Kp=22.2, Ki=1.08, Kd=114, pv_range=(0, 300, "degC"), op_range="0,255 pwm")
    found = convert(source, "simple-pid/simple-pid", to_op_range="0,1 duty")
    assert found.verdict == "exact"
    assert dials(found, "Kp", "Ki", "Kd") == pytest.approx([22.2 / 255, 1.08 / 255, 114 / 255], rel=1e-12)
    assert dials(found, "Kp", "Ki", "Kd") == pytest.approx(
        [0.0870588, 0.00423529, 0.447059], rel=1e-5
    )  # as published, to six digits


def test_a_transmitter_ranged_twice_as_wide_doubles_the_percent_gain() -> None:
    source = load("fisher/provox", GAIN=2, RESET=4, pv_range=(0, 200, "degC"))
    assert dials(convert(source, "emerson/deltav", to_pv_range=(0, 400, "degC")), "GAIN", "RESET") == [4, 15]


def test_a_transmitter_in_fahrenheit_leaves_the_percent_gain() -> None:
    source = load("fisher/provox", GAIN=2, RESET=4, pv_range=(0, 100, "degC"))
    assert dials(convert(source, "emerson/deltav", to_pv_range=(32, 212, "degF")), "GAIN", "RESET") == [2, 15]


@pytest.mark.parametrize("target", ["arduino/pid", "epics/epid", "mathworks/pid2"])
def test_a_card_in_engineering_units_gets_the_gain_per_its_own_unit(target: str) -> None:
    """9 units of output per degC are 5 per degF."""
    source = load("simple-pid/simple-pid", Kp=9, Ki=0.9, pv_range=(0, 100, "degC"), op_range=(0, 60, "kg/h"))
    gain = next(v for v in convert(source, target, to_pv_range=(0, 200, "degF")).settings.values() if v.setting.sets == "gain")
    assert gain.value == pytest.approx(5, rel=1e-12)


@pytest.mark.parametrize("to_pv_range", ["0,400 degC", "0,27648 counts", "32,212 degF", "0,4095 counts = 0..400 degC"])
def test_the_same_loop_in_another_unit_gets_the_same_settings(to_pv_range: str) -> None:
    """A source in degC and one in degF, alike in physics, come to the same target."""
    celsius = load("simple-pid/simple-pid", Kp=9, Ki=0.9, Kd=2, pv_range=(0, 200, "degC"), op_range=(0, 60))
    fahrenheit = load("simple-pid/simple-pid", Kp=5, Ki=0.5, Kd=2 * 5 / 9, pv_range=(32, 392, "degF"), op_range=(0, 60))
    found = [convert(s, "generic/parallel", to_pv_range=to_pv_range) for s in (celsius, fahrenheit)]
    assert dials(found[0], "kp", "ki", "kd") == pytest.approx(dials(found[1], "kp", "ki", "kd"), rel=1e-12)


def test_two_pairs_of_numbers_without_units_are_asked_about_with_what_states_each_reading() -> None:
    source = load("fisher/provox", GAIN=2, RESET=4, pv_range=(0, 200))
    with pytest.raises(pidemu.QuestionError) as error:
        convert(source, "emerson/deltav", to_pv_range=(0, 400))
    (question,) = error.value.questions
    assert (question.kind, question.about) == ("scale", "pv_range")
    assert question.text == (
        "fisher/provox: PV range: are 0 to 200 (source) and 0 to 400 (target) the same signal, or two ranges of one quantity?"
    )
    assert [a.says for a in question.readings] == [
        "the same signal (ends correspond): the gain in percent stays",
        "another range of the same quantity: the gain in percent is multiplied by 2",
    ]
    assert [shlex.split(a.command)[5:] for a in question.readings] == [
        ["--pv-range=0,200 = 0,400", "--to", "emerson/deltav", "--to-pv-range=0,400"],
        ["--pv-range=0,200 eu", "--to", "emerson/deltav", "--to-pv-range=0,400 eu"],
    ]
    answered = [a.conversion for a in question.readings]
    assert [dials(c, "GAIN") for c in answered if c is not None] == [[2], [4]]


@pytest.mark.parametrize(("own", "gain"), [("0,200 = 0,400", 2), ("0,200 eu", 4)])
def test_what_the_question_offers_answers_it(own: str, gain: float) -> None:
    to = "0,400 eu" if "eu" in own else "0,400"
    source = load("fisher/provox", GAIN=2, RESET=4, pv_range=own)
    assert dials(convert(source, "emerson/deltav", to_pv_range=to), "GAIN") == [gain]


BAILEY: dict[str, object] = {"K": 1, "KP": 2.5, "KI": 0.5, "KD": 0.2}
BOTH = ("pv_range", "op_range")


def needed(source: Settings, target: str, **how: Any) -> tuple[str, ...]:
    return ranges_needed(source, convert(source, target, assume=True, **how).settings)


def test_a_source_in_engineering_units_and_a_target_in_percent_need_both_ranges() -> None:
    assert needed(load("bailey/fc19", **BAILEY), "emerson/deltav") == BOTH
    assert needed(load("fisher/provox", GAIN=2, RESET=4), "simple-pid/simple-pid") == BOTH
    assert needed(load("bailey/fc19", **BAILEY, pv_range=(0, 400)), "emerson/deltav") == ("op_range",)
    assert needed(load("bailey/fc19", **BAILEY, op_range=(0, 100)), "emerson/deltav") == ("pv_range",)


def test_with_both_ranges_the_gain_is_right_and_nothing_is_asked() -> None:
    found = convert(load("bailey/fc19", **BAILEY, pv_range=(0, 400), op_range=(0, 100)), "emerson/deltav")
    assert dials(found, "GAIN") == pytest.approx([10], rel=1e-12)
    assert range_questions(found.source, found.settings) == ()


@pytest.mark.parametrize(
    ("source", "target"),
    [("fisher/provox", "emerson/deltav"), ("simple-pid/simple-pid", "arduino/pid"), ("bailey/fc19", "epics/epid")],
)
def test_two_cards_in_the_same_units_need_no_ranges(source: str, target: str) -> None:
    given: dict[str, dict[str, object]] = {
        "fisher/provox": {"GAIN": 2, "RESET": 4}, "simple-pid/simple-pid": {"Kp": 2, "Ki": 0.1}, "bailey/fc19": BAILEY,
    }  # fmt: skip
    assert needed(load(source, **given[source]), target) == ()


def test_a_question_names_the_card_and_what_to_add() -> None:
    source = load("bailey/fc19", **BAILEY)
    pv, op = range_questions(source, load("emerson/deltav", GAIN=1, RESET=10))
    assert (pv.kind, pv.about, pv.example) == ("range", "pv_range", '--pv-range "0,400 degC"')
    assert (op.kind, op.about, op.example) == ("range", "op_range", '--op-range "0,100 %"')
    assert pv.text == (
        "the PV range is not given, and the settings depend on its span, since bailey/fc19 has gains in engineering units; "
        'add for example --pv-range "0,400 degC"'
    )


def a_card(unit: str, form: str = "standard") -> pidemu.Card:
    value = {"%/eu": 2, "eu": 50, "eu/eu": 2}[unit]
    return made_up_card(
        form=form,
        settings={
            "G": {"sets": "gain", "unit": unit},
            "Ti": {
                "sets": "integral",
                "unit": "s/repeat" if form == "standard" else "1/s",
                "off": "inf" if form == "standard" else 0,
            },
        },
        examples=[{"given": {"G": value, "Ti": 10}, "canonical": {"kp": 2, "ki": 0.2 if form == "standard" else 10, "kd": 0}}],
    )


@pytest.mark.parametrize(("unit", "ranges"), [("%/eu", ("pv_range",)), ("eu", ("pv_range",)), ("eu/eu", BOTH)])
def test_a_card_in_percent_with_a_gain_per_unit_counts_too(unit: str, ranges: tuple[str, ...]) -> None:
    own = a_card(unit).settings(G=2, Ti=10)
    assert needed(own, "emerson/deltav") == ranges
    assert ranges_needed(load("fisher/provox", GAIN=2, RESET=4), own) == ranges


@pytest.mark.parametrize("unit", ["%/eu", "eu"])
def test_where_a_unit_cancels_only_the_other_range_is_needed(unit: str) -> None:
    own = a_card(unit).settings(G=2, Ti=10)
    assert ranges_needed(own, own) == ()
    assert needed(own, "simple-pid/simple-pid") == ("op_range",)


def test_a_span_that_scales_one_gain_of_a_parallel_card_alone_does_not_cancel() -> None:
    own = a_card("%/eu", "parallel").settings(G=2, Ti=0.1)
    assert ranges_needed(own, load("generic/parallel", kp=1, ki=1)) == ()  # the other side is an equation
    assert needed(own, "emerson/deltav") == ("pv_range",)
    assert ranges_needed(own, own) == ()


@pytest.mark.parametrize("generic", ["generic/standard", "generic/parallel", "generic/series"])
def test_a_generic_card_takes_the_signals_of_the_other_side(generic: str) -> None:
    found = convert(load("simple-pid/simple-pid", Kp=2, Ki=0.1), generic)
    assert ranges_needed(found.source, found.settings) == ()
    assert next(v for v in found.settings.values() if v.setting.sets == "gain").value == 2
    assert "in output units per PV unit; give both ranges for percent" in signals_note(found.source, found.settings)
    assert f"{signals_note(found.source, found.settings)}." in found.warnings


def test_a_generic_card_is_in_percent_as_soon_as_a_range_is_given() -> None:
    assert needed(load("simple-pid/simple-pid", Kp=2, Ki=0.1, pv_range=(0, 300)), "generic/standard") == ("op_range",)
    found = convert(load("simple-pid/simple-pid", Kp=2, Ki=0.1, pv_range=(0, 300), op_range=(0, 200)), "generic/standard")
    assert dials(found, "K") == pytest.approx([3], rel=1e-12)
    assert signals_note(found.source, found.settings) == ""


def test_a_generic_source_has_the_target_s_ranges() -> None:
    new = {"to_pv_range": (0, 300, "degC"), "to_op_range": (0, 1, "duty")}
    found = convert(load("generic/standard", K=3, Ti=20), "simple-pid/simple-pid", **new)
    assert dials(found, "Kp") == pytest.approx([0.01], rel=1e-12)
    assert ranges_needed(found.source, found.settings) == ()


def test_between_a_generic_card_and_one_in_percent_nothing_is_said() -> None:
    found = convert(load("fisher/provox", GAIN=2, RESET=4), "generic/standard")
    assert signals_note(found.source, found.settings) == ""


def test_ranges_stand_in_the_plain_values_where_they_are_given() -> None:
    found = load("fisher/provox", GAIN=2, RESET=4, pv_range="0,4095 counts = 0..400 degC").to_dict()
    meaning = {"low": 0.0, "high": 400.0, "unit": "degC"}
    assert found["pv_range"] == {"low": 0.0, "high": 4095.0, "unit": "counts", "meaning": meaning}
    assert "op_range" not in found


def test_a_change_of_settings_keeps_the_ranges_with_their_units() -> None:
    s = load("fisher/provox", GAIN=2, RESET=4, pv_range=(0, 400, "degC")).changed({"GAIN": 3})
    assert s.pv_range == SignalRange(0, 400, "degC")


def converted(*words: str) -> Any:
    return strict_json(told(*words, "--json"))


COUNTS = (
    "--pv-range",
    "0,16383 counts",
    "--op-range",
    "0,16383 counts",
    "--to-pv-range",
    "0,1000 degF",
    "--to-op-range",
    "0,100 %",
)


def test_the_command_line_takes_ranges_with_units() -> None:
    words = (
        "convert",
        "allen-bradley/plc5",
        "EQUATION=ISA",
        "KC=20",
        "TI=1.4",
        "--to",
        "allen-bradley/logix-pid",
        "--set",
        "PE=dependent",
    )
    found = converted(*words, *COUNTS)
    assert {n: found["to"]["settings"][n]["value"] for n in ("KP", "KI")} == pytest.approx({"KP": 20, "KI": 1.4}, rel=1e-12)
    assert found["to"]["pv_range"] == {"low": 0.0, "high": 1000.0, "unit": "degF"}


LOOP = """\
card: allen-bradley/plc5
settings: {EQUATION: ISA, KC: 20, TI: 1.4, pv_range: "0,16383 counts", op_range: "0,16383 counts"}
to: allen-bradley/logix-pid
set: {PE: dependent}
to-pv-range: 0,1000 degF
to-op-range: 0,100 %
"""


def test_a_loop_file_takes_ranges_with_units(tmp_path: Path) -> None:
    (tmp_path / "loop.yaml").write_text(LOOP, encoding="utf-8")
    found = converted("convert", "--loop", str(tmp_path / "loop.yaml"))
    assert found["to"]["settings"]["KP"]["value"] == pytest.approx(20, rel=1e-12)
    assert found["to"]["op_range"] == {"low": 0.0, "high": 100.0, "unit": "%"}


def test_an_assignment_takes_a_range_with_its_unit() -> None:
    words = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "pv_range=0,200 degC", "--to", "emerson/deltav")
    assert converted(*words, "--to-pv-range", "0,400 degC")["to"]["settings"]["GAIN"]["value"] == 4


@pytest.mark.parametrize("target", ["bailey/fc18", "bailey/fc19"])
@pytest.mark.parametrize("ranges", [(100, 100), (200, 100), (100, 200), (0.3, 16)])
def test_an_overall_multiplier_that_sets_the_filter_does_not_depend_on_the_spans(target: str, ranges: tuple[float, float]) -> None:
    """Ki = 2/90 1/s and Kd = 20 s with a filter of 1 s: exact with K = 2 and KD = 1/6 min, in the two cards' common units."""
    source = load("advanced-pid/advanced-pid", Kp=2, Ki=2 / 90, Kd=20, Tf=1, pv_range=(0, ranges[0]), op_range=(0, ranges[1]))
    found = convert(source, target)
    assert found.verdict == "exact"
    assert dials(found, "K", "KP", "KI", "KD") == pytest.approx([2, 1, 60 / 90, 1 / 6], rel=1e-9)


PAIRS = [
    ("fisher/provox", "emerson/deltav"), ("fisher/provox", "epics/epid"), ("iec/61131-3-pid", "emerson/deltav"),
    ("ros/control-toolbox", "mathworks/pid2"), ("modelica/limpid", "bailey/fc18"), ("arduino/pid", "simple-pid/simple-pid"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_ranges_are_needed_exactly_where_a_span_twice_as_wide_changes_a_dial(source: str, target: str) -> None:
    plain, card = typical_settings(pidemu.load_card(source)), pidemu.load_card(target)

    def found(pv: float, op: float) -> list[float]:
        ranged = plain.changed({"pv_range": (0, pv), "op_range": (0, op)})
        return [v.value for v in convert(ranged, target, given=held_dials(card), allow_approximate=True).settings.values()]

    once, wider = found(100, 100), {"pv_range": found(200, 100), "op_range": found(100, 200)}
    changes = tuple(
        name for name, values in wider.items() if values != pytest.approx(once, rel=1e-6)
    )  # as near as matches are found
    assumed = convert(plain, target, given=held_dials(card), allow_approximate=True, assume=True)
    assert ranges_needed(plain, assumed.settings) == changes
    if changes:
        with pytest.raises(pidemu.QuestionError) as caught:
            convert(plain, target, given=held_dials(card), allow_approximate=True)
        asked = tuple(q.about for q in caught.value.questions if q.kind == "range")
        # output limits of 0 to 100 on the card whose gain is per unit say that its output is in percent
        percent = {s.equation.output.limits for s in (plain, assumed.settings) if s.equation.signals == "engineering"} == {(0, 100)}
        assert asked == tuple(which for which in changes if not (which == "op_range" and percent))
