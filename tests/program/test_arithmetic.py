"""float32 and whole numbers, operation by operation (specs/equations.md, section 7)."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pidemu import Controller
from pidemu.algorithm.model import Algorithm
from pidemu.backends.python import source
from pidemu.card.model.base import Rule
from pidemu.errors import ScanError
from pidemu.program.builder import build
from tests.algorithms import NONE, VELOCITY, algorithm, changed, incremental
from tests.helpers import Floats, made_up_card, outputs
from tests.program.support import signals, states_of

f32 = np.float32
H, U0 = 0.1, 40.3
"""Numbers that neither float32 nor float64 holds exactly."""
PID = algorithm(kp=2.1, ki=0.37, kd=1.3, Tf=0.7, arithmetic__type="float32")
FOUR_POINT = algorithm(kd=1.3, derivative__rule=Rule.FOUR_POINT, arithmetic__type="float32")
FLOAT32: dict[str, Any] = {"arithmetic": {"type": "float32"}}

seeds = st.integers(0, 2**32 - 1)


def narrow(sp: Floats, pv: Floats) -> list[tuple[np.float32, np.float32]]:
    return list(zip(sp.astype(f32), pv.astype(f32), strict=True))


def clip(v: np.float32) -> np.float32:
    return f32(min(max(v, f32(0)), f32(100)))


# --- every operation is rounded: each line below is one assignment of the program, on float32 numbers --------------------


def by_hand_positional(sp: Floats, pv: Floats) -> list[float]:
    kp, ki_h, decay, gain = f32(2.1), f32(0.37 * H), f32(0.7 / (0.7 + H)), f32(1.3 / (0.7 + H))
    I, D, x1, u, out = f32(0), f32(0), None, f32(U0), []  # noqa: E741 (the field's symbol)
    for r, y in narrow(sp, pv):
        e = r - y
        P = kp * e
        D = decay * D + gain * (e - (e if x1 is None else x1))
        I = u - P - D if x1 is None else I + ki_h * e  # noqa: E741
        u, x1 = clip(P + I + D), e
        out.append(float(u))
    return out


def by_hand_velocity(sp: Floats, pv: Floats) -> list[float]:
    kp, ki_h, decay, gain = f32(2.1), f32(0.37 * H), f32(0.7 / (0.7 + H)), f32(1.3 / (0.7 + H))
    D, e1, u, out = f32(0), None, f32(U0), []
    for r, y in narrow(sp, pv):
        e, D1 = r - y, D
        D = decay * D + gain * (e - (e if e1 is None else e1))
        du = kp * (e - e1) + ki_h * e + (D - D1) if e1 is not None else f32(0)
        u, e1 = clip(u + du), e
        out.append(float(u))
    return out


def by_hand_trapezoidal(sp: Floats, pv: Floats) -> list[float]:
    kp, half = f32(2.1), f32(0.37 * H / 2)
    I, e1, u, out = f32(0), None, f32(U0), []  # noqa: E741
    for r, y in narrow(sp, pv):
        e = r - y
        P = kp * e
        I = u - P if e1 is None else I + half * (e + e1)  # noqa: E741
        u, e1 = clip(P + I), e
        out.append(float(u))
    return out


CASES: dict[str, tuple[Algorithm, Callable[[Floats, Floats], list[float]]]] = {
    "positional": (PID, by_hand_positional),
    "velocity": (incremental(PID), by_hand_velocity),
    "trapezoidal": (changed(PID, kd=0.0, Tf=0.0, integral__rule=Rule.TRAPEZOIDAL), by_hand_trapezoidal),
}


@pytest.mark.parametrize("name", CASES)
@given(seed=seeds)
def test_every_operation_of_a_float32_program_is_rounded(name: str, seed: int) -> None:
    a, by_hand = CASES[name]
    sp, pv = signals(seed, 60)
    program = build(a, H, initial_output=U0)
    assert by_hand(sp, pv) == outputs(program, sp, pv).tolist()
    assert by_hand(sp, pv) != outputs(replace(program, precision="float64"), sp, pv).tolist()


@pytest.mark.parametrize("literals", ["float32", "float64"])
@given(seed=seeds)
def test_a_literal_has_the_width_that_the_card_says(literals: str, seed: int) -> None:
    """The 3 of the four-point rule: beside a float64 literal the operation is float64, until it is stored."""
    a = changed(FOUR_POINT, arithmetic__literals=literals)
    sp, pv = signals(seed, 60)
    g, e = f32(1.3 / (10 * H)), [r - y for r, y in narrow(sp, pv)]
    expected = []
    for n in range(60):
        x0, x1, x2, x3 = (e[max(n - k, 0)] for k in range(4))
        three = np.float64(3) if literals == "float64" else f32(3)
        expected.append(float(f32(g * (three * (x0 - x3) + x1 - x2))))
    assert expected == outputs(build(a, H, limits=(-1e9, 1e9)), sp, pv).tolist()


def test_the_two_widths_of_a_literal_differ_on_these_signals() -> None:
    sp, pv = signals(1, 60)
    both = [changed(FOUR_POINT, arithmetic__literals=literals) for literals in ("float32", "float64")]
    one, other = (outputs(build(a, H, limits=(-1e9, 1e9)), sp, pv) for a in both)
    assert np.count_nonzero(one != other) > 5


@pytest.mark.parametrize("limits", [(0.1, 99.9), (-0.3, 33.3)])
def test_limits_that_float32_does_not_hold_are_the_nearest_inside_them(limits: tuple[float, float]) -> None:
    sp, zero = np.array([0.0, 1000, -1000, 1000]), np.zeros(4)
    u = outputs(build(PID, H, limits=limits), sp, zero)[1:]
    assert (limits[0] <= u.min(), u.max() <= limits[1]) == (True, True)
    assert np.abs(np.array([u.min(), u.max()]) - limits).max() <= np.spacing(f32(max(limits)))


# --- the integral that stands still ----------------------------------------------------------------------------------


def far_integral(precision: Any, e: float) -> Floats:
    """The integral over 2000 scans of 0.05 s with Ti = 5000 s and K = 1, from 50: 1e-5 e per scan."""
    a = algorithm(kp=1.0, ki=1 / 5000, arithmetic__type=precision)
    sp = np.full(2000, 50.0 + e)
    (I,) = states_of(build(a, 0.05, initial_output=50.0 + e), sp, 0 * sp + 50.0, "I")  # noqa: E741
    return np.asarray(I)


def test_an_integral_whose_increment_is_below_half_a_unit_of_its_last_place_stands_still() -> None:
    # at 50 that unit is 2**-18, 3.8e-6, and the increment 1e-6
    moving, standing = far_integral("float64", 0.1), far_integral("float32", 0.1)
    assert moving[-1] - moving[0] == pytest.approx(1999e-6, rel=1e-6)  # a difference of numbers of 50, of which 1e-15 is rounding
    assert np.all(standing == standing[0])
    assert standing[0] == pytest.approx(50.0, abs=1e-5)


def test_just_above_half_a_unit_it_moves_by_a_whole_one_in_every_scan() -> None:
    assert np.all(np.diff(far_integral("float32", 0.25)) == 2.0**-18)  # the increment is 2.5e-6


# --- a float32 controller stays one ----------------------------------------------------------------------------------


def is_float32(x: float) -> bool:
    return float(f32(x)) == x


def test_what_a_float32_controller_keeps_and_returns_is_float32_whatever_happens_to_it() -> None:
    card = made_up_card(
        derivative={"on": "error", "filter": {"applies-to": "term", "time": 0.7}},
        scan={"default": "0.1 s", "interval": "measured"},
        feedforward={"summed": "before-limits", "gain": 0.3},
        **FLOAT32,
    )
    ctl = Controller(card.settings(kp=2.1, ki=0.37, kd=1.3), initial_output=U0)
    doings: list[dict[str, Any]] = [
        {}, {"auto": False, "manual": 41.7}, {"auto": False}, {}, {"interval": 0.13}, {"feedforward": 0.7}, {"cascade": 50.1},
        {"track": 33.3}, {}, {"hold": True}, {}, {"interval": 0.0}, {},
    ]  # fmt: skip
    for n, doing in enumerate(doings):
        u = ctl.scan(50.3 + n / 7, 50.1 - n / 3, **doing)
        assert (doing, is_float32(u)) == (doing, True)
        assert all(is_float32(x) for x in ctl.state.values())
        if n == 3:
            ctl.change(kp=1.9, kd=0)
        if n == 8:
            ctl.change(kd=1.7)
            assert all(is_float32(x) for x in ctl.state.values())


@pytest.mark.parametrize("doing", [{"auto": False, "manual": 0.1}, {"track": 0.1}], ids=str)
def test_an_operators_output_is_rounded_even_while_a_signal_is_bad(doing: dict[str, Any]) -> None:
    ctl = Controller(made_up_card(**FLOAT32).settings(kp=1, ki=0.1))
    good, bad = ctl.scan(50.0, 50.0, **doing), ctl.scan(50.0, math.nan, **doing)
    assert (good, bad) == (float(f32(0.1)), float(f32(0.1)))


def test_a_controller_that_becomes_float32_rounds_what_it_keeps() -> None:
    card = made_up_card(options={"REAL": {"default": "LREAL", "choices": {"LREAL": {}, "REAL": FLOAT32}}})
    ctl = Controller(card.settings(kp=2.1, ki=0.37), initial_output=U0)
    ctl.run(50.3, [50.1, 49.7])
    ctl.change(REAL="REAL")
    assert all(is_float32(x) for x in ctl.state.values())


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, 3e38])
def test_float32_signals_overflow_quietly_scan_after_scan_as_in_a_run(value: float) -> None:
    chosen = made_up_card(faults={"signal": "propagate"}, **FLOAT32).settings(kp=2.1, ki=0.37)
    once, often = Controller(chosen), Controller(chosen)
    pv = [50.0, value, -value, 50.0]
    assert [repr(u) for u in once.run(50.0, pv).tolist()] == [repr(often.scan(50.0, y)) for y in pv]


@pytest.mark.parametrize("literals", ["float32", "float64"])
def test_the_printed_module_of_a_float32_program_runs_on_its_own(literals: str) -> None:
    a = changed(PID, Tf=0.0, derivative__rule=Rule.FOUR_POINT, arithmetic__literals=literals)
    program = build(a, H, initial_output=U0)
    sp, pv = signals(3, 40)
    more = f"\nprint(list(map(float, run(list(INITIAL), {sp.tolist()}, {pv.tolist()}, [1.0] * 40, [0.0] * 40))))\n"
    done = subprocess.run([sys.executable, "-I", "-"], input=source(program) + more, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == repr(outputs(program, sp, pv).tolist())
    assert ("float64(3.0)" in source(program)) == (literals == "float64")


# --- whole numbers ---------------------------------------------------------------------------------------------------

COUNTS = algorithm(
    kp=1.5, ki=1.5 / 60, c=0.0, windup=VELOCITY, arithmetic__type="integer", arithmetic__counts=10, arithmetic__gain_counts=100,
)  # fmt: skip
POSITIONAL_COUNTS = changed(COUNTS, implementation="positional", integral__windup=NONE)
TICKS = 10_000


@settings(max_examples=5)
@given(seed=seeds, most=st.integers(1, 30))
def test_with_carried_remainders_the_sum_is_the_floor_of_the_exact_sum(seed: int, most: int) -> None:
    """``M = kp (e + (h/Ti) sum of e)`` in whole numbers, after ten thousand scans of 0.1 s with Ti = 60 s."""
    e = np.random.default_rng(seed).integers(-most, most + 1, 10_000)
    e[0] = 0
    u = outputs(build(COUNTS, 0.1, limits=(-1e6, 1e6)), e / 10, np.zeros(10_000))
    h, Ti = TICKS // 10, 60 * TICKS
    sums = np.cumsum(e) * h // Ti
    assert u.tolist() == ((150 * (e + sums) // 100) / 10).tolist()  # kp is 150 of a hundredth


def test_without_the_remainders_a_small_error_would_never_move_the_output() -> None:
    e = np.ones(10_000, dtype=np.int64)
    e[0] = 0
    assert int(np.sum(e * (TICKS // 10) // (60 * TICKS))) == 0  # each increment rounded down by itself
    u = outputs(build(COUNTS, 0.1), e / 10, np.zeros(10_000))
    assert u[-1] == (150 * (1 + 9999 // 600) // 100) / 10 == 2.5  # one count in 600 scans


@settings(max_examples=5)
@given(seed=seeds)
def test_nothing_of_the_derivative_is_lost_to_rounding(seed: int) -> None:
    """``(h + Tf) D`` and its remainder are what came in, ``Td`` times the fall of the measurement, less what ``-h D`` took out."""
    a = changed(COUNTS, ki=0.0, kd=1.5 * 7, Tf=3.0)
    y = np.cumsum(np.random.default_rng(seed).integers(-5, 6, 2000)) + 500
    D, rest = (x.astype(np.int64) for x in states_of(build(a, 0.1, limits=(-1e6, 1e6)), np.zeros(2000), y / 10, "D", "Dr"))
    h, Td, Tf = TICKS // 10, 7 * TICKS, 3 * TICKS
    taken = h * np.concatenate([[0], np.cumsum(D)[:-1]])
    assert ((h + Tf) * D + rest).tolist() == (Td * (y[0] - y) - taken).tolist()
    assert np.all((rest >= 0) & (rest < h + Tf))


@pytest.mark.parametrize(
    ("a", "h", "message"),
    [
        (changed(COUNTS, kp=1.505), 0.1, "the gain is not a whole number of counts"),
        (COUNTS, 0.00015, "the scan interval of 0.00015 s is not a whole number of 0.0001 s"),
        (changed(COUNTS, ki=1.5 / 60.00005), 0.1, "the integral time of 60.0001 s is not a whole number"),
        (changed(COUNTS, kp=1e15, ki=0.0), 0.1, "the gain is too large for whole numbers"),
        (changed(COUNTS, b=0.0), 0.1, "integer arithmetic is defined for velocity PID in standard form"),
        (
            changed(COUNTS, implementation="positional", integral__windup=NONE),
            0.1,
            "integer arithmetic is defined for velocity PID in standard form",
        ),
    ],
)
def test_what_whole_numbers_cannot_hold_is_refused(a: Algorithm, h: float, message: str) -> None:
    with pytest.raises(ScanError, match=message):
        build(a, h)
