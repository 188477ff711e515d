"""How a trial of a closed loop ended."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu import Loop
from pidemu.fleet.blocks import figures_of
from pidemu.simulation.outcome import feedback_is_negative, has_settled, late_scan, margins_of, settled_by, stability_of
from pidemu.simulation.simulate import run_trial
from pidemu.simulation.trial import trial
from tests.fleet.support import mixed

PROCESS = pidemu.Process.from_lags(1.0, [10], delay=2)


def standard(**given: Any) -> pidemu.Settings:
    return pidemu.load_card("generic/standard").settings(given)


@pytest.mark.parametrize(
    ("swing", "peak", "settled"),
    [
        (0.0, 0.0, True),
        (0.049, 1.0, True),
        (0.051, 1.0, False),
        (1e-12, 0.0, True),
        (math.inf, math.inf, False),
        (math.nan, 1, False),
    ],
)
def test_settled_is_a_swing_below_a_twentieth_of_the_peak(swing: float, peak: float, settled: bool) -> None:
    assert has_settled(swing, peak) is settled


@pytest.mark.parametrize(("time", "settled"), [(40, None), (49, None), (50, None), (52, False), (2000, False)])
def test_a_run_that_ends_in_the_dead_time_says_nothing_about_settling(time: float, settled: bool | None) -> None:
    """A loop that is unstable: its load step of 10 % comes at 20 s, and is seen 30 s later."""
    process, settings = pidemu.Process.from_lags(1.0, [10], delay=30), standard(K=5, Ti=10, Td=0)
    fleet = pidemu.Fleet([Loop("A", settings, process, 1.0)]).simulate(setpoint=0, load=(20, 10), time=time)
    assert fleet.settled == [settled]
    made = trial(settings, process, 1.0, setpoint=0, load=(20, 10), time=time)
    run = run_trial(made)
    assert settled_by(made, figures_of(made, run.measurement, run.output)) is settled


def test_a_run_without_a_step_is_settled() -> None:
    made = trial(standard(K=1, Ti=10, Td=0), PROCESS, 1.0, setpoint=0, load=0, time=1)
    assert settled_by(made, {"swing": 0.0, "peak": 0.0}) is True


def test_the_last_part_is_a_fifth_and_ten_scans_at_least() -> None:
    assert [late_scan(n) for n in (1000, 101, 40, 10, 3)] == [800, 80, 30, 0, 0]


@pytest.mark.parametrize(("gain", "stable"), [(2.0, True), (12.0, False)])
def test_stability_is_that_of_the_signals(gain: float, stable: bool) -> None:
    """The oracle is a long run without limits: an error that dies out, or one that does not."""
    settings = standard(K=gain, Ti=10)
    made = trial(settings, PROCESS, 0.5)
    ran = pidemu.simulate(settings, PROCESS, 0.5, setpoint=(5, 1), load=0, time=400, output_limits=(-1e9, 1e9))
    assert stability_of(made, margins_of(made)) is stable
    assert bool(np.abs(ran.error[-50:]).max() < 1e-3) is stable


@pytest.mark.parametrize(
    ("gain", "Ti", "stable"), [(0.5, math.inf, None), (1.0, math.inf, False), (2.0, math.inf, False), (0.1, 20, False)]
)
def test_with_positive_feedback_a_gain_of_one_at_rest_is_unstable(gain: float, Ti: float, stable: bool | None) -> None:
    made = trial(standard(K=gain, Ti=Ti), PROCESS, 0.5, action="direct")
    assert not feedback_is_negative(made)
    assert margins_of(made) is None
    assert stability_of(made, None) is stable


def test_a_card_without_choice_of_action_has_the_sign_of_its_gain() -> None:
    settings = pidemu.load_card("ros/control-toolbox").settings(p=-2, i=-0.1)
    assert feedback_is_negative(trial(settings, pidemu.Process.from_lags(-1.0, [10]), 0.5))
    assert not feedback_is_negative(trial(settings, PROCESS, 0.5, action="direct"))


def has_narrow_integral(loop: Loop) -> bool:
    """Tell whether limits of the integral itself would stop what the law lets grow."""
    limits = loop.settings.algorithm().integral.limits
    return limits is not None and isinstance(limits.high, float) and limits.high < 1000


LINEAR = [x for x in mixed() if not x.settings.algorithm().beyond_the_law and not has_narrow_integral(x)]


@pytest.mark.parametrize("loop", LINEAR[::5], ids=lambda loop: loop.tag)
def test_loops_of_all_cards_die_out_without_limits_where_they_are_called_stable_and_only_there(loop: Loop) -> None:
    """The oracle is the emulation: 2,000 scans after a small setpoint step, the last quarter against the first."""
    given: dict[str, Any] = {"time": 2000 * (loop.scan or 1.0), "setpoint": (1, 1e-3), "load": 0, "action": loop.action}
    made = trial(loop.settings, loop.process, loop.scan, output_limits=(-1e9, 1e9), **given)
    ran = pidemu.simulate(loop.settings, loop.process, loop.scan, output_limits=(-1e9, 1e9), engine="python", **given)
    with np.errstate(all="ignore"):
        moves = np.abs(np.diff(ran.measurement))
    first, last = moves[:500].max(), moves[-500:].max()
    assert stability_of(made, margins_of(made)) in (None, bool(last < 0.5 * max(first, 1e-12)))
