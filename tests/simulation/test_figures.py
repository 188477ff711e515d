"""Margins and stability of closed loops against exact formulas, python-control and each other."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
import scipy.signal
from hypothesis import assume, example, given
from hypothesis import strategies as st

import pidemu
from pidemu.analysis.figures import crossover, loop_figures, scan_for, time_scale
from pidemu.analysis.open_loop import OpenLoop, picture_of
from pidemu.errors import UndefinedError
from pidemu.law.law import Law
from pidemu.process.process import Process
from tests.simulation.processes import processes, transfer_function

FOPDT = Process.from_lags(1, [1], delay=1)


def law(kp: float, ki: float = 0.0, kd: float = 0.0, Tf: float = 0.0, scan: float | None = None) -> Law:
    return pidemu.load_card("generic/parallel").settings(kp=kp, ki=ki, kd=kd, Tf=Tf).law(scan)


gains = st.floats(0.05, 10)
zero_or = st.just(0.0) | st.floats(0.02, 3)


@st.composite
def laws(draw: st.DrawFn, scan: float | None = None) -> Law:
    kp, kd = draw(gains), draw(zero_or)
    return law(kp, kp * draw(zero_or), kp * kd, 0.1 * kd, scan)


@st.composite
def unstable_ones(draw: st.DrawFn) -> Process:
    """Processes of `processes`, every third with an unstable pole."""
    p = draw(processes())
    return Process(p.gain, [*p.poles, draw(st.floats(0.05, 1))], p.zeros) if draw(st.integers(0, 2)) == 0 else p


def controller_of(c: Law) -> Any:
    """The controller as a transfer function of python-control, without the common factor of a controller without integral."""
    a, s = c.algorithm, control.tf("s")
    return a.kp + (a.ki / s if a.ki else 0.0) + (a.kd * s / (1 + a.Tf * s) if a.kd else 0.0)


def test_the_ultimate_gain_of_a_lag_with_dead_time() -> None:
    w = FOPDT.w180  # w + arctan w = pi
    found = loop_figures(law(1.0), FOPDT)
    assert found.gain_margin == pytest.approx(math.hypot(1, w), rel=1e-12)
    assert found.gain_margin == pytest.approx(2.2618263, abs=1e-7)
    assert (found.phase_margin, found.delay_margin) == (math.inf, math.inf)
    assert math.isnan(found.crossover)
    assert [loop_figures(law(k), FOPDT).stable for k in (2.2618, 2.2619)] == [True, False]


@pytest.mark.parametrize("K", [0.2, 0.5, 1.5])
def test_margins_of_an_integrator_with_dead_time_are_the_formulas(K: float) -> None:
    found = loop_figures(law(K), Process(1, [0], delay=1))
    assert found.crossover == pytest.approx(K, rel=1e-12)
    assert found.gain_margin == pytest.approx(math.pi / 2 / K, rel=1e-12)
    assert found.phase_margin == pytest.approx(90 - math.degrees(K), rel=1e-10)
    assert found.delay_margin == pytest.approx(math.pi / 2 / K - 1, rel=1e-10)


@given(K=st.floats(0.05, 1.5), T=st.floats(0.1, 50), theta=st.floats(0.1, 20), gain=st.floats(0.1, 5) | st.floats(-5, -0.1))
def test_a_pi_controller_that_cancels_the_lag_leaves_an_integrator_with_dead_time(
    K: float, T: float, theta: float, gain: float
) -> None:
    kp = K * T / theta / abs(gain)
    found = loop_figures(law(kp, kp / T), Process.from_lags(gain, [T], delay=theta))
    assert found.crossover == pytest.approx(K / theta, rel=1e-9)
    assert found.gain_margin == pytest.approx(math.pi / 2 / K, rel=1e-9)
    assert found.stable


RESONANT = Process(1.078125, [-1, 0.09375, -0.001171875 + 0.0234081848j, -0.001171875 - 0.0234081848j])


@pytest.mark.parametrize("over", [1 + 1e-6, 1.001, 1.1, 1 - 1e-6, 0.999])
@pytest.mark.parametrize("zeta", [0.3, 0.02, 1e-4])
def test_a_resonance_that_just_reaches_a_loop_gain_of_1_is_seen(zeta: float, over: float) -> None:
    """``1/(s^2 + 2 zeta s + 1)`` peaks at ``1/(2 zeta sqrt(1 - zeta^2))``: with a loop gain of 1 a phase margin begins."""
    p = complex(-zeta, math.sqrt(1 - zeta**2))
    process = Process(1, [p, p.conjugate()])
    peak = 1 / (2 * zeta * math.sqrt(1 - zeta**2))
    assert math.isfinite(loop_figures(law(over / peak), process).phase_margin) == (over > 1)


@given(controller=laws(), process=unstable_ones())
@example(controller=law(0.095703125), process=RESONANT)
def test_stability_and_margins_are_python_controls(controller: Law, process: Process) -> None:
    L = controller_of(controller) * transfer_function(process) * process.feedback_sign
    poles = control.feedback(L, 1).poles()
    assume(np.min(np.abs(poles.real) / np.abs(poles)) > 1e-6)  # on the edge the two may round differently
    found = loop_figures(controller, process)
    assert found.stable == (np.max(poles.real) < 0)
    gm, pm, *_ = control.stability_margins(L)
    assert found.phase_margin == pytest.approx(pm, rel=1e-5, abs=1e-4)
    # python-control leaves out margins at zero frequency and beyond 1e8, where rounding decides
    if math.isfinite(gm) and 1e-4 < gm < 1e4:
        assert abs(math.log(found.gain_margin)) <= abs(math.log(gm)) * (1 + 1e-5) + 1e-6


@given(controller=laws(), process=unstable_ones(), delay=st.just(0.0) | st.floats(0.05, 5), scan=st.none() | st.floats(0.05, 0.5))
def test_a_stable_loop_becomes_unstable_just_where_the_gain_margin_says(
    controller: Law, process: Process, delay: float, scan: float | None
) -> None:
    process = Process(process.gain, process.poles, process.zeros, delay)
    c = Law(controller.algorithm, scan)
    found = loop_figures(c, process)
    assume(found.stable and 1e-3 < found.gain_margin < 1e3 and abs(math.log(found.gain_margin)) > 0.01)
    within, beyond = (math.exp(math.log(found.gain_margin) * share) for share in (0.999, 1.001))
    assert loop_figures(c, process, within).stable
    assert not loop_figures(c, process, beyond).stable


@given(controller=laws(), process=unstable_ones(), delay=st.just(0.0) | st.floats(0.05, 5))
def test_a_stable_loop_becomes_unstable_just_where_the_delay_margin_says(controller: Law, process: Process, delay: float) -> None:
    def delayed(extra: float) -> Process:
        return Process(process.gain, process.poles, process.zeros, delay + extra)

    found = loop_figures(controller, delayed(0.0))
    assume(found.stable and 1e-3 < found.delay_margin < 1e3)
    assert loop_figures(controller, delayed(0.999 * found.delay_margin)).stable
    assert not loop_figures(controller, delayed(1.001 * found.delay_margin)).stable


def closed_loop_poles(process: Process, scans: int, c: Law) -> Any:
    """Eigenvalues of the sampled loop, from scipy's sampled process and the backward scan equations of a parallel PID."""
    a, h = c.algorithm, c.scan
    assert h is not None
    num, den = process.rational.num[::-1], process.rational.den[::-1]
    A, B, C, _, _ = scipy.signal.cont2discrete(scipy.signal.tf2ss(num, den), h)
    n = len(A)
    size = n + scans + 3  # process, outputs under way, integral, filtered derivative, last error
    unit, M = np.eye(size), np.zeros((size, size))
    integral, derivative, last = unit[size - 3], unit[size - 2], unit[size - 1]
    e = np.zeros(size)
    e[:n] = -process.feedback_sign * C[0]
    new_I = integral + a.ki * h * e
    new_D = (a.Tf * derivative + a.kd * (e - last)) / (a.Tf + h)
    u = a.kp * e + new_I + new_D
    M[:n, :n] = A
    M[:n] += B @ (u if scans == 0 else unit[n + scans - 1])[None, :]
    for k in range(scans):
        M[n + k] = u if k == 0 else unit[n + k - 1]
    M[size - 3], M[size - 2], M[size - 1] = new_I, new_D, e
    used = np.ones(size, dtype=bool)
    used[size - 3] = a.ki != 0
    return np.linalg.eigvals(M[np.ix_(used, used)])


@given(controller=laws(), process=unstable_ones(), scan=st.floats(0.05, 1), scans=st.integers(0, 5))
def test_the_sampled_loop_is_stable_where_its_eigenvalues_are_inside_the_unit_circle(
    controller: Law, process: Process, scan: float, scans: int
) -> None:
    assume(len(process.poles) > len(process.zeros))
    c = Law(controller.algorithm, scan)
    poles = closed_loop_poles(process, scans, c)
    assume(np.min(np.abs(np.abs(poles) - 1)) > 1e-6)  # on the edge the two may round differently
    found = loop_figures(c, Process(process.gain, process.poles, process.zeros, scans * scan))
    assert found.stable == (np.max(np.abs(poles)) < 1)


@given(controller=laws(), process=processes(), delay=st.just(0.0) | st.floats(0.1, 5))
def test_the_largest_sensitivities_are_those_of_a_dense_grid(controller: Law, process: Process, delay: float) -> None:
    process = Process(process.gain, process.poles, process.zeros, delay)
    found = loop_figures(controller, process)
    assume(found.stable and found.Ms < 20)  # a grid does not find sharper peaks
    loop = OpenLoop(controller, process)
    w = picture_of(loop).w
    L = loop(np.geomspace(w[0], min(w[-1], 100.0), 20_000))
    S, T = np.max(1 / np.abs(1 + L)), np.max(np.abs(L / (1 + L)))
    assert found.Ms >= S * (1 - 1e-9)
    assert found.Mt >= T * (1 - 1e-9)
    assert max(1.0, S) == pytest.approx(found.Ms, rel=0.01)  # what a grid of this density can miss of a sharp peak
    assert pytest.approx(found.Mt, rel=0.01) == T


def test_an_unstable_process_needs_gain_and_bears_little_dead_time() -> None:
    process = Process(-1, [1])  # 1/(s - 1)
    found = loop_figures(law(2.0), process)
    assert found.stable
    assert found.gain_margin == pytest.approx(0.5)
    assert found.phase_margin == pytest.approx(60)
    assert found.delay_margin == pytest.approx(math.pi / 3 / math.sqrt(3))
    assert not loop_figures(law(0.99), process).stable
    for scan in (None, 0.05):
        stable = [loop_figures(law(1.2, scan=scan), Process(-1, [1], delay=theta)).stable for theta in (0.1, 1.1)]
        assert stable == [True, False]  # no proportional gain suffices from theta = 1/p on


def test_an_unfiltered_derivative_on_a_first_order_process_bears_no_dead_time() -> None:
    c = law(2, 0, 1)
    found = loop_figures(c, Process(1, [-1], delay=0))  # the loop gain goes to 1 from above
    assert (found.stable, found.delay_margin) == (True, 0.0)
    assert not loop_figures(c, Process(1, [-1], delay=0.01)).stable
    assert loop_figures(law(2, 0, 0.5), Process(1, [-1], delay=0.01)).stable


def test_a_controller_that_integrates_behind_a_washout_is_not_stable() -> None:
    washout = Process(1, [-1, -2], [0])
    assert not loop_figures(law(1, 0.5), washout).stable
    assert not loop_figures(law(1, 0.5, scan=0.1), washout).stable
    assert loop_figures(law(1), washout).stable


def test_a_negative_process_gain_turns_the_action_and_nothing_else() -> None:
    figures = [loop_figures(law(1.2, 0.3, 0.2, 0.02), Process.from_lags(g, [2, 1], delay=1), iae=1.0) for g in (1.5, -1.5)]
    assert figures[0] == figures[1]
    assert figures[0].stable
    a = replace(law(1.2, 0.3, 0.2, 0.02).algorithm, kp=-1.2, ki=-0.3, kd=-0.2)
    assert loop_figures(Law(a), Process.from_lags(1.5, [2, 1], delay=1), iae=1.0) == figures[0]


def test_undamped_processes_have_figures_too() -> None:
    oscillator = Process(1, [1j, -1j])
    assert loop_figures(law(0.0, 0.0, 1.0, 0.01), oscillator).stable  # the derivative damps it
    assert loop_figures(law(0.0, 0.0, 1.0, 0.01, scan=0.02), oscillator).stable
    assert not loop_figures(law(1.0), oscillator).stable
    assert not loop_figures(law(1.0, scan=0.02), oscillator).stable


def test_a_controller_that_does_nothing_leaves_the_process_alone() -> None:
    found = loop_figures(law(0.0), FOPDT, iae=3.0)
    assert (found.stable, found.gain_margin, found.Ms, found.Mt, found.iae) == (True, math.inf, 1.0, 0.0, 3.0)


def test_the_factor_multiplies_the_gain() -> None:
    assert loop_figures(law(1.0), FOPDT, -2.0, 1.0) == loop_figures(law(2.0), FOPDT, iae=1.0)
    assert loop_figures(law(1.0, 0.5), FOPDT, 2.0).gain_margin == pytest.approx(loop_figures(law(1.0, 0.5), FOPDT).gain_margin / 2)


def test_the_margins_of_a_fast_sampled_loop_are_those_of_the_continuous_one() -> None:
    process = Process.from_lags(1, [10, 2], delay=1)
    continuous, sampled = (loop_figures(law(3, 0.3, 3, 0.3, scan=h), process, iae=0.0) for h in (None, 1e-3))
    for name in ("gain_margin", "phase_margin", "delay_margin", "crossover", "Ms", "Mt"):
        assert getattr(sampled, name) == pytest.approx(getattr(continuous, name), rel=5e-3), name


def test_a_dead_time_of_many_scans_takes_no_longer() -> None:
    process = Process.from_lags(0.5, [100], delay=600)
    found = loop_figures(law(0.4, 0.4 / 300, scan=0.1), process)
    assert found.gain_margin == pytest.approx(loop_figures(law(0.4, 0.4 / 300), process).gain_margin, rel=1e-3)
    assert found.stable


def test_dahlins_loop_needs_a_scan_interval() -> None:
    s = pidemu.load_card("generic/dahlin").settings(Kp=2, tau=10, theta=3, **{"lambda": 5})
    process = Process.from_lags(2, [10], delay=3)
    assert loop_figures(s.law(1.0), process).stable
    assert scan_for(s, process) <= 1.0
    with pytest.raises(UndefinedError, match="give a scan interval"):
        loop_figures(s.law(), process)


def test_the_crossover_of_any_response() -> None:
    process = Process(0.5, [0], delay=1)
    assert crossover(lambda w: np.full(w.shape, 2.0 + 0j), process) == pytest.approx(1.0, rel=1e-12)
    assert crossover(lambda w: np.full(w.shape, 1e-3 + 0j), Process(1, [-1])) is None
    assert crossover(lambda w: np.full(w.shape, 2.0 + 0j), process, scan=5.0) is None  # beyond the Nyquist frequency
    c = law(1.2, 0.3, 0.2, 0.02)
    assert crossover(c.response, FOPDT) == pytest.approx(loop_figures(c, FOPDT).crossover, rel=1e-9)


def test_the_time_in_which_a_loop_moves() -> None:
    assert time_scale(law(0.5), Process(1, [0])) == pytest.approx(2.0)
    assert time_scale(law(0.5), FOPDT) == 2.0  # no crossover: lag and dead time
    assert time_scale(law(0.5), Process(1)) == 1.0
    s = pidemu.load_card("generic/parallel").settings(kp=0.5, ki=0)
    assert scan_for(s, Process(1, [0])) == 0.1
    assert scan_for(s, Process(0.01, [0])) == 1.0  # the card's own
