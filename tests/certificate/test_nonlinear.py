"""Nonlinear differences: what happens at limits and transfers, by hand and by emulation on signals of the test's own."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.card.stages import STARTS
from pidemu.certificate import nonlinear
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.nonlinear import nonlinear_differences
from pidemu.certificate.sides import Side
from pidemu.certificate.trials import Plan, Trial, tried
from pidemu.record.standard import scale_of
from pidemu.scan.build import Action
from pidemu.settings import Settings
from tests.checks.bench import VALID, edited, written
from tests.conversion.test_options import CARDS, SOURCES
from tests.helpers import Floats

STAYS = "at the limit after the error has turned [s]"
AT_ZERO = "output with the error back at zero [% of output span]"
TO_AUTO = "bump to automatic [% of output span]"
TO_MANUAL = "bump to manual [% of output span]"
ASPECTS = ["windup", "transfer", "limits", "arithmetic", "error", "output", "setpoint"]


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(**values)


def differences(
    source: Settings, target: Settings, scan: float | tuple[float, float] = 1.0, time: float = 60.0, size: float = 4.0
) -> dict[str, NonlinearDifference]:
    scans = scan if isinstance(scan, tuple) else (scan, scan)
    return {d.aspect: d for d in nonlinear_differences(source, target, scans, (time, size))}


def excursion(s: Settings, time: float, size: float, h: float, limits: tuple[float, float] = (0, 100)) -> tuple[Floats, int, int]:
    """Output from rest at 50 through an error of 8 sizes, as much the other way, and none; where it turns, and where it ends."""
    n = round(time / h)
    e = 4 * size * np.concatenate([np.ones(2 * n), -np.ones(3 * n), np.zeros(n)])
    controller = pidemu.Controller(s, h, output_limits=limits)
    controller.rest(50.0, 50.0, 50.0)
    return controller.run(50 + e, 50 - e), 2 * n, 5 * n


@pytest.mark.parametrize(("h", "stays"), [(1.0, 13.0), (0.5, 13.0), (3.0, 12.0), (0.04, 13.12)])
def test_an_integral_without_windup_protection_comes_back_when_arithmetic_says(h: float, stays: float) -> None:
    K, Ti, time, size = 2.0, 60.0, 60.0, 4.0
    error = 8 * size
    integral = 50 + K * error * 2 * time / Ti  # it went on all the time
    scans = next(j for j in itertools.count(1) if integral - j * K * error * h / Ti - K * error < 100)
    source, target = settings("generic/standard", K=K, Ti=Ti), settings("iec/61131-3-pid", KP=-K, TR=Ti)
    found = differences(source, target, (1.0, h), time, size)["windup"]
    assert (scans - 1) * h == pytest.approx(stays, abs=1e-9)
    # back-calculation holds the integral at 100, so that P of -64 leads away at once; float32 may round to the next scan
    assert found.figures[STAYS] == pytest.approx((0.0, stays), abs=h if h < 0.1 else 1e-9)
    assert "generic/standard (back-calculation, Tt = 60 s) leaves it at once, iec/61131-3-pid (none) leaves it after" in found.text
    assert "when an error of 32 % for 120 s" in found.text


def test_less_than_a_scan_is_no_difference() -> None:
    source, target = settings("iec/61131-3-pid", KP=-2, TR=60), settings("mathworks/pid2", Kp=2, Ki=2 / 60)
    assert "windup" not in differences(source, target, (1.0, 0.1))  # 13.1 s, of which the first sees 13


def test_provox_and_deltav_differ_in_the_way_back() -> None:
    source = settings("fisher/provox", GAIN=2.0, RESET=1)
    assert "windup" not in differences(source, settings("emerson/deltav", GAIN=2.0, RESET=60))  # both are positive feedback
    target = settings("emerson/deltav", GAIN=2.0, RESET=60, ARW_HI_LIM=90, ARW_LO_LIM=10)
    found = differences(source, target)["windup"]
    fast = "emerson/deltav (external-reset, returning 16 times as fast from beyond its windup limits)"
    assert f"fisher/provox (external-reset) as well as {fast}" in found.text
    for s, stays, at_zero in zip((source, target), found.figures[STAYS], found.figures[AT_ZERO], strict=True):
        output, turn, end = excursion(s, 60.0, 4.0, 1.0)
        assert output[turn - 1] == 100
        assert stays == np.count_nonzero(output[turn:end] == 100)
        assert at_zero == output[-1]


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("honeywell/tdc3000", "generic/standard"),
        ("mathworks/pid2", "yokogawa/fieldbus-pid"),
        ("honeywell/udc", "oscat/ft-pid"),
        ("allen-bradley/plc5", "ros/control-toolbox"),
        ("king/velocity", "epics/epid"),
        ("toshiba/pid3", "ni/pid"),
    ],
)
def test_times_and_outputs_are_those_of_an_emulation(source: str, target: str) -> None:
    pair = dict(SOURCES)[source], dict(SOURCES)[target]
    found = differences(*pair, time=90.0)["windup"]
    for s, stays, at_zero in zip(pair, found.figures[STAYS], found.figures[AT_ZERO], strict=True):
        output, turn, end = excursion(s, 90.0, 4.0, 1.0)
        reached = output[turn - 1]
        held = np.flatnonzero(output[turn:end] == reached)
        assert stays == (held[-1] + 1 if held.size and reached in (0, 100) else 0)
        assert at_zero == pytest.approx(output[-1], abs=1e-9)


def test_an_integral_that_stands_still_at_a_limit_both_ways_never_leaves_it(tmp_path: Path) -> None:
    stuck = edited(
        VALID,
        ("{scheme: back-calculation, tracking-time: Ti}", "{scheme: freeze, direction: both}"),
        ("proportional: {on: error}", "proportional: {on: none}"),
    )
    card = pidemu.load_card(written(tmp_path, stuck))
    found = differences(card.settings(GAIN=2, RESET=60), settings("generic/parallel", kp=0, ki=2 / 60))["windup"]
    assert found.figures[STAYS][0] == math.inf
    assert "does not leave it within 180 s" in found.text
    assert found.figures[AT_ZERO][0] == 100


def test_where_no_limit_is_reached_the_words_say_so() -> None:
    found = differences(settings("generic/standard", K=0.1, Ti=60), settings("iec/61131-3-pid", KP=-0.1, TR=60), size=20.0)[
        "windup"
    ]
    assert "an error of 90 % for 120 s brings neither there" in found.text
    assert found.figures[STAYS] == (0.0, 0.0)


def test_the_same_scheme_with_another_tracking_time_is_a_difference() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("astrom-hagglund/listing", K=2, Ti=60, Td=0, Tt=5, N=10))
    assert "(back-calculation, Tt = 60 s)" in found["windup"].text
    assert "(back-calculation, Tt = 5 s)" in found["windup"].text


def test_loading_the_output_bumps_by_the_other_terms() -> None:
    K, ki, size = 2.0, 0.02, 4.0
    found = differences(settings("generic/parallel", kp=K, ki=ki), settings("arduino/pid", Kp=K, Ki=ki), size=size)["transfer"]
    error = -size / 2  # the measurement is that much above the setpoint
    assert found.figures[TO_AUTO] == pytest.approx((0.0, K * error + ki * 1.0 * error), abs=1e-9)
    assert found.figures[TO_MANUAL] == (0.0, 0.0)
    assert f"generic/parallel {STARTS['bumpless']} and arduino/pid {STARTS['load-output']}" in found.text
    assert "the output bumps by 0 % on the source and -4.04 % on the target" in found.text


def test_the_iec_example_bumps_at_the_transfer_to_manual_as_it_multiplies_the_operators_output() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("iec/61131-3-pid", KP=-2, TR=60))["transfer"]
    assert found.figures[TO_MANUAL] == pytest.approx((0.0, (-2 - 1) * 50.0), abs=1e-4)
    assert "iec/61131-3-pid multiplies the operator's output by the gain" in found.text
    assert "to manual, where the operator's output is what the output was, by 0 % on the source and -150 % on" in found.text


def test_an_integral_that_runs_on_in_manual_makes_the_output_jump() -> None:
    K, Ti, T, e = 0.5, 60.0, 60.0, -2.0
    found = differences(settings("generic/standard", K=K, Ti=Ti), settings("oscat/ft-pid", KP=K, TN=Ti, TV=0))["transfer"]
    computed = 50 + K * e + K * e * (3 * T + 1) / Ti  # from 50 at rest, with the error of the manual spell and one scan more
    assert found.figures[TO_AUTO][1] == pytest.approx(computed - 40, abs=0.02)  # half a scan, as the rule is the trapezoidal one
    assert STARTS["running"] in found.text


@pytest.mark.parametrize(
    "source", ["arduino/pid", "gnc-tools/cpid", "modelica/limpid", "advanced-pid/advanced-pid", "ros/control-toolbox"]
)
def test_bumps_are_per_cent_of_the_output_range(source: str) -> None:
    card = pidemu.load_card(source)
    known = {n: v.value for n, v in dict(SOURCES)[source].items() if v.active}
    plain = card.settings(**known, pv_range=(0, 100), op_range=(0, 100))
    halved = card.settings(**known, pv_range=(0, 50), op_range=(0, 50))
    generic = settings("generic/standard", K=2, Ti=100)
    one, other = (differences(generic, s)["transfer"].figures for s in (plain, halved))
    assert one[TO_AUTO] == pytest.approx(other[TO_AUTO], abs=1e-9)
    assert one[TO_MANUAL] == pytest.approx(other[TO_MANUAL], abs=1e-9)
    assert one[TO_AUTO][1] != 0 or one[TO_MANUAL][1] != 0


def test_a_wider_measurement_range_of_the_target_does_not_count_as_a_larger_error() -> None:
    source = settings("generic/standard", K=2, Ti=60, pv_range=(0, 100), op_range=(0, 100))
    conversion = pidemu.convert(source, "iec/61131-3-pid", pv_range=(0, 400))
    found = differences(source, conversion.settings)["windup"]
    assert found.figures[STAYS] == (0.0, 13.0)


def test_gains_of_the_other_sign_bump_the_same_way() -> None:
    source = settings("simple-pid/simple-pid", Kp=-2, Ki=-0.02)
    conversion = pidemu.convert(source, "arduino/pid", given={})
    found = differences(source, conversion.settings)
    assert "transfer" not in found  # both load the output
    assert found["windup"].figures[STAYS] == (0.0, 0.0)


def test_without_integral_the_bias_is_named() -> None:
    neither = differences(settings("generic/standard", K=2, Ti=math.inf), settings("generic/parallel", kp=2, ki=0))
    assert "carry it over" in neither["transfer"].text
    assert "windup" not in neither
    ways = differences(settings("generic/standard", K=2, Ti=math.inf), settings("king/velocity", KC=2, TI=math.inf))
    assert "counts from different starts" in ways["transfer"].text


def test_a_controller_that_cannot_be_emulated_leaves_the_words_and_says_why() -> None:
    source = settings("generic/standard", K=2, Ti=60)
    target = settings("mathworks/pid2", Kp=2, Ki=2 / 60, Kd=20, Tf=0.1)
    found = differences(source, target)
    assert "the forward rule is unstable" in found["windup"].text
    assert "generic/standard back-calculation, Tt = 60 s, mathworks/pid2 none" in found["windup"].text
    assert found["windup"].figures == {}
    assert STARTS["running"] in found["transfer"].text
    assert found["transfer"].figures == {}
    assert "limits" in found


@pytest.mark.parametrize(("scan", "expected"), [((0.005, 1.0), 50.0), ((1.0, 0.02), 50.0), ((30.0, 1.0), 6.4)])
def test_scan_intervals_far_apart_get_a_time_that_both_can_show(scan: tuple[float, float], expected: float) -> None:
    K, Ti = 2.0, 60.0
    conditional = settings("allen-bradley/plc5", Kp=K, Ki=K / Ti, Kd=0)
    found = differences(settings("generic/standard", K=K, Ti=Ti), conditional, scan)["windup"]
    # P alone saturates, so that the integral never moves; over 600 s an error of 3.2 % does, and I ends where P of -6.4 % leaves it
    assert found.figures[AT_ZERO][1] == pytest.approx(expected, abs=K / Ti * 32 * scan[1] + 1e-9)


def test_scan_intervals_too_far_apart_are_not_tried() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("arduino/pid", Kp=2, Ki=2 / 60), (60.0, 0.01))
    assert "arduino/pid cannot be: its scan interval of 0.01 s is too short beside the other's" in found["windup"].text


def test_an_output_that_overflows_is_no_figure() -> None:
    source = settings("astrom-hagglund/listing", K=5.7, Ti=2180, Td=576, Tt=1.5, N=3.8)
    found = differences(source, settings("generic/standard", K=5.7, Ti=2180), 60.0, *scale_of(source, 60.0))["windup"]
    assert "overflows at a scan interval of 60 s: the tracking time of 1.5 s is less, and back-calculation overshoots" in found.text
    assert found.figures == {}


def test_settings_against_themselves_differ_in_nothing() -> None:
    for card, s in SOURCES:
        assert nonlinear_differences(s, s, (1.0, 1.0), scale_of(s, 1.0)) == (), card


def test_every_pair_of_cards_has_its_differences_in_words_and_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[object, Trial] = {}

    def once(side: Side, plan: Plan, action: Action, span: float) -> Trial:
        """Emulate every card once with the same limits, not once in every pair."""
        key = (side.name, plan, action, span)
        return seen[key] if key in seen else seen.setdefault(key, tried(side, plan, action, span))

    monkeypatch.setattr(nonlinear, "tried", once)
    for (a, source), (b, target) in itertools.permutations(SOURCES, 2):
        found = nonlinear_differences(source, target, (1.0, 1.0), (90.0, 4.0))
        aspects = [d.aspect for d in found]
        assert aspects == sorted(aspects, key=ASPECTS.index), (a, b)
        named = {d.aspect: d for d in found}
        both = source.algorithm(), target.algorithm()
        if all(x.ki for x in both) and both[0].windup != both[1].windup:
            assert set(named["windup"].figures) == {STAYS, AT_ZERO}, (a, b)
        if both[0].start != both[1].start:
            assert set(named["transfer"].figures) == {TO_AUTO, TO_MANUAL}, (a, b)
        if {x.precision for x in both} != {"float64"} and both[0].precision != both[1].precision:
            assert "arithmetic" in named, (a, b)
        for d in found:
            assert d.text, (a, b)
            assert not any(math.isnan(x) for pair in d.figures.values() for x in pair), (a, b, d)
    assert len(CARDS) >= 31
