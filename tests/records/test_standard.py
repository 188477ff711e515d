"""The standard record: what happens in it, and that it is the same for everybody."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pidemu
from pidemu.errors import ScanError
from pidemu.records.standard import StandardRecord, scale_of, standard_record


def part(record: StandardRecord, name: str) -> tuple[list[float], list[float], list[float]]:
    """Return setpoint, measurement and mode within a segment."""
    assert record.time is not None
    assert record.auto is not None
    [s] = [s for s in record.segments if s.name == name]
    inside = (record.time >= s.start - 1e-9) & (record.time < s.end - 1e-9)
    return record.sp[inside].tolist(), record.pv[inside].tolist(), record.auto[inside].tolist()


RECORD = standard_record(1.0, time=40.0, size=4.0)


def test_the_segments_follow_each_other_from_start_to_end() -> None:
    assert [s.name for s in RECORD.segments] == [
        "at rest",
        "setpoint steps",
        "PV ramps",
        "PV steps",
        "PV sine sweep",
        "PV noise",
        "large positive error",
        "large negative error",
        "back from the limit",
        "manual",
        "return to automatic",
        "setpoint step again",
        "into a limit, with noise",
        "back from it, with noise",
    ]
    starts, ends = [s.start for s in RECORD.segments], [s.end for s in RECORD.segments]
    assert [0.0, *ends[:-1]] == starts
    assert RECORD.time is not None
    assert RECORD.time.tolist() == list(range(round(ends[-1])))


def test_the_setpoint_steps_up_down_and_back() -> None:
    sp, pv, _ = part(RECORD, "setpoint steps")
    assert sp == [54.0] * 40 + [46.0] * 40 + [50.0] * 40
    assert pv == [50.0] * 120
    sp, pv, _ = part(RECORD, "setpoint step again")
    assert sp == [54.0] * 40 + [50.0] * 40
    assert pv == [50.0] * 80


def test_the_measurement_ramps_and_steps() -> None:
    sp, pv, _ = part(RECORD, "PV ramps")
    assert sp == [50.0] * 100
    assert pv[:21] == pytest.approx([50 + 0.2 * n for n in range(21)], abs=1e-6)
    assert (pv[60], pv[80], pv[99]) == pytest.approx((46, 50, 50), abs=1e-6)
    assert part(RECORD, "PV steps")[1] == [54.0] * 40 + [46.0] * 40 + [50.0] * 20


def test_the_sine_has_a_period_that_falls_from_two_times_to_a_fifth() -> None:
    fine = standard_record(0.01, time=1.0, size=4.0)
    pv = np.array(part(fine, "PV sine sweep")[1]) - 50
    assert np.abs(pv).max() == pytest.approx(4, rel=1e-3)
    crossings = np.flatnonzero(pv[:-1] * pv[1:] < 0) * 0.01
    # the phase is 2 pi 0.5 (e^(r x) - 1)/r with r = ln(10)/4: half turns at x = ln(1 + r n)/r
    rate = math.log(10) / 4
    expected = [math.log(1 + rate * n) / rate for n in range(1, len(crossings) + 1)]
    assert crossings == pytest.approx(expected, abs=0.015)
    assert crossings[0] == pytest.approx(2 / 2, abs=0.25)
    assert crossings[-1] - crossings[-2] == pytest.approx(0.2 / 2, abs=0.02)


def test_the_noise_is_bounded_varied_and_that_of_its_seed() -> None:
    noise = np.array(part(RECORD, "PV noise")[1]) - 50
    assert np.abs(noise).max() <= 2
    assert np.unique(noise).size == 80
    # random.Random(1).random() gives 0.134, 0.847, 0.764, 0.255, 0.495, 0.449; 2.5 of them per scan; the size is 4
    drawn = [0.13436424411240122, 0.763774618976614, 0.4494910647887381]
    assert noise[:3] == pytest.approx([4 * (x - 0.5) for x in drawn], abs=1e-12)
    other = standard_record(1.0, seed=2, time=40.0, size=4.0)
    differs = np.flatnonzero(other.pv != RECORD.pv)
    assert set(np.unique(differs // 40)) == {13, 14, 28, 29, 30, 31, 32, 33}  # the parts with noise, in times of 40 s
    np.testing.assert_array_equal(other.sp, RECORD.sp)


def test_the_large_errors_are_eight_sizes_as_far_as_the_range_allows() -> None:
    sp, pv, _ = part(RECORD, "large positive error")
    assert {a - b for a, b in zip(sp, pv, strict=True)} == {32.0}
    sp, pv, _ = part(RECORD, "large negative error")
    assert {a - b for a, b in zip(sp, pv, strict=True)} == {-32.0}
    wide = standard_record(1.0, time=40.0, size=20.0)
    assert (wide.sp.min(), wide.sp.max()) == (5, 95)


def test_the_last_parts_lead_into_a_limit_and_back_with_noise() -> None:
    sp, pv, auto = part(RECORD, "into a limit, with noise")
    assert (set(sp), set(auto)) == ({50.0}, {1.0})
    ramp = [min(n / 40, 1.0) for n in range(120)]
    noise = np.array(pv) - 50 - 32 * np.array(ramp)
    # random.Random(1).random() gives 0.134, 0.847, 0.764, 0.255, 0.495, 0.449; a quarter of the noise without limits
    drawn = [0.13436424411240122, 0.763774618976614, 0.4494910647887381]
    assert noise[:3] == pytest.approx([x - 0.5 for x in drawn], abs=1e-6)
    assert np.abs(noise).max() <= 0.5 + 1e-9
    _, pv, _ = part(RECORD, "back from it, with noise")
    rest = np.array(pv) - 50 - 32 * np.array([max(1 - n / 40, 0.0) for n in range(120)])
    assert np.abs(rest).max() <= 0.5 + 1e-9
    assert np.unique(rest.round(9)).size > 100
    wide = standard_record(1.0, time=40.0, size=20.0)
    assert part(wide, "into a limit, with noise")[1][60] == pytest.approx(95, abs=2.5)


def test_in_manual_the_operator_moves_the_output_and_the_measurement_stays_off() -> None:
    _, pv, auto = part(RECORD, "manual")
    assert set(auto) == {0.0}
    assert set(pv) == {52.0}
    assert RECORD.manual is not None
    assert RECORD.auto is not None
    by_hand = RECORD.manual[RECORD.auto == 0]
    assert by_hand[:41].tolist() == [60.0] * 41
    assert by_hand[60] == pytest.approx(50, abs=1e-6)
    assert by_hand[81:].tolist() == [40.0] * 39
    assert np.isnan(RECORD.manual[RECORD.auto == 1]).all()
    _, pv, auto = part(RECORD, "return to automatic")
    assert pv == [52.0] * 40 + [50.0] * 40
    assert set(auto) == {1.0}


def test_errors_sum_to_nothing_in_the_parts_before_saturation() -> None:
    for name in ("setpoint steps", "PV ramps", "PV steps"):
        sp, pv, _ = part(RECORD, name)
        assert sum(sp) - sum(pv) == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("scan", [0.5, 2.0, 0.1])
def test_another_scan_interval_samples_the_same_signals(scan: float) -> None:
    other = standard_record(scan, time=40.0, size=4.0)
    step, of = (round(1 / scan), 1) if scan < 1 else (1, round(scan))
    for name in ("sp", "pv", "auto", "manual"):
        np.testing.assert_allclose(getattr(other, name)[::step], getattr(RECORD, name)[::of], rtol=0, atol=1e-12)


def test_the_same_call_gives_the_same_bits() -> None:
    again = standard_record(1.0, time=40.0, size=4.0)
    for name in ("sp", "pv", "auto", "manual", "time"):
        np.testing.assert_array_equal(getattr(again, name), getattr(RECORD, name))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scan": 0.0}, "scan interval 0 of the standard record is not a positive number"),
        ({"scan": 1.0, "time": math.inf}, "time is inf; give a finite number"),
        ({"scan": 1.0, "size": -1.0}, "size -1 of the standard record is not a positive number"),
        ({"scan": 1e-6}, "a standard record with time 60 s, scanned every 1e-06 s, is too long; use a longer interval"),
    ],
)
def test_a_record_that_cannot_be_made_is_refused(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(ScanError) as caught:
        standard_record(**arguments)  # type: ignore[arg-type]
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("dials", "scan", "expected"),
    [
        ({"K": 2, "Ti": 120}, 1.0, (120, 4)),  # 8 %/2
        ({"K": 0.1, "Ti": 120}, 1.0, (120, 20)),  # at most 20 %
        ({"K": 400, "Ti": 120}, 1.0, (120, 0.05)),
        ({"K": 2, "Ti": 10}, 1.0, (20, 2)),  # at least 20 scans, in which the integral moves by twice K
        ({"K": 2, "Ti": 1e9}, 1.0, (20_000, 4)),
        ({"K": 2, "Ti": "off"}, 1.0, (60, 4)),
    ],
)
def test_the_scale_goes_by_integral_time_and_gain(dials: dict[str, object], scan: float, expected: tuple[float, float]) -> None:
    assert scale_of(pidemu.load_card("generic/standard").settings(dials), scan) == pytest.approx(expected, rel=1e-12)


def test_the_scale_knows_no_sign() -> None:
    card = pidemu.load_card("advanced-pid/advanced-pid")
    for sign in (1, -1):
        assert scale_of(card.settings(Kp=2 * sign, Ki=sign / 60, Kd=0, Tf=0), 1.0) == pytest.approx((120, 4), rel=1e-12)


def test_an_integral_alone_takes_the_time_in_which_it_moves_by_what_it_gets() -> None:
    card = pidemu.load_card("generic/parallel")
    assert scale_of(card.settings(kp=0, ki=0.02, kd=0), 1.0) == pytest.approx((50, 8), rel=1e-12)
