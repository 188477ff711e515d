"""What is around controller and process: noise, a valve, a load with its own way, ramps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.errors import ProcessError
from pidemu.process.process import Process
from pidemu.simulation.noise import Noise
from pidemu.simulation.simulate import run_scan_by_scan, run_trial
from pidemu.simulation.trial import trial
from pidemu.simulation.valve import MovingValve, Valve, read_valve

TANK = Process.from_lags(1.5, [20, 4], delay=3.3)
PIDF = pidemu.load_card("generic/standard").settings(K=2, Ti=25, Td=3, Tf=0.5)
AROUND: dict[str, dict[str, Any]] = {
    "noise": {"noise": Noise(0.4, lag=2.0, seed=5)},
    "valve": {"valve": Valve(deadband=0.8, stiction=0.3, resolution=0.25, rate=2.0)},
    "load of its own": {"load_process": Process.from_lags(-0.7, [8], delay=5.5)},
    "load at the measurement": {"load_process": Process(1.0)},
    "ramps": {"durations": (30.0, 12.5)},
}
AROUND["all"] = {name: x for one in list(AROUND.values()) for name, x in one.items()}


def goes(valve: Valve, outputs: list[float], scan: float = 1.0, rest: float = 50.0) -> list[float]:
    moving = MovingValve(valve, rest, scan)
    return [moving.move(u) for u in outputs]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("around", AROUND.values(), ids=AROUND)
def test_every_engine_and_the_controller_scan_by_scan_give_the_same_bits(around: dict[str, Any], engine: Engine) -> None:
    made = trial(PIDF, TANK, 1.0, time=400, **around)
    run = run_trial(made, engine)
    out, pv, *valve = run_scan_by_scan(made)
    assert np.array_equal(run.output, out)
    assert np.array_equal(run.measurement, pv)
    assert (run.valve is None) == (not valve)
    assert run.valve is None or np.array_equal(run.valve, valve[0])


def test_a_dead_band_is_taken_up_before_the_valve_follows() -> None:
    """By hand: half the dead band lies on each side."""
    assert goes(Valve(deadband=2), [50.5, 51, 53, 52.5, 51, 50, 49]) == [50, 50, 52, 52, 52, 51, 50]


def test_a_sticking_valve_stays_and_then_goes_to_the_output() -> None:
    assert goes(Valve(stiction=1), [50.5, 51, 51.01, 52, 50.02, 50]) == [50, 50, 51.01, 51.01, 51.01, 50]


def test_a_valve_of_a_resolution_stands_at_multiples_from_rest() -> None:
    assert goes(Valve(resolution=0.5), [50.2, 50.25, 50.7, 50.8, 49.7], rest=50.0) == [50, 50.5, 50.5, 51, 49.5]


def test_a_slow_valve_travels_at_its_rate() -> None:
    assert goes(Valve(rate=2), [60, 60, 60, 50.5, 50.5], scan=0.5) == [51, 52, 53, 52, 51]


@given(st.lists(st.floats(-1e6, 1e6), max_size=30), st.floats(1e-6, 1e3))
def test_a_valve_with_backlash_is_never_farther_from_the_output_than_half_of_it(outputs: list[float], deadband: float) -> None:
    stands = goes(Valve(deadband=deadband), outputs)
    assert all(abs(v - u) <= deadband / 2 + 1e-9 * (1 + abs(u)) for u, v in zip(outputs, stands, strict=True))


def test_a_sticking_valve_makes_a_pi_loop_cycle_and_a_free_one_does_not() -> None:
    """Integral action and stiction end in a limit cycle, whatever the tuning; the valve's steps are above the stiction."""
    s = pidemu.load_card("generic/standard").settings(K=1, Ti=20, Td=0)
    process = Process.from_lags(1.0, [10, 2], delay=1)
    free, stuck = (pidemu.simulate(s, process, 0.5, setpoint=3, load=0, time=3000, valve=v) for v in (None, Valve(stiction=2)))
    late = slice(-2000, None)
    assert np.ptp(free.measurement[late]) < 1e-9
    assert np.ptp(stuck.measurement[late]) > 1
    assert stuck.valve is not None
    moves = np.abs(np.diff(stuck.valve[late]))
    assert np.all((moves == 0) | (moves >= 2 - 1e-9))


def test_noise_has_the_deviation_and_the_lag_that_it_is_given() -> None:
    """200,000 scans: the deviation is known within 0.6 % with a lag of ten scans, the correlation within 0.01."""
    for lag in (0.0, 10.0):
        x = Noise(0.5, lag, seed=2).at(200_000, 1.0)
        assert x.std() == pytest.approx(0.5, rel=0.02)
        expected = math.exp(-1 / lag) if lag else 0.0
        assert float(np.corrcoef(x[1:], x[:-1])[0, 1]) == pytest.approx(expected, abs=0.01)
    assert np.array_equal(Noise(1.0, seed=4).at(50, 1.0), Noise(1.0, seed=4).at(50, 2.0))
    assert not np.array_equal(Noise(1.0, seed=4).at(50, 1.0), Noise(1.0, seed=5).at(50, 1.0))


def test_noise_moves_the_output_as_the_law_says() -> None:
    """P and unfiltered D, a process too slow to answer: the deviation is ``K sqrt((1 + Td/h)^2 + (Td/h)^2)``."""
    s = pidemu.load_card("generic/standard").settings(K=0.5, Ti=1e9, Td=3)
    run = pidemu.simulate(s, Process.from_lags(1e-9, [1e6]), 1.0, setpoint=0, load=0, time=50_000, noise=0.2)
    assert run.output[1:].std() == pytest.approx(0.5 * 0.2 * math.hypot(4, 3), rel=0.01)


def test_a_load_that_goes_the_process_s_way_is_one_that_adds_to_the_output() -> None:
    """Superposition: the same to rounding, which a few hundred scans of a stable loop leave at 1e-9."""
    usual = pidemu.simulate(PIDF, TANK, 1.0, time=400)
    own = pidemu.simulate(PIDF, TANK, 1.0, time=400, load_process=TANK)
    assert own.measurement == pytest.approx(usual.measurement, abs=1e-9)


def test_a_load_at_the_measurement_is_a_setpoint_step_the_other_way_a_scan_later() -> None:
    """P, I and D see the error alone (b = c = 1), so that both are one step of the error."""
    s = PIDF.changed({"c": 1})
    setpoint = pidemu.simulate(s, TANK, 1.0, setpoint=(10, -5), load=0, time=400)
    load = pidemu.simulate(s, TANK, 1.0, setpoint=0, load=(9, 5), time=400, load_process=Process(1.0))
    assert load.error == pytest.approx(setpoint.error, abs=1e-9)


def test_a_ramp_goes_along_a_straight_line_from_its_start_on() -> None:
    run = pidemu.simulate(PIDF, TANK, 1.0, setpoint=(10, 8), load=0, time=40, durations=(4.0, 0.0))
    assert (run.setpoint[9:16] - 50).tolist() == [0, 0, 2, 4, 6, 8, 8]


def test_the_same_seed_gives_the_same_loop_and_no_noise_none() -> None:
    first, again = (pidemu.simulate(PIDF, TANK, 1.0, time=200, noise=Noise(0.3, seed=7)) for _ in range(2))
    assert np.array_equal(first.measurement, again.measurement)
    usual = pidemu.simulate(PIDF, TANK, 1.0, time=200)
    assert np.array_equal(pidemu.simulate(PIDF, TANK, 1.0, time=200, noise=0, valve=Valve()).output, usual.output)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Noise(-1), "noise: deviation is -1 %; give 0 or more"),
        (lambda: Noise(1, lag=-2), "noise: lag is -2 s; give 0 or more"),
        (lambda: Noise(math.nan), "noise: deviation is nan; give a finite number"),
        (lambda: Noise(1, seed=-1), "noise: the seed -1 is not a whole number from 0 on"),
        (lambda: Noise(1, seed=1.5), "noise: the seed 1.5 is not a whole number from 0 on"),  # type: ignore[arg-type]
        (lambda: Valve(deadband=-1), "valve: deadband is -1 %; give 0 or more"),
        (lambda: Valve(rate=0), "valve: with a rate of 0 %/s it never gets anywhere; give one above 0, or leave it out"),
        (lambda: Valve(rate=math.nan), "valve: rate is nan; give a finite number"),
        (lambda: read_valve("deadband"), "valve: 'deadband' is not one of deadband=..., stiction=..., resolution=..., rate=..."),
        (lambda: read_valve("dead=1"), "valve: 'dead=1' is not one of deadband=..., stiction=..., resolution=..., rate=..."),
        (lambda: read_valve("rate=1,rate=2"), "valve: rate comes twice; give it once"),
        (lambda: read_valve("rate=fast"), "valve: rate: 'fast' is not a number"),
        (
            lambda: pidemu.simulate(PIDF, TANK, 1.0, durations=(0, -3)),
            "the duration of the load ramp is -3 s; give 0 or more",
        ),
        (
            lambda: pidemu.simulate(PIDF, TANK, 1.0, load_process=Process(2, unit="degC/%")),
            "the gain of 2 [degC/%] is in degC/%, and a loop is computed in %/%; give process.in_percent(pv_range)",
        ),
    ],
)
def test_what_no_loop_has_is_refused(make: object, message: str) -> None:
    with pytest.raises(ProcessError) as found:
        make()  # type: ignore[operator]
    assert str(found.value) == message
