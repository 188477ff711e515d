"""National Instruments' fast and precise PID from the equations of the manual, the integral corrected to what a limit leaves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.settings.action import Action
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision; the order in which the terms are summed is free."""


@dataclass(frozen=True)
class Dials:
    """Gain, times in minutes, setpoint factor and linearity; the fast algorithm has both at 1."""

    Kc: float
    Ti: float
    Td: float
    algorithm: str
    beta: float = 1.0
    L: float = 1.0

    def card(self) -> pidemu.Settings:
        given: dict[str, object] = {"Kc": self.Kc, "Ti": self.Ti, "Td": self.Td, "ALGORITHM": self.algorithm}
        if self.algorithm == "precise":
            given |= {"BETA": self.beta, "LINEARITY": self.L}
        return pidemu.load_card("ni/pid").settings(given)


@dataclass
class Ni:
    """The function, called every dt seconds."""

    d: Dials
    dt: float
    sign: float
    low: float
    high: float
    last: float
    sum: float = 0.0
    e1: float | None = None
    PV1: float | None = None
    automatic: bool = False
    size: float = field(default=1.0)

    def call(self, SP: float, PV: float, auto: bool, manual: float) -> float:
        d, dt, K = self.d, self.dt / 60, self.sign * self.d.Kc  # minutes
        beta, L = (d.beta, d.L) if d.algorithm == "precise" else (1.0, 1.0)

        def weighed(x: float) -> float:
            return x * (L + (1 - L) * abs(x) / 100)

        e = weighed(SP - PV)
        e1, PV1 = (e, PV) if self.e1 is None or self.PV1 is None else (self.e1, self.PV1)
        uP = K * weighed(beta * SP - PV)
        uD = -K * d.Td / dt * (PV - PV1)
        grown = K / d.Ti * (e + e1) / 2 * dt
        self.e1, self.PV1 = e, PV
        if not auto:
            u = manual
        else:
            self.sum = self.sum + grown if self.automatic else self.last - uP - uD  # without a bump
            total = uP + self.sum + uD
            u = min(max(total, self.low), self.high)
            if total >= self.high or total <= self.low:
                self.sum = u - uP - uD
        self.size = max(self.size, abs(uP), abs(uD), abs(grown), abs(self.sum), abs(K * d.Td / dt * PV), abs(K * PV))
        self.last, self.automatic = u, auto
        return u


def expected(ni: Ni, record: Signals) -> Floats:
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, strict=True)
    return np.array([ni.call(*row) for row in columns])


dials = st.builds(
    Dials,
    Kc=st.floats(0.05, 20),
    Ti=st.floats(0.02, 60),
    Td=st.just(0.0) | st.floats(0.001, 2),
    algorithm=st.sampled_from(["fast", "precise"]),
    beta=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
    L=st.sampled_from([0.0, 0.1, 1.0]) | st.floats(0, 1),
)


@settings(max_examples=60)
@given(
    dials,
    st.floats(0.05, 5),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(-100.0, 100.0), (0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)]),
    st.integers(0, 10**6),
)
def test_both_algorithms_equal_the_manuals_equations_at_both_limits_and_through_manual_spells(
    d: Dials, dt: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    ni = Ni(d, dt, 1.0 if action == "reverse" else -1.0, *bounds, last=40.0)
    want = expected(ni, record)
    ctl = pidemu.Controller(d.card(), scan=dt, action=action, output_limits=bounds, initial_output=40.0)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), want, TOLERANCE, 10 * ni.size)


def test_the_precise_algorithm_with_beta_and_linearity_of_one_is_the_fast_one() -> None:
    record = signals(5)
    fast, precise = (pidemu.Controller(Dials(2.0, 0.5, 0.1, name).card(), scan=1.0) for name in ("fast", "precise"))
    found = precise.run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, fast.run(record.sp, record.pv, record.auto, record.manual), TOLERANCE, 2 * 6 * 100)


def test_a_linearity_of_a_tenth_leaves_a_tenth_of_the_gain_at_the_setpoint_and_all_of_it_at_the_whole_range() -> None:
    def kick(step: float) -> float:
        ctl = pidemu.Controller(Dials(2.0, 1e9, 0.0, "precise", L=0.1).card(), scan=1.0, output_limits=(-1e6, 1e6))
        return float(np.diff(ctl.run([0.0, step], 0.0))[0])

    assert kick(0.001) == pytest.approx(2.0 * 0.1 * 0.001, rel=1e-4)
    assert kick(100.0) == pytest.approx(2.0 * 100.0)


def test_the_setpoint_factor_weighs_the_kick_and_with_linearity_the_gain_depends_on_where_the_setpoint_lies() -> None:
    def kick(sp: float, L: float) -> float:
        ctl = pidemu.Controller(Dials(2.0, 1e9, 0.0, "precise", beta=0.5, L=L).card(), scan=1.0, output_limits=(-1e6, 1e6))
        return float(np.diff(ctl.run([sp, sp + 0.001], sp))[0]) / 0.001

    assert kick(20.0, 1.0) == pytest.approx(1.0, rel=1e-6)
    assert kick(80.0, 1.0) == pytest.approx(1.0, rel=1e-6)
    assert kick(80.0, 0.1) > 2.5 * kick(20.0, 0.1)


@pytest.mark.parametrize(
    ("algorithm", "changed"),
    [
        ("fast", {"Kc": 7.0}),
        ("fast", {"Ti": 2e6}),
        ("precise", {"Kc": 7.0}),
        ("precise", {"BETA": 0.9}),
        ("precise", {"LINEARITY": 0.8}),
    ],
)
def test_a_setting_changed_while_running_does_not_move_the_output(algorithm: str, changed: dict[str, float]) -> None:
    d = Dials(2.0, 1e6, 0.0, algorithm, beta=0.4, L=0.3)  # so slow an integral that it does not move the output by itself
    ctl = pidemu.Controller(d.card(), scan=1.0, output_limits=(-1e6, 1e6))
    before = ctl.run(60.0, np.minimum(np.arange(40.0, 60.0), 52.0))
    ctl.change(changed)
    assert ctl.run(60.0, [52.0, 52.0]) == pytest.approx([before[-1]] * 2, abs=1e-5)


def test_the_gains_as_delivered_integrate_a_hundred_times_a_minute() -> None:
    s = pidemu.load_card("ni/pid").settings()
    assert [s[n].value for n in ("Kc", "Ti", "Td")] == [1.0, 0.01, 0.0]
    ctl = pidemu.Controller(s, scan=0.1, output_limits=(-1e6, 1e6))
    out = ctl.run(1.0, np.zeros(601))  # an error of 1 for a minute
    assert out[-1] - out[0] == pytest.approx(100.0)
