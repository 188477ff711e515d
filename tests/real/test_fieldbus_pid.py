"""Yokogawa's fieldbus PID block: I-PD in automatic, PI-D in cascade, written with PV - SP as the manual has it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

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
class Dials:
    """The block's parameters."""

    GAIN: float
    RESET: float
    RATE: float
    PV_FTIME: float = 0.0
    SP_RATE_UP: float = np.inf
    SP_RATE_DN: float = np.inf

    def card(self) -> pidemu.Settings:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return pidemu.load_card("yokogawa/fieldbus-pid").settings(values)


@dataclass
class Block:
    """One block. The change dMV is that of a direct-acting loop, and is taken off otherwise."""

    d: Dials
    dT: float
    action: Action
    low: float
    high: float
    OUT: float
    history: list[tuple[float, float]] = field(default_factory=list)  # PV and the setpoint in force, newest last
    automatic: bool = False
    SP: float = np.nan
    size: float = field(default=1.0)

    def scan(self, SP: float, IN: float, auto: bool, manual: float, CAS_IN: float, BKCAL_IN: float = np.nan) -> float:
        d, dT = self.d, self.dT
        cascade = auto and not np.isnan(CAS_IN)
        if cascade:
            SP = CAS_IN
        elif not np.isnan(self.SP):  # in each execution period, whatever its length
            SP = min(max(SP, self.SP - d.SP_RATE_DN), self.SP + d.SP_RATE_UP)
        self.SP = SP
        PV = IN if not self.history else (d.PV_FTIME * self.history[-1][0] + dT * IN) / (d.PV_FTIME + dT)
        self.history = [*(self.history or [(PV, SP)] * 2), (PV, SP)][-3:]
        (PV2, _), (PV1, SP1), _ = self.history
        terms = (
            d.GAIN * ((PV - SP) - (PV1 - SP1) if cascade else PV - PV1),
            d.GAIN * dT / d.RESET * (PV - SP),
            d.GAIN * d.RATE / dT * (PV - 2 * PV1 + PV2),
        )
        if not auto:
            self.OUT = manual
        else:
            dMV = sum(terms) if self.automatic else 0.0  # none in the first automatic scan
            read_back = self.OUT if np.isnan(BKCAL_IN) else BKCAL_IN
            self.OUT = min(max(read_back + (dMV if self.action == "direct" else -dMV), self.low), self.high)
        self.automatic = auto
        self.size = max(self.size, *map(abs, terms), d.GAIN * (abs(PV) + abs(SP)), d.GAIN * d.RATE / dT * abs(PV))
        return self.OUT


def remote(record: Signals, seed: int) -> Floats:
    """Return a remote setpoint in spells of cascade, NaN between them."""
    rng = np.random.default_rng(seed + 1)
    out = np.full(len(record), np.nan)
    for _ in range(4):
        start = int(rng.integers(0, len(record)))
        out[start : start + int(rng.integers(1, 40))] = rng.uniform(10, 90)
    drift = rng.normal(0, 0.5, len(record)) * (rng.random(len(record)) < 0.3)
    return (out + np.cumsum(drift)).round(3)


def read_back(record: Signals, seed: int) -> Floats:
    """Return a read-back output, NaN in spells where nothing is read back."""
    rng = np.random.default_rng(seed + 2)
    out = 50 + np.cumsum(rng.normal(0, 3, len(record)))
    for _ in range(3):
        start = int(rng.integers(0, len(record)))
        out[start : start + int(rng.integers(1, 40))] = np.nan
    return out.round(3)


def expected(block: Block, record: Signals, cascade: Floats, back: Floats | None = None) -> Floats:
    back = np.full(len(record), np.nan) if back is None else back
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, cascade, back, strict=True)
    return np.array([block.scan(*row) for row in columns])


dials = st.builds(
    Dials,
    GAIN=st.floats(0.05, 20),
    RESET=st.floats(0.5, 1000) | st.floats(0.1, 10000),
    RATE=st.just(0.0) | st.floats(0.1, 60),
    PV_FTIME=st.just(0.0) | st.floats(0.1, 20),
    SP_RATE_UP=st.just(np.inf) | st.floats(0.05, 20),
    SP_RATE_DN=st.just(np.inf) | st.floats(0.05, 20),
)


@settings(max_examples=60)
@given(
    dials,
    st.floats(0.1, 5),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)]),
    st.integers(0, 10**6),
)
def test_the_card_equals_the_published_increments_in_every_mode(
    d: Dials, dT: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    cascade = remote(record, seed)
    block = Block(d, dT, action, *bounds, OUT=40.0)
    want = expected(block, record, cascade)
    ctl = pidemu.Controller(d.card(), scan=dT, action=action, output_limits=bounds, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual, cascade=cascade)
    assert close(found, want, TOLERANCE, 10 * block.size)


@settings(max_examples=40)
@given(
    dials,
    st.floats(0.1, 5),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)]),
    st.integers(0, 10**6),
)
def test_the_change_is_added_to_what_is_read_back_from_downstream(
    d: Dials, dT: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    cascade, back = remote(record, seed), read_back(record, seed)
    block = Block(d, dT, action, *bounds, OUT=40.0)
    want = expected(block, record, cascade, back)
    ctl = pidemu.Controller(d.card(), scan=dT, action=action, output_limits=bounds, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual, cascade=cascade, external_reset=back)
    assert close(found, want, TOLERANCE, 10 * block.size)


def test_a_limit_downstream_that_is_read_back_does_not_wind_the_block_up() -> None:
    d = Dials(GAIN=1.0, RESET=10.0, RATE=0.0)

    def run(reads: bool) -> list[float]:
        ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=50.0)
        block, sent = Block(d, 1.0, "reverse", 0, 100, OUT=50.0), [50.0]
        for k in range(60):
            back = min(sent[-1], 60.0)  # downstream takes no more than 60
            SP = 60.0 if k < 40 else 40.0
            sent.append(ctl.scan(SP, 50.0, external_reset=back) if reads else ctl.scan(SP, 50.0))
            assert sent[-1] == pytest.approx(block.scan(SP, 50.0, True, 0.0, np.nan, back if reads else np.nan), abs=1e-9)
        return sent[1:]

    reading, alone = run(True), run(False)
    assert reading[39] == pytest.approx(61.0)  # one increment of 10 h/Ti beyond what is read back
    assert reading[40] == pytest.approx(59.0)
    assert alone[39] == pytest.approx(89.0)
    assert alone[40] == pytest.approx(88.0)


@settings(max_examples=20)
@given(dials, st.integers(0, 10**6))
def test_scan_by_scan_a_loop_that_goes_into_cascade_only_later_is_the_same_as_in_one_run(d: Dials, seed: int) -> None:
    record = signals(seed)
    cascade = remote(record, seed)
    whole = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    single = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    want = whole.run(record.sp, record.pv, record.auto, record.manual, cascade=cascade)
    found = [
        single.scan(r, y, auto=bool(a), manual=m, cascade=None if np.isnan(c) else c)
        for r, y, a, m, c in zip(record.sp, record.pv, record.auto, record.manual, cascade, strict=True)
    ]
    assert close(found, want, TOLERANCE, 100 * d.GAIN * (1 + d.RATE))


def test_a_change_of_mode_alone_does_not_move_the_output() -> None:
    d = Dials(GAIN=5.0, RESET=10000.0, RATE=10.0)
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    cascade = np.where(np.arange(30) // 10 == 1, 50.0, np.nan)  # the remote setpoint is the local one
    assert ctl.run(50.0, np.full(30, 50.0), cascade=cascade) == pytest.approx([40.0] * 30, abs=1e-12)


def test_a_remote_setpoint_that_differs_kicks_on_the_way_into_cascade_and_not_on_the_way_out() -> None:
    d = Dials(GAIN=2.0, RESET=100.0, RATE=0.0)
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    out = ctl.run(50.0, np.full(6, 50.0), cascade=[np.nan, np.nan, 53.0, 53.0, np.nan, np.nan])
    integral = 2.0 / 100 * 3.0
    assert np.diff(out) == pytest.approx([0.0, 2.0 * 3.0 + integral, integral, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("cascade", "kick"), [(False, 0.0), (True, 2.0)])
def test_a_setpoint_change_is_answered_by_integral_action_in_automatic_and_by_a_kick_as_well_in_cascade(
    cascade: bool, kick: float
) -> None:
    ctl = pidemu.Controller(Dials(GAIN=2.0, RESET=100.0, RATE=5.0).card(), scan=1.0, initial_output=40.0)
    sp = np.array([50.0, 50.0, 51.0, 51.0])
    out = ctl.run(sp, 50.0, cascade=sp) if cascade else ctl.run(sp, 50.0)
    assert np.diff(out) == pytest.approx([0.0, kick + 0.02, 0.02], abs=1e-12)


def test_the_load_is_answered_alike_in_both_modes() -> None:
    pv = signals(4).pv
    d = Dials(GAIN=1.5, RESET=30.0, RATE=4.0)
    auto, cascade = (pidemu.Controller(d.card(), scan=1.0, output_limits=(-1e6, 1e6)) for _ in range(2))
    assert close(cascade.run(50.0, pv, cascade=50.0), auto.run(50.0, pv), TOLERANCE, 1e5)


@pytest.mark.parametrize("dT", [0.25, 1.0, 4.0])
def test_the_setpoint_rates_count_execution_periods_and_only_the_local_setpoint(dT: float) -> None:
    d = Dials(GAIN=2.0, RESET=100.0, RATE=0.0, SP_RATE_UP=3.0, SP_RATE_DN=1.0)
    sp = np.array([50.0, 60.0, 60.0, 50.0, 50.0])
    out = pidemu.Controller(d.card(), scan=dT, initial_output=40.0).run(sp, 50.0)
    assert np.diff(out) == pytest.approx(2.0 * dT / 100 * np.array([3.0, 6.0, 5.0, 4.0]), rel=1e-12)
    ctl = pidemu.Controller(d.card(), scan=dT, initial_output=40.0)
    remote_step = ctl.run(50.0, np.full(3, 50.0), cascade=[50.0, 60.0, 60.0])
    assert np.diff(remote_step) == pytest.approx([2.0 * 10 + 0.2 * dT, 0.2 * dT], rel=1e-12)
