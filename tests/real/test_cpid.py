"""gnc-tools cpid against its documented behaviour, and against outputs of the real thing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.errors import PidemuError
from tests.real.support import close, common_record, outputs, signals, trace

TOLERANCE = 1e-12
"""Double precision: a few units in the last place per scan, relative to the largest term."""


class Cpid:
    """cpidUpdate; in manual it is called all the same, and its output is not used."""

    def __init__(
        self,
        Kp: float,
        Ki: float,
        Kd: float,
        Tf: float = 0.0,
        limits: tuple[float, float] = (-math.inf, math.inf),
        b: float = 1.0,
        c: float = 1.0,
        rRampMax: float = math.inf,
    ) -> None:
        self.Kp, self.Ki, self.Kd, self.Tf, self.limits, self.b, self.c, self.rRampMax = Kp, Ki, Kd, Tf, limits, b, c, rRampMax
        self.integral = self.derivative_state = self.setpoint = 0.0
        self.size = 0.0

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        most = self.rRampMax  # per sample: dt has no part in it
        self.setpoint += min(max(sp - self.setpoint, -most), most)
        r = self.setpoint
        integrand = self.Ki * (r - pv)
        derivative = 0.0
        if self.Kd and self.Tf:
            derivative = (self.Kd * (self.c * r - pv) - self.derivative_state) / self.Tf
            self.derivative_state += dt * derivative
        elif self.Kd:
            present = self.Kd * (self.c * r - pv) / dt
            derivative, self.derivative_state = present - self.derivative_state, present
        proportional = self.Kp * (self.b * r - pv)
        self.size = max(self.size, abs(proportional), abs(self.integral), abs(derivative))
        wanted = proportional + self.integral + derivative
        output = min(max(wanted, self.limits[0]), self.limits[1])
        if self.Ki:
            self.integral += dt * (integrand + output - wanted)
        return output if auto else manual


def controller(scan: float, limits: tuple[float, float], **given: float) -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card("gnc-tools/cpid").settings(given), scan=scan, output_limits=limits)


class TestTrace:
    """Kp=1.2 Ki=0.15 Kd=0.8 Tf=0.6 b=0.7 c=0.3, limits 0 and 100, 0.5 s, always in automatic."""

    def test_the_oracle_reproduces_the_real_function(self) -> None:
        record, real = common_record().always_auto(), trace("real_cpid")
        oracle = Cpid(1.2, 0.15, 0.8, 0.6, (0, 100), 0.7, 0.3)
        assert close(outputs(oracle, record, 0.5), real["u"], TOLERANCE, oracle.size)

    def test_the_card_reproduces_the_real_function(self) -> None:
        record, real = common_record(), trace("real_cpid")
        ctl = controller(0.5, (0, 100), Kp=1.2, Ki=0.15, Kd=0.8, Tf=0.6, b=0.7, c=0.3)
        assert close(ctl.run(record.sp, record.pv), real["u"], TOLERANCE, 100)

    def test_the_function_is_driven_to_its_lower_limit(self) -> None:
        assert (trace("real_cpid")["u"] == 0).any()


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    Kp=st.sampled_from([1.0, -1.0]) | st.floats(0.1, 8) | st.floats(-8, -0.1),
    Ki=st.just(0.0) | st.floats(0.001, 2) | st.floats(-1, -0.001),
    Kd=st.just(0.0) | st.floats(0.01, 20),
    Tf_per_scan=st.just(0.0) | st.floats(0.6, 30),
    b=st.sampled_from([0.0, 1.0]) | st.floats(0.1, 2),
    c=st.sampled_from([0.0, 1.0]) | st.floats(0.1, 2),
    ramp=st.just(math.inf) | st.floats(0.5, 50),
    limits=st.sampled_from([(0.0, 100.0), (-20.0, 40.0), (10.0, 10.5), (-math.inf, math.inf), (-math.inf, 30.0)]),
    scan=st.sampled_from([0.05, 0.5, 1.0]),
)
def test_any_settings_and_manual_spells_agree_with_the_documented_computation(
    seed: int,
    Kp: float,
    Ki: float,
    Kd: float,
    Tf_per_scan: float,
    b: float,
    c: float,
    ramp: float,
    limits: tuple[float, float],
    scan: float,
) -> None:
    Tf = Tf_per_scan * scan if Kd else 0.0  # the function refuses a filter of nothing
    record = signals(seed)
    oracle = Cpid(Kp, Ki, Kd, Tf, limits, b, c, ramp)
    expected = outputs(oracle, record, scan)
    ctl = controller(scan, limits, Kp=Kp, Ki=Ki, Kd=Kd, Tf=Tf, b=b, c=c, rRampMax=ramp)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), expected, TOLERANCE, oracle.size)


@pytest.mark.parametrize("scan", [0.1, 0.5, 2.0])
def test_the_setpoint_ramp_begins_at_zero_and_counts_samples_not_seconds(scan: float) -> None:
    found = controller(scan, (-math.inf, math.inf), Kp=1.0, rRampMax=10.0).run(50.0, np.zeros(4))
    assert found == pytest.approx([10.0, 20.0, 30.0, 40.0], rel=TOLERANCE)  # rate times interval rounds twice


def test_the_ramp_is_that_of_the_authors_own_test() -> None:
    """PIDSetpointRamp of mxPID_tests.m at commit 12cb31e0: Ts = 0.1, rRampMax = 0.3 gives setpoints of 0.3, 0.6, 0.9."""
    found = controller(0.1, (-math.inf, math.inf), Kp=1.0, rRampMax=0.3).run(1.0, np.zeros(4))
    assert found == pytest.approx([0.3, 0.6, 0.9, 1.0], rel=TOLERANCE)


def test_the_ramp_is_per_sample_where_intervals_are_stated_later() -> None:
    s = pidemu.load_card("gnc-tools/cpid").settings(Kp=1.0, rRampMax=2.0)
    assert s.algorithm().setpoint.rate == 20.0  # the card's interval is 0.1 s
    assert s.algorithm(scan=0.5).setpoint.rate == 4.0
    assert s.at_scan(0.25)["rRampMax"].to("eu/s") == 8.0
    assert s.at_scan(0.25).algorithm().setpoint.rate == 8.0


def test_the_first_scan_kicks_when_there_is_a_derivative() -> None:
    found = controller(0.5, (-math.inf, math.inf), Kp=1.0, Kd=2.0).run(50.0, [49.0, 49.0])
    assert found.tolist() == [5.0, 1.0]


def test_at_a_limit_the_integral_is_pulled_back_with_one_second() -> None:
    found = controller(0.5, (-100, 100), Kp=10.0, Ki=0.1).run(50.0, [30.0, 49.0])
    assert found == pytest.approx([100.0, 10.0 + 0.5 * (0.1 * 20 + 100 - 200)], rel=TOLERANCE)


def test_the_algorithm_runs_on_in_manual() -> None:
    ctl = controller(1.0, (-math.inf, math.inf), Kp=1.0, Ki=0.5)
    assert ctl.run(50.0, np.full(4, 48.0), [0, 0, 0, 1], 7.0).tolist() == [7.0, 7.0, 7.0, 5.0]


@pytest.mark.parametrize("Tf", [0.05, 0.25])
def test_a_filter_time_up_to_half_the_interval_is_refused(Tf: float) -> None:
    with pytest.raises(PidemuError):
        controller(0.5, (0, 100), Kp=1.0, Kd=1.0, Tf=Tf)


@pytest.mark.parametrize("wrong", [{"b": -0.1}, {"c": -0.1}, {"Tf": -1.0}, {"rRampMax": -1.0}])
def test_negative_weights_times_and_ramps_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(PidemuError):
        pidemu.load_card("gnc-tools/cpid").settings({"Kp": 1.0, "Kd": 1.0, **wrong})


def test_a_signal_that_is_not_finite_changes_nothing_and_the_last_output_stands() -> None:
    record = signals(6).always_auto()
    pv = record.pv.copy()
    pv[[20, 21, 90]] = math.nan, math.inf, -math.inf
    oracle, expected = Cpid(1.5, 0.2, 0.8, 0.9, (0, 100), rRampMax=20), [0.0]
    for sp, y in zip(record.sp.tolist(), pv.tolist(), strict=True):
        expected.append(oracle.scan(sp, y, True, 0.0, 0.5) if math.isfinite(y) else expected[-1])
    found = controller(0.5, (0, 100), Kp=1.5, Ki=0.2, Kd=0.8, Tf=0.9, rRampMax=20).run(record.sp, pv)
    assert close(found, expected[1:], TOLERANCE, oracle.size)


def test_changed_gains_leave_the_integral_as_it_stands() -> None:
    record = signals(13).always_auto()
    oracle = Cpid(1.0, 0.1, 0.5, 1.0, (0, 100))
    ctl = controller(0.5, (0, 100), Kp=1.0, Ki=0.1, Kd=0.5, Tf=1.0)
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.5)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.Kp, oracle.Ki = 3.0, 0.02
    ctl.change(Kp=3.0, Ki=0.02)
    expected = outputs(oracle, second, 0.5)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)
