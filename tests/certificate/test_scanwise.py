"""Both controllers on one record: what the certificate says of it, against emulations set up by hand."""

from __future__ import annotations

import numpy as np
import pytest

import pidemu
from pidemu.certificate.models import EXACT, ScanByScan
from pidemu.certificate.scanwise import common_interval, emulated, record_for
from pidemu.errors import ScanError
from pidemu.records.standard import standard_record
from pidemu.settings.settings import Settings
from tests.helpers import WIDE, Floats

LINEAR = ["at rest", "setpoint steps", "PV ramps", "PV steps", "PV sine sweep", "PV noise"]


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(values)


PI = settings("generic/standard", K=2, Ti=30)
PID = settings("generic/standard", K=2, Ti=30, Td=4, Tf=0.5)
PROVOX = settings("fisher/provox", GAIN=2, RESET=4, RATE=0.1)


def by_hand(
    source: Settings, target: Settings, scans: tuple[float, float], time: float, size: float, limits: tuple[float, float] = WIDE
) -> tuple[Floats, Floats, Floats]:
    """Times of the source's scans, its output there, and what the target's output is then: 15 times of the standard record."""
    found = []
    for s, h in zip((source, target), scans, strict=True):
        record = standard_record(h, 1, time, size)
        assert record.time is not None
        n = int(np.sum(record.time < 15 * time * (1 - 1e-9)))
        controller = pidemu.Controller(s, h, output_limits=limits)
        controller.rest(50.0, 50.0, 50.0)
        found.append((record.time[:n], controller.run(record.sp[:n], record.pv[:n])))
    (at, ours), (there, theirs) = found
    last = np.array([int(np.sum(there <= t + 1e-6)) - 1 for t in at])
    return at, ours, theirs[last]


@pytest.mark.parametrize("h", [0.1, 1.0, 2.5])
def test_the_record_ends_before_anything_is_meant_to_reach_a_limit(h: float) -> None:
    record = record_for(PID, h)
    assert [s.name for s in record.segments] == LINEAR
    assert record.time is not None
    T = max(30.0, 20 * h)
    assert record.time.size == record.sp.size == record.pv.size == round(15 * T / h)
    assert record.time[-1] == pytest.approx(15 * T - h)
    assert (record.auto, record.manual) == (None, None)
    assert np.max(np.abs(record.sp - 50)) == pytest.approx(record.size)
    assert np.max(np.abs(record.pv - 50)) == pytest.approx(record.size)
    assert record.size == pytest.approx(8 / 2 / (T / 30))  # moves the output by 8 %, by P or within a time by I


def test_a_long_integral_time_is_cut_down_to_two_thousand_scans() -> None:
    assert record_for(settings("generic/standard", K=2, Ti=30000), 1.0).characteristic_time == 2000
    assert record_for(settings("generic/standard", K=2, Ti=1500), 1.0).characteristic_time == 1500


@pytest.mark.parametrize(
    "source", [PI, PROVOX, settings("generic/series", K=0.2, Ti=300, Td=20, alpha=0.5)], ids=lambda s: s.summary
)
def test_on_the_record_a_usual_controller_reaches_no_limit(source: Settings) -> None:
    record = record_for(source, 1.0)
    free, limited = (by_hand(source, source, (1.0, 1.0), record.characteristic_time, record.size, x)[1] for x in (WIDE, (0, 100)))
    assert np.ptp(free) > 8
    assert free.tolist() == limited.tolist()


def segment_of(when: float, time: float) -> str:
    """Name of the part of the record, by the lengths in its documentation."""
    ends = np.cumsum([1, 3, 2.5, 2.5, 4, 2]) * time
    return LINEAR[int(np.sum(ends <= when + 1e-9))]


@pytest.mark.parametrize("scans", [(1.0, 1.0), (1.0, 0.25), (0.5, 2.0), (1.0, 0.3)])
@pytest.mark.parametrize(
    ("source", "target"),
    [
        (PI, settings("generic/standard", K=2.2, Ti=30)),
        (PID, settings("generic/parallel", kp=2, ki=2 / 30, kd=7, Tf=2)),
        (PROVOX, settings("emerson/deltav", GAIN=2.7, RESET=20.25, RATE=3.694, ALPHA=0.2)),
        (PID, settings("generic/standard", K=2, Ti=30, Td=4, Tf=0.5, b=0.5, c=0)),
    ],
    ids=["gain", "filter", "cards", "setpoint alone"],
)
def test_the_largest_difference_its_time_and_its_part_are_those_of_an_own_emulation(
    source: Settings, target: Settings, scans: tuple[float, float]
) -> None:
    found = emulated(source, target, scans)
    record = record_for(source, scans[0])
    time, size = record.characteristic_time, record.size
    at, ours, theirs = by_hand(source, target, scans, time, size)
    apart = np.abs(ours - theirs)
    worst = int(np.argmax(apart))
    assert found.largest == pytest.approx(apart[worst], rel=1e-12)
    assert found.largest_at == pytest.approx(at[worst])
    assert found.segment == segment_of(at[worst], time)
    assert found.size == pytest.approx(np.max(np.abs(ours - 50)), rel=1e-12)
    assert (found.scan, found.taken) == (scans, False)
    # the same with the setpoint at 50 all the time
    still = []
    for s, h in zip((source, target), scans, strict=True):
        again = standard_record(h, 1, time, size)
        assert again.time is not None
        n = int(np.sum(again.time < 15 * time * (1 - 1e-9)))
        controller = pidemu.Controller(s, h, output_limits=WIDE)
        controller.rest(50.0, 50.0, 50.0)
        still.append((again.time[:n], controller.run(np.full(n, 50.0), again.pv[:n])))
    last = np.array([int(np.sum(still[1][0] <= t + 1e-6)) - 1 for t in still[0][0]])
    assert found.on_measurement == pytest.approx(np.max(np.abs(still[0][1] - still[1][1][last])), rel=1e-12, abs=1e-12)


def test_two_proportional_controllers_differ_by_what_a_pocket_calculator_says() -> None:
    source, target = (settings("generic/standard", K=K, Ti="off") for K in (2.0, 2.5))
    found = emulated(source, target, (1.0, 1.0))
    # the size is 8/2 = 4 %, so the output moves by 8 %, the other one by 10 %; at once, when the setpoint first steps after 60 s
    assert (found.size, found.largest, found.on_measurement) == pytest.approx((8.0, 2.0, 2.0))
    assert (found.largest_at, found.segment) == (60.0, "setpoint steps")
    assert not found.is_exact
    assert not found.is_exact_on_measurement


def test_a_difference_on_the_setpoint_alone_is_none_while_it_rests() -> None:
    found = emulated(PID, settings("generic/standard", K=2, Ti=30, Td=4, Tf=0.5, b=0), (1.0, 1.0))
    assert found.segment == "setpoint steps"
    assert found.largest > 1
    assert found.on_measurement < 1e-11  # the sum of two weighted terms is rounded otherwise
    assert (found.is_exact, found.is_exact_on_measurement) == (False, True)


def test_new_ranges_and_another_action_are_taken_into_account() -> None:
    source = settings("simple-pid/simple-pid", Kp=-2, Ki=-0.1, Kd=-3)  # direct acting by the sign of its gains
    target = settings("generic/parallel", kp=3, ki=0.15, kd=4.5, c=0)
    assert emulated(source, target, (1.0, 1.0), -1.5).is_exact
    assert not emulated(source, target, (1.0, 1.0), -1.0).is_exact


def test_cards_in_engineering_units_are_compared_in_percent() -> None:
    source = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=0.1, Kd=3, pv_range=(-50, 150), op_range=(4, 20))
    ratio = 200 / 16  # of the spans: gains in engineering units to percent per percent
    target = settings("generic/parallel", kp=2 * ratio, ki=0.1 * ratio, kd=3 * ratio, c=0)
    assert emulated(source, target, (1.0, 1.0)).is_exact
    off = emulated(source, settings("generic/parallel", kp=2.1 * ratio, ki=0.1 * ratio, kd=3 * ratio, c=0), (1.0, 1.0))
    assert off.largest == pytest.approx(0.1 * ratio * record_for(source, 1.0).size)  # of P, in percent of span


EXACT_ONES = {
    "forms": (PID, settings("generic/parallel", kp=2, ki=2 / 30, kd=8, Tf=0.5), (1.0, 1.0)),
    "positional and velocity": (PI, settings("king/velocity", Kc=2, Ti=0.5), (1.0, 1.0)),
    "itself": (PROVOX, PROVOX, (0.7, 0.7)),
    "float32 itself": (settings("oscat/ft-pid", KP=2, TN=30, TV=0),) * 2 + ((1.0, 1.0),),
    "proportional alone, at other scans": (
        settings("generic/standard", K=2, Ti="off"),
        settings("generic/parallel", kp=2, ki=0),
        (1.0, 1.0),
    ),
}


@pytest.mark.parametrize("name", EXACT_ONES)
def test_controllers_of_one_equation_give_the_same_output(name: str) -> None:
    source, target, scans = EXACT_ONES[name]
    found = emulated(source, target, scans)
    assert found.is_exact
    assert found.is_exact_on_measurement
    assert found.largest <= EXACT * 100
    assert found.size > 5


def test_scan_by_scan_is_exact_to_the_span_or_to_what_the_output_moves_over() -> None:
    def one(largest: float, on_measurement: float, size: float) -> ScanByScan:
        return ScanByScan((1.0, 1.0), False, largest, 0.0, "at rest", on_measurement, size)

    assert one(0.9e-7, 0.9e-7, 10).is_exact
    assert not one(1.1e-7, 0.9e-7, 10).is_exact
    assert one(1.1e-7, 0.9e-7, 10).is_exact_on_measurement
    assert one(0.9e-5, 1.1e-5, 10_000).is_exact
    assert not one(0.9e-5, 1.1e-5, 10_000).is_exact_on_measurement


def test_intervals_too_far_apart_are_not_run_against_each_other_and_the_reason_is_told() -> None:
    """71 s and 8 ms: 177,500 scans in the time in which the old controller moves; a run took four seconds."""
    with pytest.raises(ScanError, match=r"does 177,500 scans in the 1420 s in which the old one moves, too many to run both"):
        emulated(
            settings("generic/series", K=96, Ti=562.2, Td=0.0761), settings("king/velocity", Kc=96, Ti=562, Td=0), (71.0, 0.008)
        )


FLOAT32: dict[str, dict[str, object]] = {
    "oscat/ft-pid": {"KP": 2 + 1 / 30, "TN": 30.5, "TV": 0},  # by the trapezoidal rule the same: kp more by ki h/2
    "iec/61131-3-pid": {"KP": -2, "TR": 30, "TD": 0},
    "ardupilot/ac-pid": {"P": 2, "I": 2 / 30, "D": 0, "IMAX": 1e6},
}


@pytest.mark.parametrize("card", FLOAT32)
def test_float32_shows_as_a_small_difference_that_is_not_exact(card: str) -> None:
    target = settings(card, **FLOAT32[card])
    scan = 1.0
    found = emulated(PI, target, (scan, scan))
    assert np.allclose(PI.law(scan).response([0.01, 0.1]), target.law(scan).response([0.01, 0.1]), rtol=1e-12)
    # an output of 50 in 24 bits is known to 2e-6; the 450 scans of the record add up at most as many roundings of a state of 50
    assert EXACT * 100 < found.largest < 450 * 50 * 2.0**-24
    assert not found.is_exact


def test_a_conversion_to_float32_is_exact_by_its_law_and_not_claimed_to_be_the_same_scan_by_scan() -> None:
    found = pidemu.convert(PI, "iec/61131-3-pid", scan=1.0)
    both = found.certificate.scan_by_scan
    assert both is not None
    assert found.verdict == "exact"
    assert (both.is_exact, both.same_rules) == (False, False)
    assert EXACT * 100 < both.largest < 450 * 50 * 2.0**-24  # as above


def test_another_integral_rule_is_judged_by_the_phase_that_it_costs() -> None:
    """By the trapezoidal rule the integral is ``ki (z + 1) h/2/(z - 1)``, by the backward rule ``ki z h/(z - 1)``."""
    found = pidemu.convert(PI, "oscat/ft-pid", scan=1.0)
    cost = found.certificate.scan_cost
    assert cost is not None
    w = 2 / 30
    z = np.exp(1j * w)
    backward, trapezoidal = (2 * (1 + rule / 30) for rule in (z / (z - 1), (z + 1) / (2 * (z - 1))))
    assert cost.phase_deg == pytest.approx(np.degrees(np.angle(backward / trapezoidal)), rel=1e-6)
    assert 0.3 < cost.phase_deg < 1  # less than a degree leaves it exact
    assert found.verdict == "exact"


@pytest.mark.parametrize(
    ("source", "h"),
    [
        (settings("generic/standard", K=2, Ti=30), 1.0),  # the card's second lies between 0.15 and 1.5
        (settings("generic/standard", K=2, Ti=3000), 15.0),  # a 200th
        (settings("generic/standard", K=2, Ti=10), 0.5),  # a 20th
        (settings("advanced-pid/advanced-pid", Kp=2, Ki=0.2, Kd=0, Tf=0), 0.1),  # that card's own
        (settings("advanced-pid/advanced-pid", Kp=2, Ki=2 / 30, Kd=0, Tf=0), 0.15),
        (settings("generic/series", K=2, Ti=6, Td=4), 0.5),  # of the effective integral time, 10 s
        (settings("generic/standard", K=2, Ti="off", Td=4, Tf=0.5), 0.2),  # of the derivative time
        (settings("generic/standard", K=2, Ti="off"), 0.05),  # of one second
    ],
    ids=lambda x: x.summary if isinstance(x, Settings) else str(x),
)
def test_an_interval_that_nobody_gave_is_the_source_s_made_to_suit_its_settings(source: Settings, h: float) -> None:
    target = settings("generic/parallel", kp=1, ki=0.1)
    assert common_interval(source, target) == pytest.approx(h)
    assert common_interval(source, source) == pytest.approx(h)


def forward(Tf: float) -> Settings:
    return settings("mathworks/pid2", Kp=2, Ki=0.002, Kd=1, Tf=Tf, b=1, c=1)


def cpid(Tf: float) -> Settings:
    return settings("gnc-tools/cpid", Kp=2, Ki=0.002, Kd=1, Tf=Tf, b=1, c=1, rRampMax=1e9)


@pytest.mark.parametrize(("Tf", "h"), [(3.0, 5.0), (2.0, 1.25), (0.1, 5 / 64)])
def test_it_is_quartered_until_it_suits_the_filters_of_both(Tf: float, h: float) -> None:
    slow = settings("generic/standard", K=2, Ti=1000)  # a 200th is 5 s; the forward rule needs less than twice the filter time
    assert h < 2 * Tf <= (4 * h if h < 5 else 8 * h)
    assert common_interval(slow, forward(Tf)) == pytest.approx(h)
    assert common_interval(forward(Tf), slow) == pytest.approx(h)


def test_a_dial_that_counts_in_scans_has_its_interval() -> None:
    """cpid's rRampMax is per scan."""
    slow = settings("generic/standard", K=2, Ti=1000)
    assert common_interval(slow, cpid(3.0)) == common_interval(cpid(3.0), slow) == 0.1


def test_where_no_interval_suits_both_nothing_is_run_and_the_certificate_says_why() -> None:
    with pytest.raises(ScanError, match="too short for the scan interval"):
        common_interval(settings("generic/standard", K=2, Ti=1000), cpid(1e-6))
    found = pidemu.convert(cpid(1e-6), "generic/parallel")
    c = found.certificate
    assert (c.scan_by_scan, c.nonlinear) == (None, ())
    assert c.not_emulated.startswith("the filter time 1e-06 s is too short for the scan interval")
    assert f"The two were not run against each other: {c.not_emulated}." in found.warnings
    assert c.feedback.is_exact


def test_a_series_product_of_mixed_rules_has_not_the_rules_of_a_sum() -> None:
    """Trapezoidal times backward is ``Td/Ti (z + 1)/(2 z)``, which a sum has as ``Td/Ti``; backward times backward is that too."""
    series = settings("honeywell/tdc3000", K=2, T1=1.5, T2=0.2, FORM="interactive", CTEQN="A")
    found = pidemu.convert(series, "generic/parallel", options={"INTEGRAL_RULE": "trapezoidal"})
    both = found.certificate.scan_by_scan
    assert both is not None
    assert (both.same_rules, both.is_exact_on_measurement) == (False, False)
    assert found.verdict == "exact"
    backward = pidemu.convert(settings("fisher/provox", GAIN=2, RESET=4, RATE=0.1), "generic/parallel").certificate.scan_by_scan
    assert backward is not None
    assert (backward.same_rules, backward.is_exact) == (True, True)


def test_given_intervals_are_used_and_one_that_is_taken_is_said_to_be() -> None:
    given, taken = (pidemu.convert(PI, "generic/parallel", scan=h).certificate.scan_by_scan for h in ((0.5, 0.5), None))
    assert given is not None
    assert taken is not None
    assert (given.scan, given.taken) == ((0.5, 0.5), False)
    assert (taken.scan, taken.taken) == ((1.0, 1.0), True)


def test_without_emulation_the_certificate_has_none_and_gives_no_reason() -> None:
    c = pidemu.convert(PI, "generic/parallel", emulate=False).certificate
    assert (c.scan_by_scan, c.not_emulated, c.nonlinear, c.loop) == (None, "", (), None)
    assert c.verdict == "exact"


def test_a_target_that_would_not_scan_once_is_not_run() -> None:
    with pytest.raises(ScanError, match=r"^a scan interval of 1e\+09 s is longer than the whole record, "):
        emulated(PI, PI, (1e-9, 1e9))
