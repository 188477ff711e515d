"""Toshiba's PID3 in Python's whole numbers: hundredths of a percent, milliseconds, and two remainders that are carried."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.settings.action import Action
from tests.real.support import Floats, Signals, signals

MINUTE = 60_000
"""Milliseconds; a step of TI or TD, 0.001 min, is 60 of them, and a tenth of it 6."""


@dataclass(frozen=True)
class Dials:
    """KP in 0.01, TI and TD in 0.001 min, as the parameter words hold them."""

    KP: int
    TI: int
    TD: int

    def card(self) -> pidemu.Settings:
        return pidemu.load_card("toshiba/pid3").settings(KP=self.KP / 100, TI=self.TI / 1000, TD=self.TD / 1000)


@dataclass
class Pid3:
    """The instruction. MV counts in 1/100 of a count, so that KP times a sum is whole too; division is towards minus infinity."""

    d: Dials
    dt: int
    sign: int
    low: int
    high: int
    MV: int
    e1: int = 0
    PV1: int = 0
    D1: int = 0
    Ir: int = 0
    Dr: int = 0
    begun: bool = False
    automatic: bool = False

    def scan(self, SV: int, PV: int, auto: bool, manual: int) -> int:
        TI, TD = self.d.TI * MINUTE // 1000, self.d.TD * MINUTE // 1000
        e = SV - PV
        dP = e - self.e1 if self.begun else 0
        dI, self.Ir = divmod(e * self.dt + self.Ir, TI) if TI else (0, 0)
        before = self.PV1 if self.begun else PV
        dD, self.Dr = divmod(TD * (before - PV) - self.dt * self.D1 + self.Dr, self.dt + TD // 10) if TD else (0, 0)
        self.D1 += dD
        if not auto:
            self.MV = manual * 100
        else:
            change = self.d.KP * (dP + dI + dD) if self.automatic else 0
            self.MV = min(max(self.MV + self.sign * change, self.low * 100), self.high * 100)
        self.e1, self.PV1, self.begun, self.automatic = e, PV, True, auto
        return self.MV // 100


def counts(x: Floats) -> list[int]:
    return [round(v) for v in x * 100]


def percent(record: Signals) -> Signals:
    """Return a record in whole hundredths of a percent, as the inputs of the instruction are."""
    return Signals(record.sp.round(2), record.pv.round(2), record.auto, record.manual.round(2))


def expected(pid: Pid3, record: Signals) -> list[int]:
    columns = zip(counts(record.sp), counts(record.pv), record.auto > 0, counts(record.manual), strict=True)
    return [pid.scan(*row) for row in columns]


dials = st.builds(
    Dials,
    KP=st.just(0) | st.integers(1, 2000) | st.integers(1, 32767),
    TI=st.just(0) | st.integers(1, 2000) | st.integers(1, 32767),
    TD=st.just(0) | st.integers(1, 500) | st.integers(1, 32767),
)


@settings(max_examples=60)
@given(
    dials,
    st.integers(1, 50).map(lambda n: 100 * n),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0, 10_000), (2_000, 6_000), (-2_500, 12_500)]),
    st.integers(0, 10**6),
)
def test_the_card_equals_the_whole_numbers_exactly_at_both_limits_and_through_manual_spells(
    d: Dials, dt: int, action: Action, bounds: tuple[int, int], seed: int
) -> None:
    record = percent(signals(seed))
    pid = Pid3(d, dt, 1 if action == "reverse" else -1, *bounds, MV=4_000 * 100)
    want = expected(pid, record)
    limits = (bounds[0] / 100, bounds[1] / 100)
    ctl = pidemu.Controller(d.card(), scan=dt / 1000, action=action, output_limits=limits, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual)
    assert counts(found) == want
    assert found == pytest.approx(np.array(want) / 100, abs=1e-12)


def test_a_slow_integral_of_one_count_does_not_stand_still() -> None:
    d = Dials(KP=100, TI=30_000, TD=0)  # 30 min
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=50.0)
    out = ctl.run(50.01, np.full(3 * 1800 + 2, 50.0))  # 1 count of error for an hour and a half
    assert counts(out[[0, 1798, 1799, 3599, 5399]]) == [5000, 5000, 5001, 5002, 5003]


def test_without_the_remainders_it_would() -> None:
    e, dt, TI = 1, 1000, 30 * MINUTE
    assert sum(e * dt // TI for _ in range(5400)) == 0


@settings(max_examples=30)
@given(st.integers(1, 32767), st.integers(1, 100).map(lambda n: 100 * n), st.integers(0, 10**6))
def test_the_increments_of_the_integral_add_up_to_the_whole_part_of_the_exact_sum(TI: int, dt: int, seed: int) -> None:
    record = percent(signals(seed, 120).always_auto())
    e = [s - p for s, p in zip(counts(record.sp), counts(record.pv), strict=True)]
    pid = Pid3(Dials(100, TI, 0), dt, 1, -(10**9), 10**9, MV=0)
    out = expected(pid, record)
    exact = [Fraction(dt * sum(e[: n + 1]), TI * MINUTE // 1000) for n in range(len(e))]
    start = exact[0].__floor__()  # the first scan is a transfer: its increment is not used
    assert out == [e[n] - e[0] + exact[n].__floor__() - start for n in range(len(e))]
    ctl = pidemu.Controller(Dials(100, TI, 0).card(), scan=dt / 1000, output_limits=(-1e7, 1e7))
    assert counts(ctl.run(record.sp, record.pv)) == out


def test_the_filtered_derivative_follows_its_exact_lag_within_a_few_counts_and_comes_back_to_zero() -> None:
    TD = 500  # half a minute, filtered with 3 s
    ctl = pidemu.Controller(Dials(100, 0, TD).card(), scan=1.0, output_limits=(-1e5, 1e5), initial_output=0.0)
    pv = np.concatenate([[50.0], np.full(60, 51.0)])
    out = ctl.run(50.0, pv)
    n = np.arange(60)
    exact = -1.0 - 30 / (1 + 3) * (3 / 4) ** n  # P, and the backward rule's lag
    assert out[1:] == pytest.approx(exact, abs=0.05)
    assert out[-1] == pytest.approx(-1.0, abs=0.05)


def test_a_gain_between_two_steps_of_its_dial_is_refused() -> None:
    s = pidemu.load_card("toshiba/pid3").settings(KP=1.234, TI=1)
    with pytest.raises(pidemu.ScanError, match="gain"):
        pidemu.Controller(s, scan=1.0)


def test_a_scan_of_a_fraction_of_its_clock_is_refused() -> None:
    with pytest.raises(pidemu.ScanError, match="scan interval"):
        pidemu.Controller(Dials(100, 1000, 0).card(), scan=1 / 3)


@pytest.mark.parametrize("scan", [0.5, 1.0])
def test_the_limit_of_the_set_value_counts_control_intervals(scan: float) -> None:
    s = pidemu.load_card("toshiba/pid3").settings(KP=2, TI=0, DSV=0.25)
    out = pidemu.Controller(s, scan=scan, initial_output=40.0).run([50.0, 51.0, 51.0, 51.0, 51.0, 51.0], 50.0)
    assert counts(out) == [4000, 4050, 4100, 4150, 4200, 4200]
