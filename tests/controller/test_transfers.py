"""What the integral, the derivative and the output do at a transfer, by hand, and what bumpless means on every card (section 6)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Controller
from pidemu.algorithm.model import Algorithm
from tests.helpers import made_up_card, scans_of, settings_of
from tests.histories import history

KP, KI, KD = 2.0, 0.25, 4.0
NONE: dict[str, Any] = {"scheme": "none"}
VELOCITY: dict[str, Any] = {"implementation": "velocity", "integral": {"rule": "backward", "windup": {"scheme": "velocity"}}}
BEFORE: dict[str, Any] = {"feedforward": {"summed": "before-limits", "gain": 2.0}}
AFTER: dict[str, Any] = {"feedforward": {"summed": "after-limits", "gain": 2.0}}

seeds = st.integers(0, 2**32 - 1)
on_every_card = pytest.mark.parametrize("name", pidemu.cards())


def bench(transfer: dict[str, Any], *, kp: float = KP, ki: float = KI, kd: float = 0.0, **fields: Any) -> Controller:
    """A parallel PID at 1 s, with an output of 40 before its first scan."""
    card = made_up_card(transfer={"start": "bumpless"} | transfer, **fields)
    return Controller(card.settings(kp=kp, ki=ki, kd=kd), initial_output=40.0)


# --- every start: manual at an error of 4 with the operator at 70, then automatic at an error of 6 -------------------

MANUAL = [0.0, 0.0, 1.0, 1.0]
OPERATOR = [math.nan, 70.0, math.nan, math.nan]
P, DI = 12.0, 1.5
"""2 times 6, and 0.25 times 6."""


def started(transfer: dict[str, Any], **fields: Any) -> list[float]:
    """The two automatic outputs after two manual scans."""
    u: list[float] = bench(transfer, **fields).run([54.0, 54, 56, 56], 50.0, MANUAL, OPERATOR)[2:].tolist()
    return u


@pytest.mark.parametrize(
    ("transfer", "first"),
    [
        ({"start": "bumpless"}, 70.0),
        ({"start": "load-output"}, 70 + P + DI),
        ({"start": "load-output", "first-scan": "holds"}, 70 + P),
        ({"start": "tracked"}, (70 - 8) + P + DI),  # in manual I = 70 - 2 times 4
        ({"start": "keep"}, (40 - 8) + P + DI),  # from the very first scan, I = 40 - 8
        ({"start": "keep", "first-scan": "holds"}, (40 - 8) + P),
        ({"start": "keep", "power-up": "zero"}, 1 + P + DI),  # the very first scan adds 0.25 times 4, then it stands still
        ({"start": "keep", "power-up": "zero", "first-scan": "holds"}, 0 + P),
        ({"start": "zero"}, P + DI),
        ({"start": "zero", "first-scan": "holds"}, P),
        ({"start": "running"}, (40 - 8 + 1) + P + DI),  # one manual scan after the first has added 0.25 times 4
        ({"start": "running", "power-up": "zero"}, 2 + P + DI),
        ({"start": "running", "power-up": "zero", "first-scan": "holds"}, 1 + P + DI),
    ],
    ids=str,
)
def test_each_start_makes_the_first_automatic_output_that_it_says(transfer: dict[str, Any], first: float) -> None:
    assert started(transfer) == [first, first + DI]


def test_a_limited_load_is_cut_and_one_that_is_loaded_as_it_is_is_not() -> None:
    for loaded, first in (("limited", 100.0), ("as-it-is", 130.0)):
        card = made_up_card(transfer={"start": "load-output", "loaded": loaded, "first-scan": "holds"})
        ctl = Controller(card.settings(kp=KP, ki=KI))
        ctl.scan(50.0, 50.0, auto=False, manual=130.0)
        assert (ctl.scan(50.0, 50.0), ctl.state["I"]) == (100.0, first)


@pytest.mark.parametrize(("without", "expected"), [("kept", [70 + P, 70 + P]), ("zero", [P, P])])
def test_without_integral_action_the_load_is_kept_or_not(without: str, expected: list[float]) -> None:
    assert started({"start": "load-output", "without-integral": without}, ki=0.0) == expected


@pytest.mark.parametrize("windup", ["none", "back-calculation", "external-reset", "recompute", "reset-outside-band", "clamp"])
@pytest.mark.parametrize("rule", ["backward", "forward"])
@settings(max_examples=10)
@given(seed=seeds)
def test_an_integral_that_is_kept_stands_still_in_manual_whatever_the_scheme(windup: str, rule: str, seed: int) -> None:
    scheme = {"scheme": windup} | ({"tracking-time": 5.0} if windup == "back-calculation" else {})
    ctl = bench({"start": "keep"}, integral={"rule": rule, "windup": scheme})
    rng = np.random.default_rng(seed)
    ctl.run(rng.uniform(40, 60, 10), 50.0)
    before = ctl.state["I"]
    ctl.run(rng.uniform(-100, 200, 10), 50.0, auto=False, manual=rng.uniform(0, 100, 10))
    assert before == ctl.state["I"]


@pytest.mark.parametrize("start", ["load-output", "keep", "zero"])
@pytest.mark.parametrize("rule", ["backward", "forward", "trapezoidal"])
def test_an_integral_that_does_not_grow_in_the_first_scan_is_still_what_it_was_after_it(start: str, rule: str) -> None:
    ctl = bench({"start": start, "first-scan": "holds"}, integral={"rule": rule, "windup": NONE})
    ctl.scan(50.0, 50.0)
    ctl.scan(50.0, 50.0, auto=False, manual=70.0)
    ctl.scan(54.0, 50.0)
    assert ctl.state["I"] == {"load-output": 70.0, "keep": 40.0, "zero": 0.0}[start]


# --- the derivative at the transfer: in manual the measurement stands at 10, 20, 30, then 40 and 40 in automatic -----


@pytest.mark.parametrize(
    ("derivative", "expected"),
    [("running", [-40.0, 0.0]), ("restarted", [0.0, 0.0]), ("zeroed", [-160.0, 0.0]), ("preset", [-40.0, 0.0])],
)
def test_each_derivative_start_makes_the_derivative_that_it_says(derivative: str, expected: list[float]) -> None:
    transfer = {"start": "load-output", "derivative": derivative, "without-integral": "zero"}
    ctl = bench(transfer, kp=0.0, ki=0.0, kd=KD, derivative={"on": "pv"}, output={"limits": [-1000, 1000]})
    assert ctl.run(0.0, [10.0, 20, 30, 40, 40], [0, 0, 0, 1, 1])[3:].tolist() == expected


@pytest.mark.parametrize(
    ("derivative", "first"),
    # D_n = (4 D + 4 times -10)/5 in every scan: 0, -8, -14.4, then -19.52; from rest -8; from a signal of zero 4 times -40 over 5
    [("running", -19.52), ("restarted", 0.0), ("zeroed", -32.0), ("preset", -8.0)],
)
def test_each_derivative_start_deals_with_the_filter_as_well(derivative: str, first: float) -> None:
    transfer = {"start": "load-output", "derivative": derivative, "without-integral": "zero"}
    term = {"on": "pv", "filter": {"applies-to": "term", "time": 4.0}}
    ctl = bench(transfer, kp=0.0, ki=0.0, kd=KD, derivative=term, output={"limits": [-1000, 1000]})
    out = ctl.run(0.0, [10.0, 20, 30, 40, 40], [0, 0, 0, 1, 1])[3:]
    assert out.tolist() == pytest.approx([first, 0.8 * first], rel=1e-14)  # 0.8 is no binary number


def test_a_derivative_that_starts_from_zero_kicks_in_the_very_first_scan_only() -> None:
    ctl = bench({"start": "zero", "power-up": "zero"}, kp=0.0, ki=0.0, kd=1.0, derivative={"on": "error", "starts": "zero"})
    assert ctl.run(60.0, [50.0, 50, 49, 49], [1, 1, 0, 1]).tolist() == [10.0, 0.0, 0.0, 0.0]


# --- the output in manual --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("manual_output", "expected"), [("operator", [40, 30, 30]), ("gain-times-operator", [40, 60, 60]), ("zero", [0, 0, 0])]
)
def test_the_output_in_manual_is_what_the_card_says(manual_output: str, expected: list[float]) -> None:
    ctl = bench({"manual-output": manual_output})
    assert ctl.run(50.0, np.full(3, 50.0), False, [math.nan, 30.0, math.nan]).tolist() == expected


# --- feedforward: a gain of 2 ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fields", [BEFORE, AFTER, BEFORE | VELOCITY], ids=["before limits", "after limits", "velocity"])
def test_a_feedforward_signal_moves_the_output_by_its_gain_times_its_own_move(fields: dict[str, Any]) -> None:
    ctl = bench({}, ki=0.0 if fields is not AFTER else KI, **fields)
    u = ctl.run(50.0, np.full(4, 50.0), feedforward=[3.0, 3.0, 8.0, 1.0])
    assert np.diff(u).tolist() == [0.0, 10.0, -14.0]


def test_before_the_limits_the_feedforward_counts_in_the_sum_and_after_them_on_the_limited_output() -> None:
    # P = 2 times 40 beyond the limits from I = 40; the feedforward takes 60 away
    before, after = (bench({}, ki=1e-9, **fields) for fields in (BEFORE, AFTER))
    for ctl, expected in ((before, 40 + 80 - 60), (after, 100 - 60)):
        u = [ctl.scan(50.0, 50.0, feedforward=0.0), ctl.scan(90.0, 50.0, feedforward=-30.0)]
        assert u == pytest.approx([40.0, expected], abs=1e-6)  # and 1e-9 of integral action


@pytest.mark.parametrize("start", ["bumpless", "tracked"])
@pytest.mark.parametrize("fields", [BEFORE, AFTER], ids=["before limits", "after limits"])
def test_with_feedforward_a_bumpless_transfer_is_still_bumpless(start: str, fields: dict[str, Any]) -> None:
    ctl = bench({"start": start}, **fields)
    ctl.run(54.0, [50.0, 50.0], False, [math.nan, 70.0], feedforward=[5.0, 6.0])
    first = 70.0 if start == "bumpless" else 71.0  # a tracked integral moves on by 0.25 times 4
    assert ctl.scan(54.0, 50.0, feedforward=6.0) == first


def test_with_feedforward_a_velocity_transfer_is_still_bumpless() -> None:
    ctl = bench({}, **BEFORE | VELOCITY)
    ctl.run(54.0, [50.0, 50.0], False, [math.nan, 70.0], feedforward=[5.0, 6.0])
    assert [ctl.scan(54.0, 50.0, feedforward=9.0), ctl.scan(54.0, 50.0, feedforward=9.0)] == [70.0, 71.0]


@pytest.mark.parametrize(
    ("windup", "left"),
    # P = 60 and an increment of 7.5 on I = 10: the feedforward of 40 is what takes the sum beyond 100
    [({"scheme": "recompute"}, 100 - 60 - 40), ({"scheme": "conditional"}, 10.0), ({"scheme": "freeze"}, 17.5)],
    ids=str,
)
def test_a_windup_scheme_counts_the_feedforward_into_the_sum(windup: dict[str, Any], left: float) -> None:
    ctl = bench({}, integral={"rule": "backward", "windup": windup}, **BEFORE)
    ctl.scan(50.0, 50.0, auto=False, manual=50.0, feedforward=20.0)
    ctl.scan(50.0, 50.0, feedforward=20.0)  # I = 50 - 40
    assert (ctl.scan(80.0, 50.0, feedforward=20.0), ctl.state["I"]) == (100.0, left)


# --- every card ------------------------------------------------------------------------------------------------------


def terms(a: Algorithm, h: float) -> float:
    """A bound on the terms of a record between 0 and 100, and of their sums over some hundred scans."""
    return 100 * (1 + abs(a.kp) + 4 * abs(a.kd) / h + abs(a.ki) * h * 100) + (100 * a.dahlin.numbers(h)[0] if a.dahlin else 0.0)


@on_every_card
@settings(max_examples=10)
@given(data=st.data(), seed=seeds)
def test_a_card_whose_transfer_is_bumpless_does_not_bump(name: str, data: st.DataObject, seed: int) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    a = chosen.algorithm(own_units=True)
    if a.transfer.start != "bumpless" or not (a.velocity or a.ki):
        return
    h = data.draw(scans_of(a))
    ctl = Controller(chosen, h, output_limits=(0, 100), initial_output=50.0)
    history(seed, a).run(ctl)
    # I = u - P - D, and then P + I + D: rounded to 1e-16 of the largest; whole counts; 24 bits
    counts = a.arithmetic.counts or 1
    allowed = {"float64": 1e-12 * terms(a, h), "float32": 1e-6 * terms(a, h), "integer": 1.0 / counts}[a.arithmetic.type]
    automatic = ("to automatic", "to cascade")
    entered = [e for e in ctl.events if e.text.endswith(automatic) and not e.text.startswith(("automatic", "cascade"))]
    assert [e for e in entered if abs(e.bump) > allowed] == []


@on_every_card
@settings(max_examples=10)
@given(data=st.data(), seed=seeds, shift=st.integers(-50, 50))
def test_only_the_difference_of_setpoint_and_measurement_counts_where_p_and_d_act_on_the_error(
    name: str, data: st.DataObject, seed: int, shift: int
) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    a = chosen.algorithm()
    of_the_error = (a.b == 1 or not a.kp) and (a.c == 1 or not a.kd) and a.cascade_b is None and a.setpoint.starts != "zero"
    if not of_the_error or a.arithmetic.type != "float64" or (a.error is not None and a.error.zero_crossing):
        return
    h, x = data.draw(scans_of(a)), history(seed, a)
    one, other = (Controller(chosen, h, output_limits=(-1e9, 1e9), initial_output=50.0) for _ in range(2))
    moved = x.moved(**{s: x.columns[s] + shift for s in ("sp", "pv", "cascade")})
    # the signals have ten binary places, so their difference is exact; behind a filter it is rounded to 1e-16 of itself
    filtered = a.measurement.filter or a.setpoint.filter or a.error.filter or a.Tf
    difference = np.max(np.abs(x.run(one) - moved.run(other)))
    assert difference <= (1e-11 * terms(a, h) if filtered else 0.0)
