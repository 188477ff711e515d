"""Modelica's LimPID against its two computations in plain Python, and against an accurate solution of its differential equations.

Orders measured here: slope of log error over log scan in three halvings, worst output over 12 s, scans of 16 to 2 ms, Td/Nd 0.2 s.

=============  ==================  =================
METHOD         nothing at a limit  windup at work
=============  ==================  =================
continuous     2.00, 2.00, 2.00    1.02, 1.01, 1.00
sampled        1.00, 1.00, 1.00    0.99, 1.00, 1.00
=============  ==================  =================
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import pidemu
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision; the order in which the terms are summed is free."""


@dataclass(frozen=True)
class Dials:
    """The block's parameters, with the values it has when nothing is said."""

    k: float = 1.0
    Ti: float = 0.5
    Td: float = 0.1
    wp: float = 1.0
    wd: float = 0.0
    Ni: float = 0.9
    Nd: float = 10.0
    kFF: float = 1.0
    kind: str = "PID"

    def card(self, method: str) -> pidemu.Settings:
        values = {n: getattr(self, n) for n in ("k", "Ti", "Td", "wp", "wd", "Ni", "Nd", "kFF")}
        return pidemu.load_card("modelica/limpid").settings(values, controllerType=self.kind, METHOD=method)


@dataclass
class Sampled:
    """The block with one rule for both of its states: a step from one instant to the next, at rest before the first."""

    d: Dials
    h: float
    low: float
    high: float
    method: str
    integral: float = 0.0
    slow: float = 0.0  # what the derivative block has followed its input to
    before: tuple[float, float] | None = None  # error and input of the derivative at the last instant
    size: float = field(default=1.0)

    def step(self, r: float, y: float, ff: float = 0.0) -> float:
        d, h = self.d, self.h
        e, x = r - y, d.wd * r - y
        lag = d.Td / d.Nd
        e1, x1 = self.before or (e, 0.0)
        if self.before is not None and "I" in d.kind:
            mean = e if self.method == "sampled" else (e + e1) / 2
            self.integral += d.k / d.Ti * h * mean
        rate = 0.0
        if "D" in d.kind and d.Td:  # slow' = (x - slow)/lag, the derivative is Td slow'
            if self.method == "sampled":
                self.slow = (lag * self.slow + h * x) / (lag + h)
            else:
                self.slow = ((2 * lag - h) * self.slow + h * (x + x1)) / (2 * lag + h)
            rate = (x - self.slow) / lag
        self.before = (e, x)
        parts = (d.k * (d.wp * r - y), self.integral, d.k * d.Td * rate, d.kFF * ff)
        total = sum(parts)
        out = min(max(total, self.low), self.high)
        if "I" in d.kind:
            self.integral += self.pull(total, out)
        self.size = max(self.size, *map(abs, parts), abs(d.k * d.Nd * x), abs(self.integral))
        return out

    def pull(self, total: float, out: float) -> float:
        """What the tracking adds to the integral: h/(Ni Ti) of what is cut off; an implicit solver's sum holds that already."""
        share = self.h / (self.d.Ni * self.d.Ti)
        if self.method == "sampled":
            total = (total + share * out) / (1 + share)  # solves v = total + share (out - v)
        return share * (out - total)


def expected(oracle: Sampled, record: Signals, ff: Floats | None = None) -> Floats:
    feed = np.zeros(len(record)) if ff is None else ff
    own = [oracle.step(r, y, f) for r, y, f in zip(record.sp, record.pv, feed, strict=True)]
    return np.where(record.auto > 0, own, record.manual)


dials = st.builds(
    Dials,
    k=st.floats(0.1, 20) | st.floats(-20, -0.1),
    Ti=st.floats(0.2, 200),
    Td=st.just(0.0) | st.floats(0.1, 20),
    wp=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
    wd=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
    Ni=st.floats(0.5, 5),
    Nd=st.floats(1, 20),
    kFF=st.floats(-2, 2),
    kind=st.sampled_from(["P", "PI", "PD", "PID"]),
)


@settings(max_examples=30)
@given(dials, st.sampled_from(["continuous", "sampled"]), st.floats(0.01, 0.2), st.sampled_from([1, 100]), st.integers(0, 10**6))
def test_every_controller_type_and_method_equals_the_stepwise_computation_also_at_limits_and_beside_manual_spells(
    d: Dials, method: str, h: float, longer: int, seed: int
) -> None:
    record = signals(seed)
    h *= longer if method == "sampled" else 1  # the explicit pull of the other method rings beyond twice the tracking time
    oracle = Sampled(d, h, 5.0, 90.0, method)
    want = expected(oracle, record)
    ctl = pidemu.Controller(d.card(method), scan=h, output_limits=(5.0, 90.0))
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), want, TOLERANCE, oracle.size)


@pytest.mark.parametrize("h", [0.5, 5.0, 50.0])
def test_however_long_the_step_an_implicit_solver_pulls_the_integral_back_to_the_limit_and_not_beyond(h: float) -> None:
    d = Dials(k=2.0, Ti=0.5, kind="PI", Ni=0.9)  # h is up to 111 tracking times
    ctl = pidemu.Controller(d.card("sampled"), scan=h, output_limits=(-1.0, 1.0))
    found = ctl.run(10.0, np.zeros(50))
    assert set(found.tolist()) == {1.0}
    steady = 1.0 + d.k * 10.0 * d.Ni  # the sum at which the pull takes what the error adds
    assert d.k * (ctl.state["I"] + 10.0) == pytest.approx(steady, rel=1e-6)
    oracle = Sampled(d, h, -1.0, 1.0, "sampled")
    for _ in range(50):
        oracle.step(10.0, 0.0)
    assert d.k * ctl.state["I"] == pytest.approx(oracle.integral, rel=1e-12)


@settings(max_examples=20)
@given(dials, st.sampled_from(["continuous", "sampled"]), st.integers(0, 10**6))
def test_the_feedforward_is_limited_and_pulls_the_integral_back_as_the_other_terms_do(d: Dials, method: str, seed: int) -> None:
    record = signals(seed).always_auto()
    ff = np.random.default_rng(seed).uniform(-100, 100, len(record)).round(2)
    oracle = Sampled(d, 0.1, 0.0, 100.0, method)
    want = expected(oracle, record, ff)
    ctl = pidemu.Controller(d.card(method), scan=0.1, output_limits=(0.0, 100.0))
    assert close(ctl.run(record.sp, record.pv, feedforward=ff), want, TOLERANCE, oracle.size)


# the differential equations


SMOOTH = Dials(k=1.5, Ti=2.0, Td=1.0, wp=0.8, wd=0.5, Ni=0.7, Nd=5.0)


def setpoint(t: float) -> float:
    """A smooth setpoint that starts at zero and at rest."""
    return 1 - math.cos(0.9 * t)


def measurement(t: float) -> float:
    """A smooth measurement that starts at zero."""
    return 0.6 * math.sin(0.7 * t) ** 2 + 0.1 * math.sin(2.3 * t)


def exact(d: Dials, low: float, high: float, times: Floats) -> Floats:
    """Return the block's output at the given instants, solved with a tolerance far below any scan's error."""
    lag = d.Td / d.Nd

    def total(t: float, integral: float, slow: float) -> float:
        r, y = setpoint(t), measurement(t)
        return d.k * (d.wp * r - y) + integral + d.k * d.Td * (d.wd * r - y - slow) / lag

    def slopes(t: float, state: Floats) -> list[float]:
        integral, slow = state
        r, y = setpoint(t), measurement(t)
        v = total(t, integral, slow)
        return [d.k / d.Ti * (r - y) + (min(max(v, low), high) - v) / (d.Ni * d.Ti), (d.wd * r - y - slow) / lag]

    solved = solve_ivp(slopes, (0.0, times[-1]), [0.0, 0.0], method="DOP853", t_eval=times, rtol=1e-11, atol=1e-12, max_step=0.01)
    assert solved.success
    out = [total(t, integral, slow) for t, integral, slow in zip(times, *solved.y, strict=True)]
    return np.clip(out, low, high)


def worst(method: str, h: float, low: float, high: float, reference: Floats) -> float:
    times = [n * h for n in range(reference.size)]
    ctl = pidemu.Controller(SMOOTH.card(method), scan=h, output_limits=(low, high))
    out = ctl.run([setpoint(t) for t in times], [measurement(t) for t in times])
    return float(np.max(np.abs(out - reference)))


def orders(method: str, low: float, high: float) -> list[float]:
    """Return the order of convergence in each of three halvings of the scan."""
    finest = 0.002
    solution = exact(SMOOTH, low, high, np.linspace(0.0, 12.0, 6001))
    errors = [worst(method, finest * every, low, high, solution[::every]) for every in (8, 4, 2, 1)]
    return [math.log2(a / b) for a, b in itertools.pairwise(errors)]


def test_the_record_reaches_both_limits_and_leaves_them() -> None:
    out = exact(SMOOTH, -0.4, 1.2, np.linspace(0.0, 12.0, 1201))
    inside = (out > -0.4) & (out < 1.2)
    assert (out == -0.4).sum() > 20
    assert (out == 1.2).sum() > 20
    assert np.count_nonzero(np.diff(inside.astype(int))) >= 4


@pytest.mark.parametrize(("method", "order", "slack"), [("continuous", 2.0, 0.02), ("sampled", 1.0, 0.03)])
def test_unlimited_the_methods_converge_to_the_differential_equations_with_the_orders_stated(
    method: str, order: float, slack: float
) -> None:
    assert orders(method, -1e6, 1e6) == pytest.approx([order] * 3, abs=slack)


@pytest.mark.parametrize("method", ["continuous", "sampled"])
def test_with_windup_at_work_both_methods_converge_with_the_first_order(method: str) -> None:
    assert orders(method, -0.4, 1.2) == pytest.approx([1.0] * 3, abs=0.15)


def test_the_block_as_it_comes_is_the_one_of_the_library() -> None:
    s = pidemu.load_card("modelica/limpid").settings()
    assert {name: v.value for name, v in s.items()} == {
        "k": 1, "Ti": 0.5, "Td": 0.1, "wp": 1, "wd": 0, "Ni": 0.9, "Nd": 10, "kFF": 1,
    }  # fmt: skip
