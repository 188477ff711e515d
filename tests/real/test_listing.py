"""The textbooks' program listing: output first, then the updates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from tests.real.support import Floats, Signals, close, signals

TOLERANCE = 1e-12
"""Double precision; the order in which the terms are summed is free."""


@dataclass(frozen=True)
class Dials:
    """The listing's parameters."""

    K: float
    Ti: float
    Td: float
    Tt: float
    N: float
    b: float

    def values(self) -> dict[str, object]:
        return {name: getattr(self, name) for name in ("K", "Ti", "Td", "Tt", "N", "b")}


@dataclass
class Listing:
    """The program: precomputed coefficients, one scan, and the parameter change that does not bump."""

    d: Dials
    h: float
    low: float
    high: float
    I: float = 0.0  # noqa: E741 (the listing's name)
    D: float = 0.0
    yold: float | None = None
    last: tuple[float, float] = (0.0, 0.0)
    size: float = field(default=1.0)

    def scan(self, r: float, y: float) -> float:
        d, h = self.d, self.h
        bi, ad = d.K * h / d.Ti, d.Td / (d.Td + d.N * h)
        bd, ao = d.K * d.N * d.Td / (d.Td + d.N * h), h / d.Tt
        P = d.K * (d.b * r - y)
        self.D = ad * self.D - bd * (y - (y if self.yold is None else self.yold))
        v = P + self.I + self.D
        u = min(max(v, self.low), self.high)
        self.size = max(self.size, abs(P), abs(self.I), abs(self.D), abs(d.K * r), abs(bd * y), abs(ao * (u - v)))
        self.I = self.I + bi * (r - y) + ao * (u - v)
        self.yold, self.last = y, (r, y)
        return u

    def change(self, new: Dials) -> None:
        r, y = self.last
        self.I += self.d.K * (self.d.b * r - y) - new.K * (new.b * r - y)
        self.d = new


def expected(listing: Listing, record: Signals) -> Floats:
    own = [listing.scan(r, y) for r, y in zip(record.sp, record.pv, strict=True)]
    return np.where(record.auto > 0, own, record.manual)


def controller(d: Dials, h: float, low: float, high: float) -> pidemu.Controller:
    card = pidemu.load_card("astrom-hagglund/listing")
    return pidemu.Controller(card.settings(d.values()), scan=h, output_limits=(low, high))


dials = st.builds(
    Dials,
    K=st.floats(0.1, 20) | st.floats(-20, -0.1),
    Ti=st.floats(1, 500),
    Td=st.just(0.0) | st.floats(0.1, 60),
    Tt=st.floats(2, 200),
    N=st.floats(2, 20),
    b=st.sampled_from([0.0, 1.0]) | st.floats(0, 1),
)
limits = st.sampled_from([(-np.inf, np.inf), (0.0, 100.0), (20.0, 60.0)])


@settings(max_examples=40)
@given(dials, st.floats(0.05, 3), limits, st.integers(0, 10**6))
def test_the_card_equals_the_listing_at_both_limits_and_beside_manual_spells(
    d: Dials, h: float, bounds: tuple[float, float], seed: int
) -> None:
    record = signals(seed)
    listing = Listing(d, h, *bounds)
    want = expected(listing, record)
    found = controller(d, h, *bounds).run(record.sp, record.pv, record.auto, record.manual)
    assert close(found, want, TOLERANCE, listing.size)


@settings(max_examples=30)
@given(dials, st.floats(0.1, 10), st.floats(0, 1), st.integers(0, 10**6))
def test_a_changed_gain_or_weight_is_compensated_as_the_listing_does(d: Dials, factor: float, weight: float, seed: int) -> None:
    record = signals(seed).always_auto()
    other = replace(d, K=d.K * factor, b=weight)
    listing, ctl = Listing(d, 0.5, 0.0, 100.0), controller(d, 0.5, 0.0, 100.0)
    for n, (r, y) in enumerate(zip(record.sp, record.pv, strict=True)):
        if n in (70, 140):
            new = other if n == 70 else d
            listing.change(new)
            ctl.change(K=new.K, b=new.b)
        want = listing.scan(r, y)
        assert close(ctl.scan(r, y), want, TOLERANCE, listing.size)


def test_at_rest_a_changed_gain_does_not_move_the_output() -> None:
    d = Dials(K=2.0, Ti=20.0, Td=5.0, Tt=10.0, N=8.0, b=0.6)
    ctl = controller(d, 1.0, 0.0, 100.0)
    before = ctl.run(np.full(300, 50.0), np.full(300, 50.0))[-1]
    ctl.change(K=9.0, b=0.1)
    assert ctl.scan(50.0, 50.0) == pytest.approx(before, abs=1e-12)


@pytest.mark.parametrize(("name", "value"), [("Ti", 200.0), ("Td", 0.0), ("N", 2.0), ("Tt", 1.0)])
def test_the_other_parameters_change_without_any_correction(name: str, value: float) -> None:
    d = Dials(K=2.0, Ti=20.0, Td=5.0, Tt=10.0, N=8.0, b=0.6)
    record = signals(11).always_auto()
    listing, ctl = Listing(d, 1.0, 0.0, 100.0), controller(d, 1.0, 0.0, 100.0)
    for n, (r, y) in enumerate(zip(record.sp, record.pv, strict=True)):
        if n == 100:
            listing.d = replace(d, **{name: value})
            ctl.change({name: value})
        assert close(ctl.scan(r, y), listing.scan(r, y), TOLERANCE, listing.size)


def test_an_error_of_one_scan_counts_in_the_integral_one_scan_late() -> None:
    d = Dials(K=2.0, Ti=10.0, Td=0.0, Tt=10.0, N=8.0, b=1.0)
    ctl = controller(d, 1.0, -np.inf, np.inf)
    assert ctl.run([0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]).tolist() == [0.0, 2.0, 0.2, 0.2]
