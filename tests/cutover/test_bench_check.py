"""The bench check against figures published by hand, and against the law."""

from __future__ import annotations

from typing import Any

import pytest

import pidemu
from pidemu.cutover.bench_check import STEPS, BenchCheck, bench_check
from pidemu.errors import ScanError
from tests.cutover.bench import defined, on_every_card


def settings(name: str, **dials: Any) -> pidemu.Settings:
    return pidemu.load_card(name).settings(**dials)


CASES = [  # dials, scan [s], and by hand for an error of 10 %: jump [%], ramp [% per minute]
    ("allen-bradley/logix-pid", {"KP": 1.8, "KI": 1.25, "KD": 0.2, "PE": "dependent"}, 0.5, 18.0, 14.4),
    ("allen-bradley/pide", {"PGain": 2.5, "IGain": 0.5, "DGain": 0.1, "DependIndepend": "true"}, 0.25, 25.0, 50.0),
    ("allen-bradley/pide", {"PGain": 4, "IGain": 3, "DependIndepend": "true", "PVEProportional": "true"}, 0.25, 40.0, 13.333),
    ("allen-bradley/logix-pid", {"KP": 3, "KI": 0.66667, "KD": 0.13333, "PE": "dependent"}, 0.1, 30.0, 45.0),
    (
        "simple-pid/simple-pid",
        {"Kp": 0.078431, "Ki": 0.0019608, "Kd": 0.11765, "pv_range": (0, 300), "op_range": (0, 1)}, 0.1, 235.29, 352.94,
    ),
    ("allen-bradley/logix-pid", {"KP": 1.8, "KI": 0.41667, "KD": 0.016667, "PE": "dependent", "DOE": "error"}, 0.1, 18.0, 43.2),
    ("allen-bradley/logix-pid", {"KP": 1.0, "KI": 0.5, "KD": 0.05, "PE": "dependent"}, 0.25, 10.0, 20.0),
    ("allen-bradley/logix-pid", {"KP": 4, "KI": 0, "PE": "dependent"}, 0.5, 40.0, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("name", "dials", "scan", "jump", "ramp"), CASES)
def test_jump_and_ramp_are_those_worked_out_by_hand(
    name: str, dials: dict[str, Any], scan: float, jump: float, ramp: float
) -> None:
    check = bench_check(settings(name, **dials), scan)
    per_ten = 10 / check.step
    # 1e-4: four digits; the hand-made figures have five, and so have the dials
    assert abs(check.jump * per_ten) == pytest.approx(jump, rel=1e-4)
    assert abs(check.ramp_per_minute * per_ten) == pytest.approx(ramp, rel=1e-4)


@on_every_card
def test_the_emulated_step_is_the_law_s_first_two_moments(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        a = s.algorithm()
        if a.error is not None or a.integral.deadband or a.output.deadband or a.arithmetic.type == "integer":
            continue  # gap, error squared and deadbands are not linear; whole counts
        h = 0.05 if name != "modelica/limpid" else 0.01
        check = bench_check(s, h, "reverse")
        m0, m1, _ = s.law().moments()
        # what a scan more or less of integration is, and the rounding of 24 bits in signals of 50 and terms of some hundred
        rounding = 1e-9 if a.arithmetic.type == "float64" else 2e-3
        assert check.ramp_per_minute == pytest.approx(-60 * m0 * check.step, rel=1e-6, abs=60 * rounding), s.summary
        assert check.jump == pytest.approx(-m1 * check.step, rel=1e-6, abs=abs(m0) * h * check.step + rounding), s.summary
        most = 0.3 * 255 if name == "arduino/pid" else 30  # its output is 0 to 255
        assert max(abs(check.jump), abs(check.kick)) < most or check.step == STEPS[-1]


def test_pi_is_one_sentence() -> None:
    s = settings("allen-bradley/pide", PGain=1.8, IGain=1.25, DependIndepend="true")
    start = "In automatic, with PV at SP and the output half way, move PV"
    assert bench_check(s, 0.5, "reverse").text == (
        f"{start} up by 10 %: the output falls by 18 % and goes on falling at 14.4 % per minute."
    )
    assert bench_check(s, 0.5, "direct").text == (
        f"{start} up by 10 %: the output rises by 18 % and goes on rising at 14.4 % per minute."
    )
    assert bench_check(s, 0.5).text == (
        f"{start} until the error (SP - PV reverse acting, PV - SP direct acting) is +10 %: the output rises by 18 % and goes on "
        "rising at 14.4 % per minute."
    )


def test_p_alone_jumps_only_and_i_alone_ramps_only() -> None:
    p = bench_check(settings("emerson/deltav", GAIN=2.5, STRUCTURE=4), 0.2, "direct")
    assert p.text.endswith("move PV up by 10 %: the output rises by 25 %.")
    assert (p.jump, p.kick, p.ramp_per_minute) == (25.0, 0.0, 0.0)
    i = bench_check(settings("generic/parallel", kp=0, ki=0.02), 1.0, "reverse")
    assert i.text.endswith("the output does not jump but begins falling at 12 % per minute.")
    assert (i.jump, i.kick) == (0.0, 0.0)
    off = bench_check(settings("generic/parallel", kp=0, ki=0), 1.0, "reverse")
    assert off.text.endswith("the output does not move.")


def test_the_kick_of_the_derivative_stands_apart_and_the_step_is_small_enough_for_it() -> None:
    s = settings("emerson/deltav", GAIN=2.5, RESET=30, RATE=4.32, ALPHA=0.1111, FORM="Series")
    check = bench_check(s, 0.2, "direct")
    assert check.step == 1.0  # 2 % would kick by 37 %
    first = (2.5 + 2.5 * 4.32 / (0.1111 * 4.32 + 0.2)) * (1 + 0.2 / 30)  # P and D, and the integral of both
    assert check.kick == pytest.approx(first, rel=1e-9)
    assert check.jump == pytest.approx(2.5 * (1 + 4.32 / 30), rel=1e-6)
    assert check.text.endswith(
        "move PV up by 1 %: the output rises by 18.51 % at first, at a scan every 0.2 s; when the derivative has died out, after "
        "2.8 s, a rise of 2.86 % is left, and with it a rise of 5 % per minute since the step."
    )


def test_without_a_scan_interval_it_is_worked_out_at_the_one_the_two_were_run_at() -> None:
    source = settings("generic/standard", K=2, Ti=20, Td=2)
    check = pidemu.convert(source, "emerson/deltav").bench_check
    assert isinstance(check, BenchCheck)
    # K (1 + h/Ti + Td/(alpha Td + h)) at the run's interval of 1 s, alpha the 1/8 that the card begins with, for a step of 5 %
    assert check.text.count("at a scan every 1 s") == 1
    assert check.kick == pytest.approx(26.5, rel=1e-12)


def test_a_gain_whose_smallest_step_hits_a_limit_is_told_instead_of_a_clipped_figure() -> None:
    with pytest.raises(ScanError, match="the smallest step of PV would take the output to a limit"):
        bench_check(settings("generic/standard", K=2e6, Ti=20), 1.0)


def test_the_steps_are_also_in_the_signals_own_units_where_their_ranges_are_given() -> None:
    s = settings("allen-bradley/pide", PGain=1.8, IGain=1.25, DependIndepend="true", pv_range=(0, 150), op_range=(4, 20))
    assert bench_check(s, 0.5, "reverse").text.endswith(
        "move PV up by 10 % (15 PV units): the output falls by 18 % (2.88 OP units) and goes on falling at 14.4 % (2.304 OP units) "
        "per minute."
    )
    bare = bench_check(settings("simple-pid/simple-pid", Kp=0.5, Ki=0.1), 0.1)
    assert bare.text.endswith("up by 10 PV units: the output falls by 5 OP units and goes on falling at 60 OP units per minute.")


@pytest.mark.parametrize(("gain", "way"), [(1.2, "rises"), (-1.2, "falls")])
def test_where_the_sign_is_the_action_the_check_knows_it(gain: float, way: str) -> None:
    check = bench_check(settings("iec/61131-3-pid", KP=gain, TR=8), 0.1)
    assert f"move PV up by 10 PV units: the output {way} by 12 OP units" in check.text
    assert check.action == {"rises": "direct", "falls": "reverse"}[way]
