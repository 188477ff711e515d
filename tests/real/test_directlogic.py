"""DirectLOGIC's loops from the equations of the DL405 and DL05 manuals, chapter 8, on signals in percent."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.settings.action import Action
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision: outputs and bias are sums of 200 increments."""


@dataclass(frozen=True)
class Dials:
    """Kc, Ti [s], Td [s], PV filter constant, and the choices; `limit` is the derivative gain limit Kd, `band` the deadband [%]."""

    Kc: float
    Ti: float
    Td: float
    filter: float = 1.0
    algorithm: str = "POSITION"
    error: str = "LINEAR"
    transfer: str = "I"
    limit: float | None = None
    band: float = 2.0

    def card(self) -> pidemu.Settings:
        given: dict[str, object] = {"GAIN": self.Kc, "RESET": self.Ti, "RATE": self.Td, "FILTER": self.filter}
        given |= {"ALGORITHM": self.algorithm, "ERROR_TERM": self.error, "TRANSFER": self.transfer}
        if self.error == "DEADBAND":
            given["DEADBAND"] = self.band
        if self.limit is not None:
            given |= {"DERIVATIVE_GAIN_LIMIT": "ON", "LIMIT": self.limit}
        return pidemu.load_card("automationdirect/directlogic").settings(given)


@dataclass
class Loop:
    """One loop.

    `edge` is the nearest that the sum came to a limit: rounding could put it on the other side, and the bias with it.
    """

    d: Dials
    Ts: float
    sign: float
    low: float
    high: float
    M: float
    Mx: float = 0.0
    begun: bool = False
    automatic: bool = False
    PV: float = 0.0
    Y: tuple[float, float] = (0.0, 0.0)
    e1: float = 0.0
    SP: float = 0.0
    SP1: float = 0.0
    size: float = field(default=1.0)
    edge: float = field(default=np.inf)

    def scan(self, SP: float, PV: float, auto: bool, manual: float) -> float:
        d, Ts = self.d, self.Ts
        if d.transfer == "I":  # in manual the setpoint is the measurement, and stays so until somebody enters another
            entered = not self.begun or SP != self.SP1
            self.SP = (SP if entered else self.SP) if auto else PV
        else:
            self.SP = SP
        self.SP1 = SP
        self.PV = PV if not self.begun else self.PV + d.filter * (PV - self.PV)
        share = Ts / (Ts + d.Td / d.limit) if d.limit else 1.0
        Y1, Y2 = self.Y if self.begun else (self.PV, self.PV)
        Y = Y1 + share * (self.PV - Y1)
        e = self.shaped(self.SP - self.PV)
        e1 = self.e1 if self.begun else e
        self.Y, self.e1 = (Y, Y1), e
        Kc, Ki, Kr = self.sign * d.Kc, self.sign * d.Kc * Ts / d.Ti, self.sign * d.Kc * d.Td / Ts
        self.size = max(self.size, *(abs(x) for x in (Kc * e, Ki * e, Kr * PV, Kc * PV, self.Mx)))
        if not auto:
            M = manual
        elif d.algorithm == "VELOCITY":
            dM = Kc * (e - e1) + Ki * e - Kr * (Y - 2 * Y1 + Y2) if self.automatic else 0.0
            M = self.limited(self.M + dM)
        else:
            M = self.position(Kc * e, Ki * e, Kr * (Y - Y1))
        self.M, self.automatic, self.begun = M, auto, True
        return M

    def shaped(self, e: float) -> float:
        if self.d.error == "SQUARED":
            return e * abs(e) / 100
        return 0.0 if self.d.error == "DEADBAND" and abs(e) < self.d.band else e

    def limited(self, x: float) -> float:
        return min(max(x, self.low), self.high)

    def position(self, P: float, grown: float, D: float) -> float:
        bias = self.Mx if self.automatic else self.limited(self.M)  # bias = control output
        freeze = self.d.algorithm == "POSITION_FREEZE_BIAS"
        new = self.limited(bias + grown) if freeze else bias + grown
        M = P - D + new
        self.edge = min(self.edge, abs(M - self.low), abs(M - self.high))
        outside = not self.low < M < self.high
        if freeze:
            self.Mx = bias if outside else new
        else:
            self.Mx = self.limited(self.limited(M) - P + D if outside else new)
        return self.limited(M)


def expected(loop: Loop, record: Signals) -> Floats:
    columns = zip(record.sp, record.pv, record.auto > 0, record.manual, strict=True)
    return np.array([loop.scan(*row) for row in columns])


dials = st.builds(
    Dials,
    Kc=st.floats(0.05, 20),
    Ti=st.floats(0.5, 90),
    Td=st.just(0.0) | st.floats(0.1, 90),
    filter=st.sampled_from([1.0, 0.1]) | st.floats(0.1, 1),
    algorithm=st.sampled_from(["POSITION", "POSITION_FREEZE_BIAS", "VELOCITY"]),
    error=st.sampled_from(["LINEAR", "SQUARED", "DEADBAND"]),
    transfer=st.sampled_from(["I", "II"]),
    limit=st.none() | st.floats(1, 20),
    band=st.floats(0.1, 20),
)


@settings(max_examples=120)
@given(
    dials,
    st.floats(0.05, 2),
    st.sampled_from(["reverse", "direct"]),
    st.sampled_from([(0.0, 100.0), (30.0, 60.0)]),
    st.integers(0, 10**6),
)
def test_every_combination_of_the_mode_bits_equals_the_manuals_equations(
    d: Dials, Ts: float, action: Action, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    loop = Loop(d, Ts, 1.0 if action == "reverse" else -1.0, *bounds, M=40.0)
    want = expected(loop, record)
    if d.algorithm == "POSITION_FREEZE_BIAS":
        assume(loop.edge > TOLERANCE * loop.size)
    ctl = pidemu.Controller(d.card(), scan=Ts, action=action, output_limits=bounds, initial_output=40.0)
    assert close(ctl.run(record.sp, record.pv, record.auto, record.manual), want, TOLERANCE, 10 * loop.size)


def test_position_and_velocity_agree_while_nothing_is_at_a_limit() -> None:
    d = Dials(0.5, 60.0, 2.0, 0.6, limit=8.0)
    record = signals(2).always_auto()
    loops = [pidemu.Controller(replace(d, algorithm=a).card(), scan=1.0, initial_output=50.0) for a in ("POSITION", "VELOCITY")]
    sp = 50 + 0.1 * (record.sp - record.sp[0])
    pv = sp[0] + 0.1 * (record.pv - record.pv[0])
    position, velocity = (ctl.run(sp, pv) for ctl in loops)
    assert ((position > 0) & (position < 100)).all()
    assert close(np.diff(position)[1:], np.diff(velocity)[1:], TOLERANCE, 1000.0)


def saturating(algorithm: str) -> tuple[Floats, Floats, Dials]:
    """A setpoint far away for a while and then back, with a measurement that comes slowly."""
    n = np.arange(400)
    sp = np.where((n >= 20) & (n < 150), 90.0, 30.0)
    pv = 30 + 45 * (1 - np.exp(-np.maximum(n - 20, 0) / 60)) * (n < 150) + 40 * np.exp(-np.maximum(n - 150, 0) / 40) * (n >= 150)
    return sp, pv, Dials(2.5, 20.0, 0.0, algorithm=algorithm, transfer="II")


def test_bias_freeze_counts_the_bias_that_would_be_for_the_output_and_does_not_keep_it() -> None:
    d = Dials(1.0, 10.0, 0.0, algorithm="POSITION_FREEZE_BIAS", transfer="II")
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=90.0)
    # 5 + 90.5, then 9 + 91.4, which is beyond and leaves 90.5; then 8 + 90.5 + 0.8 is inside
    assert ctl.run(50.0, [45.0, 41.0, 42.0, 42.0]) == pytest.approx([95.5, 100.0, 99.3, 100.0])
    assert ctl.state["I"] == pytest.approx(91.3)


def test_an_error_at_the_edge_of_the_deadband_counts() -> None:
    d = Dials(2.0, 60.0, 0.0, error="DEADBAND", transfer="II", band=2.0)
    ctl = pidemu.Controller(d.card(), scan=1.0, initial_output=40.0)
    assert ctl.run(50.0, [50.0, 48.25, 48.0, 52.0]) == pytest.approx([40.0, 40.0, 44 + 4 / 60, 36.0])


def test_frozen_or_adjusted_the_bias_lets_the_output_leave_its_limit_before_the_setpoint_is_passed_where_windup_would_not() -> None:
    pv = 20 + np.clip(np.arange(600) - 200, 0, 600) * 0.12  # stuck far below the setpoint, then slowly past it

    def leaves(out: npt.ArrayLike) -> int:
        return int(np.flatnonzero(np.asarray(out) >= 100.0)[-1])

    def run(algorithm: str) -> int:
        d = Dials(2.5, 20.0, 0.0, algorithm=algorithm, transfer="II")
        return leaves(pidemu.Controller(d.card(), scan=0.5, initial_output=30.0).run(60.0, pv))

    free = 30 + 2.5 * (60 - pv) + np.cumsum(2.5 * 0.5 / 20 * (60 - pv))
    passes = int(np.flatnonzero(pv < 60)[-1])
    assert max(run("POSITION"), run("POSITION_FREEZE_BIAS")) < passes < leaves(free)


def test_the_first_transfer_mode_does_not_bump_and_the_second_bumps_by_the_gain_times_the_error() -> None:
    def bump(transfer: str) -> float:
        d = Dials(2.0, 60.0, 0.0, transfer=transfer)
        ctl = pidemu.Controller(d.card(), scan=0.5)
        ctl.run(55.0, np.full(5, 50.0), False, 40.0)
        return ctl.scan(55.0, 50.0) - 40.0

    assert bump("I") == pytest.approx(0.0, abs=1e-12)
    assert bump("II") == pytest.approx(2.0 * 5 + 2.0 * 0.5 / 60 * 5)


def test_without_reset_the_bias_stays_as_it_was_loaded() -> None:
    for off in (0.0, 99.99):
        s = pidemu.load_card("automationdirect/directlogic").settings(GAIN=2, RESET=off, TRANSFER="II")
        ctl = pidemu.Controller(s, scan=0.5, initial_output=40.0)
        assert ctl.run([50.0, 55.0, 45.0], 50.0).tolist() == [40.0, 50.0, 30.0]


def test_a_gain_of_zero_leaves_nothing_moving() -> None:
    s = pidemu.load_card("automationdirect/directlogic").settings(GAIN=0, RESET=10, RATE=5)
    record = signals(9).always_auto()
    assert set(pidemu.Controller(s, scan=0.5, initial_output=40.0).run(record.sp, record.pv).tolist()) == {40.0}


def test_the_derivative_does_not_see_the_setpoint() -> None:
    s = pidemu.load_card("automationdirect/directlogic").settings(GAIN=2, RESET=0, RATE=50, TRANSFER="II")
    ctl = pidemu.Controller(s, scan=0.5, initial_output=40.0)
    assert ctl.run([50.0, 51.0, 51.0], 50.0).tolist() == [40.0, 42.0, 42.0]
