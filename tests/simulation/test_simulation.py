"""Closed loops of emulated controllers against scipy, exact solutions and the integral of the error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy.signal
from hypothesis import assume, given
from hypothesis import strategies as st

import pidemu
from pidemu.analysis.figures import crossover, loop_figures, scan_for
from pidemu.analysis.load_response import continuous_load_iae, load_iae
from pidemu.arrays import Floats
from pidemu.backends.choice import Choice
from pidemu.backends.engine_names import Engine
from pidemu.certificate.figures import loop_rows
from pidemu.errors import ProcessError, UndefinedError
from pidemu.process.hold import Plant
from pidemu.process.process import Process, parse_process
from pidemu.settings.settings import Settings
from pidemu.simulation.simulate import Simulation, compare_loops, run_trial, simulate
from pidemu.simulation.trial import trial
from tests.fleet.support import EVERY_ENGINE

WIDE = (-1e9, 1e9)
ANY = Choice("python", "any")
FOPDT = Process.from_lags(1, [10], delay=2)


def parallel(**dials: float) -> Settings:
    return pidemu.load_card("generic/parallel").settings({"kp": 0.0, "ki": 0.0, "kd": 0.0, **dials})


def count_moves(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What is simulated from now on, scan by scan."""
    moved: list[float] = []
    move = Plant.move

    def counted(plant: Plant, u: float) -> None:
        moved.append(u)
        move(plant, u)

    monkeypatch.setattr(Plant, "move", counted)
    return moved


def in_turns(s: Settings, process: Process, h: float, scans: int, sp: Floats, load: Floats) -> tuple[Floats, Floats]:
    """The loop of a discrete law, as a difference equation, and of scipy's sampled process; in deviations from rest."""
    law = s.law(h)
    A, B, C, _, _ = scipy.signal.cont2discrete(scipy.signal.tf2ss(process.rational.num[::-1], process.rational.den[::-1]), h)
    impulses = law.impulse(sp.size, "setpoint"), law.impulse(sp.size)
    x, y, u = np.zeros((len(A), 1)), np.zeros(sp.size), np.zeros(sp.size)
    for n in range(sp.size):
        y[n] = (C @ x).item()
        u[n] = impulses[0][: n + 1][::-1] @ sp[: n + 1] - impulses[1][: n + 1][::-1] @ y[: n + 1]
        x = A @ x + B * (u[n - scans] + load[n - scans] if n >= scans else 0.0)
    return y, u


@given(
    kp=st.floats(0.1, 3),
    ki=st.floats(0.01, 0.5),
    kd=st.just(0.0) | st.floats(0.1, 3),
    lags=st.lists(st.floats(1, 20), min_size=1, max_size=3),
    h=st.floats(0.2, 2),
    scans=st.integers(0, 3),
)
def test_a_linear_loop_is_that_of_the_discrete_law_and_scipys_process(
    kp: float, ki: float, kd: float, lags: list[float], h: float, scans: int
) -> None:
    s = parallel(kp=kp, ki=ki, kd=kd, Tf=kd / kp / 5)
    process = Process.from_lags(1.2, lags, delay=scans * h)
    found = simulate(s, process, h, setpoint=(5 * h, 4.0), load=(20 * h, -3.0), time=60 * h, output_limits=WIDE)
    n = np.arange(found.times.size)
    y, u = in_turns(s, process, h, scans, np.where(n >= 5, 4.0, 0.0), np.where(n >= 20, -3.0, 0.0))
    assume(np.max(np.abs(u)) < 1e6)  # far below the limits; an unstable loop grows beyond
    scale = 1e-10 * max(1.0, np.max(np.abs(u)), np.max(np.abs(y)))  # an unstable loop grows, and rounding with it
    np.testing.assert_allclose(found.measurement - 50, y, rtol=0, atol=scale * 100)
    np.testing.assert_allclose(found.output - 50, u, rtol=0, atol=scale * 100)


def test_a_pi_controller_that_cancels_a_lag_makes_a_first_order_loop() -> None:
    K, T, h = 2.0, 10.0, 2e-3
    found = simulate(parallel(kp=K, ki=K / T), Process.from_lags(1, [T]), h, setpoint=(0, 10), load=0, time=20)
    exact = 50 + 10 * -np.expm1(-K * found.times / T)
    assert np.max(np.abs(found.measurement - exact)) < 10 * K * h / T  # sampling delays by a scan


@pytest.mark.parametrize(
    ("card", "dials"),
    [
        ("generic/standard", {"K": 2, "Ti": 10, "Td": 1, "Tf": 0.1}),
        ("generic/series", {"K": 2, "Ti": 10, "Td": 1}),
        ("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.02}),
        ("emerson/deltav", {"GAIN": 2, "RESET": 10, "RATE": 1}),
        ("honeywell/tdc3000", {"K": 2, "T1": 0.2, "T2": 0.01}),
        ("arduino/pid", {"Kp": 2, "Ki": 0.2, "Kd": 1}),
        ("simple-pid/simple-pid", {"Kp": 2, "Ki": 0.2, "Kd": 1}),
        ("king/velocity", {"Kc": 2, "Ti": "10 s", "Td": "1 s"}),
        ("advanced-pid/advanced-pid", {"Kp": 2, "Ki": 0.2, "Kd": 1, "Tf": 0.5}),
    ],
)
def test_the_error_after_a_load_step_integrates_to_the_load_over_ki(card: str, dials: dict[str, object]) -> None:
    s = pidemu.load_card(card).settings(dials)
    found = simulate(s, FOPDT, 0.5, setpoint=0, load=(1, 4.0), time=500)
    assert float(np.sum(found.error)) * 0.5 == pytest.approx(-4.0 / s.algorithm().ki, rel=1e-6)
    assert found.measurement[-1] == pytest.approx(50, abs=1e-6)
    assert found.output[-1] == pytest.approx(46, abs=1e-6)


def test_the_iae_of_a_load_step_is_that_of_the_simulated_loop() -> None:
    for s in (parallel(kp=4, ki=1.0, kd=3, Tf=0.3), pidemu.load_card("emerson/deltav").settings(GAIN=3, RESET=5, RATE=1)):
        found = simulate(s, FOPDT, 0.25, setpoint=0, load=(0, 1.0), time=600)
        assert load_iae(s, FOPDT, 0.25) == pytest.approx(found.iae, rel=1e-6)
        assert found.iae > 1.01 / s.algorithm().ki  # the error changes its sign


def test_the_iae_of_a_slow_integral_is_known_before_it_has_settled() -> None:
    s = parallel(kp=0.2, ki=0.2 / 3600)
    assert load_iae(s, FOPDT, 1.0) == pytest.approx(18_000, rel=1e-6)  # IE = 1/ki; the time constant is 6 h
    assert load_iae(s, FOPDT, 1.0, factor=2) == pytest.approx(9_000, rel=1e-6)


@given(kp=st.floats(0.05, 5), ki=st.floats(0.02, 5))
def test_the_continuous_iae_of_a_second_order_loop_is_the_formula(kp: float, ki: float) -> None:
    found = continuous_load_iae(parallel(kp=kp, ki=ki), Process(-1, [0]))
    if kp * kp >= 4 * ki:
        expected = 1 / ki
    else:  # the area under all half waves of exp(-kp t/2) sin(w t)/w
        w = math.sqrt(ki - kp * kp / 4)
        expected = 1 / math.tanh(math.pi * kp / 2 / (2 * w)) / ki
    assert found == pytest.approx(expected, rel=3e-3)  # extrapolated from two short scan intervals


def test_the_iae_is_infinite_where_the_error_does_not_go_to_zero() -> None:
    assert load_iae(parallel(kp=2), FOPDT, 0.5) == math.inf
    assert load_iae(parallel(kp=20, ki=5), FOPDT, 0.5) == math.inf
    assert continuous_load_iae(parallel(kp=20, ki=5), FOPDT) == math.inf
    washout = Process(1, [-1, -2], [0])
    assert math.isfinite(load_iae(parallel(kp=2), washout, 0.1))


def test_settings_that_depend_on_size_do_not_count_for_the_iae() -> None:
    plain = pidemu.load_card("ros/control-toolbox").settings(p=2, i=0.2, d=0)
    deadband = pidemu.load_card("ros/control-toolbox").settings(p=2, i=0.2, d=0, error_deadband=5.0)
    assert load_iae(deadband, FOPDT, 0.5) == load_iae(plain, FOPDT, 0.5) == pytest.approx(5.0, rel=1e-6)


def test_an_unstable_loop_swings_from_limit_to_limit() -> None:
    s = parallel(kp=20, ki=2)
    found = simulate(s, FOPDT, 0.5, time=200)
    late = found.output[-100:]
    assert not loop_figures(s.law(0.5), FOPDT).stable
    assert (late.min(), late.max()) == (0.0, 100.0)
    narrow = simulate(s, FOPDT, 0.5, time=200, output_limits=(30, 60)).output
    assert (narrow.min(), narrow.max()) == (30.0, 60.0)


def test_a_process_that_runs_away_ends_at_infinity_without_a_warning() -> None:
    found = simulate(parallel(kp=0.1, ki=0.01), Process(-1, [5]), 0.1, time=200)
    assert not np.isfinite(found.measurement[-1])
    assert np.isfinite(found.output).all()


@pytest.mark.parametrize("dials", [{"kp": 2.0}, {"kp": 2.0, "b": 0.0}, {"ki": 0.1}, {"kp": 2.0, "ki": 0.1, "kd": 1.0}])
def test_a_loop_without_steps_stays_at_rest(dials: dict[str, float]) -> None:
    found = simulate(parallel(**dials), FOPDT, 0.5, setpoint=0, load=0, time=50, initial=(30, 30, 40))
    np.testing.assert_allclose(found.measurement, 30.0, atol=1e-12)
    np.testing.assert_allclose(found.output, 40.0, atol=1e-12)


def test_a_card_in_engineering_units_runs_as_its_equal_in_percent() -> None:
    card = pidemu.load_card("mathworks/pid2")
    own = card.settings(Kp=0.5, Ki=0.04, pv_range=(0, 400), op_range=(-10, 10))
    percent = card.settings(Kp=10, Ki=0.8)  # times 400/20
    found, expected = (simulate(s, FOPDT, 0.5, output_limits=(0, 100), time=100) for s in (own, percent))
    assert expected.output.max() == 100.0
    np.testing.assert_allclose(found.output, expected.output, atol=1e-9)
    np.testing.assert_allclose(found.measurement, expected.measurement, atol=1e-9)


def test_the_action_is_that_of_negative_feedback() -> None:
    s = parallel(kp=2, ki=0.2)
    plain, turned = (simulate(s, Process.from_lags(g, [10], delay=2), 0.5, time=100, load=0) for g in (1, -1))
    assert (plain.action, turned.action) == ("reverse", "direct")
    np.testing.assert_allclose(turned.measurement, plain.measurement, atol=1e-10)
    np.testing.assert_allclose(turned.output - 50, 50 - plain.output, atol=1e-10)
    away = simulate(s, FOPDT, 0.5, time=100, action="direct")
    assert away.output[-1] in (0.0, 100.0)


def test_by_default_the_scan_is_the_cards_and_short_enough_and_both_responses_settle() -> None:
    s = parallel(kp=2, ki=0.2)
    found = simulate(s, FOPDT)
    assert found.scan == scan_for(s, FOPDT) == 0.25  # crossover at 0.2 rad/s
    for end in (found.times.size // 2 - 1, -1):
        assert abs(found.error[end]) < 0.05
    assert found.setpoint_step is not None
    assert found.load_step is not None
    assert found.setpoint_step[0] < found.load_step[0] == found.times[-1] / 2
    slow = simulate(s, Process.from_lags(1, [1000], delay=200), time=100)
    assert slow.scan == 1.0


def test_a_scan_interval_that_nobody_asked_for_costs_no_more_than_100_000_scans() -> None:
    s, quick = parallel(kp=2, ki=0.2), Process.from_lags(1, [1e-4], delay=1e-6)
    found = simulate(s, quick, time=3)
    assert (found.scan, found.times.size) == (3e-5, 100_001)
    assert scan_for(s, quick) == 2.8e-06
    assert found.note == (
        "a scan interval of 3e-05 s is taken, since with the 2.8e-06 s that suit this loop the run would have more than 100,000 "
        "scans; give the interval, or a shorter time"
    )
    assert simulate(s, quick, 1e-5, time=2).scan == 1e-5
    assert simulate(s, quick, 1e-5, time=2).note == ""
    assert simulate(s, quick, time=150_000, engine="python").scan == 1.0  # the card's own
    assert simulate(s, quick).note == ""


def test_the_iae_of_straight_lines_through_zero_is_exact() -> None:
    zero: Floats = np.zeros(3)
    times: Floats = np.array([0.0, 2.0, 4.0])
    found = Simulation(parallel(kp=1), FOPDT, 2.0, "reverse", WIDE, times, zero, np.array([1.0, -3.0, -3.0]), zero, None, None, ANY)
    assert found.iae == pytest.approx(0.5 * 0.5 * 1 + 0.5 * 1.5 * 3 + 2 * 3)


def test_an_exact_conversion_has_the_same_loop() -> None:
    source = pidemu.load_card("generic/series").settings(K=2, Ti=15, Td=2)
    target = pidemu.convert(source, "generic/standard").settings
    both = compare_loops(source, target, FOPDT)
    assert both.process == "1 exp(-2 s)/(10 s + 1)"
    for name in ("gain_margin", "phase_margin", "delay_margin", "crossover", "Ms", "Mt", "iae"):
        assert getattr(both.target, name) == pytest.approx(getattr(both.source, name), rel=1e-6), name
    assert both.source.stable
    assert both.target.stable
    assert both.source.iae == pytest.approx(7.5, rel=1e-4)


def test_a_longer_scan_costs_margin_and_a_factor_is_the_sources() -> None:
    s = parallel(kp=2, ki=0.2)
    both = compare_loops(s, s, FOPDT, (0.1, 1.0))
    assert both.target.gain_margin < both.source.gain_margin
    assert both.source.gain_margin == loop_figures(s.law(0.1), FOPDT).gain_margin
    half = compare_loops(parallel(kp=4, ki=0.4), s, FOPDT, (1.0, 1.0), factor=-0.5)
    assert half.source.gain_margin == pytest.approx(half.target.gain_margin, rel=1e-12)
    assert half.source.iae == pytest.approx(half.target.iae, rel=1e-6)


def test_a_recursion_in_scans_is_compared_at_its_scans_only() -> None:
    s = pidemu.load_card("generic/dahlin").settings({"Kp": 1, "tau": 10, "theta": 2, "lambda": 4})
    both = compare_loops(s, s, FOPDT, (1.0, 1.0))
    assert both.source.stable
    assert math.isfinite(both.source.iae)
    with pytest.raises(UndefinedError, match="give a scan interval"):
        compare_loops(s, s, FOPDT)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": 0}, "a simulation of 0 s.*give a time"),
        ({"time": math.inf}, "time is inf; give a finite number"),
        ({"time": 1e9}, "cannot be run; give a time of a few responses"),
        ({"time": 100, "load": (200, 5)}, "a load step of 5 % at 200 s is not within the 100 s simulated; start it earlier"),
        ({"setpoint": (-1, 5)}, "a setpoint step of 5 % at -1 s"),
        ({"setpoint": math.nan}, "the size of the setpoint step is nan; give a finite number"),
        ({"setpoint": "up"}, "setpoint is 'up'; give the size"),
        ({"load": (1, 2, 3)}, r"load is \(1, 2, 3\); give the size"),
        ({"output_limits": (0, 40)}, "the initial output 50 % is outside the output limits 0 to 40 %; give another"),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_a_remedy(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ProcessError, match=message):
        simulate(parallel(kp=2, ki=0.2), FOPDT, 0.5, **change)


def test_a_card_without_a_choice_of_action_must_have_the_right_sign() -> None:
    s = pidemu.load_card("mathworks/pid2").settings(Kp=2, Ki=0.2)
    with pytest.raises(
        ProcessError, match=r"mathworks/pid2 has no choice of control action.*-1/\(10 s \+ 1\).*give the gain the other sign"
    ):
        simulate(s, Process.from_lags(-1, [10]), 0.5)


def test_the_public_names_lead_here() -> None:
    assert pidemu.simulate is simulate
    assert pidemu.Process is Process
    assert pidemu.ProcessError is ProcessError


def test_an_iae_that_no_sampling_can_show_is_not_a_number() -> None:
    """The unfiltered derivative, 12 s, times 1/(s + 1) has gain 12 at high frequencies: sampled, it is unstable at any interval."""
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=6)
    process = Process.from_lags(1, [1])
    assert math.isnan(continuous_load_iae(settings, process))
    assert not loop_figures(settings.law(1e-4), process).stable


@pytest.mark.parametrize("process", [Process.from_lags(1, integrators=1), Process(1, [0])], ids=["integrators=1", "pole=0"])
@pytest.mark.parametrize("h", [1.0, 0.5, 2.0])
def test_the_iae_of_an_integrating_process_that_a_scan_brings_back_at_once(process: Process, h: float) -> None:
    """The gain is 1/h: the proportional action alone brings the measurement back within one scan; nothing is read in the first."""
    settings = parallel(kp=1 / h, ki=0.1 / h)
    assert load_iae(settings, process, h) == pytest.approx(10 * h, rel=1e-6)  # 1/ki


def test_a_loop_on_the_edge_of_stability_is_not_stable_and_costs_nothing() -> None:
    settings, process = pidemu.load_card("generic/standard").settings(K=1, Ti=10), Process(1, [1])
    for h in (None, 1.0, 2.0):  # 10 s^2 + 1: poles on the imaginary axis
        figures = loop_figures(settings.law(h), process)
        assert (False, math.inf, math.inf) == (figures.stable, figures.Ms, figures.Mt)
        assert abs(figures.phase_margin) < 1e-9
    assert load_iae(settings, process, 2.0) == math.inf


def test_an_integral_that_does_not_settle_in_time_is_not_computed_and_the_certificate_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    moved = count_moves(monkeypatch)
    settings, slow = parallel(kp=1, ki=0.1), Process.from_lags(0.3, [1] * 20)
    rows = loop_rows(compare_loops(settings, settings, slow, (0.2, 0.2)))
    assert ["IAE, load step of 1 % [% s]", *["not computed: it takes too many scans"] * 2] in rows
    assert len(moved) <= 2 * 100_000 // 20  # work goes with the square of 20 states


@pytest.mark.parametrize("h", [0.1, 0.01, 0.001])
def test_the_iae_at_a_very_short_scan_interval_costs_no_more_than_at_a_longer_one(
    h: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = count_moves(monkeypatch)
    settings = pidemu.load_card("generic/standard").settings(K=1, Ti=1000)
    assert load_iae(settings, Process.from_lags(1, [1000], delay=100), h) == pytest.approx(1000, rel=1e-6)
    assert len(moved) <= 100_000


DEGENERATE = [
    Process(1, [0]), Process(1, [0, 0]), Process(1, [-1, -1]), Process(1, [-1], [-1]), Process(1, [0], [0]), Process(1, [-1], [0]),
    Process(1), Process(-1, delay=1), Process(1, [1], [1]), Process(1, [1j, -1j], [1j, -1j]), Process(1, [-1], [1], 1),
    Process(1, [math.pi * 1j, -math.pi * 1j]), Process(1, [0, 0, 0, 0]), Process(1, [-math.log(2)]), Process(1, [1, 1]),
]  # fmt: skip
"""Poles at 0, 1 and -1 of the sampled loop, double ones, and ones that a zero cancels."""


@pytest.mark.parametrize("dials", [{}, {"kp": 1}, {"kp": 2}, {"ki": 1}, {"kd": 1}, {"kp": 1, "ki": 1, "kd": 1}], ids=str)
@pytest.mark.parametrize("process", DEGENERATE, ids=str)
def test_a_loop_whose_polynomials_lose_a_term_has_figures(process: Process, dials: dict[str, float]) -> None:
    settings = parallel(**dials)
    for h in (1.0, 2.0):
        found = compare_loops(settings, settings, process, (h, h))
        assert repr(found.source) == repr(found.target)
        assert found.source.iae > 0 or math.isnan(found.source.iae)
        assert found.source.stable or found.source.iae == math.inf or not any(dials.values())
    assert crossover(settings.law().response, process, 1.0) is None or dials


@pytest.mark.parametrize("engine", EVERY_ENGINE)
def test_a_dead_time_that_is_longer_than_the_run_is_run_by_every_engine(engine: Engine) -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=6)
    made = trial(settings, parse_process("gain=3,delay=4"), time=1)
    run, expected = run_trial(made, engine), run_trial(made, "python")
    assert np.array_equal(run.measurement, expected.measurement)
    assert np.array_equal(run.output, expected.output)
    assert set(run.measurement.tolist()) == {50.0}
