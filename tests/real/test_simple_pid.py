"""The Python package simple-pid: its card, an oracle of its documented behaviour, and the package itself."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simple_pid import PID

import pidemu
from tests.real.support import Floats, Signals, close, outputs, signals

TOLERANCE = 1e-12
"""Double precision: Ki e dt and (Ki dt) e round differently, in every one of 200 scans, relative to the largest term."""

Flags = tuple[bool, bool]
"""proportional_on_measurement, differential_on_measurement."""

FLAGS: list[Flags] = list(itertools.product([False, True], [False, True]))


class SimplePid:
    """One object; in manual it is switched off, and switched on again with set_auto_mode(True, the operator's last output)."""

    def __init__(
        self, Kp: float, Ki: float, Kd: float, flags: Flags, limits: tuple[float, float], starting_output: float = 0.0
    ) -> None:
        self.Kp, self.Ki, self.Kd, self.flags, self.limits = Kp, Ki, Kd, flags, limits
        self.on, self.output, self.size = True, starting_output, 0.0
        self.reset(starting_output)

    def reset(self, output: float) -> None:
        self.proportional, self.integral = 0.0, self.clamped(output)
        self.last: tuple[float, float] | None = None  # measurement and error

    def clamped(self, x: float) -> float:
        return min(max(x, self.limits[0]), self.limits[1])

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        if not auto:
            self.on, self.output = False, manual
            return manual
        if not self.on:
            self.on = True
            self.reset(self.output)
        error = sp - pv
        last_pv, last_error = self.last or (pv, error)
        self.last = (pv, error)
        if self.flags[0]:
            self.proportional -= self.Kp * (pv - last_pv)
        else:
            self.proportional = self.Kp * error
        self.integral = self.clamped(self.integral + self.Ki * error * dt)
        moved = last_pv - pv if self.flags[1] else error - last_error
        derivative = self.Kd * moved / dt
        self.size = max(self.size, *map(abs, (self.Kp * pv, self.Kp * error, self.integral, derivative, self.Kd * pv / dt)))
        self.output = self.clamped(self.proportional + self.integral + derivative)
        return self.output


def real(pid: PID, record: Signals, dt: float, last: float | None = None) -> Floats:
    """What the package returns; off in manual, and told the operator's last output when it is switched on."""
    out: list[float] = []
    for sp, pv, auto, manual in zip(*(x.tolist() for x in (record.sp, record.pv, record.auto, record.manual)), strict=True):
        if auto:
            pid.set_auto_mode(True, last_output=last)  # does nothing while it is on
            pid.setpoint = sp
            last = float(pid(pv, dt=dt) or 0.0)
        else:
            pid.set_auto_mode(False)
            last = manual
        out.append(last)
    return np.array(out)


def package(Kp: float, Ki: float, Kd: float, flags: Flags, limits: tuple[float, float], starting_output: float = 0.0) -> PID:
    low, high = (None if math.isinf(x) else x for x in limits)
    return PID(
        Kp,
        Ki,
        Kd,
        sample_time=None,
        output_limits=(low, high),
        starting_output=starting_output,
        proportional_on_measurement=flags[0],
        differential_on_measurement=flags[1],
    )


def controller(
    Kp: float, Ki: float, Kd: float, flags: Flags, limits: tuple[float, float], scan: float = 0.5, initial_output: float = 0.0
) -> pidemu.Controller:
    given: dict[str, Any] = {"Kp": Kp, "Ki": Ki, "Kd": Kd}
    given |= {"proportional_on_measurement": str(flags[0]).lower(), "differential_on_measurement": str(flags[1]).lower()}
    s = pidemu.load_card("simple-pid/simple-pid").settings(given)
    return pidemu.Controller(s, scan=scan, output_limits=limits, initial_output=initial_output)


gains = st.tuples(
    st.sampled_from([0.0, 1.0, -1.0]) | st.floats(0.01, 8) | st.floats(-8, -0.01),
    st.just(0.0) | st.floats(0.001, 2) | st.floats(-2, -0.001),
    st.just(0.0) | st.floats(0.01, 20) | st.floats(-20, -0.01),
)
limits = st.sampled_from([(0.0, 100.0), (10.0, 90.0), (-20.0, 40.0), (10.0, 10.5), (-math.inf, math.inf), (-math.inf, 30.0)])


@pytest.mark.parametrize("flags", FLAGS)
@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    gains=gains,
    limits=limits,
    scan=st.sampled_from([0.05, 0.5, 2.0]),
    start=st.sampled_from([0.0, 35.0, 120.0]),
)
def test_any_settings_and_switches_of_mode_agree_with_the_package_and_with_the_documented_computation(
    flags: Flags, seed: int, gains: tuple[float, float, float], limits: tuple[float, float], scan: float, start: float
) -> None:
    record = signals(seed)
    oracle = SimplePid(*gains, flags, limits, start)
    expected = outputs(oracle, record, scan)
    assert close(expected, real(package(*gains, flags, limits, start), record, scan), TOLERANCE, oracle.size)  # the oracle is right
    found = controller(*gains, flags, limits, scan, start).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("seed", range(4))
def test_without_integral_the_sum_is_what_was_loaded_within_limits_that_leave_out_zero(flags: Flags, seed: int) -> None:
    record = signals(seed)
    for start in (0.0, 50.0, 95.0):
        want = real(package(0.5, 0.0, 0.3, flags, (10, 90), start), record, 0.5)
        found = controller(0.5, 0.0, 0.3, flags, (10, 90), 0.5, start).run(record.sp, record.pv, record.auto, record.manual)
        assert close(found, want, TOLERANCE, 100)


@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("after", [(2.0, 0.3, 1.5), (0.4, 0.0, 1.5), (1.0, 0.1, 0.0), (-1.0, -0.2, -0.5)])
def test_changed_tunings_leave_integral_and_history_as_they_stand(flags: Flags, after: tuple[float, float, float]) -> None:
    record = signals(9)
    before = (1.0, 0.1, 0.5)
    pid, ctl = package(*before, flags, (0, 100)), controller(*before, flags, (0, 100))
    last = 0.0
    for start, tunings in ((0, before), (70, after), (140, before)):
        pid.tunings = tunings
        ctl.change(Kp=tunings[0], Ki=tunings[1], Kd=tunings[2])
        part = record.part(start, start + 70)
        want = real(pid, part, 0.5, last)
        last = float(want[-1])
        assert close(ctl.run(part.sp, part.pv, part.auto, part.manual), want, TOLERANCE, 1000)


@pytest.mark.parametrize("flags", FLAGS)
def test_a_switch_to_automatic_loads_the_operators_output_within_the_limits_and_p_on_error_comes_on_top(flags: Flags) -> None:
    record = Signals(np.full(3, 50.0), np.full(3, 46.0), np.array([0.0, 0.0, 1.0]), np.array([30.0, 130.0, 0.0]))
    found = controller(-2.0, 0.0, 1.0, flags, (0, 100)).run(record.sp, record.pv, record.auto, record.manual)
    assert found.tolist() == [30.0, 130.0, 100.0 if flags[0] else 92.0]
    assert found.tolist() == real(package(-2.0, 0.0, 1.0, flags, (0, 100)), record, 0.5).tolist()
