"""Scan programs against the discrete law, loops written by hand from specs/equations.md, and their own symmetries."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.algorithm.model import Algorithm, Place
from pidemu.backends.expressions import render
from pidemu.backends.python import compiled, source
from pidemu.card.load import variants
from pidemu.card.model.base import GENERAL_RULES, Form, Rule
from pidemu.card.references import is_active
from pidemu.card.windup import Scheme
from pidemu.card.windup.back_calculation import WindupBackCalculation
from pidemu.card.windup.conditional import WindupConditional
from pidemu.checks.runs import working
from pidemu.errors import ScanError
from pidemu.law.law import Law
from pidemu.program.builder import build
from pidemu.program.ir import Binary, Expr, Name, Number, Operator, Program, Select
from pidemu.settings.settings import limits
from tests.algorithms import (
    CLAMP,
    CLAMP_SUM,
    CONDITIONAL,
    EXTERNAL_RESET,
    FREEZE,
    NONE,
    VELOCITY,
    algorithm,
    back_calculation,
    changed,
    filter_at,
    incremental,
)  # fmt: skip
from tests.helpers import WIDE, Floats, outputs, scans_of, settings_of

PATHS: tuple[Literal["feedback"], Literal["setpoint"]] = ("feedback", "setpoint")
FILTERS: tuple[tuple[Place, Literal[1, 2]], ...] = (("term", 1), ("measurement", 1), ("measurement", 2), ("output", 1))
POSITIONAL_SCHEMES: dict[str, Scheme[float]] = {
    scheme.scheme: scheme for scheme in (NONE, CLAMP, CLAMP_SUM, FREEZE, CONDITIONAL, back_calculation(20.0), EXTERNAL_RESET)
}

on_every_card = pytest.mark.parametrize("name", pidemu.cards())


@dataclass(frozen=True)
class Record:
    """Signals of a run: in automatic throughout, or with spells in manual."""

    sp: Floats
    pv: Floats
    auto: Floats
    manual: Floats


def record(seed: int, n: int = 150, *, modes: bool = False, amplitude: float = 60.0) -> Record:
    """Setpoint steps and a wandering, noisy measurement; the first scan is at rest."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-amplitude, amplitude, n // 25 + 1), 25)[:n]
    pv = sp * rng.uniform(0, 1) + np.cumsum(rng.normal(0, amplitude / 20, n)) + rng.normal(0, 0.5, n)
    sp[0] = pv[0] = 0.0
    auto = np.repeat(rng.integers(0, 2, n // 10 + 1), 10)[:n].astype(float) if modes else np.ones(n)
    manual = np.where(rng.uniform(size=n) < 0.5, rng.uniform(5, 95, n), math.nan)
    return Record(sp, pv, auto, manual)


def run(program: Program, x: Record) -> Floats:
    return outputs(program, x.sp, x.pv, x.auto, x.manual)


def states_after(program: Program, x: Record) -> dict[str, float]:
    state = list(program.initial)
    compiled(program).run(state, x.sp.tolist(), x.pv.tolist(), x.auto.tolist(), x.manual.tolist())
    return dict(zip((q.name for q in program.states), state, strict=True))


seeds = st.integers(0, 2**32 - 1)
gains = st.just(0.0) | st.floats(0.05, 10)
weights = st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1)


@st.composite
def algorithms(draw: st.DrawFn, *, h: float = 1.0, windup: str | None = None) -> Algorithm:
    """Any algorithm that is stable at this scan interval, positional."""
    place, order = draw(st.sampled_from(FILTERS))
    kp = draw(gains)
    series = draw(st.booleans()) and kp != 0
    scheme = windup if windup is not None else draw(st.sampled_from(list(POSITIONAL_SCHEMES)))
    rules = [Rule.BACKWARD, Rule.FORWARD] if scheme == "external-reset" else list(GENERAL_RULES)
    b = 0.0 if scheme == "clamp-sum" else draw(weights)
    filter_rule = draw(st.sampled_from(GENERAL_RULES))
    fastest = 1.1 if order == 2 and filter_rule is Rule.FORWARD else 0.6  # in scans; the forward rule is stable above 1 and 1/2
    time = draw(st.floats(1, 100))
    return algorithm(
        form=Form.SERIES if series else Form.STANDARD,
        kp=kp,
        ki=draw(st.just(0.0) | st.floats(0.001, 1)),
        kd=draw(gains),
        b=b,
        c=draw(weights),
        Tf=draw(st.just(0.0) | st.floats(fastest, 20)) * h,
        Ti=time,
        windup=back_calculation(time) if scheme == "back-calculation" else POSITIONAL_SCHEMES[scheme],
        integral__rule=draw(st.sampled_from(rules)),
        derivative__rule=draw(st.sampled_from(GENERAL_RULES)),
        derivative__filter=filter_at(place, order, filter_rule),
        proportional__accumulated=b == 0 and (scheme == "clamp-sum" or draw(st.booleans())),
        transfer__start=draw(st.sampled_from(["bumpless", "load-output"])),
        transfer__derivative=draw(st.sampled_from(["running", "restarted"])),
    )


def largest_term(a: Algorithm, h: float, x: Record) -> float:
    """A bound on P and D on this record: rounding of sums and differences of terms is relative to it."""
    span = 2 * float(max(np.max(np.abs(x.sp)), np.max(np.abs(x.pv))))
    return span * (abs(a.kp) + 4 * abs(a.kd) / h) + 100


# --- the linear response ---------------------------------------------------------------------------------------------


def impulse(program: Program, path: Literal["feedback", "setpoint"], n: int) -> Floats:
    """The response to one scan of 1 on one input, from rest; the feedback path acts with a minus sign."""
    one, zero = np.zeros(n + 1), np.zeros(n + 1)
    one[1] = 1.0  # the first scan is the start, at rest
    if path == "setpoint":
        return outputs(program, one, zero)[1:]
    return -outputs(program, zero, one)[1:]


def assert_impulse(expected: Floats, actual: Floats) -> None:
    """Equal to 1e-9 of the largest sample: states carry the rounding (1e-16) of every scan before, and poles near 1 keep it.

    The law of a path on which nothing acts is not zero but that rounding.
    """
    assert np.max(np.abs(expected - actual)) <= 1e-9 * np.max(np.abs(expected)) + 1e-15


@on_every_card
@given(data=st.data())
def test_the_impulse_response_of_every_cards_program_is_that_of_its_law(name: str, data: st.DataObject) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    h = data.draw(scans_of(chosen.algorithm()))
    program = build(chosen.algorithm(own_units=True, scan=h).linear, h, limits=WIDE)
    for path in PATHS:
        assert_impulse(chosen.law(scan=h).impulse(40, path), impulse(program, path, 40))


@given(a=algorithms(h=0.7))
def test_the_impulse_response_of_any_positional_program_is_that_of_its_law(a: Algorithm) -> None:
    program = build(a, 0.7, limits=WIDE)
    for path in PATHS:
        assert_impulse(Law(a, 0.7).impulse(40, path), impulse(program, path, 40))


@given(a=algorithms(h=0.7))
def test_the_impulse_response_of_any_velocity_program_is_that_of_its_law(a: Algorithm) -> None:
    a = incremental(a, proportional__accumulated=False, transfer__start="bumpless")
    program = build(a, 0.7, limits=WIDE)
    for path in PATHS:
        assert_impulse(Law(a, 0.7).impulse(40, path), impulse(program, path, 40))


@pytest.mark.parametrize("velocity", [False, True], ids=["positional", "velocity"])
@pytest.mark.parametrize("series", [False, True], ids=["parallel", "series"])
@pytest.mark.parametrize("rule", GENERAL_RULES)
@pytest.mark.parametrize("integral", GENERAL_RULES)
@pytest.mark.parametrize(("place", "order"), [*FILTERS, ("none", 1)])
@settings(max_examples=4)
@given(
    kp=st.floats(0.05, 10), ki=st.floats(0.01, 1), kd=st.floats(0.05, 10), b=weights, c=weights, Tf=st.floats(1.1, 20),
    h=st.floats(0.1, 2),
)  # fmt: skip
def test_the_impulse_response_is_that_of_the_law_under_every_rule_filter_and_form(
    velocity: bool, series: bool, rule: Rule, integral: Rule, place: Place | Literal["none"], order: Literal[1, 2],
    kp: float, ki: float, kd: float, b: float, c: float, Tf: float, h: float,
) -> None:  # fmt: skip
    a = algorithm(
        form=Form.SERIES if series else Form.STANDARD,
        kp=kp,
        ki=ki,
        kd=kd,
        b=b,
        c=c,
        Tf=0.0 if place == "none" else Tf * h,
        windup=VELOCITY if velocity else NONE,
        integral__rule=integral,
        derivative__rule=rule,
        derivative__filter=None if place == "none" else filter_at(place, order, rule),
    )
    program = build(a, h, limits=WIDE)
    for path in PATHS:
        assert_impulse(Law(a, h).impulse(40, path), impulse(program, path, 40))


@on_every_card
@given(data=st.data())
def test_in_its_own_units_every_card_is_its_percent_law_rescaled_by_the_spans(name: str, data: st.DataObject) -> None:
    card = pidemu.load_card(name)
    default = settings_of(data, card)
    assert default.algorithm() == default.algorithm(own_units=True)
    given: dict[str, object] = {n: v.value for n, v in default.items()} | dict(default.options)
    chosen = card.settings(given, pv_range=(-50, 150), op_range=(0, 50))
    h = data.draw(scans_of(chosen.algorithm()))
    program = build(chosen.algorithm(own_units=True, scan=h).linear, h, limits=WIDE)
    engineering = chosen.equation.signals == "engineering"
    percent = 200 / 50 if engineering else 1.0  # output percent per PV percent, from output units per PV unit
    for path in PATHS:
        assert_impulse(chosen.law(scan=h).impulse(40, path), percent * impulse(program, path, 40))


@given(a=algorithms(), seed=seeds)
def test_positional_and_velocity_agree_in_the_linear_range(a: Algorithm, seed: int) -> None:
    x = record(seed)
    velocity = incremental(a, proportional__accumulated=False)
    positional_u = run(build(a, 1.0, limits=WIDE), x)
    velocity_u = run(build(velocity, 1.0, limits=WIDE), x)
    # both sum a hundred or so terms, each rounded to 1e-16 of the largest
    scale = largest_term(a, 1.0, x) + np.max(np.abs(positional_u))
    assert np.max(np.abs(positional_u - velocity_u)) <= 1e-9 * scale


@on_every_card
@given(data=st.data(), seed=seeds)
def test_every_card_agrees_with_its_other_implementation_in_the_linear_range(name: str, data: st.DataObject, seed: int) -> None:
    a = settings_of(data, pidemu.load_card(name)).algorithm().linear
    if a.dahlin is not None:
        return  # it has one implementation only
    a = changed(
        a,
        transfer__power_up="transfer",
        transfer__start="bumpless",
        transfer__first_scan="integrates",
        derivative__starts="sample",
    )
    h = data.draw(scans_of(a))
    x = record(seed)
    other = (
        changed(a, implementation="positional", integral__windup=NONE, proportional__accumulated=False)
        if a.velocity
        else incremental(a, proportional__accumulated=False)
    )
    one_u, other_u = (run(build(which, h, limits=WIDE), x) for which in (a, other))
    scale = largest_term(a, h, x) + np.max(np.abs(one_u))  # as above
    assert np.max(np.abs(one_u - other_u)) <= 1e-9 * scale


# --- limits, transfer, action ----------------------------------------------------------------------------------------


@on_every_card
@given(data=st.data(), seed=seeds, low=st.floats(-50, 49), width=st.floats(0.1, 100))
def test_in_automatic_the_output_of_every_card_is_within_its_limits(
    name: str, data: st.DataObject, seed: int, low: float, width: float
) -> None:
    a = settings_of(data, pidemu.load_card(name)).algorithm(own_units=True)
    x = record(seed, modes=True)
    u = run(build(a, data.draw(scans_of(a)), limits=(low, low + width)), x)
    in_auto = u[x.auto > 0]
    assert np.all((in_auto >= low) & (in_auto <= low + width))


@given(a=algorithms(), velocity=st.booleans(), seed=seeds)
def test_in_automatic_the_output_of_any_program_is_within_its_limits(a: Algorithm, velocity: bool, seed: int) -> None:
    x = record(seed, modes=True)
    if velocity:
        a = incremental(a)
    u = run(build(a, 1.0, limits=(10.0, 60.0)), x)
    in_auto = u[x.auto > 0]
    assert np.all((in_auto >= 10) & (in_auto <= 60))


def starts_in_automatic(x: Record) -> list[int]:
    return [n for n in range(1, len(x.auto)) if x.auto[n] > 0 and x.auto[n - 1] == 0]


def assert_bumpless(a: Algorithm, h: float, seed: int) -> None:
    x = record(seed, modes=True)
    u = run(build(a, h, limits=(0.0, 100.0), initial_output=30.0), x)
    scale = largest_term(a, h, x) + 1e12 * (a.arithmetic.type == "integer") / (
        a.arithmetic.counts or 1
    )  # whole counts; I = u - P - D, and then P + I + D: rounded to 1e-16 of the largest
    for n in starts_in_automatic(x):
        assert abs(u[n] - u[n - 1]) <= 1e-12 * scale


@on_every_card
@given(data=st.data(), seed=seeds)
def test_the_first_automatic_output_of_every_bumpless_card_is_the_last_manual_one(
    name: str, data: st.DataObject, seed: int
) -> None:
    a = settings_of(data, pidemu.load_card(name)).algorithm(own_units=True)
    h = data.draw(scans_of(a))
    if a.transfer.start == "load-output" or (a.ki == 0 and not a.velocity and a.dahlin is None):  # bumped by P + D, as in the field
        x = record(seed, modes=True)
        a = changed(
            a.linear,
            kp=0.0,
            kd=0.0,
            ki=0.0,
            transfer__start="load-output",
            transfer__without_integral="kept",
            integral__holds="ki e",
            transfer__manual_output="operator",
        )
        u = run(build(a, h, initial_output=30.0), x)
        assert all(u[n] == u[n - 1] for n in starts_in_automatic(x))
    elif a.transfer.start == "bumpless":
        assert_bumpless(a, h, seed)


@pytest.mark.parametrize("windup", [s for s in POSITIONAL_SCHEMES if not s.startswith("clamp")])
@given(data=st.data(), seed=seeds)
def test_the_first_automatic_output_of_any_bumpless_program_is_the_last_manual_one(
    windup: str, data: st.DataObject, seed: int
) -> None:
    a = data.draw(algorithms(windup=windup))
    assert_bumpless(changed(a, ki=a.ki or 0.1, transfer__start="bumpless"), 1.0, seed)


@given(a=algorithms(), seed=seeds)
def test_the_first_automatic_output_of_any_velocity_program_is_the_last_manual_one(a: Algorithm, seed: int) -> None:
    assert_bumpless(incremental(a), 1.0, seed)


@pytest.mark.parametrize("windup", POSITIONAL_SCHEMES)
@given(a=algorithms(), seed=seeds)
def test_no_windup_scheme_moves_the_integral_of_a_proportional_controller(windup: str, a: Algorithm, seed: int) -> None:
    a = changed(
        a,
        ki=0.0,
        kd=0.0,
        Tf=0.0,
        b=1.0,
        integral__windup=POSITIONAL_SCHEMES[windup],
        proportional__accumulated=False,
        transfer__start="bumpless",
    )
    program = build(a, 1.0, limits=(0.0, 100.0))
    x = record(seed, modes=True)
    assert states_after(program, x).get("I", 0.0) == 0.0
    in_auto = x.auto > 0
    assert np.array_equal(np.clip(a.kp * (x.sp - x.pv), 0.0, 100.0)[in_auto], run(program, x)[in_auto])


@on_every_card
@given(data=st.data(), seed=seeds)
def test_direct_action_is_reverse_action_on_mirrored_signals(name: str, data: st.DataObject, seed: int) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    a = chosen.algorithm(own_units=True).linear  # whole numbers are rounded down, which has no mirror image
    if chosen.equation.action.fixed:
        # there is no direct action: the real one's output in manual has the gain's sign
        a = changed(a, transfer__manual_output="operator")
    h = data.draw(scans_of(a))
    x = record(seed, modes=True)
    mirrored = replace(x, sp=-x.sp, pv=-x.pv)
    direct = run(build(a, h, action="direct", initial_output=50.0), x)
    assert np.array_equal(direct, run(build(a, h, action="reverse", initial_output=50.0), mirrored))


@on_every_card
@given(data=st.data())
def test_reverse_acting_means_that_the_output_falls_when_the_measurement_rises(name: str, data: st.DataObject) -> None:
    a = settings_of(data, pidemu.load_card(name)).algorithm()
    a = changed(a.linear, kp=abs(a.kp), ki=abs(a.ki), kd=abs(a.kd))  # a negative gain turns the action round
    first = impulse(build(a, data.draw(scans_of(a)), limits=WIDE), "feedback", 1)[0]
    late = a.integral.rule is Rule.FORWARD or a.ki == 0.0
    assert first > 0 or (a.kp == a.kd == 0.0 and late and first == 0)


# --- denormal numbers ------------------------------------------------------------------------------------------------

DECAY = 50 * 0.98 ** np.arange(100_000.0)
"""A signal that decays through the denormal numbers to exactly zero, after about 37,000 scans."""


@pytest.mark.parametrize("rule", GENERAL_RULES)
@pytest.mark.parametrize(("place", "order"), FILTERS)
@pytest.mark.parametrize("velocity", [False, True], ids=["positional", "velocity"])
def test_states_decay_to_zero_and_not_to_denormal_numbers(rule: Rule, place: Place, order: Literal[1, 2], velocity: bool) -> None:
    a = algorithm(
        kp=2.0,
        kd=5.0,
        c=0.0,
        Tf=20.0,
        windup=VELOCITY if velocity else NONE,
        derivative__rule=rule,
        derivative__filter=filter_at(place, order, rule),
    )
    program = build(a, 1.0, limits=WIDE)
    states = states_after(program, Record(DECAY * 0, DECAY, DECAY * 0 + 1, DECAY * 0))
    kept = {name: value for name, value in states.items() if name not in ("on", "begun") and not (velocity and name == "u")}
    assert dict.fromkeys(kept, 0.0) == kept


@pytest.mark.parametrize("rule", [Rule.BACKWARD, Rule.FORWARD])
@pytest.mark.parametrize("windup", [back_calculation(20.0), EXTERNAL_RESET], ids=lambda windup: windup.scheme)
def test_an_integral_that_is_drawn_back_to_zero_arrives_there(rule: Rule, windup: Scheme[float]) -> None:
    a = algorithm(kp=2.0, ki=0.1, Ti=20.0, windup=windup, integral__rule=rule)
    program = build(a, 1.0, limits=(-100.0, 0.0))
    pv = np.zeros(50_000)
    pv[0] = 50.0  # the start sets I = u - P = 100, and the high limit is 0
    assert states_after(program, Record(pv * 0, pv, pv * 0 + 1, pv * 0))["I"] == 0.0


# --- windup schemes, by hand from specs/equations.md, sections 4 to 6 ------------------------------------------------

LOW, HIGH, H = 0.0, 100.0, 0.5


def clip(x: float) -> float:
    return min(max(x, LOW), HIGH)


@dataclass(frozen=True)
class Pid:
    """A parallel PID, P on error, unfiltered D on PV, backward rules: kp = K, ki = K/Ti."""

    kp: float
    ki: float
    kd: float
    Tt: float

    def algorithm(self, windup: Scheme[float], **more: Any) -> Algorithm:
        scheme = back_calculation(self.Tt) if isinstance(windup, WindupBackCalculation) else windup
        return algorithm(kp=self.kp, ki=self.ki, kd=self.kd, c=0.0, windup=scheme, **more)

    def P(self, x: Record, n: int) -> float:
        return self.kp * float(x.sp[n] - x.pv[n])

    def D(self, x: Record, n: int) -> float:
        return -self.kd * float(x.pv[n] - x.pv[n - 1]) / H if n else 0.0

    def dI(self, x: Record, n: int) -> float:
        return self.ki * H * float(x.sp[n] - x.pv[n])


pids = st.builds(
    lambda kp, Ti, kd, Tt: Pid(kp, kp / Ti, kd, Tt),
    kp=st.floats(0.1, 10),
    Ti=st.floats(1, 100),  # the explicit lags below are stable for times above half the scan interval
    kd=st.just(0.0) | st.floats(0.1, 10),
    Tt=st.floats(1, 50),
)
U0 = 40.0


def by_none(c: Pid, x: Record) -> list[float]:
    u, I = [], 0.0  # noqa: E741 (the field's symbol)
    for n in range(len(x.sp)):
        I = I + c.dI(x, n) if n else U0 - c.P(x, n) - c.D(x, n)  # noqa: E741
        u.append(clip(c.P(x, n) + I + c.D(x, n)))
    return u


def by_clamp(c: Pid, x: Record) -> list[float]:
    u, I = [], 0.0  # noqa: E741
    for n in range(len(x.sp)):
        I = clip(I + c.dI(x, n) if n else U0 - c.P(x, n) - c.D(x, n))  # noqa: E741
        u.append(clip(c.P(x, n) + I + c.D(x, n)))
    return u


def by_clamp_sum(c: Pid, x: Record) -> list[float]:
    """P on PV, in the same sum; loaded with the output at the start, as its one implementation does."""
    u, S = [], U0
    for n in range(len(x.sp)):
        S = clip(S + c.dI(x, n) - (c.kp * float(x.pv[n] - x.pv[n - 1]) if n else 0.0))
        u.append(clip(S + c.D(x, n)))
    return u


def by_freeze(c: Pid, x: Record) -> list[float]:
    u, I = [U0], U0 - c.P(x, 0)  # noqa: E741
    for n in range(1, len(x.sp)):
        further_up, further_down = u[-1] >= HIGH and c.dI(x, n) > 0, u[-1] <= LOW and c.dI(x, n) < 0
        if not (further_up or further_down):
            I += c.dI(x, n)  # noqa: E741
        u.append(clip(c.P(x, n) + I + c.D(x, n)))
    return u


def by_conditional(c: Pid, x: Record) -> list[float]:
    u, I = [U0], U0 - c.P(x, 0)  # noqa: E741
    for n in range(1, len(x.sp)):
        ahead = c.P(x, n) + I + c.dI(x, n) + c.D(x, n)
        further_up, further_down = ahead > HIGH and c.dI(x, n) > 0, ahead < LOW and c.dI(x, n) < 0
        if not (further_up or further_down):
            I += c.dI(x, n)  # noqa: E741
        u.append(clip(c.P(x, n) + I + c.D(x, n)))
    return u


def by_back_calculation(c: Pid, x: Record) -> list[float]:
    u, I = [U0], U0 - c.P(x, 0)  # noqa: E741
    for n in range(1, len(x.sp)):
        I += c.dI(x, n)  # noqa: E741
        v = c.P(x, n) + I + c.D(x, n)
        u.append(clip(v))
        I += (H / c.Tt) * (u[-1] - v)  # noqa: E741
    return u


def by_external_reset(c: Pid, x: Record) -> list[float]:
    """The integral is F, a lag of time Ti of the limited output less D; the output is P + F + D, solved for F where it is free."""
    Ti = c.kp / c.ki
    u, F = [U0], U0 - c.P(x, 0)
    for n in range(1, len(x.sp)):
        # backward lag, Ti (F' - F) = h (u - D - F'), with u = P + F' + D as long as the output is free: F' = F + (h/Ti) P
        u.append(clip(c.P(x, n) + (F + H / Ti * c.P(x, n)) + c.D(x, n)))
        F = (Ti * F + H * (u[-1] - c.D(x, n))) / (Ti + H)
    return u


def by_external_reset_forward(c: Pid, x: Record) -> list[float]:
    """The same lag by the forward rule: F moves after the output."""
    Ti = c.kp / c.ki
    u, F = [U0], U0 - c.P(x, 0)
    F += H / Ti * (u[0] - c.D(x, 0) - F)
    for n in range(1, len(x.sp)):
        u.append(clip(c.P(x, n) + F + c.D(x, n)))
        F += H / Ti * (u[-1] - c.D(x, n) - F)
    return u


def by_velocity(c: Pid, x: Record) -> list[float]:
    u = [U0]
    for n in range(1, len(x.sp)):
        u.append(clip(u[-1] + (c.P(x, n) - c.P(x, n - 1)) + c.dI(x, n) + (c.D(x, n) - c.D(x, n - 1))))
    return u


DROPPING: Scheme[float] = WindupConditional(scheme="conditional", last_increment="dropped")
REFERENCES: list[tuple[str, Scheme[float], Callable[[Pid, Record], list[float]], dict[str, Any]]] = [
    ("none", NONE, by_none, {}),
    ("clamp", CLAMP, by_clamp, {}),
    ("clamp-sum", CLAMP_SUM, by_clamp_sum, {"b": 0.0, "proportional__accumulated": True, "transfer__start": "load-output"}),
    ("freeze", FREEZE, by_freeze, {}),
    ("conditional, dropping", DROPPING, by_conditional, {}),
    ("back-calculation", back_calculation(20.0), by_back_calculation, {}),  # of the tracking time that is drawn
    ("external-reset backward", EXTERNAL_RESET, by_external_reset, {}),
    ("external-reset forward", EXTERNAL_RESET, by_external_reset_forward, {"integral__rule": Rule.FORWARD}),
    ("velocity", VELOCITY, by_velocity, {}),
]


@pytest.mark.parametrize(("scheme", "reference", "more"), [r[1:] for r in REFERENCES], ids=[r[0] for r in REFERENCES])
@given(pid=pids, seed=seeds)
def test_each_windup_scheme_obeys_its_rule(
    scheme: Scheme[float], reference: Callable[[Pid, Record], list[float]], more: dict[str, Any], pid: Pid, seed: int
) -> None:
    x = record(seed)
    program = build(pid.algorithm(scheme, **more), H, limits=(LOW, HIGH), initial_output=U0)
    expected = np.array(reference(pid, x))
    # sums in another order: 150 roundings of 1e-16 of the largest term
    scale = largest_term(pid.algorithm(scheme), H, x) + pid.ki * H * 150 * 120
    assert np.max(np.abs(expected - run(program, x))) <= 1e-12 * scale


@pytest.mark.parametrize("scheme", [r[0] for r in REFERENCES if r[0] not in ("none", "clamp-sum", "velocity")])
def test_the_records_reach_the_limits_so_that_schemes_differ_from_integrating_always(scheme: str) -> None:
    reference = next(r[2] for r in REFERENCES if r[0] == scheme)
    pid = Pid(kp=2.0, ki=0.5, kd=1.0, Tt=4.0)
    assert by_none(pid, record(1)) != reference(pid, record(1))


# --- refusals --------------------------------------------------------------------------------------------------------

PI = algorithm(kp=2.0, ki=0.1)


def test_a_bias_belongs_to_a_positional_controller_without_integral() -> None:
    alone = changed(PI, ki=0.0)
    x = record(5)
    assert np.array_equal(np.clip(2.0 * (x.sp - x.pv) + 50.0, 0, 100), run(build(alone, 1.0, bias=50.0), x))
    for a in (PI, incremental(alone)):
        with pytest.raises(ScanError, match="a bias belongs to a positional controller without integral action"):
            build(a, 1.0, bias=50.0)


def test_external_reset_by_the_trapezoidal_rule_is_refused() -> None:
    with pytest.raises(ScanError, match="external-reset windup is defined for the backward and forward rules only"):
        build(changed(PI, integral__windup=EXTERNAL_RESET, integral__rule=Rule.TRAPEZOIDAL), 1.0)


@pytest.mark.parametrize("place", ["term", "measurement", "output"])
def test_an_unstable_forward_filter_is_refused(place: Place) -> None:
    a = changed(PI, kd=3.0, Tf=0.5, derivative__rule=Rule.FORWARD, derivative__filter=filter_at(place, 1, Rule.FORWARD))
    with pytest.raises(ScanError, match="is unstable; use a scan interval below 1 s or no filter"):
        build(a, 1.0)
    assert run(build(a, 0.9), record(3)).size == 150


@pytest.mark.parametrize("Tf", [0.6, 1.0])
def test_a_second_order_forward_filter_is_refused_up_to_the_scan_interval(Tf: float) -> None:
    # s = (z - 1)/h puts the poles (-1 +- j)/Tf at 1 - (1 -+ j) h/Tf, inside the unit circle only for Tf > h
    a = changed(PI, Tf=Tf, derivative__filter=filter_at("measurement", 2, Rule.FORWARD))
    with pytest.raises(ScanError, match=f"is unstable; use a scan interval below {Tf:g} s or no filter"):
        build(a, 1.0)
    with pytest.raises(ScanError, match=f"is unstable; use a scan interval below {Tf:g} s or no filter"):
        Law(a, 1.0)


def test_a_proportional_term_in_the_integral_sum_stays_where_there_is_no_integral() -> None:
    a = algorithm(kp=2.0, b=0.0, windup=CLAMP_SUM, proportional__accumulated=True)
    x = record(6, amplitude=10.0)
    assert np.array_equal(
        run(build(changed(a, transfer__start="load-output"), 1.0, initial_output=50.0), x),
        run(build(a, 1.0, initial_output=50.0), x),
    )


def test_a_velocity_program_with_every_term_off_holds_its_output() -> None:
    a = algorithm(windup=VELOCITY)
    assert np.array_equal(np.full(150, 30.0), run(build(a, 1.0, initial_output=30.0), record(4)))


# --- expressions as Python -------------------------------------------------------------------------------------------

VALUES = {"a": 2.5, "b": -3.0, "c": 0.0, "d": math.inf}
NUMERIC: tuple[Operator, ...] = ("+", "-", "*", "/")
COMPARING: tuple[Operator, ...] = ("<", ">", "<=", ">=", "==", "!=")
LOGICAL: tuple[Operator, ...] = ("and", "or")

leaves = st.sampled_from(sorted(VALUES)).map(Name) | st.sampled_from(
    [0.0, -0.0, 1.0, -1.0, 2.0, -0.5, 1e-300, 1e22, math.inf, -math.inf, math.nan]
).map(Number)


def grown(inner: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
    """Numbers computed from numbers, truth values from comparisons; a choice takes a truth value and two numbers."""
    comparisons = st.builds(Binary, st.sampled_from(COMPARING), inner, inner)
    truths = comparisons | st.builds(Binary, st.sampled_from(LOGICAL), comparisons, comparisons)
    truths |= st.builds(Binary, st.sampled_from(LOGICAL), truths, truths)
    return st.builds(Binary, st.sampled_from(NUMERIC), inner, inner) | st.builds(Select, truths, inner, inner)


numbers = st.recursive(leaves, grown, max_leaves=25)
anything = st.recursive(
    leaves,
    lambda inner: (
        st.builds(Binary, st.sampled_from(NUMERIC + COMPARING + LOGICAL), inner, inner) | st.builds(Select, inner, inner, inner)
    ),
    max_leaves=12,
)

APPLY: dict[Operator, Callable[[Any, Any], Any]] = {
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "<": lambda x, y: x < y,
    ">": lambda x, y: x > y,
    "<=": lambda x, y: x <= y,
    ">=": lambda x, y: x >= y,
    "==": lambda x, y: x == y,
    "!=": lambda x, y: x != y,
}


def walked(x: Expr) -> Any:
    """The value of an expression, by its tree."""
    match x:
        case Number(value=value):
            return value
        case Name(id=name):
            return VALUES[name]
        case Select(condition=condition, yes=yes, no=no):
            return walked(yes) if walked(condition) else walked(no)
        case Binary(operator="and", left=left, right=right):
            return walked(left) and walked(right)
        case Binary(operator="or", left=left, right=right):
            return walked(left) or walked(right)
        case Binary(operator=operator, left=left, right=right):
            return APPLY[operator](walked(left), walked(right))
    raise AssertionError(x)


def told(value: Callable[[], Any]) -> str:
    """A value as text, in which NaN equals NaN and -0.0 is not 0.0; or that it divides by zero."""
    try:
        return repr(value())
    except ZeroDivisionError:
        return "division by zero"


@given(x=numbers)
def test_an_expression_in_python_has_the_value_of_its_tree(x: Expr) -> None:
    assert told(lambda: walked(x)) == told(lambda: eval(render(x), dict(VALUES)))


@given(x=anything)
@example(x=Binary("<", Binary("<", Name("a"), Name("b")), Name("c")))
@example(x=Binary("==", Name("c"), Binary("==", Name("a"), Name("b"))))
def test_any_tree_at_all_keeps_its_grouping_in_python(x: Expr) -> None:
    assert told(lambda: walked(x)) == told(lambda: eval(render(x), dict(VALUES)))


@on_every_card
@given(data=st.data(), seed=seeds)
def test_the_printed_module_of_every_card_gives_the_same_bits_as_its_compiled_functions(
    name: str, data: st.DataObject, seed: int
) -> None:
    a = settings_of(data, pidemu.load_card(name)).algorithm(own_units=True)
    program = build(a, data.draw(scans_of(a)))
    x = record(seed, n=60, modes=True)
    module: dict[str, Any] = {}
    exec(source(program), module)
    state = list(module["INITIAL"])
    printed = [module["scan"](state, *(float(signal[n]) for signal in (x.sp, x.pv, x.auto, x.manual))) for n in range(len(x.sp))]
    assert run(program, x).tolist() == printed
    assert list(states_after(program, x).values()) == state


@pytest.mark.parametrize("name", pidemu.cards())
def test_no_controller_stays_at_a_limit_once_the_error_has_turned(name: str) -> None:
    """Ten minutes of error at the limit, then an error the other way: the output leaves within the time its scheme takes.

    The longest is that of schemes that let the integral go on: PLC and DCS cards must do better than the error's own duration.
    """
    card = pidemu.load_card(name)
    for variant in variants(card):
        given: dict[str, object] = dict(variant.chosen)
        parallel = variant.equation.form == "parallel"
        texts = {"gain": 3.0, "integral": "0.05 1/s" if parallel else "60 s", "derivative": 0.0}
        for dial, s in variant.equation.settings.items():
            if "scan" in s.unit and s.sets == "integral":
                given[dial] = 0.05  # one scan is a second here
            elif (
                s.sets in texts and is_active(variant.equation, dial, s) and not (s.sets == "derivative" and s.default is not None)
            ):
                given[dial] = "300 %" if s.sets == "gain" and s.unit == "%" else texts[s.sets]
            elif s.sets not in texts and s.default is None and is_active(variant.equation, dial, s):
                given[dial] = working(*limits(s))
        settings_ = card.settings(given)
        a = settings_.algorithm()
        if not a.ki or a.integral.windup.scheme == "none":
            continue  # such an integral winds up for as long as the error lasts, and unwinds as slowly
        controller = pidemu.Controller(settings_, 1.0, output_limits=(0, 100), initial_output=50.0)
        controller.run([50.0, *[60.0] * 600], [50.0, *[20.0] * 600])
        back = controller.run(60.0, np.full(140, 65.0))
        assert controller.output < 100
        # a lag of 60 s that integrates without P goes from 3 times 40 beyond the limit towards 3 times -5: 60 ln 9 = 132 s
        longest = 133 if a.integral.windup.scheme == "external-reset" and not a.kp else 60
        assert np.argmax(back < 100) <= longest, (variant.chosen, back[:5])


def test_a_controller_that_starts_at_a_limit_leaves_it_while_the_error_asks_for_it() -> None:
    """A freeze in both directions would hold the output at the limit for ever."""
    settings_ = pidemu.load_card("allen-bradley/plc5").settings(KP=1, KI=0.1)
    outputs = pidemu.Controller(settings_, 1.0, initial_output=0.0).run(60.0, np.full(40, 50.0))
    assert outputs[-1] > 30
