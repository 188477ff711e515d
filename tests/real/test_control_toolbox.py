"""ros2_control's control_toolbox Pid against its documented behaviour, and against outputs of the real thing."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.errors import PidemuError
from tests.real.support import close, common_record, outputs, signals, trace, uneven

TOLERANCE = 1e-12
"""Double precision: a few units in the last place per scan, relative to the largest term."""

EPSILON = float(np.finfo(float).eps)

Scheme = Literal["none", "back_calculation", "conditional_integration"]


class Pid:
    """compute_command with an error of setpoint less measurement; a manual scan is a call of reset.

    `edge` is the nearest that the sum came to a limit or to zero: rounding could put it on the other side, with the integral.
    """

    def __init__(
        self,
        p: float,
        i: float,
        d: float,
        limits: tuple[float, float] = (-math.inf, math.inf),
        antiwindup: Scheme = "none",
        i_min: float = -math.inf,
        i_max: float = math.inf,
        tracking_time_constant: float = 0.0,
        error_deadband: float = EPSILON,
    ) -> None:
        self.p, self.i, self.d, self.limits, self.antiwindup = p, i, d, limits, antiwindup
        self.i_min, self.i_max, self.error_deadband = i_min, i_max, error_deadband
        self.tracking = tracking_time_constant
        if self.tracking == 0 and i:
            self.tracking = math.sqrt(d / i) if d else p / i
        self.size, self.edge = 0.0, math.inf
        self.reset()

    def reset(self) -> None:
        self.last_error = self.integral = self.command = 0.0

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        if not auto:
            self.reset()
            return 0.0
        error = sp - pv
        if dt == 0:
            return self.command
        if not math.isfinite(error):
            self.command = math.nan
            return math.nan
        terms = (self.p * error, self.integral, self.d * (error - self.last_error) / dt)
        self.last_error = error
        self.size = max(self.size, *map(abs, terms))
        wanted = sum(terms)
        self.command = min(max(wanted, self.limits[0]), self.limits[1])
        if abs(error) > self.error_deadband:
            self.integrate(error, wanted, dt)
        return self.command

    def integrate(self, error: float, wanted: float, dt: float) -> None:
        saturated = abs(wanted - self.command) > EPSILON
        self.edge = min(self.edge, *(abs(wanted - limit) for limit in (*self.limits, 0.0)))
        if self.antiwindup == "back_calculation":
            if self.i:
                self.integral += dt * (self.i * error + (self.command - wanted) / self.tracking)
        elif self.antiwindup == "none" or not (saturated and error * wanted > 0):
            self.integral += dt * self.i * error
        self.integral = min(max(self.integral, self.i_min), self.i_max)


def controller(scan: float, limits: tuple[float, float], **given: float | str) -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card("ros/control-toolbox").settings(given), scan=scan, output_limits=limits)


class TestTrace:
    """p=1.2 i=0.15 d=0.8, limits -20 and 40, back_calculation with 4 s, no deadband, 0.5 s."""

    def test_the_oracle_reproduces_the_real_class_and_its_integral(self) -> None:
        record, real = common_record(), trace("real_control_toolbox")
        oracle = Pid(1.2, 0.15, 0.8, (-20, 40), "back_calculation", tracking_time_constant=4, error_deadband=0)
        found = []
        for sp, pv, auto, manual in zip(record.sp, record.pv, record.auto, record.manual, strict=True):
            found.append((oracle.scan(sp, pv, bool(auto), manual, 0.5), oracle.integral))
        for column, name in zip(np.array(found).T, ("cmd", "i_term"), strict=True):
            assert close(column, real[name], TOLERANCE, oracle.size), name

    def test_the_card_reproduces_the_real_class(self) -> None:
        record, real = common_record(), trace("real_control_toolbox")
        ctl = controller(
            0.5, (-20, 40), p=1.2, i=0.15, d=0.8, antiwindup="back_calculation", tracking_time_constant=4, error_deadband=0
        )
        found = ctl.run(record.sp, record.pv, record.auto, record.manual)
        assert close(found, real["cmd"], TOLERANCE, np.abs(real["i_term"]).max())

    def test_the_class_is_driven_to_both_limits(self) -> None:
        real = trace("real_control_toolbox")["cmd"]
        assert (real == -20).any()
        assert (real == 40).any()


gains = st.tuples(
    st.sampled_from([0.0, 1.0]) | st.floats(0.05, 8),
    st.just(0.0) | st.floats(0.001, 2),
    st.just(0.0) | st.floats(0.01, 20),
    st.sampled_from([1.0, 1.0, -1.0]),
).map(lambda g: (g[0] * g[3], g[1] * g[3], g[2] * g[3]))
"""Gains of one sign; each may be zero."""


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    gains=gains,
    antiwindup=st.sampled_from(["none", "back_calculation", "conditional_integration"]),
    limits=st.sampled_from([(0.0, 100.0), (-20.0, 40.0), (10.0, 10.5), (-math.inf, math.inf), (-math.inf, 30.0)]),
    i_limits=st.sampled_from([(-math.inf, math.inf), (-5.0, 30.0), (0.0, 0.0)]),
    tracking=st.just(0.0) | st.floats(0.6, 60),
    deadband=st.sampled_from([EPSILON, 0.0, 1.0, 5.0]),
    scan=st.sampled_from([0.01, 0.1, 0.5]),
)
def test_any_settings_and_manual_spells_agree_with_the_documented_computation(
    seed: int,
    gains: tuple[float, float, float],
    antiwindup: Scheme,
    limits: tuple[float, float],
    i_limits: tuple[float, float],
    tracking: float,
    deadband: float,
    scan: float,
) -> None:
    p, i, d = gains
    if not tracking and i and (math.sqrt(d / i) if d else p / i) < scan:
        tracking = 1.0  # the recommended value would be zero, which the real class divides by, or ring and magnify its rounding
    record = signals(seed)
    oracle = Pid(p, i, d, limits, antiwindup, *i_limits, tracking, deadband)
    expected = outputs(oracle, record, scan)
    assume(antiwindup != "conditional_integration" or oracle.edge > TOLERANCE * oracle.size or not i)
    dials = {"p": p, "i": i, "d": d, "i_min": i_limits[0], "i_max": i_limits[1], "tracking_time_constant": tracking}
    ctl = controller(scan, limits, **dials, error_deadband=deadband, antiwindup=antiwindup)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), expected, TOLERANCE, oracle.size)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), antiwindup=st.sampled_from(["none", "back_calculation", "conditional_integration"]))
def test_the_interval_is_the_measured_one_and_none_at_all_changes_nothing(seed: int, antiwindup: Scheme) -> None:
    record, intervals = signals(seed), uneven(seed, 200, 0.5)
    intervals[np.arange(200) % 7 == 3] = 0.0
    oracle = Pid(1.5, 0.2, 0.8, (0, 100), antiwindup)
    expected = outputs(oracle, record, intervals)
    assume(antiwindup != "conditional_integration" or oracle.edge > TOLERANCE * oracle.size)
    ctl = controller(0.5, (0, 100), p=1.5, i=0.2, d=0.8, antiwindup=antiwindup)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual, interval=intervals)
    assert close(found, expected, TOLERANCE, oracle.size)


def test_a_negative_interval_is_refused() -> None:
    ctl = controller(0.5, (0, 100), p=1.0)
    ctl.scan(50.0, 49.0)
    with pytest.raises(PidemuError):
        ctl.scan(50.0, 49.0, interval=-0.5)


def test_an_error_that_is_not_finite_gives_nan_and_changes_nothing() -> None:
    record = signals(5).always_auto()
    pv = record.pv.copy()
    pv[[20, 21, 90]] = math.nan, math.inf, -math.inf
    oracle, expected = Pid(1.5, 0.2, 0.8, (0, 100), "back_calculation"), []
    for sp, y in zip(record.sp, pv, strict=True):
        expected.append(oracle.scan(sp, y, True, 0.0, 0.5))
    ctl = controller(0.5, (0, 100), p=1.5, i=0.2, d=0.8, antiwindup="back_calculation")
    found = ctl.run(record.sp, pv)
    assert np.isnan(found).sum() == 3
    assert close(found, expected, TOLERANCE, oracle.size)


def test_within_the_deadband_nothing_is_calculated_back() -> None:
    limits = (-math.inf, 5.0)
    oracle = Pid(4.0, 0.5, 0.0, limits, "back_calculation", tracking_time_constant=2, error_deadband=3.0)
    ctl = controller(1.0, limits, p=4.0, i=0.5, antiwindup="back_calculation", tracking_time_constant=2, error_deadband=3.0)
    errors = [2.0, 2.0, 2.0, 1.0, 1.0]  # 8 is beyond the limit, and within the band
    assert close(ctl.run(errors, 0.0), [oracle.scan(e, 0.0, True, 0.0, 1.0) for e in errors], TOLERANCE)


def test_the_integral_is_one_scan_late() -> None:
    found = controller(1.0, (-math.inf, math.inf), p=0.0, i=0.5).run(50.0, [48.0, 48.0, 48.0])
    assert found.tolist() == [0.0, 1.0, 2.0]


def test_the_first_scan_after_a_reset_kicks() -> None:
    found = controller(0.5, (-math.inf, math.inf), p=1.0, d=2.0).run(50.0, [49.0, 49.0, 49.0, 49.0], [1, 1, 0, 1], 30.0)
    assert found.tolist() == [5.0, 1.0, 0.0, 5.0]


def test_a_changed_gain_leaves_the_integral_as_it_stands() -> None:
    record = signals(11).always_auto()
    oracle = Pid(1.0, 0.1, 0.5, (0, 100), "back_calculation", tracking_time_constant=3)
    ctl = controller(0.5, (0, 100), p=1.0, i=0.1, d=0.5, antiwindup="back_calculation", tracking_time_constant=3)
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.5)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.p, oracle.i = 3.0, 0.02
    ctl.change(p=3.0, i=0.02)
    expected = outputs(oracle, second, 0.5)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)
