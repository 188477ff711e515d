"""Two controllers in cascade."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete

import pidemu
from pidemu.errors import ProcessError
from pidemu.process.process import Process
from pidemu.simulation.cascade import simulate_cascade
from pidemu.simulation.noise import Noise
from pidemu.simulation.valve import Valve

standard = pidemu.load_card("generic/standard").settings
OUTER, INNER = standard(K=3, Ti=100, Td=0), standard(K=4, Ti=10, Td=0)
REACTOR, JACKET = Process.from_lags(0.8, [120, 20]), Process.from_lags(1.2, [10])


def by_hand(scans: int, h: float, every: int, setpoint: float, load: float, outer_load: float) -> tuple[np.ndarray, np.ndarray]:
    """The same cascade from SciPy's sampled state space and two PI equations, in deviations: a second reading of the equations."""
    A = np.array([[-1 / 10, 0, 0], [1 / 120, -1 / 120, 0], [0, 1 / 20, -1 / 20]])
    B = np.array([[1.2 / 10, 0], [0, 0.8 / 120], [0, 0]])
    A[1, 0] *= 0.8
    G, H, *_ = cont2discrete((A, B, np.eye(3), np.zeros((3, 2))), h)
    x, sums, u = np.zeros(3), np.zeros(2), np.zeros(2)
    outer, inner = [], []
    for i in range(scans):
        if i % every == 0:
            e = setpoint - x[2]
            sums[0] += 3 * every * h / 100 * e
            u[0] = 3 * e + sums[0]
        e = u[0] - x[0]
        sums[1] += 4 * h / 10 * e
        u[1] = 4 * e + sums[1]
        outer.append(x[2])
        inner.append(x[0])
        x = G @ x + H @ np.array([u[1] + load, outer_load])
    return np.array(outer), np.array(inner)


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize(("setpoint", "load", "outer_load"), [(2, 0, 0), (0, 3, 0), (0, 0, -2), (1, 2, 3)])
def test_a_cascade_is_that_of_scipy(every: int, setpoint: float, load: float, outer_load: float) -> None:
    """Two thousand scans of a stable loop: rounding stays below 1e-9."""
    steps: dict[str, Any] = {"setpoint": (0, setpoint), "load": (0, load), "outer_load": (0, outer_load)}
    run = simulate_cascade(OUTER, INNER, REACTOR, JACKET, (every * 1.0, 1.0), time=2000, **steps)
    outer, inner = by_hand(2001, 1.0, every, setpoint, load, outer_load)
    assert run.inner.measurement - 50 == pytest.approx(inner, abs=1e-9)
    assert run.outer.measurement - 50 == pytest.approx(outer[::every], abs=1e-9)


def test_a_cascade_takes_a_load_at_its_inner_process_far_better_than_one_loop() -> None:
    run = simulate_cascade(OUTER, INNER, REACTOR, JACKET, 1.0, setpoint=0, load=(10, 10), time=2000)
    alone = pidemu.simulate(OUTER, Process.from_lags(0.96, [120, 20, 10]), 1.0, setpoint=0, load=(10, 10), time=2000)
    assert run.outer.iae < alone.iae / 5


def test_the_inner_loop_runs_in_cascade_mode_as_its_card_has_it() -> None:
    """Yokogawa's block has P on the measurement in automatic, and on the error in cascade: the remote setpoint moves it at once."""
    inner = pidemu.load_card("yokogawa/fieldbus-pid").settings(GAIN=2, RESET=10)
    run = simulate_cascade(OUTER, inner, REACTOR, JACKET, 1.0, setpoint=(10, 1), load=0, time=40)
    jump = run.outer.output[10] - run.outer.output[9]
    assert run.inner.output[10] - run.inner.output[9] == pytest.approx(jump * (2 + 2 / 10), rel=1e-6)


def test_both_controllers_start_at_rest_and_stay_there_without_a_step() -> None:
    inner = pidemu.load_card("emerson/deltav").settings(GAIN=2, RESET=10, RATE=1)
    outer = pidemu.load_card("fisher/provox").settings(GAIN=1, RESET=1, RATE=0.1)
    run = simulate_cascade(outer, inner, REACTOR, JACKET, 1.0, setpoint=0, load=0, time=300)
    for loop in (run.outer, run.inner):
        assert np.abs(loop.measurement - 50).max() < 1e-9
        assert np.abs(loop.output - 50).max() < 1e-9


def test_a_valve_and_noise_are_where_they_belong() -> None:
    asked: dict[str, Any] = {"noise": Noise(0.2, seed=1), "valve": Valve(deadband=2), "time": 400}
    run = simulate_cascade(OUTER, INNER, REACTOR, JACKET, 1.0, **asked)
    assert run.inner.valve is not None
    assert np.abs(run.inner.valve - run.inner.output).max() == pytest.approx(1.0)
    assert run.outer.valve is None
    assert (run.outer.measurement - Noise(0.2, seed=1).at(401, 1.0))[:5] == pytest.approx(50, abs=0.05)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            {"scan": (1.5, 1.0)},
            "the outer controller scans every 1.5 s, not a multiple of the inner one's 1 s; give one that is",
        ),
        (
            {"scan": (0.5, 1.0)},
            "the outer controller scans every 0.5 s, not a multiple of the inner one's 1 s; give one that is",
        ),
        ({"load": (5000, 1), "time": 100}, "a load step of 1 % at 5000 s is not within the 100 s simulated; start it earlier"),
    ],
)
def test_a_cascade_that_cannot_be_run_is_refused(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ProcessError) as found:
        simulate_cascade(OUTER, INNER, REACTOR, JACKET, **words)
    assert str(found.value) == message
