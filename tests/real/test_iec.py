"""The PID example of IEC 61131-3 against its printed text, and against outputs of MATIEC's compiled block."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import close, common_record, outputs, signals, trace

TRACE_TOLERANCE = 1e-6
"""Single precision has 24 bits, 6e-8; the trace is printed with nine digits."""

TOLERANCE = 5e-6
"""The sum is rounded in every one of 200 scans, and it multiplies by the gain in one order or the other."""

F = np.float32


class Iec:
    """PID with INTEGRAL and DERIVATIVE as the standard prints them, in REAL of 32 bits, with the literals of DERIVATIVE in 64."""

    def __init__(self, KP: float, TR: float, TD: float) -> None:
        self.KP, self.TR, self.TD = F(KP), F(TR), F(TD)
        self.sum, self.derivative = F(0), F(0)
        self.x1 = self.x2 = self.x3 = F(0)
        self.size = 0.0

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        cycle = F(dt)
        error = F(pv) - F(sp)
        if auto:
            self.sum = self.sum + error * cycle
            self.derivative = F((np.float64(3) * (error - self.x3) + self.x1 - self.x2) / (np.float64(10) * cycle))
            self.x1, self.x2, self.x3 = error, self.x1, self.x2
        else:
            self.sum = self.TR * (F(manual) - error)
            self.derivative = F(0)
            self.x1 = self.x2 = self.x3 = error
        terms = (error, self.sum / self.TR, self.derivative * self.TD)
        self.size = max(self.size, *(abs(float(self.KP * t)) for t in terms))
        return float(self.KP * (terms[0] + terms[1] + terms[2]))


def controller(KP: float, TR: float, TD: float, scan: float) -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card("iec/61131-3-pid").settings(KP=KP, TR=TR, TD=TD), scan=scan)


class TestTrace:
    """KP=-1.2 TR=8 TD=0.6, 500 ms."""

    def test_the_oracle_reproduces_the_real_block_and_its_terms(self) -> None:
        record, real = common_record(), trace("real_iec61131")
        oracle, found = Iec(-1.2, 8, 0.6), []
        for sp, pv, auto, manual in zip(record.sp, record.pv, record.auto, record.manual, strict=True):
            xout = oracle.scan(sp, pv, bool(auto), manual, 0.5)
            found.append((xout, float(oracle.sum), float(oracle.derivative)))
        for column, name in zip(np.array(found).T, ("xout", "iterm", "dterm"), strict=True):
            assert (column == real[name].astype(np.float32)).all(), name  # nine digits are all bits of single precision

    def test_the_card_reproduces_the_real_block(self) -> None:
        record, real = common_record(), trace("real_iec61131")
        found = controller(-1.2, 8, 0.6, 0.5).run(record.sp, record.pv, record.auto, record.manual)
        assert close(found, real["xout"], TRACE_TOLERANCE)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    KP=st.sampled_from([1.0, -1.0, 0.0]) | st.floats(0.1, 8) | st.floats(-8, -0.1),
    TR=st.floats(0.5, 500),
    TD=st.just(0.0) | st.floats(0.01, 20),
    scan=st.sampled_from([0.05, 0.5, 2.0]),
)
def test_any_settings_and_manual_spells_agree_with_the_printed_block(
    seed: int, KP: float, TR: float, TD: float, scan: float
) -> None:
    record = signals(seed)
    oracle = Iec(KP, TR, TD)
    expected = outputs(oracle, record, scan)
    found = controller(KP, TR, TD, scan).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


def test_every_output_is_a_single_precision_number() -> None:
    record = signals(3)
    found = controller(-1.7, 13, 0.9, 0.5).run(record.sp, record.pv, record.auto, record.manual)
    assert (found == found.astype(np.float32)).all()


def test_in_manual_the_output_is_the_gain_times_what_the_operator_asks_for() -> None:
    found = controller(-1.5, 10, 0, 1.0).run(50.0, [48.0, 47.0], 0, [20.0, 40.0])
    assert found == pytest.approx([-30.0, -60.0], rel=TRACE_TOLERANCE)


def test_the_transfer_goes_on_from_the_manual_output() -> None:
    found = controller(-2.0, 10, 0, 1.0).run(50.0, [50.0, 50.0], [0, 1], 20.0)
    assert found == pytest.approx([-40.0, -40.0], rel=TRACE_TOLERANCE)


def test_without_a_manual_scan_the_sum_and_the_history_begin_at_zero() -> None:
    found = controller(-1.0, 10, 2, 1.0).scan(50.0, 40.0)
    assert found == pytest.approx(-(-10 - 10 / 10 + 2 * 3 * -10 / 10), rel=TRACE_TOLERANCE)


def test_a_single_precision_sum_stands_still_when_the_increment_is_too_small() -> None:
    ctl = controller(-1.0, 1e6, 0, 0.01)
    start = ctl.run(50.0, 49.99, [0, 1], 40.0)[-1]
    assert ctl.run(50.0, np.full(500, 49.99))[-1] == start


def test_there_are_no_output_limits_unless_one_gives_them() -> None:
    assert controller(-100.0, 10, 0, 1.0).run(90.0, [90.0, 10.0], [0, 1], 0.0)[-1] == pytest.approx(8800.0, rel=TRACE_TOLERANCE)


@settings(max_examples=10)
@given(seed=st.integers(0, 10_000), KP=st.floats(0.2, 4), TR=st.floats(2, 100))
def test_a_changed_gain_or_reset_time_acts_on_the_whole_sum(seed: int, KP: float, TR: float) -> None:
    record = signals(seed).always_auto()
    oracle, ctl = Iec(-1.0, 20, 0.5), controller(-1.0, 20, 0.5, 0.5)
    for half, (kp, tr) in ((record.part(0, 100), (-1.0, 20.0)), (record.part(100, 200), (KP, TR))):
        oracle.KP, oracle.TR = F(kp), F(tr)
        ctl.change(KP=kp, TR=tr)
        expected = outputs(oracle, half, 0.5)
        assert close(ctl.run(half.sp, half.pv), expected, TOLERANCE, oracle.size)
