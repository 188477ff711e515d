"""How far gain and dead time may change: against closed forms, published numbers, python-control, and the emulated loop."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

import pidemu
from pidemu.analysis.critical_delay import critical_delays
from pidemu.analysis.figures import loop_figures
from pidemu.analysis.open_loop import OpenLoop
from pidemu.process.process import Process
from pidemu.settings.settings import Settings

REFERENCE: dict[str, Any] = json.loads((Path(__file__).parents[1] / "data" / "robustness_limits.json").read_text("utf-8"))
lags = Process.from_lags


def standard(**dials: float) -> Settings:
    return pidemu.load_card("generic/standard").settings(dials)


def limits(settings: Settings, process: Process, gains: list[float], scan: float | None = None) -> list[float]:
    found = critical_delays(OpenLoop(settings.law(scan), process), np.array(gains)) / process.delay
    return [float(x) for x in found]


LOOPS = [
    (pidemu.load_card("honeywell/udc").settings(GAIN=2, RSET="20 s/repeat", RATE=0), lags(1.0, lags=[20], delay=5)),
    (pidemu.load_card("generic/parallel").settings(kp=1.2, ki=0.12, kd=20, Tf=1), lags(0.05, lags=[10], integrators=1, delay=3)),
]


@pytest.mark.parametrize(("settings", "process", "expected"), [(*a, b) for a, b in zip(LOOPS, REFERENCE["loops"], strict=True)])
def test_limits_are_those_of_an_independent_computation(settings: Settings, process: Process, expected: dict[str, Any]) -> None:
    found = pidemu.robustness(settings, process)
    for name in ("gain_margin", "delay_margin", "Ms", "Mt"):
        assert pytest.approx(expected[name], rel=1e-6) == getattr(found, name)
    assert pytest.approx(expected["lower_gain_limit"] or 0.0, rel=1e-6) == found.lower_gain_limit
    points = [(g, r) for g, r in expected["limit"] if r is not None]
    exact = [2.0 ** (round(6 * math.log2(g)) / 6) for g, _ in points]
    assert pytest.approx([r for _, r in points], rel=5e-6) == limits(settings, process, exact)
    at = dict(zip(found.gain_ratio.tolist(), found.delay_ratio.tolist(), strict=True))
    assert pytest.approx(limits(settings, process, [0.5, 1, 2]), rel=1e-9) == [at[0.5], at[1.0], at[2.0]]


@pytest.mark.parametrize("lam", [6.0, 20.0, 60.0])
def test_lambda_tuning_has_its_closed_form(lam: float) -> None:
    theta, tau = 6.0, 20.0
    settings = standard(K=tau / (0.8 * (lam + theta)), Ti=tau)
    found = pidemu.robustness(settings, lags(0.8, lags=[tau], delay=theta))
    assert pytest.approx(math.pi / 2 * (1 + lam / theta), rel=1e-9) == found.gain_ratio * found.delay_ratio
    assert pytest.approx(math.pi / 2 * (1 + lam / theta), rel=1e-9) == found.gain_margin


def test_proportional_control_of_a_dead_time_is_stable_below_a_gain_of_one_whatever_the_dead_time() -> None:
    card = pidemu.load_card("generic/parallel")
    assert limits(card.settings(kp=0.5, ki=0, kd=0), lags(1.0, lags=[1e-3], delay=4), [0.5, 1.9]) == [math.inf, math.inf]


def test_proportional_control_of_an_integrator_allows_a_quarter_turn() -> None:
    settings = pidemu.load_card("generic/parallel").settings(kp=0.5, ki=0, kd=0)
    assert pytest.approx([math.pi / 2, math.pi / 4]) == limits(settings, lags(0.2, integrators=1, delay=10), [1, 2])


def test_minimum_iae_tuning_fails_where_the_article_says() -> None:
    settings = standard(K=2.98310989, Ti=0.798402844, Td=0.331096573, Tf=0.331096573 / 8)
    process = lags(1.0, lags=[1, 0.3], delay=0.39)
    found = pidemu.robustness(settings, process)
    assert (round(found.gain_margin, 2), round(1 + found.delay_margin / 0.39, 2)) == (1.42, 1.63)
    both = 1.23462
    assert pytest.approx(both, rel=1e-4) == limits(settings, process, [both])[0]
    assert not found.holds_the_aid


@pytest.mark.parametrize(("kp", "stable"), [(0.1751, False), (0.1754, True), (8.037, True), (8.039, False)])
def test_less_proportional_gain_alone_also_makes_a_parallel_controller_unstable(kp: float, stable: bool) -> None:
    settings = pidemu.load_card("generic/parallel").settings(kp=kp, ki=1.2, kd=0)
    assert stable == pidemu.robustness(settings, lags(1.0, lags=[5], delay=1)).stable


def test_a_small_ms_is_no_sign_of_stability() -> None:
    process = lags(0.8, lags=[20, 10], delay=4)
    ultimate = 1 / abs(complex(process.response(process.w180)))
    settings = pidemu.load_card("generic/parallel").settings(kp=2.6 * ultimate, ki=0, kd=0)
    found = pidemu.robustness(settings, process)
    assert (found.stable, found.Ms, found.delay_margin) == (False, math.inf, 0.0)
    assert pytest.approx(1 / 2.6) == found.gain_margin  # the stable gains that are nearest


def test_a_loop_without_dead_time_is_that_of_python_control() -> None:
    process = lags(1.5, lags=[10, 4, 1])
    settings = standard(K=3, Ti=8, Td=2, Tf=0.25)
    found = pidemu.robustness(settings, process)
    s = control.tf("s")
    P = 1.5 / ((10 * s + 1) * (4 * s + 1) * (s + 1))
    L = P * 3 * (1 + 1 / (8 * s) + 2 * s / (1 + 0.25 * s))
    gain_margin, phase_margin, _, _, crossover, _ = control.stability_margins(L)
    assert pytest.approx(gain_margin, rel=1e-6) == found.gain_margin
    assert pytest.approx(math.radians(phase_margin) / crossover, rel=1e-6) == found.delay_margin
    w = np.geomspace(1e-3, 100, 40_000)
    S = 1 / (1 + L(1j * w))
    assert pytest.approx([np.abs(S).max(), np.abs(1 - S).max()], rel=1e-6) == [found.Ms, found.Mt]
    assert set(found.delay_ratio[found.gain_ratio < gain_margin]) == {math.inf}
    assert set(found.delay_ratio[found.gain_ratio > gain_margin]) == {0.0}


def test_scanning_faster_and_faster_leads_to_the_continuous_loop() -> None:
    settings, process = LOOPS[1]
    continuous = np.array(limits(settings, process, [0.25, 0.5, 1, 2, 4]))
    apart = [np.abs(np.array(limits(settings, process, [0.25, 0.5, 1, 2, 4], h)) / continuous - 1).max() for h in (0.2, 0.1, 0.02)]
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] < 0.006


def test_the_sampled_loop_is_another_one() -> None:
    settings, process = LOOPS[0]
    found = pidemu.robustness(settings, process, scan=1.0)
    assert round(found.gain_margin, 2) == 2.79
    assert pytest.approx(loop_figures(settings.law(1.0), process).Ms) == found.Ms
    later = replace(process, delay=process.delay + found.delay_margin)
    assert not loop_figures(settings.law(1.0), replace(later, delay=later.delay * 1.001)).stable
    assert loop_figures(settings.law(1.0), replace(later, delay=later.delay * 0.999)).stable


EMULATED: list[tuple[str, dict[str, Any], Process, float]] = [
    ("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.1}, lags(1.0, lags=[20, 5], delay=3), 1.0),
    (
        "emerson/deltav",
        {"GAIN": 1.5, "RESET": 20, "RATE": 3, "FORM": "Standard"},
        lags(1.2, lags=[15, 4], delay=5),
        2.0,
    ),
    ("honeywell/tdc3000", {"K": 1.5, "T1": 0.4, "FORM": "ideal", "CTEQN": "A"}, lags(1.0, lags=[20], delay=6.3), 2.0),
    ("arduino/pid", {"Kp": 2, "Ki": 0.1, "Kd": 1}, lags(0.9, lags=[20, 3], delay=4.7), 1.0),
    ("generic/standard", {"K": 0.3, "Ti": 40}, lags(0.1, lags=[5], integrators=1, delay=3), 1.0),
]


def growth(settings: Settings, process: Process, h: float, period: float) -> float:
    """Return by how much the error of an emulated loop grows from one part of a run to the next, after a small load step."""
    length = 12 * period
    run = pidemu.simulate(settings, process, h, setpoint=0, load=(h, 1e-5), time=3 * length, output_limits=(-1e4, 1e4))
    parts = [run.error[(run.times >= k * length) & (run.times < (k + 1) * length)] for k in (1, 2)]
    swing = [float(np.ptp(part - np.linspace(part[0], part[-1], part.size))) for part in parts]
    return swing[1] / swing[0]


@pytest.mark.parametrize(("card", "dials", "process", "h"), EMULATED, ids=[e[0] for e in EMULATED])
def test_the_emulated_loop_is_stable_inside_the_limit_alone(card: str, dials: dict[str, Any], process: Process, h: float) -> None:
    settings = pidemu.load_card(card).settings(dials)
    gains = np.exp(np.random.default_rng(7).uniform(math.log(0.5), math.log(2), 4))
    for g, r in zip(gains.tolist(), limits(settings, process, gains.tolist(), h), strict=True):
        changed = replace(process, gain=g * process.gain)
        at = replace(changed, delay=r * process.delay)
        period = 2 * math.pi / loop_figures(settings.law(h), replace(at, delay=0.999 * at.delay)).crossover
        inside, outside = (growth(settings, replace(changed, delay=x * r * process.delay), h, period) for x in (0.98, 1.02))
        assert inside < 1 < outside, (g, r)


def test_random_sampled_loops_change_where_the_limit_is() -> None:
    rng = np.random.default_rng(3)
    for _ in range(25):
        T, L, h = rng.uniform(4, 20), rng.uniform(0.5, 8), rng.choice([0.3, 1.0])
        process = [lags(1.0, lags=[T], delay=L), lags(0.8, lags=[T, T / 3], delay=L)][rng.integers(2)]
        settings = standard(K=float(rng.uniform(0.3, 3)), Ti=float(rng.uniform(5, 30)))
        law = settings.law(h)
        for g, r in zip((0.5, 1.0, 2.0), limits(settings, process, [0.5, 1.0, 2.0], h), strict=True):
            stable = [loop_figures(law, Process(g * process.gain, process.poles, (), x * r * L)).stable for x in (0.999, 1.001)]
            assert stable == [True, False], (settings, process, h, g)


def test_a_process_of_the_wrong_sign_is_refused_where_the_sign_of_the_gain_is_the_action() -> None:
    settings = pidemu.load_card("simple-pid/simple-pid").settings(Kp=1, Ki=0.1, Kd=0)
    with pytest.raises(pidemu.ProcessError, match="give the gain the other sign"):
        pidemu.robustness(settings, lags(-1.0, lags=[10], delay=2))
    other = pidemu.load_card("fisher/provox").settings(GAIN=1, RESET=4, RATE=0)
    assert pidemu.robustness(other, lags(-1.0, lags=[10], delay=2)).stable
