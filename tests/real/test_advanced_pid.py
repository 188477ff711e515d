"""The Python package advanced-pid: its card, an oracle of its documented behaviour, and the package itself."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from advanced_pid import PID
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import Floats, Signals, close, outputs, signals, uneven

TOLERANCE = 1e-12
"""Double precision: a few units in the last place per scan, relative to the largest term."""


class AdvancedPid:
    """pid(t, e) with an error of setpoint less measurement; in manual it is called all the same, and its output is not used."""

    def __init__(self, Kp: float, Ki: float, Kd: float, Tf: float, limits: tuple[float, float]) -> None:
        self.Kp, self.Ki, self.Kd, self.Tf, self.limits = Kp, Ki, Kd, Tf, limits
        self.lagged: float | None = None
        self.integral = self.size = 0.0

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        error = sp - pv
        if self.lagged is None:
            self.lagged, dt = error, 0.0
        self.integral = min(max(self.integral + max(dt, 0.0) * self.Ki * error, self.limits[0]), self.limits[1])
        derivative = 0.0
        if self.Kd and self.Tf:
            share = math.exp(-max(dt, 0.0) / self.Tf)
            self.lagged = share * self.lagged + (1 - share) * error
            derivative = self.Kd / self.Tf * (error - self.lagged)
            self.size = max(self.size, abs(self.Kd / self.Tf * error))
        self.size = max(self.size, abs(self.Kp * error), abs(self.integral))
        output = min(max(self.Kp * error + self.integral + derivative, self.limits[0]), self.limits[1])
        return output if auto else manual


def package(Kp: float, Ki: float, Kd: float, Tf: float, limits: tuple[float, float], record: Signals, times: Floats) -> Floats:
    """What the real package returns, called in every scan and not used in manual."""
    pid = PID(Kp, Ki, Kd, Tf)
    pid.set_output_limits(*limits)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # time that runs backwards
        errors = (record.sp - record.pv).tolist()
        raw = np.array([pid(t, e) for t, e in zip(times.tolist(), errors, strict=True)])
    return np.where(record.auto > 0, raw, record.manual)


def controller(Kp: float, Ki: float, Kd: float, Tf: float, limits: tuple[float, float], scan: float = 0.5) -> pidemu.Controller:
    s = pidemu.load_card("advanced-pid/advanced-pid").settings(Kp=Kp, Ki=Ki, Kd=Kd, Tf=Tf)
    return pidemu.Controller(s, scan=scan, output_limits=limits)


gains = st.tuples(
    st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-8, 8).filter(lambda x: abs(x) > 1e-9),
    st.just(0.0) | st.floats(-2, 2).filter(lambda x: abs(x) > 1e-9),
    st.just(0.0) | st.floats(-20, 20).filter(lambda x: abs(x) > 1e-9),
    st.just(0.0) | st.floats(0.01, 30),
)
limits = st.sampled_from([(0.0, 100.0), (-20.0, 40.0), (10.0, 10.5), (-math.inf, math.inf), (-math.inf, 30.0)])
TINY = 1e-200


def sensible(g: tuple[float, float, float, float]) -> bool:
    """Gains whose products do not fall below the smallest numbers."""
    return all(x == 0 or abs(x) > TINY for x in g)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), gains=gains.filter(sensible), limits=limits, scan=st.sampled_from([0.05, 0.5, 2.0]))
def test_any_settings_agree_with_the_package_and_with_the_documented_computation(
    seed: int, gains: tuple[float, float, float, float], limits: tuple[float, float], scan: float
) -> None:
    record = signals(seed)
    times = np.arange(len(record), dtype=np.float64) * scan
    oracle = AdvancedPid(*gains, limits)
    expected = outputs(oracle, record, scan)
    real = package(*gains, limits, record, times)
    assert close(expected, real, 10 * TOLERANCE, oracle.size)  # the oracle is right; times are differences of large numbers
    found = controller(*gains, limits, scan).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), gains=gains.filter(sensible), limits=limits)
def test_intervals_that_are_uneven_zero_or_negative_agree_with_the_package(
    seed: int, gains: tuple[float, float, float, float], limits: tuple[float, float]
) -> None:
    record, intervals = signals(seed), uneven(seed, 200, 0.5)
    intervals[10::23] = 0.0
    intervals[15::31] = -0.75
    oracle = AdvancedPid(*gains, limits)
    expected = outputs(oracle, record, intervals)
    assert close(expected, package(*gains, limits, record, np.cumsum(intervals)), 10 * TOLERANCE, oracle.size)
    found = controller(*gains, limits).run(record.sp, record.pv, record.auto, record.manual, interval=intervals)
    assert close(found, expected, TOLERANCE, oracle.size)


def test_without_a_filter_time_there_is_no_derivative() -> None:
    record = signals(4).always_auto()
    with_kd = controller(1.0, 0.1, 5.0, 0.0, (0, 100)).run(record.sp, record.pv)
    without = controller(1.0, 0.1, 0.0, 0.0, (0, 100)).run(record.sp, record.pv)
    assert with_kd.tolist() == without.tolist()


def test_the_first_scan_does_not_integrate() -> None:
    assert controller(1.0, 0.5, 0.0, 0.0, (-100, 100), 1.0).run(50.0, [48.0, 48.0]).tolist() == [2.0, 3.0]


def test_the_integral_alone_is_clamped_to_the_output_limits() -> None:
    found = controller(1.0, 1.0, 0.0, 0.0, (0, 10), 1.0).run(50.0, [50.0, 0.0, 0.0, 52.0])
    assert found.tolist() == [0.0, 10.0, 10.0, 6.0]  # 10 - 2 of the integral, and P = -2


def test_without_integral_the_clamp_holds_the_sum_inside_limits_that_leave_out_zero() -> None:
    record = signals(0).always_auto()
    real = package(0.5, 0.0, 0.0, 0.0, (10, 90), record, np.arange(len(record), dtype=np.float64) * 0.5)
    assert close(controller(0.5, 0.0, 0.0, 0.0, (10, 90)).run(record.sp, record.pv), real, TOLERANCE)


def test_a_signal_that_is_not_a_number_goes_into_the_integral_and_stays() -> None:
    record = signals(2).always_auto()
    pv = record.pv.copy()
    pv[50] = math.nan
    broken = Signals(record.sp, pv, record.auto, record.manual)
    times = np.arange(len(record), dtype=np.float64) * 0.5
    real = package(1.0, 0.1, 0.5, 0.2, (0, 100), broken, times)
    found = controller(1.0, 0.1, 0.5, 0.2, (0, 100)).run(broken.sp, broken.pv)
    assert np.isnan(real[50:]).all()
    assert close(found, real, 10 * TOLERANCE, 100)


def test_changed_gains_leave_integral_and_lag_as_they_stand() -> None:
    record = signals(9).always_auto()
    pid = PID(1.0, 0.1, 0.5, 0.4)
    pid.set_output_limits(0, 100)
    ctl = controller(1.0, 0.1, 0.5, 0.4, (0, 100))
    real, found = [], []
    for k, e in enumerate((record.sp - record.pv).tolist()):
        if k == 100:
            pid.set_gains(2.0, 0.3, 1.5, 0.8)
            ctl.change(Kp=2.0, Ki=0.3, Kd=1.5, Tf=0.8)
        real.append(pid(0.5 * k, e))
        found.append(ctl.scan(float(record.sp[k]), float(record.pv[k])))
    assert close(found, real, 10 * TOLERANCE, 100)


@pytest.mark.parametrize("scan", [0.1, 0.5])
def test_the_derivative_of_a_step_decays_with_the_filter_time(scan: float) -> None:
    found = controller(0.0, 0.0, 1.0, 0.5, (-math.inf, math.inf), scan).run([0.0, 1.0, 1.0, 1.0], 0.0)
    assert found == pytest.approx([0.0] + [2.0 * math.exp(-k * scan / 0.5) for k in (1, 2, 3)], rel=TOLERANCE)
