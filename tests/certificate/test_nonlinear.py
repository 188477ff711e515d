"""Nonlinear differences: what happens at limits and transfers, by hand and by emulation on signals of the test's own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.card.transfer import STARTS
from pidemu.certificate import limit_test as windup
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.nonlinear import nonlinear_differences
from pidemu.certificate.recovery import Recoveries, Recovery
from pidemu.certificate.scaled_controller import scaled_controllers
from pidemu.certificate.trials import TrialPlan, TriedController
from pidemu.controller.bench import limits_in_percent
from pidemu.records.standard import scale_of, standard_record
from pidemu.settings.settings import Settings
from tests.algorithms import NONE
from tests.checks.bench import VALID, edited, written
from tests.conversion.usual import CARDS, SOURCES
from tests.helpers import Floats

STAYS = "at the limit after the error has turned [s]"
AT_ZERO = "output with the error back at zero [% of output span]"
WITH_NOISE = "output on the way back from a limit, with noise [% of output span]"
TO_AUTO = "bump to automatic [% of output span]"
TO_MANUAL = "bump to manual [% of output span]"
ASPECTS = ["windup", "transfer", "bias", "limits", "arithmetic", "error", "output", "setpoint"]


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(**values)


def differences(
    source: Settings, target: Settings, scan: float | tuple[float, float] = 1.0, time: float = 60.0, size: float = 4.0
) -> dict[str, NonlinearDifference]:
    scans = scan if isinstance(scan, tuple) else (scan, scan)
    return {d.aspect: d for d in nonlinear_differences(source, target, scans, (time, size))}


def excursion(
    s: Settings, time: float, size: float, h: float, limits: tuple[float, float] = (0, 100), ramp: float = 0.0
) -> tuple[Floats, int, int]:
    """Output from rest at 50 through an error of 8 sizes, as much the other way, and none; where it turns, and where it ends."""
    n = round(time / h)
    e = 8 * size * np.concatenate([np.ones(2 * n), -np.ones(3 * n), np.zeros(n)])
    if ramp:
        x = np.arange(6 * n) * h
        e = 8 * size * np.interp(x, [0, ramp, 2 * time, 2 * time + ramp, 5 * time, 5 * time + ramp], [0, 1, 1, -1, -1, 0])
    controller = pidemu.Controller(s, h, output_limits=limits)
    controller.rest(50.0, 50.0, 50.0)
    return controller.run(np.full_like(e, 50.0), 50 - e), 2 * n, 5 * n


def slow(both: tuple[Settings, Settings], time: float) -> float:
    """Five times the longer derivative time, half the characteristic time at most."""
    return min(5 * max(abs(a.kd / a.kp) for a in (s.algorithm() for s in both)), time / 2)


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
    story = "With the valve at 100 % and the error reversing, the old controller leaves the limit at once, the new one after "
    assert found.text.startswith(f"{story}{found.figures[STAYS][1]:.4g} s.")


def test_less_than_a_scan_is_no_difference() -> None:
    source, target = settings("iec/61131-3-pid", KP=-2, TR=60), settings("mathworks/pid2", Kp=2, Ki=2 / 60)
    assert "windup" not in differences(source, target, (1.0, 0.1))  # 13.1 s, of which the first sees 13


def test_both_may_leave_at_once_and_the_output_after_the_spell_differ() -> None:
    K, Ti = 2.0, 60.0
    source, target = settings("generic/standard", K=K, Ti=Ti), settings("allen-bradley/plc5", Kp=K, Ki=K / Ti, Kd=0)
    found = differences(source, target)["windup"]
    assert found.figures[STAYS] == (0.0, 0.0)
    for s, at_zero in zip((source, target), found.figures[AT_ZERO], strict=True):
        output, turn, _ = excursion(s, 60.0, 4.0, 1.0)
        assert (output[turn - 1], output[turn] < 100) == (100, True)
        assert at_zero == output[-1]
    assert found.figures[AT_ZERO][1] == 50  # P alone saturates, so that the integral of the PLC-5 never moves
    assert found.text.startswith(
        "With the valve at 100 % and the error reversing, both controllers leave the limit at once; after 180 s of an error of "
        f"32 % the other way and back at zero, the output is {found.figures[AT_ZERO][0]:.4g} % on the old controller and 50 % on "
        "the new one, until the loop removes the difference."
    )


def test_schemes_of_different_names_that_behave_alike_have_no_difference() -> None:
    """Positive feedback with and without a fast way back: where P is on the error, the fast one never gets its turn."""
    source = settings("fisher/provox", GAIN=2.0, RESET=1)
    target = settings("emerson/deltav", GAIN=2.0, RESET=60, ARW_HI_LIM=95, ARW_LO_LIM=5)
    for s in (source, target):
        np.testing.assert_allclose(excursion(s, 60.0, 4.0, 1.0)[0], excursion(source, 60.0, 4.0, 1.0)[0], rtol=0, atol=1e-9)
    assert source.algorithm().integral.windup != target.algorithm().integral.windup
    assert "windup" not in differences(source, target)
    velocity, recomputed = settings("yokogawa/fieldbus-pid", GAIN=2, RESET=60), settings("allen-bradley/pide", PGain=2, IGain=2)
    assert "windup" not in differences(velocity, recomputed)
    conditional, other = settings("mathworks/pid2", Kp=2, Ki=2 / 60), settings("iec/61131-3-pid", KP=-2, TR=60)
    assert conditional.algorithm().integral.windup == other.algorithm().integral.windup == NONE
    assert "windup" not in differences(conditional, other)


def test_a_faster_way_back_inside_the_output_limits_is_told_and_the_verdict_is_not_exact() -> None:
    """DeltaV's limits of anti-reset windup at 60 %: an output of 100 % falls by 34 % more than PROVOX's when the error turns."""
    source = settings("emerson/deltav", GAIN=1, RESET=1, ARW_HI_LIM=60, FORM="Standard")
    found = pidemu.convert(source, "fisher/provox", scan=1.0)
    assert found.verdict == "approximate"
    assert found.sentence.startswith("The two equations are the same; what differs is how fast the integral comes back.")
    assert differences(source, found.settings)["integral"].text == (
        "The integral comes back differently inside the output limits: that of emerson/deltav comes back 16 times as fast while "
        "the output is above 60 %; that of fisher/provox comes back as it went."
    )
    outputs = []
    for s in (source, found.settings):
        controller = pidemu.Controller(s, 1.0, output_limits=(0, 100))
        controller.rest(50.0, 50.0, 50.0)
        pv = np.repeat([50.0, 30.0, 50.0, 52.0, 50.0], (5, 15, 10, 10, 20))
        outputs.append(float(controller.run(np.full_like(pv, 50.0), pv)[-1]))
    assert outputs[1] - outputs[0] > 30


@pytest.mark.parametrize(("limits", "told"), [((0, 60), False), ((0, 61), True)])
def test_a_faster_way_back_at_the_output_limits_themselves_does_nothing(limits: tuple[float, float], told: bool) -> None:
    source = settings("emerson/deltav", GAIN=1, RESET=1, ARW_HI_LIM=60)
    found = pidemu.convert(source, "fisher/provox", scan=1.0, limits=limits)
    assert ("integral" in {d.aspect for d in found.certificate.nonlinear}) == told
    assert found.verdict == ("approximate" if told else "exact")


def test_noise_and_derivative_at_a_limit_show_what_steps_do_not() -> None:
    """A velocity controller drifts off the limit: what noise adds is kept, what it takes away is cut off at the limit."""
    source = settings("generic/standard", K=2, Ti=60, Td=8, Tf=1)
    target = settings("yokogawa/fieldbus-pid", GAIN=2, RESET=60, RATE=8)
    found = differences(source, target)["windup"]
    record = standard_record(1.0, time=60.0, size=4.0)
    outputs = []
    for s in (source, target):
        controller = pidemu.Controller(s, 1.0, output_limits=(0, 100))
        controller.rest(50.0, 50.0, 50.0)
        raw = controller.run(record.sp[-360:], record.pv[-360:])
        outputs.append(np.convolve(raw, np.ones(6) / 6)[:360])
    worst = 180 + int(np.argmax(np.abs(outputs[0] - outputs[1])[180:]))
    assert found.figures[WITH_NOISE] == pytest.approx((outputs[0][worst], outputs[1][worst]), abs=1e-9)
    assert outputs[1][worst] - outputs[0][worst] > 30
    pair = Recovery(100, True, 0.0, 50.0), Recovery(100, True, 0.0, 50.0)
    alike = Recoveries(pair, short=False, late=False, apart=False, noisy=(1.25, 40.5), noisy_at=57.0)
    assert windup.story(alike, TrialPlan(60.0, 4.0, (0.0, 100.0)), scaled_controllers(source, target, (1.0, 1.0))) == (
        "Coming back from 0 % along a ramp of PV with noise of 0.5 %, 57 s after PV has turned, the output is 1.25 % on the old "
        "controller and 40.5 % on the new one; without noise they are alike."
    )


def test_what_the_linear_laws_make_different_is_no_difference_at_a_limit() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("generic/standard", K=2.1, Ti=63))
    assert "windup" not in found  # the same scheme; 5 % of the gain move the output after the spell as well


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
        low, high = limits_in_percent(pair[0], None)
        ramp = slow(pair, 90.0)
        output, turn, end = excursion(s, 90.0, 4.0, 1.0, (low, high), ramp)
        reached = output[turn - 1]
        held = np.flatnonzero(output[turn + math.ceil(ramp / 2) : end] == reached)
        assert stays == (held[-1] + 1 if held.size and reached in (low, high) else 0)
        assert at_zero == pytest.approx(output[-1], abs=1e-9)


def test_an_integral_that_stands_still_at_a_limit_both_ways_never_leaves_it(tmp_path: Path) -> None:
    stuck = edited(
        VALID,
        ("{scheme: back-calculation, tracking-time: Ti}", "{scheme: freeze, direction: both}"),
        ("proportional: {on: error}", "proportional: {on: none}"),
        ("{kp: 2,", "{kp: 0,"),
    )
    card = pidemu.load_card(written(tmp_path, stuck))
    found = differences(card.settings(GAIN=2, RESET=60), settings("generic/parallel", kp=0, ki=2 / 60))["windup"]
    assert found.figures[STAYS][0] == math.inf
    assert "the old controller stays there for the 180 s that this lasts" in found.text
    assert found.figures[AT_ZERO][0] == 100


def test_a_low_gain_starts_nearer_to_the_limit_so_that_it_gets_there() -> None:
    """K = 0.1: an error of 45 % for two integral times moves the output by 13.5 %, which from 50 % would reach no limit."""
    K, Ti, time, error = 0.1, 60.0, 60.0, 45.0
    found = differences(settings("generic/standard", K=K, Ti=Ti), settings("iec/61131-3-pid", KP=-K, TR=Ti), size=20.0)["windup"]
    start = 100 - 0.6 * K * error * (1 + 2 * time / Ti)
    integral = start + K * error * 2 * time / Ti
    scans = next(j for j in itertools.count(1) if integral - j * K * error / Ti - K * error < 100)
    # both rest at `start`; the integral without protection needs these scans
    assert found.figures[STAYS] == pytest.approx((0.0, scans - 1), abs=1e-9)


def test_another_tracking_time_is_a_difference_where_it_shows() -> None:
    source = settings("generic/standard", K=2, Ti=60)
    found = differences(source, settings("astrom-hagglund/listing", K=2, Ti=60, Td=0, Tt=300, N=10))["windup"]
    assert found.figures[AT_ZERO][0] > 5  # Tt = Ti lets the integral come back within the spell
    assert found.figures[AT_ZERO][1] == 0
    near = settings("astrom-hagglund/listing", K=2, Ti=60, Td=0, Tt=59.5, N=10)
    assert "windup" not in differences(source, near)


def test_loading_the_output_bumps_by_the_other_terms() -> None:
    K, ki, size = 2.0, 0.02, 4.0
    found = differences(settings("generic/parallel", kp=K, ki=ki), settings("arduino/pid", Kp=K, Ki=ki), size=size)["transfer"]
    error = -size / 2  # the measurement is that much above the setpoint
    assert found.figures[TO_AUTO] == pytest.approx((0.0, K * error + ki * 1.0 * error), abs=1e-9)
    assert found.figures[TO_MANUAL] == (0.0, 0.0)
    said = f"generic/parallel {STARTS['bumpless'].of_a_controller}, arduino/pid {STARTS['load-output'].of_a_controller}"
    assert said in found.text
    assert "with PV 2 % above SP, the output jumps by 0 % on the old controller and -4.04 % on the new one" in found.text


def test_the_iec_example_bumps_at_the_transfer_to_manual_as_it_multiplies_the_operators_output() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("iec/61131-3-pid", KP=-2, TR=60))["transfer"]
    assert found.figures[TO_MANUAL] == pytest.approx((0.0, (-2 - 1) * 50.0), abs=1e-4)
    assert "iec/61131-3-pid multiplies the operator's output by the gain" in found.text
    assert "Switched to manual at its present output, it jumps by 0 % on the old controller and -150 % on" in found.text


def test_an_integral_that_runs_on_in_manual_makes_the_output_jump() -> None:
    K, Ti, T, e = 0.5, 60.0, 60.0, -2.0
    found = differences(settings("generic/standard", K=K, Ti=Ti), settings("oscat/ft-pid", KP=K, TN=Ti, TV=0))["transfer"]
    computed = 50 + K * e + K * e * (3 * T + 1) / Ti  # from 50 at rest, with the error of the manual spell and one scan more
    assert found.figures[TO_AUTO][1] == pytest.approx(computed - 40, abs=0.02)  # half a scan, as the rule is the trapezoidal one
    assert STARTS["running"].of_a_controller in found.text


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
    source = settings("generic/standard", K=2, Ti=60, pv_range=(0, 100, "degC"), op_range=(0, 100))
    conversion = pidemu.convert(source, "iec/61131-3-pid", to_pv_range=(0, 400, "degC"))
    found = differences(source, conversion.settings)["windup"]
    assert found.figures[STAYS] == (0.0, 13.0)


def test_gains_of_the_other_sign_bump_the_same_way() -> None:
    source = settings("simple-pid/simple-pid", Kp=-2, Ki=-0.02)
    conversion = pidemu.convert(source, "arduino/pid", given={})
    found = differences(source, conversion.settings)
    assert "transfer" not in found  # both load the output
    assert "windup" not in found  # their sums are limited in other places of the scan, and come out alike


def test_without_integral_a_positional_target_has_its_bias_open() -> None:
    p_only = settings("generic/standard", K=2, Ti=math.inf)
    neither = differences(p_only, settings("generic/parallel", kp=2, ki=0))
    assert neither["bias"].text.startswith("Open: the bias.")
    assert "while SP = PV, or give it with --bias" in neither["bias"].text
    assert {"windup", "transfer"}.isdisjoint(neither)
    assert "bias" not in differences(p_only, settings("king/velocity", KC=2, TI=math.inf))  # it has none
    assert "bias" in differences(settings("king/velocity", KC=2, TI=math.inf), p_only)
    assert "bias" not in differences(settings("generic/standard", K=2, Ti=60), settings("generic/parallel", kp=2, ki=2 / 60))


def test_without_integral_what_a_limit_leaves_behind_is_told() -> None:
    found = differences(settings("generic/standard", K=2, Ti=math.inf), settings("king/velocity", KC=2, TI=math.inf))["windup"]
    assert found.figures == {"output after an excursion to the limit and back [% of output span]": (50.0, 20.0)}
    assert found.text == (
        "From an output of 50 %, PV moves by 40 %, so that the output stands at 100 %, and comes back: then the old controller is "
        "at 50 %, the new one at 20 %. Without integral action nothing removes this difference, and every limit adds to it."
    )


def test_a_controller_that_cannot_be_emulated_leaves_the_words_and_says_why() -> None:
    source = settings("generic/standard", K=2, Ti=60)
    target = settings("mathworks/pid2", Kp=2, Ki=2 / 60, Kd=20, Tf=0.1)
    found = differences(source, target)
    assert "the forward rule is unstable" in found["windup"].text
    assert found["windup"].text.endswith("mathworks/pid2: none: the integral goes on.")
    assert found["windup"].figures == {}
    assert STARTS["running"].of_a_controller in found["transfer"].text
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
    assert "arduino/pid cannot be emulated: its scan interval of 0.01 s is too short beside the other's" in found["windup"].text


def test_an_output_that_overflows_is_no_figure() -> None:
    source = settings("astrom-hagglund/listing", K=5.7, Ti=2180, Td=0, Tt=0.0015, N=3.8)
    found = differences(source, settings("generic/standard", K=5.7, Ti=2180), 60.0, *scale_of(source, 60.0))["windup"]
    assert (
        "overflows at a scan interval of 60 s: the tracking time of 0.0015 s is less, and back-calculation overshoots" in found.text
    )
    assert found.figures == {}


def test_settings_against_themselves_differ_in_nothing() -> None:
    for card, s in SOURCES:
        assert nonlinear_differences(s, s, (1.0, 1.0), scale_of(s, 1.0)) == (), card


def test_every_pair_of_cards_has_its_differences_in_words_and_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[object, object] = {}

    def once(of: Callable[..., object]) -> Callable[..., object]:
        """Emulate every card once with the same limits, not once in every pair."""

        def call(tried: TriedController, *arguments: object, **named: object) -> object:
            key = (of.__name__, tried.key, arguments, tuple(named.items()))
            return seen[key] if key in seen else seen.setdefault(key, of(tried, *arguments, **named))

        return call

    monkeypatch.setattr(TriedController, "course", once(TriedController.course))
    monkeypatch.setattr(TriedController, "transfers", once(TriedController.transfers))
    for (a, source), (b, target) in itertools.permutations(SOURCES, 2):
        found = nonlinear_differences(source, target, (1.0, 1.0), (90.0, 4.0))
        aspects = [d.aspect for d in found]
        assert aspects == sorted(aspects, key=ASPECTS.index), (a, b)
        named = {d.aspect: d for d in found}
        if "windup" in named and all(x.algorithm().ki for x in (source, target)):
            assert {STAYS, AT_ZERO} <= set(named["windup"].figures), (a, b)
        if "transfer" in named:
            assert set(named["transfer"].figures) == {TO_AUTO, TO_MANUAL}, (a, b)
        for d in found:
            assert d.text[0].isupper() or d.text.startswith((a, b)), (a, b, d.text)
            assert d.text.endswith("."), (a, b, d.text)
            assert not any(math.isnan(x) for pair in d.figures.values() for x in pair), (a, b, d)
    assert len(CARDS) >= 31
