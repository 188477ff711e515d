"""MathWorks' pid2 and pidstd2 against their documented transfer functions, simulated by scipy from the zero state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import pidemu
from pidemu.errors import ScanError
from tests.real.support import Floats, Signals, close, signals

FORMULAS = ("ForwardEuler", "BackwardEuler", "Trapezoidal")
TOLERANCE = 1e-12
"""Double precision; scipy sums the same terms in another order."""


def integrator(formula: str, h: float) -> tuple[Floats, Floats]:
    """Return numerator and denominator of IF(z) or DF(z), in powers of 1/z."""
    top = {"ForwardEuler": [0.0, h], "BackwardEuler": [h, 0.0], "Trapezoidal": [h / 2, h / 2]}[formula]
    return np.array(top), np.array([1.0, -1.0])


@dataclass(frozen=True)
class Dials:
    """Parallel gains, weights, formulas and sample time."""

    Kp: float
    Ki: float
    Kd: float
    Tf: float
    b: float
    c: float
    integral: str
    derivative: str
    h: float

    def card(self, form: str) -> pidemu.Settings:
        given: dict[str, object] = {"b": self.b, "c": self.c, "IFormula": self.integral, "DFormula": self.derivative, "FORM": form}
        if form == "parallel":
            given |= {"Kp": self.Kp, "Ki": self.Ki, "Kd": self.Kd, "Tf": self.Tf}
        else:
            Td = self.Kd / self.Kp
            Ti, N = self.Kp / self.Ki if self.Ki else "off", Td / self.Tf if self.Tf else "off"
            given |= {"Kp": self.Kp, "Ti": Ti, "Td": Td, "N": N}
        return pidemu.load_card("mathworks/pid2").settings(given)

    def simulated(self, r: Floats, y: Floats) -> tuple[Floats, float]:
        """Return u = Kp (b r - y) + Ki IF(z) (r - y) + Kd/(Tf + DF(z)) (c r - y), and the largest number in it."""
        top, bottom = integrator(self.integral, self.h)
        integral = lfilter(self.Ki * top, bottom, r - y)
        top, bottom = integrator(self.derivative, self.h)
        filtered = lfilter(self.Kd * bottom, self.Tf * bottom + top, self.c * r - y) if self.Kd else np.zeros_like(r)
        proportional = self.Kp * (self.b * r - y)
        jump = abs(self.Kd) / (self.Tf + self.h) * np.abs(self.c * r - y).max()
        size = max(float(np.abs(x).max()) for x in (integral, filtered, proportional))
        return proportional + integral + filtered, max(size, jump)


@st.composite
def dials(draw: st.DrawFn) -> Dials:
    h = draw(st.floats(0.05, 2))
    derivative = draw(st.sampled_from(FORMULAS))
    Tf = draw(st.floats(0.6, 20)) * h  # above half the sample time: stable by every formula
    if derivative == "BackwardEuler" and draw(st.booleans()):
        Tf = 0.0
    signed = st.floats(0.1, 20) | st.floats(-20, -0.1)
    return Dials(
        Kp=draw(st.just(0.0) | signed),
        Ki=draw(st.just(0.0) | st.floats(0.01, 2) | st.floats(-2, -0.01)),
        Kd=draw(st.just(0.0) | st.floats(0.1, 20) | st.floats(-20, -0.1)),
        Tf=Tf,
        b=draw(st.sampled_from([0.0, 1.0]) | st.floats(0, 2)),
        c=draw(st.sampled_from([0.0, 1.0]) | st.floats(0, 2)),
        integral=draw(st.sampled_from(FORMULAS)),
        derivative=derivative,
        h=h,
    )


def starts(record: Signals, at_rest: bool) -> tuple[Floats, Floats]:
    """Return setpoint and measurement, behind one sample at zero or away from zero at once."""
    lead = [0.0] if at_rest else []
    return np.concatenate([lead, record.sp]), np.concatenate([lead, record.pv])


@settings(max_examples=40)
@given(dials(), st.integers(0, 10**6), st.booleans())
def test_the_parallel_form_equals_its_transfer_functions(d: Dials, seed: int, at_rest: bool) -> None:
    r, y = starts(signals(seed), at_rest)
    want, size = d.simulated(r, y)
    assert close(pidemu.Controller(d.card("parallel"), scan=d.h).run(r, y), want, TOLERANCE, size)


@settings(max_examples=40)
@given(dials(), st.integers(0, 10**6), st.booleans())
def test_the_standard_form_equals_the_parallel_gains_it_stands_for(d: Dials, seed: int, at_rest: bool) -> None:
    assume(d.Kp)  # it multiplies all terms
    assume(d.Ki * d.Kp >= 0)
    assume(d.Kd * d.Kp >= 0)  # times are not negative
    assume(d.Kd or not d.Tf)  # without derivative time there is no divisor that gives a filter
    r, y = starts(signals(seed), at_rest)
    want, size = d.simulated(r, y)
    assert close(pidemu.Controller(d.card("standard"), scan=d.h).run(r, y), want, 10 * TOLERANCE, size)


@pytest.mark.parametrize("formula", FORMULAS)
def test_every_pair_of_formulas_is_right_on_one_record(formula: str) -> None:
    for other in FORMULAS:
        d = Dials(2.0, 0.3, 4.0, 1.5, 0.6, 0.2, formula, other, 0.5)
        r, y = starts(signals(7), False)
        want, size = d.simulated(r, y)
        assert close(pidemu.Controller(d.card("parallel"), scan=0.5).run(r, y), want, TOLERANCE, size)


@pytest.mark.parametrize(("formula", "share"), [("ForwardEuler", 0.0), ("BackwardEuler", 1.0), ("Trapezoidal", 0.5)])
def test_from_the_zero_state_an_integrator_counts_this_share_of_the_first_error(formula: str, share: float) -> None:
    d = Dials(0.0, 0.3, 0.0, 1.5, 1.0, 1.0, formula, "BackwardEuler", 0.5)
    assert pidemu.Controller(d.card("parallel"), scan=0.5).scan(54.0, 50.0) == pytest.approx(share * 0.3 * 0.5 * 4.0)


def test_a_spell_in_manual_leaves_the_transfer_function_running() -> None:
    record = signals(3)
    d = Dials(2.0, 0.3, 4.0, 1.5, 0.6, 0.2, "BackwardEuler", "Trapezoidal", 0.5)
    want, size = d.simulated(record.sp, record.pv)
    found = pidemu.Controller(d.card("parallel"), scan=0.5).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, np.where(record.auto > 0, want, record.manual), TOLERANCE, size)


def test_nothing_is_limited() -> None:
    d = Dials(50.0, 5.0, 0.0, 1.0, 1.0, 1.0, "BackwardEuler", "BackwardEuler", 1.0)
    out = pidemu.Controller(d.card("parallel"), scan=1.0).run(np.full(100, 90.0), np.full(100, 10.0))
    assert out[-1] == pytest.approx(50 * 80 + 5 * 80 * 100)


@pytest.mark.parametrize("Tf", [0.2, 0.5])
def test_a_forward_euler_filter_faster_than_half_the_sample_time_is_refused(Tf: float) -> None:
    settings_ = pidemu.load_card("mathworks/pid2").settings(Kp=1, Kd=1, Tf=Tf)
    with pytest.raises(ScanError, match="forward rule is unstable"):
        pidemu.Controller(settings_, scan=1.0)
