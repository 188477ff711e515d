"""ArduPilot's AC_PID against its documented computation; recorded outputs of the real one stand in its card."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import close, outputs, signals

TOLERANCE = 2e-5
"""Floats have 24 bits, 6e-8 per operation: the integral is rounded in every one of 200 scans, here in another order of factors."""

F = np.float32
EPSILON = F(np.finfo(np.float32).eps)


def positive(x: np.float32) -> bool:
    """What the vehicle's mathematics takes for a sign: from the single-precision epsilon up."""
    return bool(x >= EPSILON)


class AcPid:
    """update_all; the caller limits the output, uses it in automatic only, and reports in the next scan that it was at a limit.

    `edge` is the nearest that the sum came to a limit: rounding could put it on the other side, and the integral with it.
    """

    def __init__(
        self,
        P: float,
        I: float,  # noqa: E741
        D: float,
        IMAX: float,
        filters: tuple[float, float, float] = (0.0, 0.0, 0.0),
        limits: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:
        self.P, self.I, self.D, self.IMAX, self.filters, self.limits = F(P), F(I), F(D), F(IMAX), filters, limits
        self.target = self.error = self.derivative = self.integral = F(0)
        self.fresh, self.at_limit = True, False
        self.size, self.edge = 0.0, math.inf

    def share(self, hertz: float, dt: np.float32) -> np.float32:
        if hertz == 0:
            return F(1)
        return dt / (dt + F(1) / (F(2 * math.pi) * F(hertz)))

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        if not (math.isfinite(sp) and math.isfinite(pv)):
            return 0.0
        self.update(F(sp), F(pv), F(dt))
        self.integrate(F(dt))
        terms = (self.error * self.P, self.integral, self.derivative * self.D)
        self.size = max(self.size, *(abs(float(t)) for t in terms))
        raw = float(terms[0] + terms[1] + terms[2])
        self.edge = min(self.edge, abs(raw - self.limits[0]), abs(raw - self.limits[1]))
        output = min(max(raw, self.limits[0]), self.limits[1])
        self.at_limit = output in self.limits
        return output if auto else float(F(manual))

    def update(self, target: np.float32, measurement: np.float32, dt: np.float32) -> None:
        if self.fresh:
            self.fresh, self.target, self.error = False, target, target - measurement
            return
        last = self.error
        self.target += self.share(self.filters[0], dt) * (target - self.target)
        self.error += self.share(self.filters[1], dt) * ((self.target - measurement) - self.error)
        self.derivative += self.share(self.filters[2], dt) * ((self.error - last) / dt - self.derivative)

    def integrate(self, dt: np.float32) -> None:
        if abs(self.I) < EPSILON:
            self.integral = F(0)
            return
        shrinks = (positive(self.integral) and positive(-self.error)) or (positive(-self.integral) and positive(self.error))
        if not self.at_limit or shrinks:
            self.integral = min(max(self.integral + self.error * self.I * dt, -self.IMAX), self.IMAX)


def controller(
    P: float,
    I: float,  # noqa: E741
    D: float,
    IMAX: float,
    filters: tuple[float, float, float] = (0.0, 0.0, 0.0),
    limits: tuple[float, float] = (-math.inf, math.inf),
    scan: float = 0.0025,
) -> pidemu.Controller:
    card = pidemu.load_card("ardupilot/ac-pid")
    s = card.settings(P=P, I=I, D=D, IMAX=IMAX, FLTT=filters[0], FLTE=filters[1], FLTD=filters[2])
    return pidemu.Controller(s, scan=scan, output_limits=limits)


hertz = st.just(0.0) | st.floats(0.05, 40)
gains = st.tuples(st.just(0.0) | st.floats(0.01, 4), st.just(0.0) | st.floats(0.01, 4), st.just(0.0) | st.floats(0.001, 2))


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    gains=gains,
    IMAX=st.sampled_from([0.0, 0.5, 20.0, 1000.0]),
    filters=st.tuples(hertz, hertz, hertz),
    scan=st.sampled_from([0.0025, 0.02, 0.5]),
)
def test_any_settings_and_filters_agree_with_the_documented_computation(
    seed: int, gains: tuple[float, float, float], IMAX: float, filters: tuple[float, float, float], scan: float
) -> None:
    record = signals(seed)
    oracle = AcPid(*gains, IMAX, filters)
    expected = outputs(oracle, record, scan)
    ctl = controller(*gains, IMAX, filters, scan=scan)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), expected, TOLERANCE, oracle.size)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    P=st.just(0.0) | st.floats(0.1, 4),
    I=st.just(0.0) | st.floats(0.05, 2),
    D=st.just(0.0) | st.floats(0.01, 1),
    IMAX=st.sampled_from([5.0, 1e6]),
    limits=st.sampled_from([(-30.0, 30.0), (-10.0, 20.0), (-0.5, 40.0), (10.0, 10.5), (-math.inf, 15.0)]),
    scan=st.sampled_from([0.02, 0.5]),
)
def test_at_a_limit_card_and_usual_caller_agree(
    seed: int,
    P: float,
    I: float,  # noqa: E741
    D: float,
    IMAX: float,
    limits: tuple[float, float],
    scan: float,
) -> None:
    record, oracle = signals(seed), AcPid(P, I, D, IMAX, (0, 0, 2.0), limits)
    expected = outputs(oracle, record, scan)
    assume(oracle.edge > TOLERANCE * oracle.size)
    found = controller(P, I, D, IMAX, (0, 0, 2.0), limits, scan).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


def test_at_a_limit_the_integral_may_only_shrink() -> None:
    errors = [-20.0, 6.0, 6.0, 1.0, 1.0]  # the integral is below zero when the output is at the high limit
    oracle = AcPid(10.0, 0.05, 0.0, 100.0, limits=(-50.0, 50.0))
    found = controller(10.0, 0.05, 0.0, 100.0, limits=(-50.0, 50.0), scan=1.0).run(errors, 0.0)
    assert close(found, [oracle.scan(e, 0.0, True, 0.0, 1.0) for e in errors], TOLERANCE)


def test_an_integral_of_zero_does_not_leave_a_limit_by_itself() -> None:
    # at the low limit after the first scan: the integral would grow, but from zero that is not shrinking
    found = controller(1.0, 0.5, 0.0, 100.0, limits=(10.0, 50.0), scan=1.0).run([0.0, 4.0, 4.0, 4.0], 0.0)
    assert found.tolist() == [10.0, 10.0, 10.0, 10.0]


def test_the_first_scan_is_at_no_limit_whatever_the_initial_output() -> None:
    assert controller(0.0, 1.0, 0.0, 100.0, limits=(0.0, 50.0), scan=1.0).run([-5.0, 20.0], 0.0).tolist() == [0.0, 15.0]


def test_with_a_negative_integral_gain_the_flag_lets_the_integral_grow_and_the_card_lets_it_shrink() -> None:
    errors = [-20.0, 60.0, 3.0]  # the integral is 10, then -20 with the output at the low limit; it would become -21.5
    oracle = AcPid(-1.0, -0.5, 0.0, 100.0, limits=(-50.0, 50.0))
    assert [oracle.scan(e, 0.0, True, 0.0, 1.0) for e in errors] == [30.0, -50.0, -3 - 21.5]
    found = controller(-1.0, -0.5, 0.0, 100.0, limits=(-50.0, 50.0), scan=1.0).run(errors, 0.0)
    assert found.tolist() == [30.0, -50.0, -3 - 20.0]


def test_a_target_or_measurement_that_is_not_finite_gives_zero_and_changes_nothing() -> None:
    record = signals(8).always_auto()
    pv = record.pv.copy()
    pv[[30, 31, 120]] = math.nan, math.inf, -math.inf
    oracle = AcPid(1.0, 0.3, 0.1, 50.0, (2.0, 3.0, 5.0))
    expected = [oracle.scan(r, y, True, 0.0, 0.02) for r, y in zip(record.sp.tolist(), pv.tolist(), strict=True)]
    found = controller(1.0, 0.3, 0.1, 50.0, (2.0, 3.0, 5.0), scan=0.02).run(record.sp, pv)
    assert found[[30, 31, 120]].tolist() == [0.0, 0.0, 0.0]
    assert close(found, expected, TOLERANCE, oracle.size)


def test_the_integral_is_limited_both_ways() -> None:
    ctl = controller(0.0, 10.0, 0.0, 2.5, scan=0.1)
    assert ctl.run(50.0, np.full(50, 40.0))[-1] == 2.5
    assert ctl.run(50.0, np.full(50, 60.0))[-1] == -2.5


def test_a_filter_of_zero_hertz_lets_the_signal_through() -> None:
    assert controller(2.0, 0.0, 0.0, 1.0).run([50.0, 55.0], 50.0).tolist() == [0.0, 10.0]


def test_the_filters_begin_at_the_first_signals_so_that_nothing_kicks() -> None:
    found = controller(1.0, 0.0, 1.0, 1.0, (0.5, 0.5, 5.0)).run(50.0, np.full(5, 47.0))
    assert found == pytest.approx(np.full(5, 3.0), rel=1e-6)


def test_every_output_is_a_single_precision_number() -> None:
    record = signals(3).always_auto()
    found = controller(0.7, 0.3, 0.05, 20.0, (3.0, 4.0, 5.0), (-50, 50), 0.02).run(record.sp, record.pv)
    assert (found == found.astype(np.float32)).all()


def test_a_changed_derivative_gain_acts_at_once_on_what_the_filter_holds() -> None:
    record = signals(14).always_auto()
    oracle, ctl = AcPid(1.0, 0.3, 0.4, 50.0, (0, 0, 0.5)), controller(1.0, 0.3, 0.4, 50.0, (0, 0, 0.5), scan=0.1)
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.1)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.D = F(1.2)
    ctl.change(D=1.2)
    expected = outputs(oracle, second, 0.1)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)


def test_changed_gains_leave_the_integral_as_it_stands() -> None:
    record = signals(12).always_auto()
    oracle, ctl = AcPid(1.0, 0.3, 0.1, 50.0, (0, 0, 5.0)), controller(1.0, 0.3, 0.1, 50.0, (0, 0, 5.0), scan=0.02)
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.02)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.P, oracle.I = F(2.0), F(0.05)
    ctl.change(P=2.0, I=0.05)
    expected = outputs(oracle, second, 0.02)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)
