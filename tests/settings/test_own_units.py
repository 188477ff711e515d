"""Bands and gains in percent of output of controllers that compute in engineering units, worked by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.errors import SettingError
from tests.checks.bench import VALID, Edit, added, edited, written

_EXAMPLE = VALID[VALID.index("  - given") :]
HEATER: tuple[Edit, ...] = (
    *added("signals", "engineering"),
    ('unit: "%/%"', "unit: degC"),
    ("limits: [0, 100]", "limits: [0, 1]"),
    # 1 degC of a band of 4 is a quarter of the output; each second the integral adds a sixtieth of that
    (_EXAMPLE, "  - given: {GAIN: 4, RESET: 60}\n    outputs: [0.254167, 0.258333, 0.2625]\n"),
)
"""A heater of 0 to 1 with a proportional band in degrees."""
EXACT = 1e-12
"""Doubles: a few units in the last place."""


def card(folder: Path, *more: Edit) -> pidemu.Card:
    return pidemu.load_card(written(folder, edited(edited(VALID, *HEATER), *more)))


def step(settings: pidemu.Settings, limits: tuple[float, float] | None = None) -> float:
    """Return what the output moves by when the measurement falls by one degree, without integral action."""
    ctl = pidemu.Controller(settings, 1.0, output_limits=limits, bias=0.5)
    before, after = ctl.run([200.0, 200.0], [200.0, 199.0])
    return float(after - before)


def test_one_degree_of_a_band_of_four_moves_a_heater_of_0_to_1_by_a_quarter(tmp_path: Path) -> None:
    s = card(tmp_path).settings(GAIN=4, RESET="off")
    assert step(s) == pytest.approx(0.25, rel=EXACT)
    assert s.op_range is not None
    assert s.op_range.ends == (0, 1)


@pytest.mark.parametrize(
    ("unit", "dial", "expected"),
    [
        ("degC", 4, 0.25),
        ("eu", 4, 0.25),
        ("'%/degC'", 25, 0.25),
        ("'%/eu'", 25, 0.25),
        ("eu/eu", 0.25, 0.25),
    ],
)
def test_every_way_to_state_a_gain_gives_the_same_controller(unit: str, dial: float, expected: float, tmp_path: Path) -> None:
    s = card(tmp_path, ("unit: degC", f"unit: {unit}"), ("{GAIN: 4,", f"{{GAIN: {dial},")).settings(GAIN=dial, RESET="off")
    assert step(s) == pytest.approx(expected, rel=EXACT)


def test_a_band_is_of_the_output_range_that_is_given_and_not_of_its_limits(tmp_path: Path) -> None:
    s = card(tmp_path).settings(GAIN=4, RESET="off", op_range=(0, 255))
    assert step(s, (0, 100)) == pytest.approx(63.75, rel=EXACT)


def test_a_band_in_fahrenheit_given_for_a_dial_in_celsius_is_converted(tmp_path: Path) -> None:
    s = card(tmp_path).settings(GAIN="7.2 degF", RESET="off")
    assert s["GAIN"].value == pytest.approx(4, rel=EXACT)
    assert s["GAIN"].to("K") == pytest.approx(4, rel=EXACT)


def test_in_percent_the_gain_is_that_of_the_stated_range(tmp_path: Path) -> None:
    s = card(tmp_path).settings(GAIN=4, RESET=60, pv_range=(0, 400))
    assert s.algorithm().kp == 100  # 400 degC over 4 degC
    assert s.algorithm(own_units=True).kp == 0.25


def test_the_law_and_the_scan_program_agree_in_a_conversion_to_percent(tmp_path: Path) -> None:
    s = card(tmp_path).settings(GAIN=40, RESET=60, pv_range=(0, 400))
    conversion = pidemu.convert(s, "generic/standard", scan=1.0)
    assert conversion.settings["K"].value == pytest.approx(10, rel=EXACT)
    assert conversion.verdict == "exact"


def test_a_conversion_to_the_band_and_back_gives_the_same_band(tmp_path: Path) -> None:
    source = pidemu.load_card("generic/standard").settings(K=10, Ti=60, pv_range=(0, 400))
    there = pidemu.convert(source, card(tmp_path), scan=1.0)
    assert there.settings["GAIN"].value == pytest.approx(40, rel=EXACT)
    assert step(there.settings.changed({"RESET": "off"})) == pytest.approx(1 / 40, rel=EXACT)


def test_a_deadband_of_the_output_is_measured_by_the_output() -> None:
    s = pidemu.load_card("epics/epid").settings(KP=1, ODEL=1, pv_range=(0, 200), op_range=(0, 50))
    assert s.algorithm().output.deadband == 2  # 1 of 50
    assert s.algorithm(own_units=True).output.deadband == 1


SCANS: tuple[Edit, ...] = (
    ("RESET: {sets: integral, unit: s, off: inf}", "RESET: {sets: integral, unit: scan, off: inf}"),
    ("RATE: {sets: derivative, unit: s,", "RATE: {sets: derivative, unit: scan,"),
    ("scan: {default: 1 s}", "scan: {default: 0.5 s}"),
    (_EXAMPLE, "  - given: {GAIN: 2, RESET: 60}\n    outputs: [2.033333, 2.066667, 2.1]\n"),  # 2/60 in each scan
)
"""Edits that make the times of the test bench count in scans."""


@pytest.mark.parametrize("h", [0.1, 0.5, 2.0])
def test_times_in_scans_are_seconds_by_the_scan_interval(h: float, tmp_path: Path) -> None:
    s = pidemu.load_card(written(tmp_path, edited(VALID, *SCANS))).settings(GAIN=2, RESET=40, RATE=8)
    a = s.algorithm(scan=h)
    assert (a.kp, a.ki, a.kd) == pytest.approx((2, 2 / (40 * h), 2 * 8 * h), rel=EXACT)
    seconds = pidemu.load_card(written(tmp_path / "s", VALID)).settings(GAIN=2, RESET=40 * h, RATE=8 * h)
    pv = [50.0, 49.0, 52.0, 51.0, 51.0]
    found, expected = (pidemu.Controller(x, h, initial_output=50.0).run(50.0, pv) for x in (s, seconds))
    assert found == pytest.approx(expected, rel=EXACT)
    w = np.array([0.01, 0.1]) / h
    assert np.allclose(s.law(h).response(w), seconds.law(h).response(w), rtol=EXACT)


def test_a_conversion_reads_times_in_scans_at_the_scan_that_is_given(tmp_path: Path) -> None:
    bench = pidemu.load_card(written(tmp_path, edited(VALID, *SCANS)))
    s = bench.settings(GAIN=2, RESET=40)
    plain = pidemu.convert(s, "generic/standard", emulate=False)
    assert plain.settings["Ti"].value == pytest.approx(20, rel=EXACT)  # the card's 0.5 s
    said = "nobody/bench: RESET in scans: taken at 0.5 s, the card's interval; give the real one, --scan."
    assert said in plain.warnings
    at_two = pidemu.convert(s, "generic/standard", scan=2.0)
    assert at_two.settings["Ti"].value == pytest.approx(80, rel=EXACT)
    assert at_two.verdict == "exact"
    back = pidemu.convert(at_two.settings, bench, options={"STRUCTURE": "PID"}, scan=(2.0, 2.0))
    assert back.settings["RESET"].value == pytest.approx(40, rel=EXACT)
    assert back.verdict == "exact"
    assert said not in (*at_two.warnings, *back.warnings)


def test_two_controllers_that_count_in_scans_are_asked_for_both_intervals(tmp_path: Path) -> None:
    one = pidemu.load_card(written(tmp_path / "1", edited(VALID, *SCANS)))
    slower = (*SCANS[:2], ("scan: {default: 1 s}", "scan: {default: 2 s}"), SCANS[3])
    other = pidemu.load_card(written(tmp_path / "2", edited(VALID, *slower)))
    with pytest.raises(SettingError, match="dials of nobody/bench and of nobody/bench count in scans; give both scan intervals"):
        pidemu.convert(one.settings(GAIN=2, RESET=40), other)
    conversion = pidemu.convert(one.settings(GAIN=2, RESET=40), other, scan=(0.5, 2.0), compensate=False)
    assert conversion.settings["RESET"].value == pytest.approx(10, rel=EXACT)


def test_the_emulation_reads_scans_as_the_law_does_where_no_interval_is_given(tmp_path: Path) -> None:
    bench = pidemu.load_card(written(tmp_path, edited(VALID, *SCANS)))
    conversion = pidemu.convert(bench.settings(GAIN=2, RESET=400, RATE=20), "generic/standard")
    assert conversion.certificate.scan_by_scan is not None
    assert conversion.verdict in ("exact", "exact-feedback")


@pytest.mark.parametrize(("dial", "given"), [("RESET", "20 s"), ("RATE", "1 min")])
def test_seconds_for_a_dial_in_scans_are_refused_as_the_interval_is_not_known(dial: str, given: str, tmp_path: Path) -> None:
    bench = pidemu.load_card(written(tmp_path, edited(VALID, *SCANS)))
    with pytest.raises(SettingError, match=f"'{given}' does not count in scans, this dial is in scan; .* write it in scan"):
        bench.settings({"GAIN": 2, "RESET": 40, dial: given})


def test_scans_for_a_dial_in_seconds_are_refused_as_the_interval_is_not_known() -> None:
    with pytest.raises(SettingError, match="'20 scans' counts in scans, this dial is in s"):
        pidemu.load_card("generic/standard").settings(K=2, Ti="20 scans")
