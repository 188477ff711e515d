"""EPICS epid record against its documented behaviour, and against outputs of the real thing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import Floats, Signals, close, common_record, outputs, signals, trace, uneven

TOLERANCE = 1e-12
"""Double precision: a few units in the last place per scan, relative to the largest term."""


class Epid:
    """The record with soft device support: feedback off is manual, and OUTL holds what record or operator wrote last.

    `edge` is the nearest that the sum came to a limit: rounding could put it on the other side, and the integral with it.
    """

    def __init__(self, KP: float, KI: float, KD: float, low: float, high: float, ODEL: float = 0.0, outl: float = 0.0) -> None:
        self.KP, self.KI, self.KD, self.low, self.high, self.ODEL = KP, KI, KD, low, high, ODEL
        self.outl, self.last_error, self.oval, self.feedback = outl, 0.0, 0.0, False
        self.P = self.I = self.D = 0.0
        self.size, self.edge = 0.0, math.inf

    def scan(self, sp: float, pv: float, auto: bool, manual: float, dt: float) -> float:
        if not auto:
            self.outl = manual
        error = sp - pv
        self.P = self.KP * error
        self.D = self.KP * self.KD * (error - self.last_error) / dt
        increment = self.KP * self.KI * error * dt
        if auto and not self.feedback:
            self.I = self.outl
        elif auto:
            inside = self.low < self.oval < self.high
            leads_back = (self.oval >= self.high and increment < 0) or (self.oval <= self.low and increment > 0)
            if inside or leads_back:
                self.I = min(max(self.I + increment, self.low), self.high)
        if self.KI == 0:
            self.I = 0.0
        wanted = self.P + self.I + self.D
        self.edge = min(self.edge, abs(wanted - self.low), abs(wanted - self.high))
        total = min(max(wanted, self.low), self.high)
        if self.ODEL == 0 or abs(total - self.oval) > self.ODEL:
            self.oval = total
        self.last_error, self.feedback = error, auto
        self.size = max(self.size, abs(self.P), abs(self.I), abs(self.D))
        if auto:
            self.outl = self.oval
        return self.outl


def controller(
    KP: float, KI: float, KD: float, scan: float, limits: tuple[float, float], ODEL: float = 0.0, initial_output: float = 0.0
) -> pidemu.Controller:
    s = pidemu.load_card("epics/epid").settings(KP=KP, KI=KI, KD=KD, ODEL=ODEL)
    return pidemu.Controller(s, scan=scan, output_limits=limits, initial_output=initial_output)


def written(oval: Floats, record: Signals) -> Floats:
    """What stands at OUTL: the record's output with feedback on, the operator's with feedback off."""
    return np.where(record.auto > 0, oval, record.manual)


class TestTrace:
    """KP=1.2 KI=0.12 KD=0.6, limits 0 and 100, 0.5 s."""

    def test_the_oracle_reproduces_the_real_record_and_its_terms(self) -> None:
        record, real = common_record(), trace("real_epid")
        oracle = Epid(1.2, 0.12, 0.6, 0, 100)
        terms = []
        for sp, pv, auto, manual in zip(record.sp, record.pv, record.auto, record.manual, strict=True):
            oracle.scan(sp, pv, bool(auto), manual, 0.5)
            terms.append((oracle.oval, oracle.P, oracle.I, oracle.D))
        for found, name in zip(np.array(terms).T, ("oval", "P", "I", "D"), strict=True):
            assert close(found, real[name], TOLERANCE, oracle.size), name

    def test_the_card_reproduces_the_real_record(self) -> None:
        record, real = common_record(), trace("real_epid")
        found = controller(1.2, 0.12, 0.6, 0.5, (0, 100)).run(record.sp, record.pv, record.auto, record.manual)
        size = max(np.abs(real[name]).max() for name in ("P", "I", "D"))
        assert close(found, written(real["oval"], record), TOLERANCE, size)

    def test_the_record_is_driven_to_both_limits(self) -> None:
        real = trace("real_epid")["oval"]
        assert (real == 0).any()
        assert (real == 100).any()


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    KP=st.sampled_from([0.0, 1.0, -1.0]) | st.floats(0.01, 8) | st.floats(-8, -0.01),
    KI=st.just(0.0) | st.floats(0.001, 2),
    KD=st.just(0.0) | st.floats(0.01, 20),
    scan=st.sampled_from([0.1, 0.5, 2.0]),
    limits=st.sampled_from([(0.0, 100.0), (-20.0, 40.0), (10.0, 10.5), (-math.inf, math.inf), (30.0, math.inf)]),
)
def test_any_settings_and_manual_spells_agree_with_the_documented_computation(
    seed: int, KP: float, KI: float, KD: float, scan: float, limits: tuple[float, float]
) -> None:
    if KP == 0 and KI:
        KI = 0.0
    record = signals(seed)
    record.manual.clip(*limits, out=record.manual)  # what is loaded from beyond them is a case of its own
    before = min(max(50.0, limits[0]), limits[1])
    oracle = Epid(KP, KI, KD, *limits, outl=before)
    expected = outputs(oracle, record, scan)
    assume(oracle.edge > TOLERANCE * oracle.size)
    ctl = controller(KP, KI, KD, scan, limits, initial_output=before)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, expected, TOLERANCE, oracle.size)


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), KP=st.floats(0.2, 4), KI=st.floats(0.01, 1), KD=st.just(0.0) | st.floats(0.001, 4))
def test_the_interval_is_the_measured_one(seed: int, KP: float, KI: float, KD: float) -> None:
    record, intervals = signals(seed), uneven(seed, 200, 0.5)
    oracle = Epid(KP, KI, KD, 0, 100)
    expected = outputs(oracle, record, intervals)
    assume(oracle.edge > TOLERANCE * oracle.size)
    found = controller(KP, KI, KD, 0.5, (0, 100)).run(record.sp, record.pv, record.auto, record.manual, interval=intervals)
    assert close(found, expected, TOLERANCE, oracle.size)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    KP=st.floats(0.2, 4),
    KI=st.floats(0.01, 1),
    ODEL=st.sampled_from([0.0, 0.5, 5.0]),
    limits=st.sampled_from([(-1e6, 1e6), (0.0, 100.0), (-20.0, 40.0)]),
)
def test_the_output_deadband_holds_small_changes_back(
    seed: int, KP: float, KI: float, ODEL: float, limits: tuple[float, float]
) -> None:
    record = signals(seed).always_auto()
    oracle = Epid(KP, KI, 0, *limits, ODEL)
    expected = outputs(oracle, record, 0.5)
    assume(oracle.edge > TOLERANCE * oracle.size)
    found = controller(KP, KI, 0, 0.5, limits, ODEL).run(record.sp, record.pv)
    assert close(found, expected, TOLERANCE, oracle.size)


def test_an_output_held_back_just_before_a_limit_is_not_at_the_limit() -> None:
    sp, pv = np.full(4, 50.0), np.array([46.4, 46.1, 46.1, 49.0])  # 18, and then 20 is too small a change
    oracle, ctl = Epid(5.0, 0.1, 0, 0, 20, 4.0), controller(5.0, 0.1, 0, 1.0, (0, 20), 4.0)
    record = Signals(sp, pv, np.ones(4), np.zeros(4))
    assert close(ctl.run(sp, pv), outputs(oracle, record, 1.0), TOLERANCE)


def test_feedback_bumps_by_the_proportional_term_when_it_is_switched_on() -> None:
    ctl = controller(2.0, 0.1, 0.0, 1.0, (0, 100))
    assert ctl.run(50.0, [45.0, 45.0], [0, 1], 30.0).tolist() == [30.0, 40.0]


def test_the_first_scan_with_feedback_loads_what_stands_at_the_output() -> None:
    ctl = controller(1.0, 0.1, 0.0, 1.0, (0, 100), initial_output=25.0)
    assert ctl.scan(50.0, 48.0) == pytest.approx(27.0, rel=TOLERANCE)


def test_a_value_beyond_the_limits_is_loaded_as_it_is() -> None:
    ctl = controller(1.0, 0.1, 0.0, 1.0, (0, 100))
    assert ctl.run([50.0, 50.0], [50.0, 60.0], [0, 1], 120.0).tolist() == [120.0, 100.0]  # 120 - 10 is still beyond


def test_a_value_loaded_beyond_the_limits_stays_in_the_record_while_it_is_frozen_and_is_limited_in_the_card() -> None:
    record = Signals(np.full(4, 50.0), np.array([50.0, 50.0, 49.0, 80.0]), np.array([0.0, 1, 1, 1]), np.full(4, 120.0))
    oracle = Epid(1.0, 0.1, 0.0, 0, 100)
    assert outputs(oracle, record, 1.0).tolist() == [120.0, 100.0, 100.0, 70.0]  # 120 - 3 is limited to 100, and P is -30
    found = controller(1.0, 0.1, 0.0, 1.0, (0, 100)).run(record.sp, record.pv, record.auto, record.manual)
    assert found.tolist() == pytest.approx([120.0, 100.0, 100.0, 67.0])  # already 100 one scan before, then 100 - 3


def test_in_manual_the_output_deadband_compares_with_the_records_own_output_and_in_the_card_with_the_operators() -> None:
    record = Signals(np.full(3, 50.0), np.array([40.0, 40.0, 40.0]), np.array([1.0, 0, 1]), np.full(3, 23.0))
    oracle = Epid(1.0, 0.1, 0.0, 0, 100, ODEL=5.0, outl=20.0)
    assert outputs(oracle, record, 1.0).tolist() == [30.0, 23.0, 33.0 - 3.0]  # 33 is near the 30 that OVAL still is
    found = controller(1.0, 0.1, 0.0, 1.0, (0, 100), 5.0, 20.0).run(record.sp, record.pv, record.auto, record.manual)
    assert found.tolist() == [30.0, 23.0, 33.0]


def test_without_gain_the_record_holds_what_was_loaded_and_the_card_gives_zero() -> None:
    record = signals(5).always_auto()
    assert set(outputs(Epid(0.0, 0.1, 0.0, 0, 100, outl=25.0), record, 1.0).tolist()) == {25.0}
    assert set(controller(0.0, 0.1, 0.0, 1.0, (0, 100), 0.0, 25.0).run(record.sp, record.pv).tolist()) == {0.0}


def test_without_integral_the_output_is_proportional_whatever_it_was_before() -> None:
    ctl = controller(2.0, 0.0, 0.0, 1.0, (0, 100))
    assert ctl.run(50.0, [40.0, 40.0], [0, 1], 70.0).tolist() == [70.0, 20.0]


def test_a_changed_gain_leaves_the_integral_as_it_stands() -> None:
    record = signals(7).always_auto()
    oracle, ctl = Epid(1.0, 0.1, 0.5, 0, 100), controller(1.0, 0.1, 0.5, 0.5, (0, 100))
    first, second = record.part(0, 100), record.part(100, 200)
    expected = outputs(oracle, first, 0.5)
    assert close(ctl.run(first.sp, first.pv), expected, TOLERANCE, oracle.size)
    oracle.KP, oracle.KI = 3.0, 0.02
    ctl.change(KP=3.0, KI=0.02)
    expected = outputs(oracle, second, 0.5)
    assert close(ctl.run(second.sp, second.pv), expected, TOLERANCE, oracle.size)
