"""Dahlin's algorithm against a recursion of its own, and against what it is designed for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.settings.action import Action
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision: the output is a sum of 200 increments."""


@dataclass(frozen=True)
class Process:
    """Gain, time constant and dead time of the process, and the time constant wished for."""

    Kp: float
    tau: float
    theta: float
    lam: float

    def card(self) -> pidemu.Settings:
        given: dict[str, object] = {"Kp": self.Kp, "tau": self.tau, "theta": self.theta, "lambda": self.lam}
        return pidemu.load_card("generic/dahlin").settings(given)

    def sampled(self, h: float) -> tuple[float, float, int]:
        """Return p, q and the whole scans of dead time."""
        return math.exp(-h / self.tau), math.exp(-h / self.lam), round(self.theta / h)


@dataclass
class Dahlin:
    """D(z) multiplied out: u = q u1 + (1-q) u(N+1) + (1-q)/(Kp (1-p)) (e - p e1), on the limited outputs."""

    d: Process
    h: float
    sign: float
    low: float
    high: float
    last: float
    past: list[float] = field(default_factory=list)
    e1: float = 0.0
    automatic: bool = False
    size: float = field(default=1.0)

    def scan(self, r: float, y: float, auto: bool, manual: float) -> float:
        p, q, N = self.d.sampled(self.h)
        gain, e = (1 - q) / (self.d.Kp * (1 - p)), self.sign * (r - y)
        past = self.past or [self.last] * (N + 1)  # before the first scan the output was the initial one, and for long
        if not auto:
            u = manual
        elif not self.automatic:  # no increment at the transfer; what went before counts as it was, by hand or not
            u = min(max(past[-1], self.low), self.high)
        else:
            u = q * past[-1] + (1 - q) * past[-(N + 1)] + gain * (e - p * self.e1)
            u = min(max(u, self.low), self.high)
        self.past = [*past, u][-(N + 1) :]
        self.size = max(self.size, abs(gain * e), abs(u))
        self.e1, self.automatic = e, auto
        return u


def expected(dahlin: Dahlin, record: Signals) -> Floats:
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, strict=True)
    return np.array([dahlin.scan(*row) for row in columns])


processes = st.builds(
    Process,
    Kp=st.floats(0.2, 5) | st.floats(-5, -0.2),
    tau=st.floats(2, 300),
    theta=st.just(0.0) | st.floats(0.1, 30),
    lam=st.floats(1, 200),
)


@settings(max_examples=60)
@given(
    processes,
    st.floats(0.5, 5),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)]),
    st.integers(0, 10**6),
)
def test_the_card_equals_the_recursion_at_both_limits_and_through_manual_spells(
    d: Process, h: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    dahlin = Dahlin(d, h, 1.0 if action == "reverse" else -1.0, *bounds, last=40.0)
    want = expected(dahlin, record)
    ctl = pidemu.Controller(d.card(), scan=h, action=action, output_limits=bounds, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, want, TOLERANCE, 100 * dahlin.size)


def test_what_the_operator_did_within_the_dead_time_is_still_on_its_way_after_the_transfer() -> None:
    d = Process(2.0, 10.0, 3.0, 5.0)
    _, q, N = d.sampled(1.0)
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    out = ctl.run(50.0, np.full(9, 50.0), [1, 0, 0, 0, 1, 1, 1, 1, 1], [0, 42, 46, 54, 0, 0, 0, 0, 0])
    want = [40.0, 42.0, 46.0, 54.0, 54.0]
    for _ in range(4):  # without error only the history moves it
        want.append(q * want[-1] + (1 - q) * want[-(N + 1)])
    assert out == pytest.approx(want)


@settings(max_examples=40)
@given(
    st.floats(0.2, 5),
    st.floats(2, 100),
    st.integers(0, 20),
    st.floats(0.5, 50),
    st.floats(0.2, 3),
)
def test_with_the_process_it_is_designed_for_the_setpoint_response_is_a_lag_of_lambda_behind_the_dead_time(
    Kp: float, tau: float, N: int, lam: float, h: float
) -> None:
    d = Process(Kp, tau, N * h, lam)
    p, q, _ = d.sampled(h)
    ctl = pidemu.Controller(d.card(), scan=h, output_limits=(-1e9, 1e9), initial_output=50.0)
    ctl.scan(20.0, 20.0)
    y, deviation, sent = 20.0, 0.0, [0.0] * (N + 1)
    for k in range(120):  # the setpoint steps by 1 in scan 0; the process is held between scans
        sent.append(ctl.scan(21.0, y) - 50.0)
        deviation = p * deviation + Kp * (1 - p) * sent[-(N + 1)]
        y = 20.0 + deviation
        wanted = 1 - q ** (k + 1 - N) if k >= N else 0.0
        assert deviation == pytest.approx(wanted, abs=1e-9)


def test_the_controller_gain_of_a_process_without_dead_time_is_that_of_a_pi_controller_with_the_processs_time() -> None:
    d = Process(2.0, 10.0, 0.0, 5.0)
    p, q, _ = d.sampled(1.0)
    ctl = pidemu.Controller(d.card(), scan=1.0, output_limits=(-1e9, 1e9))
    moves = np.diff(ctl.run([50.0, 51.0, 51.0, 51.0], 50.0))
    first = (1 - q) / (2.0 * (1 - p))
    assert moves == pytest.approx([first, first * (1 - p), first * (1 - p)])


def test_dead_time_is_rounded_to_whole_scans() -> None:
    def run(theta: float) -> Floats:
        ctl = pidemu.Controller(Process(2.0, 10.0, theta, 5.0).card(), scan=1.0)
        return ctl.run([50.0, *[51.0] * 20], 50.0)

    assert (run(3.4) == run(3.0)).all()
    assert (run(2.6) == run(3.0)).all()
    assert (run(3.6) == run(4.0)).all()
    assert (run(3.6) != run(3.0)).any()


def test_more_dead_time_than_a_thousand_scans_is_refused() -> None:
    with pytest.raises(pidemu.ScanError, match="dead time"):
        pidemu.Controller(Process(2.0, 10.0, 2000.0, 5.0).card(), scan=1.0)
