"""Noise: confidence intervals hold what they promise, closed loops are told from open ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import pidemu
from pidemu.errors import FitRefusedError
from pidemu.process.fit.feedback import CLOSED, feedback_share
from pidemu.process.fit.fit import fit_process
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from tests.process.curves import Floats, held, measured

PROCESS = Process.from_lags(1.5, [20], delay=4)


def coloured(rng: np.random.Generator, n: int, size: float, pole: float) -> Floats:
    """First-order noise."""
    found = np.zeros(n)
    for k, e in enumerate(rng.normal(size=n)):
        found[k] = (pole * found[k - 1] if k else 0.0) + size * e
    return found


@pytest.mark.parametrize(("model", "lags"), [("fopdt", [12]), ("sopdt", [12, 6]), ("ipdt", [])])
@pytest.mark.parametrize("pole", [0.0, 0.7], ids=["white", "coloured"])
def test_intervals_hold_the_true_numbers_as_often_as_they_say(model: str, lags: list[float], pole: float) -> None:
    rng = np.random.default_rng(7)
    t = np.arange(0, 120, 0.5)
    u = held(t, [(10, -6)], 70)
    process = Process.from_lags(-0.8 if lags else -0.02, lags, integrators=not lags, delay=9)
    clean = measured(process, t, u, 60)
    names = {"gain": process.gain, "delay": 9, "start": 60}
    names |= {"lag": 12} if len(lags) == 1 else {"lag 1": 12, "lag 2": 6} if lags else {}
    draws, hits = 120, dict.fromkeys(names, 0)
    for _ in range(draws):
        found = fit_process(t, u, clean + coloured(rng, t.size, 0.05, pole), model).fit  # type: ignore[arg-type]
        for name, true in names.items():
            low, high = found.intervals[name]
            hits[name] += low <= true <= high
    least = {
        name: 0.75 if name in ("lag 1", "lag 2") else 0.86 for name in names
    }  # two lags that might be equal: not a linear case
    assert {name: n / draws for name, n in hits.items() if n / draws < least[name]} == {}


def test_two_thirds_of_the_draws_are_within_a_standard_deviation_of_no_bias() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0, 120, 0.5)
    u = held(t, [(10, -6)], 70)
    clean = measured(Process.from_lags(-0.8, [12], delay=9), t, u, 60)
    found = [fit_process(t, u, clean + 0.1 * rng.normal(size=t.size)).process for _ in range(60)]
    numbers = np.array([[p.gain, -1 / p.poles[0].real, p.delay] for p in found])
    assert numbers.mean(axis=0) == pytest.approx([-0.8, 12, 9], abs=0.06)
    assert numbers.std(axis=0) == pytest.approx([0.00318, 0.1786, 0.0986], rel=0.4)  # of tests/data/process_fits.json


def closed_loop(
    noise: float = 0.1, setpoint: float = 0.0, load: float = 0.0, Td: float = 0.0, every: int = 1
) -> tuple[Floats, Floats, Floats, Floats]:
    """Time, output, measurement and setpoint of a PI loop."""
    rng = np.random.default_rng(5)
    plant, integral, u, before = Plant(PROCESS.sampled(1.0)), 0.0, 0.0, 50.0
    rows = []
    for k in range(400):
        y, sp = 50 + plant.measure() + noise * rng.normal(), 50 + setpoint * (k >= 60)
        if k % every == 0:
            integral += every / 20 * (sp - y)
            u, before = (sp - y) + integral - Td * (y - before) / every, y
        rows.append((float(k), 40 + u, y, sp))
        plant.move(u + load * (k >= 60))
    time, output, measurement, setpoints = np.array(rows).T
    return time, output, measurement, setpoints


CLOSED_LOOPS = {
    "at rest": closed_loop(),
    "setpoint step": closed_loop(setpoint=5),
    "load step": closed_loop(load=5),
    "load step without noise": closed_loop(noise=0, load=5),
    "derivative action": closed_loop(Td=4),
    "slow scans": closed_loop(every=10),
}


@pytest.mark.parametrize("name", CLOSED_LOOPS)
def test_a_closed_loop_is_recognised(name: str) -> None:
    _, output, measurement, setpoint = CLOSED_LOOPS[name]
    assert feedback_share(output, measurement) > CLOSED
    assert feedback_share(output, measurement, setpoint) > 0.99


def binary(rng: np.random.Generator) -> Floats:
    """A random binary signal of 400 samples."""
    return np.asarray(50 + 5.0 * np.repeat(rng.integers(0, 2, 80), 5), dtype=np.float64)


OPEN_LOOPS: dict[str, Callable[[np.random.Generator], Floats]] = {
    "one step": lambda _: held(np.arange(400.0), [(50, 5)]),
    "staircase": lambda _: held(np.arange(400.0), [(10.0 * i, 1) for i in range(1, 38)]),
    "ramp": lambda _: 50 + np.clip(np.arange(400) - 50, 0, 200) / 10,
    "sine": lambda _: 50 + 5 * np.sin(np.arange(400) / 10),
    "binary": binary,
    "white": lambda rng: 50 + rng.normal(size=400),
    "walk": lambda rng: 50 + np.cumsum(rng.normal(size=400)),
}


@pytest.mark.parametrize("name", OPEN_LOOPS)
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_an_open_loop_is_not_taken_for_a_closed_one(name: str, noise: float) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        output = OPEN_LOOPS[name](rng)
        plant, found = Plant(PROCESS.sampled(1.0)), []
        for u in (output - output[0]).tolist():
            found.append(plant.measure() + noise * rng.normal())
            plant.move(u)
        assert feedback_share(output, np.array(found)) < CLOSED


@pytest.mark.parametrize("name", [name for name in CLOSED_LOOPS if name != "setpoint step"])
def test_a_closed_loop_without_a_setpoint_step_is_refused(name: str) -> None:
    time, output, measurement, setpoint = CLOSED_LOOPS[name]
    for known in (None, setpoint):
        with pytest.raises(
            FitRefusedError, match=r"^the loop was closed: the measurement explains \d+ % of the output's moves, .*"
        ):
            fit_process(time, output, measurement, setpoint=known)


def test_a_closed_loop_with_a_setpoint_step_is_fitted_and_told() -> None:
    time, output, measurement, setpoint = CLOSED_LOOPS["setpoint step"]
    found = fit_process(time, output, measurement, setpoint=setpoint)
    assert found.fit.closed_loop
    assert found.process.gain == pytest.approx(1.5, rel=0.05)
    assert -1 / found.process.poles[0].real == pytest.approx(20, rel=0.1)
    assert found.process.delay == pytest.approx(4, abs=0.6)
    assert found.fit.notes[-1].startswith("the loop was closed; the setpoint moved it enough for a fit")
    with pytest.raises(FitRefusedError, match=r"^the loop was closed"):
        fit_process(time, output, measurement)


def test_a_setpoint_step_that_hardly_stands_out_is_not_enough() -> None:
    time, output, measurement, setpoint = closed_loop(setpoint=0.5)
    with pytest.raises(FitRefusedError, match=r"\(the setpoint moves by 0\.5, the fit leaves"):
        fit_process(time, output, measurement, setpoint=setpoint)


def test_many_moves_of_an_open_loop_are_fitted() -> None:
    rng = np.random.default_rng(2)
    output = binary(rng)
    time = np.arange(400.0)
    found = fit_process(time, output, measured(PROCESS, time, output) + 0.1 * rng.normal(size=400))
    assert isinstance(found, pidemu.ProcessFit)
    assert (found.process.gain, found.process.delay) == pytest.approx((1.5, 4), rel=0.05)
