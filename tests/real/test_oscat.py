"""OSCAT blocks against their documented computation; recorded outputs of the real ones stand in their cards."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import close, outputs, signals, uneven

TOLERANCE = 2e-5
"""REAL has 24 bits, 6e-8 per operation: the sum is rounded in every one of 200 scans, here in another order of factors."""

F = np.float32


class Integrate:
    """INTEGRATE: trapezoids by a clock of milliseconds; the first call keeps its input, and one that is not enabled does not."""

    def __init__(self) -> None:
        self.last: np.float32 | None = None

    def step(self, enabled: bool, x: np.float32, factor: np.float32, y: np.float32, dt: float) -> np.float32:
        if self.last is None:
            self.last = x
        elif enabled:
            y = (x + self.last) * F(0.5e-3) * F(round(dt * 1e3)) * factor + y
            self.last = x
        return y


class Deriv:
    """FT_DERIV: the difference over a clock of microseconds; the first call gives 0, and so does one without time."""

    def __init__(self) -> None:
        self.last: np.float32 | None = None

    def step(self, x: np.float32, factor: np.float32, dt: float) -> np.float32:
        if self.last is None:
            self.last = x
            return F(0)
        if dt == 0:
            return F(0)
        out = (x - self.last) / F(round(dt * 1e6)) * F(1e6) * factor
        self.last = x
        return out


def limited(low: float, x: np.float32, high: float) -> np.float32:
    return max(F(low), min(F(high), x))


class Base:
    """What the three blocks share: the error of setpoint less measurement in REAL, and that in manual they run on unused.

    `edge` is the nearest that P + I came to a limit that decides something.
    """

    def __init__(self, KP: float, TN: float, TV: float, low: float, high: float) -> None:
        self.KP, self.TN, self.TV, self.low, self.high = F(KP), F(TN), F(TV), low, high
        self.integrate, self.deriv = Integrate(), Deriv()
        self.integral = F(0)
        self.size, self.edge = 0.0, math.inf

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        output = float(self.block(F(sp) - F(pv), dt))
        return output if auto else float(F(manual))

    def block(self, x: np.float32, dt: float) -> np.float32:
        raise NotImplementedError

    def seen(self, *terms: np.float32) -> None:
        self.size = max(self.size, *(abs(float(t)) for t in terms))


class FtPid(Base):
    """`low` and `high` are ILIM_L and ILIM_H."""

    def block(self, x: np.float32, dt: float) -> np.float32:
        if self.TN > 0:
            self.integral = self.integrate.step(True, x, F(1) / self.TN, self.integral, dt)
            self.integral = limited(self.low, self.integral, self.high)
        derivative = self.deriv.step(x, self.TV, dt)
        self.seen(self.KP * x, self.KP * self.integral, self.KP * derivative)
        return self.KP * (self.integral + derivative + x)


class FtPidw(Base):
    """Frozen while P + I of the last call was not inside the limits."""

    frozen = False

    def block(self, x: np.float32, dt: float) -> np.float32:
        if self.TN == 0:
            self.integral = F(0)
        else:
            self.integral = self.integrate.step(not self.frozen, x, F(1) / self.TN, self.integral, dt)
        y = self.KP * (x + self.integral)
        derivative = self.KP * self.deriv.step(x, self.TV, dt)
        self.frozen = not (F(self.low) < y < F(self.high))
        self.edge = min(self.edge, abs(float(y) - self.low), abs(float(y) - self.high))
        self.seen(self.KP * x, self.KP * self.integral, derivative)
        return limited(self.low, y + derivative, self.high)


class FtPidwl(Base):
    """FT_PIWL, which limits P + I and sets the integral back, then the derivative, then the limits again."""

    last: np.float32 | None = None

    def block(self, x: np.float32, dt: float) -> np.float32:
        scaled = x * self.KP
        y = self.piwl(scaled, dt)
        derivative = self.deriv.step(x, self.KP * self.TV, dt)
        self.seen(scaled, self.integral, derivative)
        return limited(self.low, y + derivative, self.high)

    def piwl(self, x: np.float32, dt: float) -> np.float32:
        rate = F(1) / self.TN if self.TN else F(0)
        if self.last is None:  # the first call only prepares the block
            self.last = x
            return F(0)
        self.integral = (x + self.last) * F(5e-7) * rate * F(round(dt * 1e6)) + self.integral
        self.last = x
        y = x + self.integral
        self.edge = min(self.edge, abs(float(y) - self.low), abs(float(y) - self.high))
        for beyond, limit in ((y >= F(self.high), F(self.high)), (y <= F(self.low), F(self.low))):
            if beyond:
                self.integral = limit - x if rate else F(0)
                return limit
        return y


BLOCKS: dict[str, type[Base]] = {"ft-pid": FtPid, "ft-pidw": FtPidw, "ft-pidwl": FtPidwl}


def controller(block: str, KP: float, TN: float, TV: float, limits: tuple[float, float], scan: float = 0.5) -> pidemu.Controller:
    card = pidemu.load_card(f"oscat/{block}")
    if block == "ft-pid":
        return pidemu.Controller(card.settings(KP=KP, TN=TN, TV=TV, ILIM_L=limits[0], ILIM_H=limits[1]), scan=scan)
    return pidemu.Controller(card.settings(KP=KP, TN=TN, TV=TV), scan=scan, output_limits=limits)


WIDE = (-1e38, 1e38)

blocks = st.sampled_from(sorted(BLOCKS))
gains = st.sampled_from([1.0, -1.0, 0.0]) | st.floats(0.1, 8) | st.floats(-8, -0.1)
resets = st.just(0.0) | st.floats(0.5, 300)
rates = st.just(0.0) | st.floats(0.05, 20)
scans = st.sampled_from([0.05, 0.5, 2.0])


@settings(max_examples=60)
@given(seed=st.integers(0, 10_000), block=blocks, KP=gains, TN=resets, TV=rates, scan=scans)
def test_within_the_limits_the_blocks_agree_with_the_documented_computation(
    seed: int, block: str, KP: float, TN: float, TV: float, scan: float
) -> None:
    record = signals(seed)
    oracle = BLOCKS[block](KP, TN, TV, *WIDE)
    expected = outputs(oracle, record, scan)
    found = controller(block, KP, TN, TV, WIDE, scan).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


limits = st.sampled_from([(0.0, 100.0), (-20.0, 40.0), (10.0, 10.5), (-1e38, 30.0), (-5.0, 1e38)])


@settings(max_examples=120)
@given(seed=st.integers(0, 10_000), block=blocks, KP=gains, TN=resets, TV=rates, limits=limits, scan=scans)
def test_at_limits_the_blocks_agree_with_the_documented_computation(
    seed: int, block: str, KP: float, TN: float, TV: float, limits: tuple[float, float], scan: float
) -> None:
    record, oracle = signals(seed), BLOCKS[block](KP, TN, TV, *limits)
    expected = outputs(oracle, record, scan)
    assume(oracle.edge > TOLERANCE * oracle.size)  # else rounding puts P + I on one side of a limit or the other, and that decides
    found = controller(block, KP, TN, TV, limits, scan).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), block=blocks, KP=gains, TN=resets, TV=rates)
def test_the_interval_is_the_measured_one(seed: int, block: str, KP: float, TN: float, TV: float) -> None:
    record, intervals = signals(seed), uneven(seed, 200, 0.5)
    oracle = BLOCKS[block](KP, TN, TV, *WIDE)
    expected = outputs(oracle, record, intervals)
    found = controller(block, KP, TN, TV, WIDE).run(record.sp, record.pv, record.auto, record.manual, interval=intervals)
    assert close(found, expected, TOLERANCE, oracle.size)


@pytest.mark.parametrize("block", sorted(BLOCKS))
def test_every_output_is_a_single_precision_number(block: str) -> None:
    record = signals(3).always_auto()
    found = controller(block, 1.7, 13.0, 0.9, (0, 100)).run(record.sp, record.pv)
    assert (found == found.astype(np.float32)).all()


@pytest.mark.parametrize("block", ["ft-pid", "ft-pidw"])
def test_the_first_call_is_proportional_only(block: str) -> None:
    assert controller(block, 2.0, 10.0, 3.0, WIDE, 1.0).scan(50.0, 46.0) == 8.0


def test_the_first_call_of_ft_pidwl_gives_zero() -> None:
    assert controller("ft-pidwl", 2.0, 10.0, 3.0, WIDE, 1.0).scan(50.0, 46.0) == 0.0


def test_the_limits_of_ft_pid_are_those_of_the_integral_before_the_gain() -> None:
    ctl = controller("ft-pid", 4.0, 1.0, 0.0, (-2.0, 3.0), 1.0)
    assert ctl.run(50.0, [40.0, 40.0, 40.0, 50.0])[-1] == 12.0


def test_ft_pidw_freezes_whichever_way_the_integral_would_move_and_goes_on_from_the_input_before() -> None:
    ctl = controller("ft-pidw", 1.0, 10.0, 0.0, (0.0, 10.0), 1.0)
    # integral 0, then (4 + 4)/2/10; at 20 the sum is beyond, after (4 + 20)/2/10 = 1.2 more
    found = ctl.run(50.0, [46.0, 46.0, 30.0, 48.0, 48.0])
    # the scan after the freeze does not integrate; the next takes the mean of 2 and of 20, the last input before the freeze
    assert found == pytest.approx([4.0, 4.4, 10.0, 2 + 1.6, 2 + 1.6 + (2 + 20) / 20], rel=1e-6)


def test_ft_pidwl_limits_p_and_i_before_the_derivative_is_added() -> None:
    ctl = controller("ft-pidwl", 1.0, 10.0, 1.0, (0.0, 10.0), 1.0)
    # P + I is 9 + (5 + 9)/20, then 20 + 0.7 + (9 + 20)/20, which becomes 10, so I is -10; the derivatives are 4, 11 and -5
    found = ctl.run(50.0, [45.0, 41.0, 30.0, 35.0])
    assert found == pytest.approx([0.0, 10.0, 10.0, 15 - 10 + (20 + 15) / 20 - 5], rel=1e-6)


@pytest.mark.parametrize("block", ["ft-pid", "ft-pidw"])
def test_a_changed_gain_acts_on_what_has_been_integrated(block: str) -> None:
    record = signals(21).always_auto()
    oracle, ctl = BLOCKS[block](1.0, 20.0, 0.5, *WIDE), controller(block, 1.0, 20.0, 0.5, WIDE)
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.5)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.KP, oracle.TN = F(3.0), F(50.0)
    ctl.change(KP=3.0, TN=50.0)
    expected = outputs(oracle, second, 0.5)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)


def test_a_changed_gain_of_ft_pidwl_leaves_the_integral_as_it_stands() -> None:
    ctl = controller("ft-pidwl", 1.0, 10.0, 0.0, WIDE, 1.0)
    before = ctl.run(50.0, [48.0, 48.0, 48.0, 50.0])[-1]
    ctl.change(KP=5.0)
    assert ctl.scan(50.0, 50.0) == pytest.approx(before, rel=1e-6)


def test_a_signal_that_is_not_a_number_stays_in_the_sum() -> None:
    found = controller("ft-pid", 1.0, 10.0, 0.0, WIDE, 1.0).run(50.0, [48.0, math.nan, 48.0])
    assert np.isnan(found).tolist() == [False, True, True]
