"""Fits of bump tests: published curves, exact recovery without noise, odd sampling, several steps, drift, sign."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import pidemu
from pidemu.process.fit.fit import Model, fit_process
from pidemu.process.fit.responses import HeldOutput
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from tests.process.curves import Floats, curve, held, measured, reference

CURVES = reference()["curves"]


def lags_of(process: Process) -> list[float]:
    return sorted((-1 / p.real for p in process.poles if p), reverse=True)


def test_least_squares_of_a_curve_without_noise_finds_the_process_again() -> None:
    found = fit_process(*curve("01-fopdt"))
    gain, lag, delay, start = CURVES["01-fopdt"]["lsq fopdt of this file (K, T, L, y0)"]
    numbers = (found.process.gain, *lags_of(found.process), found.process.delay, found.fit.start)
    assert numbers == pytest.approx((gain, lag, delay, start), rel=1e-7)  # the file has nine digits
    assert found.fit.rms < 1e-6
    assert found.fit.notes == ()


def test_least_squares_of_a_noisy_curve_finds_the_least_of_all_minima() -> None:
    found = fit_process(*curve("05-fopdt-noisy"))
    wanted = CURVES["05-fopdt-noisy"]
    numbers = (found.process.gain, *lags_of(found.process), found.process.delay, found.fit.start)
    assert numbers == pytest.approx(wanted["lsq fopdt of this file (K, T, L, y0)"], rel=1e-6)
    assert found.fit.rms == pytest.approx(wanted["lsq fopdt rms"], rel=1e-9)
    spread = wanted["spread over 60 draws: std of the true model's parameters"]
    for name, sigma in zip(("gain", "lag", "delay", "start"), spread, strict=True):
        low, high = found.fit.intervals[name]
        assert 0.7 < (high - low) / (2 * 1.97 * sigma) < 1.4


def test_an_integrator_is_found_again() -> None:
    found = fit_process(*curve("09-integ"), model="ipdt")
    gain, delay, start = CURVES["09-integ"]["lsq integrating of this file (K, L, y0)"]
    assert found.process.integrators == 1
    assert (found.process.gain, found.process.delay, found.fit.start) == pytest.approx((gain, delay, start), rel=1e-9)


@pytest.mark.parametrize(("method", "fit"), [("tangent", "fit1"), ("two-point", "fit2")])
@pytest.mark.parametrize(("name", "tolerance"), [("01-fopdt", 0.01), ("05-fopdt-noisy", 0.05)])
def test_millers_fits_are_read_off_the_curve(name: str, tolerance: float, method: str, fit: str) -> None:
    found = fit_process(*curve(name), method=method)  # type: ignore[arg-type]
    wanted = CURVES[name][fit]
    numbers = (found.process.gain, *lags_of(found.process), found.process.delay)
    assert numbers == pytest.approx((wanted["K"], wanted["tau"], wanted["theta"]), rel=tolerance)
    assert found.fit.intervals == {}


def test_the_slopes_of_an_integrator_are_read_off_the_curve() -> None:
    found = fit_process(*curve("09-integ"), model="ipdt", method="tangent")
    assert (found.process.gain, found.process.delay) == pytest.approx((0.02, 6.0), rel=1e-9)


def test_fit_2_is_the_better_one_for_second_order_with_dead_time() -> None:
    t = np.arange(0, 200, 0.25)
    u = held(t, [(10, 5)])
    y = measured(Process.from_lags(1, [10, 10], delay=5), t, u)
    first, second = (fit_process(t, u, y, method=m).fit.rms for m in ("tangent", "two-point"))
    assert second < 0.5 * first


@st.composite
def bump_tests(draw: st.DrawFn) -> tuple[Model, Process, Floats, Floats]:
    """Random processes, with the times and outputs of a test that excites them."""
    model: Model = draw(st.sampled_from(["fopdt", "sopdt", "ipdt"]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    duration = 10 ** rng.uniform(1, 4)
    count = int(rng.integers(80, 400))
    t = np.unique(rng.uniform(0, duration, count)) if draw(st.booleans()) else np.linspace(0, duration, count)
    steps = int(rng.integers(1, 4))
    sizes = rng.uniform(2, 8, steps) * rng.choice([-1, 1], steps)
    u = held(t, list(zip((np.sort(rng.uniform(0.05, 0.5, steps)) * duration).tolist(), sizes.tolist(), strict=True)))
    assume(np.ptp(u) > 0)
    lag, delay = duration * 10 ** rng.uniform(-1.7, -0.8), draw(st.sampled_from([0.0, 0.02, 0.1])) * duration
    gain = rng.uniform(0.2, 5) * rng.choice([-1, 1])
    if model == "ipdt":
        return model, Process.from_lags(gain / duration, integrators=1, delay=delay), t, u
    lags = [lag] if model == "fopdt" else [lag, lag * rng.uniform(0.1, 0.9)]
    return model, Process.from_lags(gain, lags, delay=delay), t, u


@given(bump_tests())
def test_any_process_is_found_again_from_any_test_without_noise(case: tuple[Model, Process, Floats, Floats]) -> None:
    model, process, t, u = case
    found = fit_process(t, u, measured(process, t, u), model).process
    assert found.gain == pytest.approx(process.gain, rel=1e-6)
    assert lags_of(found) == pytest.approx(lags_of(process), rel=1e-5)
    assert found.delay == pytest.approx(process.delay, abs=1e-6 * float(t[-1]))


def test_equal_lags_are_found_again() -> None:
    t = np.arange(0, 200.0)
    u = held(t, [(10, 5)])
    found = fit_process(t, u, measured(Process.from_lags(2, [15, 15], delay=4), t, u), "sopdt").process
    assert lags_of(found) == pytest.approx([15, 15], rel=1e-3)
    assert (found.gain, found.delay) == pytest.approx((2, 4), rel=1e-5)


def test_a_second_order_fit_of_a_first_order_process_says_that_one_lag_is_enough() -> None:
    found = fit_process(*curve("01-fopdt"), model="sopdt")
    assert found.fit.notes[-1] == "the second lag is shorter than the time between two samples: fopdt says as much"


def test_a_drift_before_the_bump_is_fitted_and_told() -> None:
    t = np.arange(0, 300.0)
    u = held(t, [(60, 5)])
    process = Process.from_lags(1.5, [25], delay=8)
    drifting = measured(process, t, u) + 0.01 * t
    found = fit_process(t, u, drifting)
    assert found.fit.drift == pytest.approx(0.01, rel=1e-6)
    assert (found.process.gain, found.process.delay) == pytest.approx((1.5, 8), rel=1e-6)
    assert found.fit.notes == ("the measurement drifts before the output moves: a drift of 0.6 per minute was fitted as well",)
    assert fit_process(t, u, drifting, drift=False).fit.drift == 0.0
    assert fit_process(t, u, measured(process, t, u)).fit.drift == 0.0


def test_samples_without_a_measurement_are_left_out_and_an_output_without_value_holds() -> None:
    t, u, y = curve("01-fopdt")
    with_gaps, with_holes = y.copy(), u.copy()
    with_gaps[[5, 100, 101, 102]] = np.nan
    with_holes[[7, 300]] = np.nan
    found = fit_process(t, with_holes, with_gaps)
    assert found.process.gain == pytest.approx(2, rel=1e-6)
    assert found.fit.samples == t.size - 4
    assert found.fit.notes == (
        "the output is missing at 2 samples, number 8, 301: taken as held",
        "left out: 4 samples without a measurement, number 6, 101, 102 and others",
    )


def test_a_record_that_ends_too_early_is_told() -> None:
    t, u, y = curve("01-fopdt")
    found = fit_process(t[:120], u[:120], y[:120])
    assert found.fit.notes[0].startswith("the record ends 39.5 s after the output first moved, before the measurement has settled")
    low, high = fit_process(t[:70], u[:70], y[:70] + 0.02 * np.sin(50 * t[:70])).fit.intervals["gain"]
    assert high - low > 0.3


def test_more_dynamics_than_the_model_has_are_told() -> None:
    t = np.arange(0, 200, 0.5)
    u = held(t, [(10, 5)])
    found = fit_process(t, u, measured(Process.from_lags(1, [15, 12, 8], delay=2), t, u))
    assert found.fit.notes[-1].endswith("something else disturbed it; try the model sopdt")


def test_the_gain_has_the_unit_that_is_given() -> None:
    found = fit_process(*curve("01-fopdt"), unit="degC/%")
    assert found.process.unit == "degC/%"
    assert found.process.in_percent((0, 400, "degC")).gain == pytest.approx(0.5, rel=1e-6)


def test_the_names_are_there_for_users() -> None:
    found = pidemu.fit_process(*curve("01-fopdt"))
    assert isinstance(found, pidemu.ProcessFit)
    assert found.fit.residuals == pytest.approx(found.fit.measurement - found.fit.simulated)


@pytest.mark.parametrize("lags", [[5.0], [5.0, 2.0], [5.0, 5.0], [5.0, 5.0000001], []], ids=str)
def test_the_responses_are_those_of_the_sampled_process(lags: list[float]) -> None:
    h, delay = 0.7, 1.3
    u = np.random.default_rng(1).normal(size=60).round(1)
    u[0] = 0.0
    plant = Plant(Process.from_lags(1, lags, integrators=not lags, delay=delay).sampled(h))
    wanted = []
    for x in u.tolist():
        wanted.append(plant.measure())
        plant.move(x)
    t: Floats = np.arange(u.size, dtype=np.float64) * h
    assert HeldOutput.from_samples(t, u).response(t - delay, lags) == pytest.approx(np.array(wanted), abs=1e-12)
