"""The Arduino PID library against its documented computation, and against outputs of the real thing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.errors import SettingError
from pidemu.settings.action import Action
from tests.real.support import Signals, close, outputs, signals, trace

TOLERANCE = 1e-12
"""Double precision: a few units in the last place per scan, relative to the largest term."""


class Arduino:
    """Compute in automatic; Initialize at the switch to it. `action` is ISA's word: reverse is the library's DIRECT."""

    def __init__(
        self,
        tunings: tuple[float, float, float],
        POn: str = "P_ON_E",
        action: Action = "reverse",
        limits: tuple[float, float] = (0.0, 255.0),
        output: float = 0.0,
    ) -> None:
        self.action, self.limits, self.output = action, limits, output
        self.set_tunings(tunings, POn)
        self.sum = self.last_input = self.size = 0.0
        self.automatic = False

    def set_tunings(self, tunings: tuple[float, float, float], POn: str) -> None:
        sign = 1.0 if self.action == "reverse" else -1.0
        self.Kp, self.Ki, self.Kd = (sign * k for k in tunings)
        self.on_error = POn == "P_ON_E"

    def limited(self, x: float) -> float:
        return min(max(x, self.limits[0]), self.limits[1])

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        if not auto:
            self.automatic, self.output = False, manual
            return manual
        if not self.automatic:
            self.automatic, self.sum, self.last_input = True, self.limited(self.output), pv
        error, moved = sp - pv, pv - self.last_input
        self.last_input = pv
        self.sum += self.Ki * dt * error
        if not self.on_error:
            self.sum -= self.Kp * moved
        self.sum = self.limited(self.sum)
        proportional = self.Kp * error if self.on_error else 0.0
        derivative = self.Kd / dt * moved
        self.size = max(self.size, *map(abs, (self.Kp * error, self.Kp * pv, self.sum, derivative, self.Kd / dt * pv)))
        self.output = self.limited(proportional + self.sum - derivative)
        return self.output


def controller(
    tunings: tuple[float, float, float],
    POn: str = "P_ON_E",
    action: Action = "reverse",
    limits: tuple[float, float] = (0.0, 255.0),
    scan: float = 0.1,
    output: float = 0.0,
) -> pidemu.Controller:
    s = pidemu.load_card("arduino/pid").settings(Kp=tunings[0], Ki=tunings[1], Kd=tunings[2], POn=POn)
    return pidemu.Controller(s, scan=scan, action=action, output_limits=limits, initial_output=output)


class TestTrace:
    """Kp=1.2 Ki=0.15 Kd=0.8, P_ON_E, DIRECT, limits 0 and 100, 0.5 s."""

    def test_the_oracle_reproduces_the_real_library(self) -> None:
        real = trace("arduino_pid_v1")
        record = Signals(real["sp"], real["pv"], real["auto"], real["man"])
        oracle = Arduino((1.2, 0.15, 0.8), limits=(0, 100))
        assert close(outputs(oracle, record, 0.5), real["out"], TOLERANCE)

    def test_the_card_reproduces_the_real_library(self) -> None:
        real = trace("arduino_pid_v1")
        ctl = controller((1.2, 0.15, 0.8), limits=(0, 100), scan=0.5)
        assert close(ctl.run(real["sp"], real["pv"], real["auto"], real["man"]), real["out"], TOLERANCE)


tunings = st.tuples(st.just(0.0) | st.floats(0.01, 20), st.just(0.0) | st.floats(0.001, 5), st.just(0.0) | st.floats(0.01, 20))
modes = st.sampled_from(["P_ON_E", "P_ON_M"])
actions = st.sampled_from(["reverse", "direct"])
limits = st.sampled_from([(0.0, 100.0), (0.0, 255.0), (-20.0, 40.0), (10.0, 10.5), (30.0, 60.0)])


@settings(max_examples=100)
@given(
    seed=st.integers(0, 10_000),
    tunings=tunings,
    POn=modes,
    action=actions,
    limits=limits,
    scan=st.sampled_from([0.02, 0.1, 0.5, 2.0]),
    output=st.sampled_from([0.0, 35.0, 300.0]),
)
def test_any_settings_directions_and_manual_spells_agree_with_the_documented_computation(
    seed: int,
    tunings: tuple[float, float, float],
    POn: str,
    action: Action,
    limits: tuple[float, float],
    scan: float,
    output: float,
) -> None:
    record = signals(seed)
    oracle = Arduino(tunings, POn, action, limits, output)
    expected = outputs(oracle, record, scan)
    found = controller(tunings, POn, action, limits, scan, output).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    changes=st.lists(st.tuples(st.integers(1, 80), tunings, modes), min_size=1, max_size=5),
    action=actions,
    limits=limits,
)
def test_set_tunings_takes_effect_on_what_comes_and_leaves_the_sum(
    seed: int, changes: list[tuple[int, tuple[float, float, float], str]], action: Action, limits: tuple[float, float]
) -> None:
    record = signals(seed)
    first = ((1.2, 0.15, 0.8), "P_ON_E")
    oracle, ctl = Arduino(*first, action, limits), controller(*first, action, limits, 0.5)
    start = 0
    for length, tunings, POn in [(30, *first), *changes]:
        oracle.set_tunings(tunings, POn)
        ctl.change(Kp=tunings[0], Ki=tunings[1], Kd=tunings[2], POn=POn)
        part = record.part(start, start + length)
        expected = outputs(oracle, part, 0.5)
        assert close(ctl.run(part.sp, part.pv, part.auto, part.manual), expected, TOLERANCE, oracle.size)
        start += len(part)


@pytest.mark.parametrize("POn", ["P_ON_E", "P_ON_M"])
@pytest.mark.parametrize("action", ["reverse", "direct"])
def test_a_loop_far_from_its_setpoint_stands_at_either_limit_and_its_sum_does_not_wind_up(POn: str, action: Action) -> None:
    pv = np.concatenate([np.full(100, 10.0), np.full(100, 90.0)])
    oracle, ctl = Arduino((2.0, 0.5, 1.0), POn, action, (0, 100)), controller((2.0, 0.5, 1.0), POn, action, (0, 100), 0.5)
    ones = np.ones(200)
    found = ctl.run(50.0, pv)
    assert close(found, outputs(oracle, Signals(50 * ones, pv, ones, ones), 0.5), TOLERANCE, oracle.size)
    ends = (100.0, 0.0) if action == "reverse" else (0.0, 100.0)
    assert (found[99], found[199]) == ends
    assert ctl.state["I"] == ends[1]
    # two scans later at the setpoint: P_ON_E is off the limit at once, P_ON_M as far as the measurement came back
    back = ctl.run(50.0, [50.0, 50.0])[-1]
    sign = 1.0 if action == "reverse" else -1.0
    assert back == pytest.approx(ends[1] if POn == "P_ON_E" else ends[1] + sign * 2.0 * 40.0)


@pytest.mark.parametrize(("POn", "bump"), [("P_ON_E", 2.0 * 5 + 0.5 * 5 * 0.1), ("P_ON_M", 0.5 * 5 * 0.1)])
def test_the_switch_to_automatic_bumps_by_the_proportional_on_error_and_by_one_increment(POn: str, bump: float) -> None:
    found = controller((2.0, 0.5, 1.0), POn).run(50.0, [47.0, 45.0], [0, 1], 30.0)
    assert found.tolist() == pytest.approx([30.0, 30.0 + bump])


def test_a_negative_tuning_is_refused_where_the_library_drops_it_without_a_word() -> None:
    with pytest.raises(SettingError, match="Kp"):
        controller((-1.0, 0.0, 0.0))
