"""What is not linear: shapes of the error, deadbands, rate limits and resolution, by hand (specs/equations.md, section 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import GENERAL_RULES, Rule
from pidemu.card.model.signals import ErrorShape
from pidemu.card.windup import Scheme
from pidemu.program.builder import build
from tests.algorithms import NONE, VELOCITY, algorithm, changed, incremental
from tests.helpers import WIDE, Floats, outputs
from tests.program.support import signals, states_of

P = algorithm(kp=1.0)
PI = algorithm(kp=2.0, ki=0.5)
SHAPES: dict[str, ErrorShape[float]] = {
    "deadband": ErrorShape(shape="gap", band=2.0),
    "deadband, subtracted": ErrorShape(shape="gap", band=2.0, subtracted=True),
    "gap": ErrorShape(shape="gap", band=2.0, gain=0.25),
    "gap, subtracted": ErrorShape(shape="gap", band=2.0, gain=0.25, subtracted=True),
    "squared": ErrorShape(shape="squared", over=50.0),
    "gain-linear": ErrorShape(shape="gain-linear", linearity=0.5, over=50.0),
}
ERRORS = [-10.0, -4.0, -2.0, -1.0, 0.0, 0.5, 2.0, 2.5, 4.0, 20.0]
SHAPED = {
    "deadband": [-10, -4, 0, 0, 0, 0, 0, 2.5, 4, 20],
    "deadband, subtracted": [-8, -2, 0, 0, 0, 0, 0, 0.5, 2, 18],
    "gap": [-10, -4, -0.5, -0.25, 0, 0.125, 0.5, 2.5, 4, 20],
    "gap, subtracted": [-8.5, -2.5, -0.5, -0.25, 0, 0.125, 0.5, 1, 2.5, 18.5],
    "squared": [-2, -0.32, -0.08, -0.02, 0, 0.005, 0.08, 0.125, 0.32, 8],
    "gain-linear": [-6, -2.16, -1.04, -0.51, 0, 0.2525, 1.04, 1.3125, 2.16, 14],
}
"""What is left of `ERRORS`: by hand."""

seeds = st.integers(0, 2**32 - 1)
in_each_implementation = pytest.mark.parametrize("windup", [NONE, VELOCITY], ids=["positional", "velocity"])


def run(a: Algorithm, errors: Sequence[float] | Floats, h: float = 1.0, **more: Any) -> list[float]:
    """The outputs on these errors: a setpoint over a measurement of zero."""
    sp = np.array(errors, dtype=float)
    u: list[float] = outputs(build(a, h, **{"limits": WIDE} | more), sp, 0 * sp).tolist()
    return u


# --- shapes of the error ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_a_shaped_error_is_what_was_worked_out_by_hand(name: str) -> None:
    assert run(changed(P, error=SHAPES[name]), ERRORS) == pytest.approx(SHAPED[name], rel=1e-15)  # 0.32 is no binary number


@pytest.mark.parametrize("name", SHAPES)
@given(seed=seeds)
def test_a_velocity_program_sums_the_increments_of_the_shaped_error(name: str, seed: int) -> None:
    errors, _ = signals(seed, 60, amplitude=8.0)
    positional = np.array(run(changed(PI, error=SHAPES[name]), errors))
    by_increments = np.array(run(incremental(PI, error=SHAPES[name]), errors))
    assert np.max(np.abs(positional - by_increments)) <= 1e-11 * (1 + np.max(np.abs(positional)))  # sums in another order


@pytest.mark.parametrize("name", [n for n in SHAPES if n not in ("deadband", "gap")])
@given(e=st.floats(-60, 60), step=st.floats(-1e-6, 1e-6))
def test_a_subtracted_gap_and_every_smooth_shape_are_continuous(name: str, e: float, step: float) -> None:
    one, other = run(changed(P, error=SHAPES[name]), [e, e + step])
    steepest = 2 * 61 / 50  # of the squared error on this range; 1 of the gaps
    assert abs(one - other) <= steepest * abs(step) + 1e-13  # rounded to 1e-16 of 60


@pytest.mark.parametrize("edge", [2.0, -2.0])
def test_a_gap_that_is_not_subtracted_jumps_at_its_edge(edge: float) -> None:
    beyond = math.nextafter(edge, 10 * edge)
    assert run(changed(P, error=SHAPES["deadband"]), [edge, beyond]) == [0, beyond]
    assert run(changed(P, error=SHAPES["gap"]), [edge, beyond]) == [edge / 4, beyond]


@pytest.mark.parametrize("name", SHAPES)
@given(e=st.floats(-60, 60))
def test_every_shape_is_odd(name: str, e: float) -> None:
    one, other = run(changed(P, error=SHAPES[name]), [e, -e])
    assert one == -other


@pytest.mark.parametrize(
    ("on", "expected"),
    # the error 1 is within the deadband of 2: P = 2 e, I grows by 0.5 e
    [("error", [0.0, 0, 0]), ("proportional", [0.0, 0.5, 1.0]), ("integral", [0.0, 2.0, 2.0])],
)
def test_a_shape_counts_for_the_terms_it_is_said_to_count_for(on: Any, expected: list[float]) -> None:
    assert run(changed(PI, error=ErrorShape(shape="gap", band=2.0, on=on)), [0, 1, 1]) == expected


def test_the_derivative_is_of_the_error_as_it_is() -> None:
    a = algorithm(kp=1.0, kd=3.0, error=ErrorShape(shape="gap", band=2.0))
    assert run(a, [0, 1, 1, 3]) == [0, 3, 0, 9]


def test_a_weighted_proportional_term_is_shaped_as_a_whole() -> None:
    a = changed(P, b=0.5, error=ErrorShape(shape="gap", band=2.0))
    sp, pv = np.array([8.0, 8, 8]), np.array([3.0, 1, 7])
    assert outputs(build(a, 1.0, limits=WIDE), sp, pv).tolist() == [0, 3, -3]  # 4 - 3 is within


# --- the zero crossing -----------------------------------------------------------------------------------------------

WAITING: list[tuple[str, list[float], list[float]]] = [
    ("comes in, counts until it crosses zero, then not", [5, 1.5, 0.5, -0.5, 1, 1.9], [5, 1.5, 0.5, 0, 0, 0]),
    ("goes out and comes in again: it counts again", [5, 1, -1, 3, 1.5, 1, -1], [5, 1, 0, 3, 1.5, 1, 0]),
    ("turns before zero: it has not crossed", [5, 1, 0.2, 1, 1.9], [5, 1, 0.2, 1, 1.9]),
    ("jumps across zero into the band", [5, -1, -1.5, -3, -1], [5, 0, 0, -3, -1]),
    ("jumps across the whole band", [5, -5, -1, 1], [5, -5, -1, 0]),
    ("zero itself is a crossing", [5, 1, 0, 1], [5, 1, 0, 0]),
    ("begins within the band", [1, 1, -1, 1], [1, 1, 0, 0]),
    ("the edge belongs to the band", [5, 2, -2, 2, 2.5, 2], [5, 2, 0, 0, 2.5, 2]),
]


@pytest.mark.parametrize(("errors", "expected"), [w[1:] for w in WAITING], ids=[w[0] for w in WAITING])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_deadband_that_waits_for_zero_counts_only_after_a_change_of_sign_within_it(
    errors: list[float], expected: list[float], sign: int
) -> None:
    a = changed(P, error=ErrorShape(shape="gap", band=2.0, zero_crossing=True))
    assert run(a, [sign * e for e in errors]) == [sign * e for e in expected]


@given(errors=st.lists(st.integers(-12, 12).map(lambda n: n / 4), min_size=1, max_size=40), gain=st.sampled_from([0.0, 0.25]))
def test_the_state_of_the_zero_crossing_is_that_of_its_story(errors: list[float], gain: float) -> None:
    """Within the band there are two ways to be: on one's way to zero, or arrived. Only leaving the band forgets the arrival."""
    a = changed(P, error=ErrorShape(shape="gap", band=2.0, gain=gain, zero_crossing=True))
    expected, arrived, before = [], False, errors[0]
    for e in errors:
        if abs(e) > 2:
            arrived = False
        elif e == 0 or e * before < 0 or before == 0:
            arrived = True
        expected.append(gain * e if arrived else e)
        before = e
    assert run(a, errors) == expected


# --- deadbands of integral and output --------------------------------------------------------------------------------


def test_within_the_integral_deadband_the_integral_stands_still_and_p_goes_on() -> None:
    a = changed(PI, integral__deadband=1.0)
    # 2 e, and 0.5 e per scan where |e| is above 1
    assert run(a, [0, 3, 1, -1, 0.5, -1.5]) == [0, 6 + 1.5, 2 + 1.5, -2 + 1.5, 1 + 1.5, -3 + 0.75]
    assert run(incremental(a), [0, 3, 1, -1, 0.5, -1.5]) == [0, 7.5, 3.5, -0.5, 2.5, -2.25]


@pytest.mark.parametrize("rule", GENERAL_RULES)
@given(seed=seeds)
def test_the_integral_deadband_looks_at_this_scans_error_under_every_rule(rule: Rule, seed: int) -> None:
    errors, _ = signals(seed, 60, amplitude=4.0)
    a = changed(PI, integral__rule=rule, integral__deadband=1.0)
    (I,) = states_of(build(a, 1.0, limits=WIDE), errors, 0 * errors, "I")  # noqa: E741
    grown = 0.5 * errors[1:] if rule is not Rule.TRAPEZOIDAL else 0.25 * (errors[1:] + errors[:-1])
    expected = np.where(np.abs(errors[1:]) > 1, grown, 0.0)
    assert np.max(np.abs(expected - np.diff(I))) <= 1e-13 * (1 + np.max(np.abs(I)))  # a difference of two sums


def test_the_output_moves_only_by_more_than_its_deadband() -> None:
    a = changed(P, output__deadband=2.0)
    assert run(a, [0, 1.5, 2, 2.5, 1, 0.5, 0.25, -5]) == [0, 0, 0, 2.5, 2.5, 2.5, 0.25, -5]


@in_each_implementation
def test_what_the_output_deadband_holds_back_is_not_lost(windup: Scheme[float]) -> None:
    a = algorithm(kp=2.0, ki=0.5, windup=windup, output__deadband=2.0)
    # the sum goes 0, 2.5, 3, 3.5, 4, 4.5, 5
    assert run(a, [0, 1, 1, 1, 1, 1, 1]) == [0, 2.5, 2.5, 2.5, 2.5, 2.5, 5]


# --- rate limits -----------------------------------------------------------------------------------------------------


def test_the_output_moves_no_faster_than_its_rate_allows() -> None:
    a = changed(P, output__rate=4.0)
    assert run(a, [0, 5, 5, 5, -5, 0, 0], h=0.5) == [0, 2, 4, 5, 3, 1, 0]


def test_an_increment_that_the_rate_limit_cuts_is_lost_to_a_velocity_program() -> None:
    a = incremental(P, output__rate=4.0)
    assert run(a, [0, 5, 5, 5, 4], h=0.5) == [0, 2, 2, 2, 1]


@given(seed=seeds, rate=st.floats(0.1, 50))
def test_no_step_of_the_output_is_larger_than_the_rate_allows(seed: int, rate: float) -> None:
    sp, pv = signals(seed)
    u = outputs(build(changed(PI, output__rate=rate), 0.5, initial_output=30.0), sp, pv)
    assert np.max(np.abs(np.diff(u, prepend=30.0))) <= 0.5 * rate * (1 + 1e-12) + 1e-13  # 30 + reach is rounded


@in_each_implementation
def test_an_operators_output_beyond_the_limits_is_brought_back_inside_at_once_however_slow_the_rate(windup: Scheme[float]) -> None:
    a = algorithm(kp=2.0, ki=0.5, windup=windup, output__rate=1.0)
    zero = np.zeros(3)
    manual = np.array([150.0, math.nan, math.nan])
    u = outputs(build(a, 1.0), zero, zero, np.array([0.0, 1, 1]), manual)
    assert u.tolist() == [150, 100, 100]


def test_the_setpoint_moves_no_faster_than_its_rate_and_starts_where_it_is() -> None:
    a = changed(P, setpoint__rate=4.0, setpoint__rate_down=4.0)
    assert run(a, [10, 10, 15, 15, 15, 14], h=0.5) == [10, 10, 12, 14, 15, 14]


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ((4.0, 2.0), [10, 12, 14, 13, 12, 11]),
        ((4.0, math.inf), [10, 12, 14, 0, 0, 0]),
        ((None, 2.0), [10, 15, 15, 14, 13, 12]),
    ],
)
def test_the_setpoint_may_rise_and_fall_at_different_rates(rates: tuple[float | None, float], expected: list[float]) -> None:
    a = changed(P, setpoint__rate=rates[0], setpoint__rate_down=rates[1])
    assert run(a, [10, 15, 15, 0, 0, 0], h=0.5) == expected


def test_a_limited_setpoint_that_starts_at_zero_goes_up_from_there_in_the_first_scan() -> None:
    a = changed(P, setpoint__rate=4.0, setpoint__starts="zero")
    assert run(a, [5, 5, 5, 5, -5], h=0.5) == [2, 4, 5, 5, 3]


def test_all_terms_see_the_limited_setpoint() -> None:
    a = algorithm(kp=1.0, ki=1.0, kd=1.0, setpoint__rate=1.0)
    ramp = changed(a, setpoint__rate=None)
    assert run(a, [0, 3, 3, 3, 3]) == run(ramp, [0, 1, 2, 3, 3]) == [0, 1 + 1 + 1, 2 + 3 + 1, 3 + 6 + 1, 3 + 9]


# --- resolution ------------------------------------------------------------------------------------------------------


def test_the_output_is_the_nearest_step_a_half_upwards_and_inside_the_limits() -> None:
    a = changed(P, output__resolution=0.5)
    assert run(a, [0.2, 0.25, 0.74, 0.75, -0.25, -0.26, 9.9], limits=(-0.4, 9.8)) == [0, 0.5, 0.5, 1, 0, -0.4, 9.8]


@in_each_implementation
def test_what_the_resolution_cuts_off_is_not_lost(windup: Scheme[float]) -> None:
    a = algorithm(kp=1.0, ki=0.125, windup=windup, output__resolution=1.0)
    # the sum goes 0, 1.125, 1.25, 1.375, 1.5: a half upwards
    assert run(a, [0, 1, 1, 1, 1]) == [0, 1, 1, 1, 2]


@given(seed=seeds, step=st.sampled_from([0.125, 1.0, 4.0]))
def test_the_output_is_always_a_multiple_of_its_resolution(seed: int, step: float) -> None:
    sp, pv = signals(seed)
    u = outputs(build(changed(PI, output__resolution=step), 0.5), sp, pv)
    assert np.all(u / step == np.floor(u / step))
