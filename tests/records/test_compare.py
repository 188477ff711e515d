"""Controllers side by side: the figures against numbers worked out another way."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.arrays import Floats
from pidemu.errors import RecordError, ScanError
from pidemu.matrix.typical import typical_settings
from pidemu.records.files import Record
from pidemu.records.sampling import record_from_percent, record_in_percent, sampled
from pidemu.records.standard import StandardRecord, standard_record
from pidemu.settings.settings import Settings
from tests.helpers import dials_of

NAN = math.nan


def pi(**dials: object) -> Settings:
    return pidemu.load_card("generic/standard").settings({"K": 2, "Ti": 40} | dials)


def of(*values: float) -> Floats:
    return np.array(values, dtype=float)


def by_segment(found: pidemu.Comparison, which: int = 0) -> dict[str, float]:
    return dict(zip((s.name for s in found.segments), found.differences[which].by_segment, strict=True))


# --- the figures -------------------------------------------------------------------------------------------------------


def test_outputs_are_those_of_controllers_that_run_alone() -> None:
    found = pidemu.compare([pi(), pi(b=0.5)], scan=1.0)
    record = standard_record(1.0, time=40.0, size=4.0)
    for label, s in (("generic/standard", pi()), ("generic/standard (2)", pi(b=0.5))):
        controller = pidemu.Controller(s, 1.0, initial_output=50.0)
        np.testing.assert_array_equal(found.outputs[label], controller.run(record.sp, record.pv, record.auto, record.manual))
    assert record.time is not None
    np.testing.assert_array_equal(found.times, record.time)


def test_a_setpoint_weight_differs_by_gain_times_what_is_left_of_the_step_and_nowhere_else() -> None:
    found = by_segment(pidemu.compare([pi(), pi(b=0.5)], scan=1.0))
    assert found["setpoint steps"] == pytest.approx(2 * 0.5 * 4, rel=1e-9)
    assert found["setpoint step again"] == pytest.approx(2 * 0.5 * 4, rel=1e-9)
    for name in ("at rest", "PV ramps", "PV steps", "PV sine sweep", "PV noise", "manual", "return to automatic"):
        assert found[name] == pytest.approx(0, abs=1e-9)
    assert found["large positive error"] > 1


def test_largest_rms_time_and_segment_of_a_difference_are_those_of_the_outputs() -> None:
    record = Record(of(50, 51, 51, 51), of(50, 50, 50, 50))
    found = pidemu.compare([pi(), pi(K=3)], record, 2.0, initial_output=40)
    # P: 2 and 3, the integral K h/Ti per scan: 0.1 and 0.15; they differ by 1.05, 1.10, 1.15
    [d] = found.differences
    assert d.largest == pytest.approx(1.15, rel=1e-12)
    assert d.rms == pytest.approx(math.sqrt((1.05**2 + 1.1**2 + 1.15**2) / 4), rel=1e-12)
    assert (d.time, d.segment, d.label) == (6.0, "automatic", "generic/standard (2)")
    assert d.by_segment == (d.largest,)


def test_mode_spells_of_a_record_are_its_segments() -> None:
    record = Record(
        np.full(7, 50.0),
        np.full(7, 50.0),
        auto=of(1, 0, 0, 1, 1, 0, 1),
        manual=of(*[30.0] * 7),
        time=np.arange(0, 14, 2, dtype=np.float64),
    )
    found = pidemu.compare([pi(), pi()], record)
    assert [(s.name, s.start, s.end) for s in found.segments] == [
        ("automatic", 0, 2),
        ("manual", 2, 6),
        ("automatic 2", 6, 10),
        ("manual 2", 10, 12),
        ("automatic 3", 12, 14),
    ]


def test_bumps_are_those_of_each_controller() -> None:
    # the programs of two transfers: bumpless, and loaded with the last output with P on top
    arduino = pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.05)
    found = pidemu.compare([pi(), arduino], scan=1.0, output_limits=(0, 100))
    bumps = {text: moved for text, _, moved in found.transfers()}
    assert "power-up to automatic" not in bumps  # every controller is at rest in the beginning
    last = np.flatnonzero(found.times == 21 * 40 - 1)[0]  # manual, with 60 %, begins 21 times 40 s after the start
    assert bumps["automatic to manual"] == tuple(60 - x[last] for x in found.outputs.values())
    assert bumps["manual to automatic"][0] == pytest.approx(0, abs=1e-9)
    # the measurement is off by 2, half the size: P is -4, and the first automatic scan integrates -0.1
    assert bumps["manual to automatic"][1] == pytest.approx(-4.1, rel=1e-9)


def test_time_in_saturation_is_that_of_the_outputs_at_the_limits() -> None:
    found = pidemu.compare([pi(), pi(K=8)], scan=0.5, output_limits=(20, 80))
    assert isinstance(found.record, StandardRecord)
    for run in found.runs:
        outputs, automatic = run.playback.outputs, found.record.auto == 1
        assert run.playback.saturated("high") == 0.5 * np.count_nonzero((outputs == 80) & automatic) > 0
        assert run.playback.saturated("low") == 0.5 * np.count_nonzero((outputs == 20) & automatic) > 0


def test_an_output_that_is_no_number_on_one_side_only_is_infinitely_far() -> None:
    record = Record(of(50, 50, 50), of(50, NAN, 50), time=of(0, 1, 2))
    propagates = pidemu.load_card("advanced-pid/advanced-pid").settings(Kp=2, Ki=0.1, Kd=0, Tf=0)
    [d] = pidemu.compare([pi(), propagates], record, output_limits=(0, 100)).differences
    assert (d.largest, d.rms, d.time) == (math.inf, math.inf, 1.0)
    [d] = pidemu.compare([propagates, propagates], record, output_limits=(0, 100)).differences
    assert (d.largest, d.rms) == (0, 0)


# --- the record -----------------------------------------------------------------------------------------------------------


def test_the_standard_record_goes_by_the_first_controller() -> None:
    found = pidemu.compare([pi(K=4, Ti=100), pi()], scan=2.0).record
    assert isinstance(found, StandardRecord)
    assert (found.characteristic_time, found.size) == pytest.approx((100, 2))


def test_a_standard_record_of_ones_own_keeps_its_interval_and_scale() -> None:
    found = pidemu.compare([pi(), pi()], standard_record(0.5, time=10.0, size=2.0, seed=7))
    assert [run.scan for run in found.runs] == [0.5, 0.5]
    assert found.to_dict()["record"] == {"time": 10.0, "size": 2.0, "seed": 7}
    np.testing.assert_array_equal(found.record.pv, standard_record(0.5, time=10.0, size=2.0, seed=7).pv)


def test_the_operator_s_output_may_be_the_recorded_one_and_that_is_noted() -> None:
    record = Record(of(50, 50), of(50, 50), time=of(0, 1), auto=of(1, 0), output=of(40, 45))
    found = pidemu.compare([pi(), pi()], record)
    assert found.outputs["generic/standard"].tolist() == [40, 45]
    assert found.notes == ("in manual the recorded output is taken for the operator's: the record has no column 'manual'",)


def test_the_scan_interval_is_that_of_the_first_card() -> None:
    found = pidemu.compare([pidemu.load_card("bailey/fc18").settings(K=1, KP=2, KI=1), pi()])
    assert [run.scan for run in found.runs] == [0.25, 0.25]


def test_two_intervals_see_the_same_signals_and_are_compared_at_the_first_one_s_scans() -> None:
    found = pidemu.compare([pi(), pi()], scan=(1.0, 0.5))
    slow, fast = found.runs
    assert fast.playback.times.size == 2 * slow.playback.times.size
    np.testing.assert_array_equal(found.outputs[fast.label], fast.playback.outputs[::2])
    # the fast one integrates K h e/Ti = 0.1 at once at the step, the slow one 0.2, and after a second both have 0.2 and 0.1 more
    assert by_segment(found)["setpoint steps"] == pytest.approx(2 * 4 / 40 * 0.5, rel=1e-9)


def test_between_its_scans_an_output_holds() -> None:
    found = pidemu.compare([pi(), pi()], scan=(1.0, 4.0))
    slow = found.runs[1].playback.outputs
    np.testing.assert_array_equal(found.outputs["generic/standard (2)"], np.repeat(slow, 4)[: found.times.size])


def test_a_recorded_file_is_read_at_each_controller_s_scans(tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text("time,sp,pv\n10,50,50\n11,51,50\n12,52,50\n13,53,50\n", encoding="utf-8")
    found = pidemu.compare([pi(), pi(), pi()], file, (1.0, 0.5, 2.0))
    assert [run.playback.times.tolist() for run in found.runs] == [
        [10, 11, 12, 13],
        [10, 10.5, 11, 11.5, 12, 12.5, 13, 13.5],
        [10, 12],
    ]
    assert [run.record.sp.tolist() for run in found.runs[1:]] == [[50, 50, 51, 51, 52, 52, 53, 53], [50, 52]]


def test_an_uneven_record_is_read_at_an_interval_that_is_given() -> None:
    record = Record(of(50, 51, 52, 53), of(50, 50, 50, 50), time=of(0, 1, 3.5, 4))
    with pytest.raises(RecordError, match=r"^record: the time column goes on by 2\.5 s .* since generic/standard computes with a"):
        pidemu.compare([pi(), pi()], record)
    found, timing = sampled(record, "record", 1.0, pi(), 1.0)
    assert timing.interval is None
    assert found.sp.tolist() == [50, 51, 51, 51, 53]
    assert found.time is not None
    assert found.time.tolist() == [0, 1, 2, 3, 4]


def test_cards_that_measure_the_interval_follow_an_uneven_record() -> None:
    card = pidemu.load_card("epics/epid")
    record = Record(of(50, 51, 51, 51), of(50, 50, 50, 50), interval=of(NAN, 1, 3, 1))
    found = pidemu.compare([card.settings(KP=2, KI=0.1), card.settings(KP=2, KI=0.2)], record, initial_output=40)
    assert found.times.tolist() == [0, 1, 4, 5]
    assert np.diff(found.outputs["epics/epid"]) == pytest.approx([2.2, 0.6, 0.2])
    assert found.differences[0].largest == pytest.approx(0.2 * 5, rel=1e-9)


def test_a_record_whose_time_stands_still_cannot_be_read_at_another_interval() -> None:
    record = Record(of(50, 51, 52), of(50, 50, 50), time=of(0, 1, 1))
    with pytest.raises(RecordError, match=r"^record: its time does not increase from line to line"):
        pidemu.compare([pi(), pi()], record, 0.5)


def test_a_signal_is_left_out_for_the_cards_that_have_no_use_for_it() -> None:
    record = Record(of(0, 0), of(0, 0), time=of(0, 1), feedforward=of(0, 0.5), names={"feedforward": "FF"})
    limpid = pidemu.load_card("modelica/limpid").settings(k=2, Ti=40, Td=0)
    found = pidemu.compare([limpid, pi()], record, output_limits=(-1, 1))
    assert found.outputs["modelica/limpid"].tolist() == [0, 0.5]
    assert found.outputs["generic/standard"].tolist() == [0, 0]
    assert "generic/standard: column FF is left out: generic/standard states no feedforward input" in found.notes


def test_a_recorded_output_is_where_all_start() -> None:
    record = Record(of(50, 50), of(50, 50), time=of(0, 1), output=of(37, 38))
    found = pidemu.compare([pi(), pidemu.load_card("honeywell/tdc3000").settings(K=2, T1=1)], record)
    assert [x.tolist() for x in found.outputs.values()] == [[37, 37], [37, 37]]


# --- limits, units, bias ---------------------------------------------------------------------------------------------------


def test_limits_are_each_card_s_own_and_the_first_one_s_where_it_has_none() -> None:
    fc18 = pidemu.load_card("bailey/fc18").settings(K=1, KP=2, KI=1)
    simple = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.1)
    found = pidemu.compare([fc18, simple, pi()], scan=1.0)
    assert [run.limits for run in found.runs] == [(-5, 105), (-5, 105), (0, 100)]
    assert "simple-pid/simple-pid: the card has no output limits of its own; it has -5 to 105 % here" in found.notes
    assert (
        "the output limits differ: bailey/fc18 -5 to 105, simple-pid/simple-pid -5 to 105, generic/standard 0 to 100 %; "
        "--limits sets the same for all"
    ) in found.notes
    assert [run.limits for run in pidemu.compare([simple, fc18], scan=1.0).runs] == [(0, 100), (-5, 105)]
    assert {run.limits for run in pidemu.compare([fc18, simple], scan=1.0, output_limits=(10, 90)).runs} == {(10, 90)}


def test_a_controller_in_engineering_units_gets_its_own_and_is_compared_in_percent() -> None:
    arduino = pidemu.load_card("arduino/pid")
    ranges = {"pv_range": (0, 200), "op_range": (0, 255)}
    # 2 %/% is 2 * 2.55 output units per 2 units of PV
    engineering = arduino.settings(Kp=2 * 255 / 200, Ki=0.05 * 255 / 200, **ranges)
    percent = arduino.settings(Kp=2, Ki=0.05)
    found = pidemu.compare([percent, engineering], scan=1.0, output_limits=(0, 100))
    assert found.differences[0].largest == pytest.approx(0, abs=1e-9)
    assert found.outputs["arduino/pid (2)"].max() == pytest.approx(100)
    assert found.runs[1].limits == (0, 100)
    for _, _, (moved, same) in found.transfers():
        assert same == pytest.approx(moved, abs=1e-9)


def test_a_record_file_is_in_the_units_of_the_first_controller() -> None:
    card = pidemu.load_card("arduino/pid")
    engineering = card.settings(Kp=2 * 255 / 200, Ki=0.1, pv_range=(0, 200), op_range=(0, 255))
    record = Record(of(100, 102), of(100, 100), time=of(0, 1), output=of(127.5, 0))
    found = pidemu.compare([engineering, card.settings(Kp=2, Ki=0.1)], record)
    assert found.record.sp.tolist() == [50, 51]
    assert found.outputs["arduino/pid"][0] == pytest.approx(50)


def test_scaling_there_and_back_changes_nothing_but_rounding() -> None:
    ranges = pidemu.load_card("arduino/pid").settings(Kp=1, Ki=0, pv_range=(-50, 150), op_range=(4, 20)).own_ranges
    record = Record(of(-50, 150), of(0, 50), manual=of(4, 20), cascade=of(50, NAN))
    percent = record_in_percent(record, ranges)
    assert (percent.sp.tolist(), percent.pv.tolist()) == ([0, 100], [25, 50])
    assert percent.manual is not None
    assert percent.cascade is not None
    assert (percent.manual.tolist(), percent.cascade[0]) == ([0, 100], 50)
    back = record_from_percent(percent, ranges)
    for name in ("sp", "pv", "manual", "cascade"):
        np.testing.assert_allclose(getattr(back, name), getattr(record, name), rtol=1e-15)


def test_a_controller_without_integral_has_the_initial_output_for_its_bias() -> None:
    found = pidemu.compare([pi(Ti="off"), pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=0)], scan=1.0)
    assert found.outputs["generic/standard"][0] == 50
    assert found.differences[0].largest == 0
    assert "generic/standard: without integral action its output at zero error is a bias, 50 %" in found.notes


@pytest.mark.parametrize("card", ["simple-pid/simple-pid", "oscat/ft-pidwl"])
def test_limits_that_a_card_does_not_have_are_said_to_be_taken(card: str) -> None:
    """The one writes infinity for them, the other the largest number that it can."""
    found = pidemu.compare([pi(), typical_settings(pidemu.load_card(card))], scan=1.0)
    assert f"{card}: the card has no output limits of its own; it has 0 to 100 % here" in found.notes


def test_direct_action_mirrors_the_outputs() -> None:
    settings = [pi(), pi(b=0)]
    reverse, direct = (pidemu.compare(settings, scan=1.0, action=a) for a in ("reverse", "direct"))
    steps = slice(0, 400)
    for label in reverse.outputs:
        np.testing.assert_allclose(direct.outputs[label][steps], 100 - reverse.outputs[label][steps], atol=1e-9)


def test_a_card_without_a_choice_of_action_says_so() -> None:
    fixed = pidemu.load_card("advanced-pid/advanced-pid").settings(Kp=2, Ki=0.1, Kd=0, Tf=0)
    notes = pidemu.compare([fixed, pi()], scan=1.0, action="direct").notes
    assert "advanced-pid/advanced-pid: there is no choice of action: the sign of the gain decides" in notes


# --- every card, plain values, wrong input -----------------------------------------------------------------------------------


@pytest.mark.parametrize("card", pidemu.cards())
@settings(max_examples=3)
@given(data=st.data())
def test_a_card_does_not_differ_from_itself(card: str, data: st.DataObject) -> None:
    s = pidemu.load_card(card).settings(data.draw(dials_of(card)))
    try:
        found = pidemu.compare([s, s], standard_record(0.5, time=10.0))
    except ScanError:
        assume(False)  # these settings cannot be run at this interval
    assert found.differences[0].largest == 0
    assert {*found.outputs} == {card, f"{card} (2)"}


def test_everything_is_there_as_plain_values() -> None:
    found = pidemu.compare([pi(), pi(b=0)], scan=1.0)
    plain = found.to_dict()
    assert plain["record"] == {"time": 40.0, "size": 4.0, "seed": 1}
    assert [c["label"] for c in plain["controllers"]] == ["generic/standard", "generic/standard (2)"]
    assert plain["controllers"][1]["settings"]["b"] == {"value": 0.0, "unit": "1"}
    assert plain["controllers"][0]["outputs"] == found.outputs["generic/standard"].tolist()
    assert plain["differences"][0]["by_segment"]["setpoint steps"] == pytest.approx(8)
    assert plain["times"] == found.times.tolist()
    assert pidemu.compare([pi(), pi()], Record(of(50), of(50))).to_dict()["record"] is None


@pytest.mark.parametrize(
    ("settings", "scan", "message"),
    [
        ([], None, "a comparison needs two controllers or more, 0 given"),
        ([pi()], None, "a comparison needs two controllers or more, 1 given"),
        ([pi(), pi()], (1.0, 2.0, 3.0), "3 scan intervals for 2 controllers; give one for all, or one for each"),
        ([pi(), pi()], 0.0, "scan interval 0 s is not a positive number"),
        (
            [pi(), pi()],
            8e-27,
            "scan interval: 8e-27 s is not an interval at which a controller is executed, 1e-09 to 1e+09 s in size; "
            "check the number and its unit",
        ),
    ],
)
def test_what_cannot_be_compared_is_refused(settings: list[Settings], scan: float | tuple[float, ...] | None, message: str) -> None:
    with pytest.raises(ScanError) as caught:
        pidemu.compare(settings, scan=scan)
    assert str(caught.value) == message


def test_an_interval_at_which_a_record_would_have_too_many_samples_is_refused() -> None:
    record = Record(of(50), of(50))
    with pytest.raises(RecordError) as caught:
        pidemu.compare([pi(), pi()], record, scan=(1.0, 1e-9))
    assert str(caught.value) == (
        f"record: read every 1e-09 s, its {record.sp.size} s are {record.sp.size * 1e9:.3g} samples, more than 10,000,000; "
        "give a longer scan interval"
    )


def test_limits_that_are_no_range_are_refused() -> None:
    with pytest.raises(ScanError, match=r"^output limits 100 to 0 are not a range; give low, then high$"):
        pidemu.compare([pi(), pi()], output_limits=(100, 0))
