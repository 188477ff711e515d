"""Measurement noise before and after: figures worked out by hand from the scan equations, and the sentence."""

from __future__ import annotations

import math
from typing import Any

import pytest

import pidemu
from pidemu.card.model.signals import SignalFilter
from pidemu.certificate.noise import noise_change, noise_gain, noise_gain_of
from pidemu.law.law import Law


def settings(name: str, **dials: Any) -> pidemu.Settings:
    return pidemu.load_card(name).settings(**dials)


TDC = settings("honeywell/tdc3000", K=2.5, T1=0.5, T2=0.08, FORM="interactive", CTEQN="B")


def deltav(**dials: Any) -> pidemu.Settings:
    return settings("emerson/deltav", **{"GAIN": 2.5, "RESET": 30, "RATE": 4.32, "ALPHA": 0.1111, "FORM": "Series", **dials})


def test_a_faster_scan_raises_the_noise_from_10_to_18_5_and_a_longer_filter_brings_it_back_to_10_5() -> None:
    """A pressure loop worked out by hand: ``(K + kd/(Tf + h))`` times the integral's first scan."""
    # 1.5 %: whether the integral adds its whole increment in the first scan or half of it, 1/30 or 1/60
    assert noise_gain(TDC, 1.0) == pytest.approx(10.0, rel=0.015)
    assert round(noise_gain(deltav(), 0.2), 1) == 18.5
    assert round(noise_gain(deltav(RATE=3.8, ALPHA=0.2632), 0.2), 1) == 10.5


def test_the_noise_gain_is_the_move_of_the_emulated_output_on_one_measurement_that_is_off() -> None:
    s = deltav()
    controller = pidemu.Controller(s, 0.2, output_limits=(-1e6, 1e6))
    controller.rest(50, 50, 50)
    moved = [abs(controller.scan(50, pv) - 50) for pv in (51.0, *[50.0] * 40)]
    assert noise_gain(s, 0.2) == pytest.approx(max(moved), rel=1e-9)  # rounding in signals of 50


def test_the_four_point_derivative_is_largest_in_the_second_scan() -> None:
    s = settings("iec/61131-3-pid", KP=-1.2, TR=8, TD=0.6)  # kd (3, 1, -1, -3)/(10 h) after P alone in the first scan
    first = 1.2 + 1.2 * 0.6 * 3 / (10 * 0.1)
    assert noise_gain(s, 0.1) == pytest.approx(first, rel=0.02)  # the integral's share is h/TR


def test_without_a_scan_interval_it_is_the_gain_at_high_frequencies() -> None:
    assert noise_gain(TDC) == pytest.approx(25.0, rel=1e-12)  # K times ten
    assert noise_gain(settings("generic/standard", K=2, Ti=10, Td=0)) == pytest.approx(2.0, rel=1e-12)
    assert noise_gain(settings("generic/standard", K=2, Ti=10, Td=3)) == math.inf


def test_above_the_corner_of_a_filter_that_lets_nothing_through_it_is_the_gain_there() -> None:
    """An I controller behind a PV filter of 2 s: ki/w at the corner, 0.5 rad/s, less 3 dB."""
    s = settings("generic/parallel", kp=0, ki=0.3)
    filtered = s.algorithm()
    law = Law(filtered.filtered(SignalFilter(time=2.0)))
    assert noise_gain_of(law) == pytest.approx(0.3 / 0.5 / math.sqrt(2), rel=1e-12)


def test_the_sentence_names_both_figures_the_reason_and_what_keeps_it_as_it_was() -> None:
    change = noise_change(TDC, deltav(), (1.0, 0.2))
    assert change.ratio == pytest.approx(1.85, rel=0.015)  # as above
    assert "the new one's by 18.5 %, as it scans faster; with ALPHA" in change.text
    assert change.text.endswith("or at the old scan interval of 1 s it would stay as it was")
    assert change.dial is not None
    kept = deltav(ALPHA=change.dial.value)
    assert change.source * 0.97 < noise_gain(kept, 0.2) <= change.source  # two digits of ALPHA


def test_where_the_filter_is_fixed_the_old_scan_interval_is_stated_with_its_own_figure() -> None:
    """DirectLOGIC with a derivative gain limit at 1 s to Logix at 0.1 s: about three times the movement."""
    source = settings(
        "automationdirect/directlogic",
        ALGORITHM="POSITION", DERIVATIVE_GAIN_LIMIT="ON", RESET_UNITS="SECONDS", ERROR_TERM="LINEAR",
        GAIN=3, RESET=40, RATE=8, LIMIT=8, FILTER=1,
    )  # fmt: skip
    target = settings("allen-bradley/logix-pid", KP=3, KI=0.66667, KD=0.13333, PE="dependent", DOE="PV", NDF="off")
    change = noise_change(source, target, (1.0, 0.1))
    assert 2.5 < change.ratio < 3.2
    assert change.dial is None
    assert "at the old scan interval of 1 s it would be" in change.text


def test_nothing_is_said_where_nothing_gets_worse_and_no_derivative_scans_faster() -> None:
    assert noise_change(TDC, deltav(ALPHA=0.12), (1.0, 1.0)).text == ""  # a longer filter
    p_and_i = (settings("fisher/provox", GAIN=2, RESET=4), deltav(GAIN=2, RESET=15, RATE=0))
    assert noise_change(*p_and_i, (1.0, 0.1)).text == ""


def test_a_lost_filter_on_the_measurement_is_said_without_derivative_too() -> None:
    source = settings("yokogawa/fieldbus-pid", GAIN=2, RESET=20, RATE=0, PV_FTIME=5)
    change = noise_change(source, settings("generic/standard", K=2, Ti=20, Td=0), (1.0, 1.0))
    assert change.ratio > 5  # 1 + Tf/h
    assert change.text.endswith("; a filter on the measurement before the new controller would keep it down")


def test_a_derivative_without_filter_and_scan_interval_is_infinite_and_said_so() -> None:
    change = noise_change(TDC, settings("generic/standard", K=2.5, Ti=30, Td=4, Tf=0))
    assert change.target == change.ratio == math.inf
    assert "derivative has no filter; the old one's noise gain is 25" in change.text


def test_new_ranges_scale_the_source_s_noise_with_its_gain() -> None:
    assert noise_change(TDC, deltav(), (1.0, 1.0), -2.0).source == pytest.approx(2 * noise_gain(TDC, 1.0), rel=1e-12)


def test_a_filter_dial_that_counts_the_other_way_is_turned_down() -> None:
    foxboro = settings("foxboro/ia-pid", PBAND=40, INT=0.5, DERIV=0.072, KD=30)
    change = noise_change(TDC, foxboro, (1.0, 0.2))
    assert change.dial is not None
    assert (change.dial.name, change.dial.value < 30) == ("KD", True)
    assert noise_gain(foxboro.changed({"KD": change.dial.value}), 0.2) <= change.source


def test_a_filter_without_a_derivative_does_not_amplify_noise_though_the_scan_is_slow() -> None:
    """A forward rule with Tf = 0.1 s is unstable at 2 s, and nothing passes it where the derivative is off."""
    options = {"FORM": "parallel", "IFormula": "ForwardEuler", "DFormula": "ForwardEuler"}
    s = pidemu.load_card("mathworks/pid2").settings({**options, "Kp": 50, "Ki": 0.5, "Kd": 0, "Tf": 0.1})
    assert noise_gain(s, 2.0) == 50  # the integral is updated after the output
