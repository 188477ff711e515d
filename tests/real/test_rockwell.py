"""Rockwell's Logix PID and PIDE instructions, written with the members and units of their manuals.

The manuals print continuous equations (PID) or pictures (PIDE). What they leave open is as the cards assume it: backward rules,
the time of the smoothing filter, and that only what pushes further is frozen.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision: the output is a sum of 200 increments."""

SMOOTHING = 1 / 16
"""Filter time as a share of the derivative dial's time: the SLC's, assumed here."""

Action = Literal["reverse", "direct"]
BOUNDS = st.sampled_from([(0.0, 100.0), (30.0, 60.0), (-1e9, 1e9)])
ACTIONS: st.SearchStrategy[Action] = st.sampled_from(["reverse", "direct"])


@dataclass(frozen=True)
class Pid:
    """Members of the PID tag, the bits as 0 and 1."""

    PE: int
    DOE: int
    NDF: int
    KP: float
    KI: float
    KD: float

    def card(self) -> pidemu.Settings:
        words = {"PE": ("independent", "dependent"), "DOE": ("PV", "error"), "NDF": ("off", "on")}
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return pidemu.load_card("allen-bradley/logix-pid").settings({**values, **{n: w[values[n]] for n, w in words.items()}})

    def gains(self) -> tuple[float, float, float, float]:
        """Kp, Ki [1/s] and Kd [s] by the conversions of 1756-RM003, p. 520, and the derivative time [s]."""
        if not self.PE:
            return self.KP, self.KI, self.KD, self.KD / self.KP
        return self.KP, self.KP / (60 * self.KI) if self.KI else 0.0, 60 * self.KP * self.KD, 60 * self.KD


@dataclass
class PidBlock:
    """One PID instruction, executed every UPD seconds: CV = KP E + Ki integral of E + Kd dE/dt + BIAS."""

    d: Pid
    UPD: float
    CA: int
    MINO: float
    MAXO: float
    CV: float
    accumulated: float = 0.0
    smoothed: float = 0.0
    previous: float | None = None
    automatic: bool = False
    size: float = field(default=1.0)

    def execute(self, SP: float, PV: float, auto: bool, SO: float, BIAS: float = 0.0) -> float:
        Kp, Ki, Kd, dial = self.d.gains()
        E, measured = (PV - SP, PV) if self.CA else (SP - PV, -PV)
        x = E if self.d.DOE else measured
        x1 = x if self.previous is None else self.previous
        Tf = 0.0 if self.d.NDF else SMOOTHING * dial
        self.previous = x
        self.smoothed = (Tf * self.smoothed + Kd * (x - x1)) / (Tf + self.UPD)
        rest = Kp * E + self.smoothed + BIAS
        growth = Ki * E * self.UPD
        if not auto:
            self.CV = SO
        else:
            if not Ki:
                self.accumulated = 0.0
            elif not self.automatic:
                self.accumulated = self.CV - rest  # calculated back: CV starts off from the set output
            elif not ((growth > 0 and self.CV >= self.MAXO) or (growth < 0 and self.CV <= self.MINO)):
                self.accumulated += growth
            self.CV = min(max(rest + self.accumulated, self.MINO), self.MAXO)
        self.automatic = auto
        self.size = max(self.size, Kp * abs(E), Kd / self.UPD * abs(PV), abs(growth), abs(rest), abs(self.accumulated))
        return self.CV


@dataclass(frozen=True)
class Pide:
    """Parameters of the PIDE block."""

    DependIndepend: bool
    PVEProportional: bool
    PVEDerivative: bool
    DSmoothing: bool
    PGain: float
    IGain: float
    DGain: float
    CVROCLimit: float = 0.0

    def card(self) -> pidemu.Settings:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        words = {n: str(v).lower() if isinstance(v, bool) else v for n, v in values.items()}
        return pidemu.load_card("allen-bradley/pide").settings(words)

    def gains(self) -> tuple[float, float, float]:
        """Kp, KI [1/s] and KD [s] from 1/min and min, or from minutes per repeat and min (1756-RM006, p. 80)."""
        if not self.DependIndepend:
            return self.PGain, self.IGain / 60, 60 * self.DGain
        return self.PGain, self.PGain / (60 * self.IGain) if self.IGain else 0.0, 60 * self.PGain * self.DGain


@dataclass
class PideBlock:
    """One PIDE block: CVn = CVn-1 + changes of the terms, with the error and the PV negated where ControlAction is set."""

    d: Pide
    DeltaT: float
    ControlAction: bool
    CVLLimit: float
    CVHLimit: float
    CV: float
    history: list[tuple[float, float]] = field(default_factory=list)  # of what P and D act on, newest last
    D: float = 0.0
    FF1: float = 0.0
    automatic: bool = False
    size: float = field(default=1.0)

    def execute(self, SP: float, PV: float, auto: bool, CVOper: float, CVPrevious: float = np.nan, FF: float = 0.0) -> float:
        d, dt = self.d, self.DeltaT
        Kp, KI, KD = d.gains()
        E, PVp = (PV - SP, -PV) if self.ControlAction else (SP - PV, PV)
        new = (-PVp if d.PVEProportional else E, -PVp if d.PVEDerivative else E)
        self.history = [*(self.history or [new, new]), new][-3:]
        (_, d2), (p1, d1), (p0, d0) = self.history
        dP, dI, dD = Kp * (p0 - p1), KI * E * dt, KD / dt * (d0 - 2 * d1 + d2)
        if d.DSmoothing:
            Tf = SMOOTHING * KD / Kp
            D = (Tf * self.D + KD * (d0 - d1)) / (Tf + dt)
            self.D, dD = D, D - self.D
        last = self.CV
        if not auto:
            self.CV = CVOper
        else:
            change = dP + dI + dD + FF - self.FF1 if self.automatic else 0.0  # no change is computed in manual
            CV = (last if np.isnan(CVPrevious) else CVPrevious) + change
            self.CV = min(max(CV, self.CVLLimit), self.CVHLimit)
            if d.CVROCLimit:
                self.CV = min(max(self.CV, last - d.CVROCLimit * dt), last + d.CVROCLimit * dt)
                self.CV = min(max(self.CV, self.CVLLimit), self.CVHLimit)
        self.FF1, self.automatic = FF, auto
        self.size = max(self.size, abs(dP), abs(dI), abs(dD), Kp * abs(E), KD / dt * (abs(PV) + abs(SP)))
        return self.CV


def wandering(seed: int, record: Signals, step: float) -> Floats:
    """Return a signal that wanders from zero, for a bias or a feedforward."""
    return np.cumsum(np.random.default_rng(seed).normal(0, step, len(record))).round(3)


def read_back(seed: int, record: Signals) -> Floats:
    """Return a CVPrevious in spells, NaN where CVSetPrevious is not set."""
    rng = np.random.default_rng(seed + 2)
    back = 50 + np.cumsum(rng.normal(0, 3, len(record)))
    back[rng.random(len(record)) < 0.6] = np.nan
    return back.round(3)


def dial(low: float, high: float) -> st.SearchStrategy[float]:
    return st.just(0.0) | st.floats(low, high)


BIT = st.integers(0, 1)
PIDS = st.builds(Pid, st.just(0), BIT, BIT, KP=st.floats(0.05, 20), KI=dial(1e-4, 1), KD=dial(0.1, 60)) | st.builds(
    Pid, st.just(1), BIT, BIT, KP=st.floats(0.05, 20), KI=dial(0.02, 60), KD=dial(0.002, 2)
)
PIDES = st.builds(
    Pide,
    *[st.booleans()] * 4,
    PGain=st.floats(0.05, 20),
    IGain=dial(0.02, 60),
    DGain=dial(0.002, 2),
    CVROCLimit=st.just(0.0) | st.floats(0.5, 20),
)


@settings(max_examples=60)
@given(PIDS, st.floats(0.1, 5), ACTIONS, BOUNDS, st.integers(0, 10**6))
def test_the_pid_card_equals_the_positional_equation_in_automatic_manual_and_at_the_limits(
    d: Pid, UPD: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    bias = wandering(seed, record, 0.3)
    block = PidBlock(d, UPD, int(action == "direct"), *bounds, CV=40.0)
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, bias, strict=True)
    want = [block.execute(*row) for row in columns]
    ctl = pidemu.Controller(d.card(), scan=UPD, action=action, output_limits=bounds, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual, feedforward=bias)
    assert close(found, want, TOLERANCE, 10 * block.size)


@settings(max_examples=60)
@given(PIDES, st.floats(0.1, 5), ACTIONS, BOUNDS, st.integers(0, 10**6))
def test_the_pide_card_equals_the_increments_in_automatic_manual_and_at_the_limits(
    d: Pide, DeltaT: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    back, ff = read_back(seed, record), wandering(seed, record, 0.5)
    block = PideBlock(d, DeltaT, action == "direct", *bounds, CV=40.0)
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, back, ff, strict=True)
    want = [block.execute(*row) for row in columns]
    ctl = pidemu.Controller(d.card(), scan=DeltaT, action=action, output_limits=bounds, initial_output=40.0)
    found = ctl.run(record.sp, record.pv, record.auto, record.manual, external_reset=back, feedforward=ff)
    assert close(found, want, TOLERANCE, 10 * block.size)


def test_an_integral_gain_of_one_repeats_the_proportional_action_of_the_pide_once_a_minute() -> None:
    """A trainer's words: an error of 10 % and an integral gain of 1 give 20 % after one minute."""
    ctl = pidemu.Controller(pidemu.load_card("allen-bradley/pide").settings(PGain=1, IGain=1), scan=1.0, initial_output=0.0)
    out = ctl.run(np.where(np.arange(61) < 1, 50.0, 60.0), 50.0)
    assert out[-1] == pytest.approx(20.0)


def test_a_reset_time_of_one_minute_is_that_of_both_instructions() -> None:
    for name, dials in (
        ("logix-pid", {"PE": "dependent", "KP": 1, "KI": 1}),
        ("pide", {"DependIndepend": "true", "PGain": 1, "IGain": 1}),
    ):
        ctl = pidemu.Controller(pidemu.load_card(f"allen-bradley/{name}").settings(dials), scan=1.0, initial_output=0.0)
        out = ctl.run(np.where(np.arange(61) < 1, 50.0, 60.0), 50.0)
        assert out[-1] == pytest.approx(20.0)


def test_the_integral_of_the_pid_is_frozen_while_the_output_is_at_its_limit() -> None:
    settings_ = pidemu.load_card("allen-bradley/logix-pid").settings(KP=1, KI=0.1)
    ctl = pidemu.Controller(settings_, scan=1.0, initial_output=90.0)
    out = ctl.run(60.0, np.full(100, 40.0))  # an error of 20 adds 2 a scan to the 70 that are left at the transfer
    assert out[4:7] == pytest.approx([98.0, 100.0, 100.0])
    assert ctl.scan(60.0, 59.0) == pytest.approx(81.0)
