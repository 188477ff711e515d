"""Rules of the derivative and filters before the algorithm: plain loops and the discrete law (specs/equations.md, section 4)."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pidemu import Controller
from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import GENERAL_RULES, Form, GeneralRule, Rule
from pidemu.card.model.signals import SignalFilter
from pidemu.errors import ScanError
from pidemu.law.law import Law
from pidemu.program.builder import build
from tests.algorithms import NONE, VELOCITY, algorithm, changed, incremental
from tests.helpers import WIDE, Floats, made_up_card, outputs
from tests.program.support import lagged, positional, signals, states_of, velocity

U0 = 20.0
RULES = [(rule, True) for rule in (*GENERAL_RULES, Rule.EXACT, Rule.LAGGED_DIFFERENCE)] + [(Rule.FOUR_POINT, False)]
BEFORE: dict[str, dict[str, Any]] = {
    "none": {},
    "previous measurement": {"measurement__previous_scan": True},
    "setpoint filter": {"setpoint__filter": SignalFilter(time=7.0)},
    "setpoint factor": {"setpoint__filter": SignalFilter(time=0.0, factor=0.3)},
    "measurement filter": {"measurement__filter": SignalFilter(time=7.0)},
    "measurement factor": {"measurement__filter": SignalFilter(time=0.0, factor=0.3)},
    "error filter": {"error__filter": SignalFilter(time=7.0), "b": 1.0, "c": 1.0},
    "error factor": {"error__filter": SignalFilter(time=0.0, factor=0.3), "b": 1.0, "c": 1.0},
    "forward filter": {"measurement__filter": SignalFilter(time=7.0, rule=Rule.FORWARD)},
    "trapezoidal filter": {"measurement__filter": SignalFilter(time=7.0, rule=Rule.TRAPEZOIDAL)},
    "all at once": {
        "measurement__previous_scan": True, "setpoint__filter": SignalFilter(time=0.0, factor=0.5),
        "measurement__filter": SignalFilter(time=3.0), "error__filter": SignalFilter(time=2.0), "b": 1.0, "c": 1.0,
    },
}  # fmt: skip
"""What is done to the signals; the filter on the error goes with P and D on the error."""

gains = st.floats(0.1, 10)
weights = st.sampled_from([0.0, 1.0]) | st.floats(0.1, 1)
seeds = st.integers(0, 2**32 - 1)

in_each_form = pytest.mark.parametrize("series", [False, True], ids=["parallel", "series"])
in_each_implementation = pytest.mark.parametrize("by_increments", [False, True], ids=["positional", "velocity"])
with_each_rule = pytest.mark.parametrize(("rule", "filtered"), RULES, ids=[rule.value for rule, _ in RULES])
behind_each_filter = pytest.mark.parametrize("before", BEFORE)


@st.composite
def algorithms(draw: st.DrawFn, rule: Rule, filtered: bool, series: bool, before: str) -> Algorithm:
    a = algorithm(
        form=Form.SERIES if series else Form.STANDARD, kp=draw(gains), ki=draw(st.floats(0.01, 0.5)), kd=draw(gains),
        b=draw(weights), c=draw(weights), Tf=draw(st.floats(1.2, 30)) if filtered else 0.0, derivative__rule=rule,
    )  # fmt: skip
    return changed(a, **BEFORE[before])


def assert_close(expected: Floats, actual: Floats, a: Algorithm, h: float, size: float = 100.0) -> None:
    """Equal to 1e-11 of the largest term: some hundred sums, each rounded to 1e-16 of it."""
    scale = size * (a.kp + 4 * a.kd / h) * (1 + a.ki / a.kp * h * len(expected)) + U0
    assert np.max(np.abs(expected - actual)) <= 1e-11 * scale


@with_each_rule
@behind_each_filter
@in_each_form
@in_each_implementation
@settings(max_examples=3)
@given(data=st.data(), h=st.sampled_from([0.25, 1.0]), seed=seeds)
def test_a_program_is_the_loop_written_by_hand(
    rule: Rule, filtered: bool, before: str, series: bool, by_increments: bool, data: st.DataObject, h: float, seed: int
) -> None:
    a = data.draw(algorithms(rule, filtered, series, before))
    sp, pv = signals(seed)
    by_hand = velocity if by_increments else positional
    program = build(incremental(a) if by_increments else a, h, limits=WIDE, initial_output=U0)
    assert_close(by_hand(a, h, sp, pv, U0), outputs(program, sp, pv), a, h)


@with_each_rule
@behind_each_filter
@in_each_form
@in_each_implementation
@pytest.mark.parametrize("path", ["feedback", "setpoint"])
@settings(max_examples=2)
@given(data=st.data(), h=st.sampled_from([0.25, 1.0]))
def test_the_impulse_response_is_that_of_the_discrete_law(
    rule: Rule, filtered: bool, before: str, series: bool, by_increments: bool, path: Literal["feedback", "setpoint"],
    data: st.DataObject, h: float,
) -> None:  # fmt: skip
    a = data.draw(algorithms(rule, filtered, series, before))
    a = incremental(a) if by_increments else a
    one, zero = np.zeros(41), np.zeros(41)
    one[1] = 1.0  # the first scan is the start, at rest
    program = build(a, h, limits=WIDE)
    response = outputs(program, one, zero) if path == "setpoint" else -outputs(program, zero, one)
    expected = Law(a, h).impulse(40, path)
    # the law's division multiplies polynomials out, whose poles near 1 cancel to some digits
    assert np.max(np.abs(expected - response[1:])) <= 1e-9 * np.max(np.abs(expected))


# --- what the exact rule is exact for --------------------------------------------------------------------------------


@in_each_implementation
@given(kd=gains, Tf=st.floats(0.05, 50), h=st.floats(0.05, 5), slope=st.floats(-5, 5))
def test_the_exact_rule_is_the_sampled_response_to_a_ramp(
    by_increments: bool, kd: float, Tf: float, h: float, slope: float
) -> None:
    a = algorithm(kd=kd, Tf=Tf, windup=VELOCITY if by_increments else NONE, derivative__rule=Rule.EXACT)
    t = h * np.arange(60.0)
    u = outputs(build(a, h, limits=WIDE), slope * t, np.zeros(60))
    expected = kd * slope * -np.expm1(-t / Tf)  # kd s/(1 + Tf s) times slope/s^2, back in time
    assert np.max(np.abs(expected - u)) <= 1e-12 * (kd * abs(slope) * (1 + 60 * h / Tf) + 1e-9)  # slope t itself is rounded


@given(kd=gains, Tf=st.floats(0.05, 50), h=st.floats(0.05, 5), seed=seeds)
def test_the_exact_rule_is_the_sampled_response_to_any_broken_line(kd: float, Tf: float, h: float, seed: int) -> None:
    """A broken line is a sum of ramps, each beginning at a sample where the slope changes."""
    x, _ = signals(seed, 60)
    x[0] = 0.0
    t = h * np.arange(60)
    slopes = np.diff(x, prepend=0.0, append=x[-1])[1:] / h  # from each sample on
    changes = np.diff(slopes, prepend=0.0)
    since = np.maximum(t[:, None] - t[None, :], 0.0)
    expected = kd * (-np.expm1(-since / Tf) @ changes)
    a = algorithm(kd=kd, Tf=Tf, derivative__rule=Rule.EXACT)
    u = outputs(build(a, h, limits=WIDE), x, np.zeros(60))
    assert np.max(np.abs(expected - u)) <= 1e-11 * kd * 60 * np.max(np.abs(slopes))  # 60 ramps that cancel


@given(Tf=st.floats(0.5, 50), h=st.floats(0.05, 5))
def test_after_a_step_exact_and_lagged_difference_decay_alike_from_different_heights(Tf: float, h: float) -> None:
    step = np.ones(30)
    step[0] = 0.0
    a = algorithm(kd=2.0, Tf=Tf, derivative__rule=Rule.EXACT)
    exact, difference = (
        outputs(build(changed(a, derivative__rule=rule), h, limits=WIDE), step, 0 * step)[1:]
        for rule in (Rule.EXACT, Rule.LAGGED_DIFFERENCE)
    )
    decay = np.exp(-h / Tf * np.arange(29))
    # 2 (1 - a)/h and 2 a/Tf at once; 1 - a loses digits where h is a hundredth of Tf
    assert np.allclose(exact, 2 * -math.expm1(-h / Tf) / h * decay, rtol=1e-9, atol=1e-12)
    assert np.allclose(difference, 2 / Tf * math.exp(-h / Tf) * decay, rtol=1e-9, atol=1e-12)


def test_four_points_of_a_ramp_give_its_slope_and_of_an_alternation_nothing_like_its_height() -> None:
    a = algorithm(kd=2.0, derivative__rule=Rule.FOUR_POINT)
    program, n = build(a, 0.5, limits=WIDE), np.arange(8.0)
    assert outputs(program, 3.0 * n, 0 * n)[3:].tolist() == [12.0] * 5  # 2 times 3 per 0.5 s
    alternating = outputs(program, (-1.0) ** n, 0 * n)[3:]
    # 2 (3 (1 + 1) - 1 - 1)/5 where the backward difference has 2 (1 + 1)/0.5 = 8
    assert alternating.tolist() == pytest.approx([-1.6, 1.6, -1.6, 1.6, -1.6], rel=1e-15)


# --- filters and the previous measurement ----------------------------------------------------------------------------


@pytest.mark.parametrize("rule", GENERAL_RULES)
@given(Tf=st.floats(0.6, 20), seed=seeds)
def test_a_filter_starts_in_the_steady_state_of_its_first_sample(rule: GeneralRule, Tf: float, seed: int) -> None:
    a = algorithm(kp=1.0, measurement__filter=SignalFilter(time=Tf, rule=rule))
    _, pv = signals(seed, 40)
    u = outputs(build(a, 1.0, limits=WIDE), 0 * pv, pv)
    assert u[0] == pytest.approx(-pv[0], rel=1e-14)  # the weights add up to 1 but for rounding
    assert np.max(np.abs(lagged(pv, SignalFilter(time=Tf, rule=rule), 1.0) + u)) <= 1e-12 * np.max(np.abs(pv))


@pytest.mark.parametrize("h", [0.1, 1.0, 7.0])
def test_a_factor_is_the_share_of_the_new_sample_at_every_scan_interval(h: float) -> None:
    card = made_up_card(
        measurement={"filter": {"factor": "k"}},
        settings={
            "kp": {"sets": "gain", "unit": "%/%"},
            "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0},
            "kd": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
            "k": {"sets": "filter-factor", "unit": "1", "default": 1},
        },
    )
    step = Controller(card.settings(kp=1, k=0.25), h, output_limits=WIDE).run(0.0, [0, 1, 1, 1])
    assert step.tolist() == pytest.approx([0, -0.25, -0.4375, -0.578125], rel=1e-12)  # h (1 - k)/k is rounded
    assert Controller(card.settings(kp=1), h, output_limits=WIDE).run(0.0, [0, 1, 1]).tolist() == [0, -1, -1]


def test_the_measurement_of_the_previous_scan_enters_every_term_one_scan_late() -> None:
    a = algorithm(kp=1.0, ki=0.5, kd=3.0, measurement__previous_scan=True)
    late = states_of(build(a, 1.0, limits=WIDE), np.zeros(5), np.array([0.0, 8, 8, 8, 8]), "D", "I", "u")
    assert [x.tolist() for x in late] == [[0, 0, -24, 0, 0], [0, 0, -4, -8, -12], [0, 0, -36, -16, -20]]


@given(seed=seeds)
def test_a_filter_on_the_setpoint_leaves_the_way_of_the_measurement_alone(seed: int) -> None:
    a = algorithm(form=Form.SERIES, kp=2.0, ki=0.1, kd=4.0, Tf=2.0)
    _, pv = signals(seed)
    plain, filtered = (build(changed(a, setpoint__filter=f), 1.0, limits=WIDE) for f in (None, SignalFilter(time=9.0)))
    assert outputs(plain, 0 * pv, pv).tolist() == outputs(filtered, 0 * pv, pv).tolist()  # a setpoint of 0 stays 0


@pytest.mark.parametrize("name", ["setpoint", "measurement", "error"])
def test_a_forward_filter_faster_than_half_the_scan_interval_is_refused(name: str) -> None:
    fast: dict[str, Any] = {f"{name}__filter": SignalFilter(time=0.5, rule=Rule.FORWARD)}
    with pytest.raises(ScanError, match="the forward rule is unstable"):
        build(algorithm(kp=1.0, **fast), 1.0)


def test_a_rule_that_does_not_fit_the_filter_is_refused() -> None:
    a = algorithm(kp=1.0, kd=1.0)
    with pytest.raises(ScanError, match="needs a filter on the derivative term"):
        build(changed(a, derivative__rule=Rule.LAGGED_DIFFERENCE), 1.0)
    with pytest.raises(ScanError, match="goes with no other on the derivative term"):
        build(changed(a, derivative__rule=Rule.FOUR_POINT, Tf=1.0), 1.0)
