"""King's four incremental equations in his notation: E = PV - SP, the increment taken off the output of a reverse-acting loop."""

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
"""Double precision: the output is a sum of 200 increments."""

SEEN: dict[str, tuple[float, float]] = {"4": (1.0, 1.0), "7": (1.0, 0.0), "8": (0.0, 0.0)}
"""Share of the setpoint that P and D see, by equation; 13 has it as settings."""


@dataclass(frozen=True)
class Dials:
    """Gain, times in minutes, equation and its weights."""

    Kc: float
    Ti: float
    Td: float
    equation: str
    alpha: float = 1.0
    beta: float = 1.0

    def card(self) -> pidemu.Settings:
        given: dict[str, object] = {"Kc": self.Kc, "Ti": self.Ti, "Td": self.Td, "EQUATION": self.equation}
        if self.equation == "13":
            given |= {"alpha": self.alpha, "beta": self.beta}
        return pidemu.load_card("king/velocity").settings(given)


@dataclass
class King:
    """One equation, scan by scan."""

    d: Dials
    ts: float
    action: Action
    low: float
    high: float
    M: float
    x: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)
    automatic: bool = False
    size: float = field(default=1.0)

    def scan(self, SP: float, PV: float, auto: bool, manual: float) -> float:
        d = self.d
        alpha, beta = SEEN.get(d.equation, (d.alpha, d.beta))
        E = PV - SP
        self.x = [*(self.x or [PV - alpha * SP]), PV - alpha * SP][-2:]
        self.y = [*(self.y or [PV - beta * SP] * 2), PV - beta * SP][-3:]
        ts, Ti, Td = self.ts / 60, d.Ti, d.Td  # minutes
        terms = (
            d.Kc * (self.x[1] - self.x[0]),
            d.Kc * ts / Ti * E,
            d.Kc * Td / ts * (self.y[2] - 2 * self.y[1] + self.y[0]),
        )
        if not auto:
            self.M = manual
        else:
            change = sum(terms) if self.automatic else 0.0  # none in the first automatic scan
            self.M = min(max(self.M + (change if self.action == "direct" else -change), self.low), self.high)
        self.automatic = auto
        self.size = max(self.size, *map(abs, terms), abs(d.Kc * PV), abs(d.Kc * Td / ts * PV))
        return self.M


def expected(king: King, record: Signals) -> Floats:
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, strict=True)
    return np.array([king.scan(*row) for row in columns])


dials = st.builds(
    Dials,
    Kc=st.just(0.0) | st.floats(0.1, 10),
    Ti=st.floats(0.05, 60) | st.just(np.inf),
    Td=st.just(0.0) | st.floats(0.01, 5),
    equation=st.sampled_from(["4", "7", "8", "13"]),
    alpha=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
    beta=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
)


@settings(max_examples=60)
@given(
    dials,
    st.floats(0.2, 10),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)]),
    st.integers(0, 10**6),
)
def test_every_equation_is_the_card_under_that_choice(
    d: Dials, ts: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    king = King(d, ts, action, *bounds, M=40.0)
    want = expected(king, record)
    ctl = pidemu.Controller(d.card(), scan=ts, action=action, output_limits=bounds, initial_output=40.0)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), want, TOLERANCE, 10 * king.size)


def moves(equation: str, n: int = 5, **more: float) -> Floats:
    """Return the output's moves after a setpoint step of 1 in the second scan: Kc = 1, Td = 0.5 min, ts = 1 s, as published."""
    d = Dials(Kc=1.0, Ti=np.inf, Td=0.5, equation=equation, **more)
    ctl = pidemu.Controller(d.card(), scan=1.0, output_limits=(-1000.0, 1000.0), initial_output=50.0)
    sp = np.where(np.arange(n + 1) > 0, 51.0, 50.0)
    return np.diff(ctl.run(sp, np.full(n + 1, 50.0)))


def test_the_derivative_of_the_error_makes_the_published_spike_of_thirty_and_takes_it_back() -> None:
    proportional = 1.0
    assert moves("4") == pytest.approx([30 + proportional, -30, 0, 0, 0], abs=1e-12)


def test_the_derivative_of_the_measurement_makes_no_spike() -> None:
    assert moves("7") == pytest.approx([1, 0, 0, 0, 0], abs=1e-12)


def test_with_the_proportional_on_the_measurement_too_only_the_integral_answers_a_setpoint() -> None:
    assert moves("8").tolist() == [0.0] * 5
    d = Dials(Kc=1.0, Ti=1.0, Td=0.5, equation="8")
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=50.0)
    assert np.diff(ctl.run([50.0, 51.0, 51.0, 51.0], 50.0)) == pytest.approx([1 / 60] * 3)


def test_by_the_equation_weights_of_one_are_the_error_and_of_zero_the_measurement_whatever_the_text_says() -> None:
    assert (moves("13", alpha=1.0, beta=1.0) == moves("4")).all()
    assert (moves("13", alpha=1.0, beta=0.0) == moves("7")).all()
    assert (moves("13", alpha=0.0, beta=0.0) == moves("8")).all()
    assert moves("13", alpha=0.4, beta=0.1) == pytest.approx([3.4, -3, 0, 0, 0], abs=1e-12)


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.floats(0.1, 5), st.floats(0.1, 20), st.just(0.0) | st.floats(0.001, 2))
def test_all_equations_answer_a_load_alike(seed: int, Kc: float, Ti: float, Td: float) -> None:
    pv = signals(seed).pv
    outs = []
    for equation in ("4", "7", "8", "13"):
        d = Dials(Kc, Ti, Td, equation, 0.3, 0.7)
        ctl = pidemu.Controller(d.card(), scan=1.0, output_limits=(-1e9, 1e9), initial_output=50.0)
        outs.append(ctl.run(50.0, pv))
    for other in outs[1:]:
        assert close(other, outs[0], 1e-11, Kc * (1 + 60 * Td) * 100)
