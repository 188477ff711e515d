"""The fine print of windup schemes by hand, and what holds for all of them (specs/equations.md, section 5).

The plain schemes stand in test_programs.py. All loops are of a parallel PID with P on error, unfiltered D on PV and backward rules.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import pidemu
from pidemu.algorithm.model import Algorithm
from pidemu.backends.python import compiled
from pidemu.card.load import variants
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import Equation, Setting
from pidemu.card.model.integral import IntegralLimits
from pidemu.card.model.signals import ErrorShape, SignalFilter
from pidemu.card.windup import Scheme
from pidemu.card.windup.back_calculation import WindupBackCalculation
from pidemu.card.windup.conditional import WindupConditional
from pidemu.card.windup.external_reset import FastReturn, WindupExternalReset
from pidemu.card.windup.freeze import WindupFreeze
from pidemu.card.windup.recompute import WindupRecompute
from pidemu.checks.runs import plausible
from pidemu.errors import UndefinedError
from pidemu.program.builder import build
from pidemu.program.ir import Program
from tests.algorithms import (
    CLAMP,
    CONDITIONAL,
    EXTERNAL_RESET,
    FREEZE,
    NONE,
    RECOMPUTE,
    RESET_OUTSIDE_BAND,
    algorithm,
    back_calculation,
    changed,
)  # fmt: skip
from tests.helpers import Floats, made_up_card, outputs
from tests.program.support import signals, states_of

LOW, HIGH, H, U0 = 0.0, 100.0, 0.5, 40.0
PLAIN = algorithm(kp=2.0, ki=0.5, kd=1.0, c=0.0)

seeds = st.integers(0, 2**32 - 1)
pids = st.builds(
    lambda kp, Ti, kd: changed(PLAIN, kp=kp, ki=kp / Ti, kd=kd, Ti=Ti),
    kp=st.floats(0.1, 10),
    Ti=st.floats(1, 100),
    kd=st.just(0.0) | st.floats(0.1, 10),
)


def clip(x: float, low: float = LOW, high: float = HIGH) -> float:
    return min(max(x, low), high)


@dataclass(frozen=True)
class Scan:
    """One scan of a loop: its terms, the increment of the integral, and what was before."""

    P: float
    D: float
    dI: float
    e: float
    I: float  # noqa: E741 (the field's symbol)
    u: float


def loop(a: Algorithm, sp: Floats, pv: Floats, step: Callable[[Scan], tuple[float, float]]) -> tuple[Floats, Floats]:
    """Outputs and integrals where `step` makes both, scan by scan; the first scan sets ``I = u - P - D`` and is not gated."""
    u, kept, I = [U0], [], 0.0  # noqa: E741
    for n in range(len(sp)):
        e = float(sp[n] - pv[n])
        D = -a.kd * float(pv[n] - pv[n - 1]) / H if n else 0.0
        before = I if n else U0 - a.kp * e
        out, I = step(Scan(a.kp * e, D, a.ki * H * e if n else 0.0, e, before, u[-1]))  # noqa: E741
        u.append(out)
        kept.append(I)
    return np.array(u[1:]), np.array(kept)


def recompute(x: Scan) -> tuple[float, float]:
    v = x.P + (x.I + x.dI) + x.D
    return clip(v), HIGH - x.P - x.D if v >= HIGH else LOW - x.P - x.D if v <= LOW else x.I + x.dI


def recompute_without_derivative(x: Scan) -> tuple[float, float]:
    """P + I is limited first, and I becomes what the limit leaves; then D is added and the sum limited again."""
    inner = x.P + (x.I + x.dI)
    I = HIGH - x.P if inner >= HIGH else LOW - x.P if inner <= LOW else x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), I


def recompute_clamped(x: Scan) -> tuple[float, float]:
    out, I = recompute(x)  # noqa: E741
    return out, clip(I)


def freeze_both(x: Scan) -> tuple[float, float]:
    I = x.I if x.u in (LOW, HIGH) else x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), I


def freeze_on_inner_sum() -> Callable[[Scan], tuple[float, float]]:
    inner = [math.nan]  # no sum yet: no limit holds it

    def step(x: Scan) -> tuple[float, float]:
        stopped = (inner[-1] >= HIGH and x.dI > 0) or (inner[-1] <= LOW and x.dI < 0)
        I = x.I if stopped else x.I + x.dI  # noqa: E741
        inner.append(x.P + I)
        return clip(x.P + I + x.D), I

    return step


def conditional_by_sign(x: Scan) -> tuple[float, float]:
    v = x.P + (x.I + x.dI) + x.D
    I = x.I if not LOW <= v <= HIGH and x.e * v > 0 else x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), I


def conditional(x: Scan) -> tuple[float, float]:
    """The increment counts for the output; of what leads beyond a limit the integral keeps what leads to it."""
    v, I = x.P + (x.I + x.dI) + x.D, x.I + x.dI  # noqa: E741
    if v > HIGH and x.dI > 0:
        I -= min(x.dI, v - HIGH)  # noqa: E741
    elif v < LOW and x.dI < 0:
        I -= max(x.dI, v - LOW)  # noqa: E741
    return clip(v), I


def conditional_dropping(x: Scan) -> tuple[float, float]:
    v = x.P + (x.I + x.dI) + x.D
    stopped = (v > HIGH and x.dI > 0) or (v < LOW and x.dI < 0)
    I = x.I if stopped else x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), I


def external_reset_with_fast_return(Ti: float) -> Callable[[Scan], tuple[float, float]]:
    """``Ti F' = u - D - F`` with ``Ti/16`` on the way back from beyond 90 or 10 %, no farther than there in one scan."""

    def step(x: Scan) -> tuple[float, float]:
        before = x.P + x.I + x.D
        plain, dI, time = clip(before + x.dI), x.dI, Ti
        if plain > 90.0 and dI < 0:
            dI, time = max(16 * dI, 90.0 - before), Ti / 16
        elif plain < 10.0 and dI > 0:
            dI, time = min(16 * dI, 10.0 - before), Ti / 16
        v = before + dI
        return clip(v), x.I + dI + H / (time + H) * (clip(v) - v)

    return step


def reset_outside_band(x: Scan) -> tuple[float, float]:
    I = x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), 0.0 if abs(x.P) > HIGH - LOW else I


def limits_of_its_own(x: Scan) -> tuple[float, float]:
    I = clip(x.I + x.dI, -15.0, 30.0)  # noqa: E741
    return clip(x.P + I + x.D), I


def lower_limit_of_the_output(x: Scan) -> tuple[float, float]:
    I = clip(x.I + x.dI, LOW, 30.0)  # noqa: E741
    return clip(x.P + I + x.D), I


def by_back_calculation(x: Scan) -> tuple[float, float]:
    v = x.P + (x.I + x.dI) + x.D
    return clip(v), x.I + x.dI + H / 4.0 * (clip(v) - v)


def windup(scheme: Scheme[float]) -> dict[str, Any]:
    return {"integral__windup": scheme}


SCHEMES: dict[str, tuple[Callable[[], Callable[[Scan], tuple[float, float]]], dict[str, Any]]] = {
    "recompute": (lambda: recompute, windup(RECOMPUTE)),
    "recompute without derivative": (
        lambda: recompute_without_derivative, windup(WindupRecompute(scheme="recompute", without_derivative=True)),
    ),
    "recompute, clamped": (lambda: recompute_clamped, windup(WindupRecompute(scheme="recompute", clamped=True))),
    "freeze in both directions": (lambda: freeze_both, windup(WindupFreeze(scheme="freeze", direction="both"))),
    "freeze by the sum without derivative": (
        freeze_on_inner_sum, windup(WindupFreeze(scheme="freeze", judged_on="sum-without-derivative")),
    ),
    "conditional by error times output": (
        lambda: conditional_by_sign,
        windup(WindupConditional(scheme="conditional", test="error-times-output", last_increment="dropped")),
    ),
    "conditional": (lambda: conditional, windup(CONDITIONAL)),
    "conditional, the last increment dropped": (
        lambda: conditional_dropping, windup(WindupConditional(scheme="conditional", last_increment="dropped")),
    ),
    "reset outside the band": (lambda: reset_outside_band, windup(RESET_OUTSIDE_BAND)),
    "integral limits": (lambda: limits_of_its_own, {"integral__limits": IntegralLimits(low=-15.0, high=30.0)}),
    "integral limits, the lower one the output's": (
        lambda: lower_limit_of_the_output, {"integral__limits": IntegralLimits(low="output", high=30.0)},
    ),
    "back-calculation": (lambda: by_back_calculation, windup(back_calculation(4.0))),
}  # fmt: skip


def program(a: Algorithm, **more: Any) -> Program:
    return build(a, H, limits=(LOW, HIGH), initial_output=U0, **more)


@pytest.mark.parametrize("name", SCHEMES)
@given(pid=pids, seed=seeds)
def test_output_and_integral_are_those_of_the_loop_written_by_hand(name: str, pid: Algorithm, seed: int) -> None:
    by_hand, how = SCHEMES[name]
    a, (sp, pv) = changed(pid, **how), signals(seed, amplitude=60.0)
    expected = loop(a, sp, pv, by_hand())
    # sums in another order: 120 roundings of 1e-16 of the largest term
    scale = 16 * 120 * (a.kp + a.kd / H + a.ki * H * 120)
    for one, other in zip(expected, states_of(program(a), sp, pv, "u", "I"), strict=True):
        assert np.max(np.abs(one - other)) <= 1e-12 * scale


@pytest.mark.parametrize("name", SCHEMES)
def test_the_signals_tell_each_scheme_from_integrating_always(name: str) -> None:
    sp, pv = signals(1, amplitude=60.0)
    always = states_of(program(PLAIN), sp, pv, "I")[0]
    assert always.tolist() != loop(changed(PLAIN, **SCHEMES[name][1]), sp, pv, SCHEMES[name][0]())[1].tolist()


# --- external reset and fast return ----------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [Rule.BACKWARD, Rule.FORWARD])
@given(pid=pids, seed=seeds)
def test_with_an_external_signal_the_integral_is_its_lag_less_the_derivative(rule: Rule, pid: Algorithm, seed: int) -> None:
    """``Ti F' = R - D - F``: what the valve did, whatever this controller asked for; NaN stands for the output itself."""
    a = changed(pid, integral__windup=EXTERNAL_RESET, integral__rule=rule)
    Ti, (sp, pv) = a.kp / a.ki, signals(seed, amplitude=60.0)
    rng = np.random.default_rng(seed)
    signal = np.where(rng.uniform(size=sp.size) < 0.3, math.nan, rng.uniform(-20, 120, sp.size))
    state = list((p := program(a, signals=("reset",))).initial)
    scan, F = compiled(p).scan, U0 - a.kp * float(sp[0] - pv[0])
    for n in range(sp.size):
        P, D = a.kp * float(sp[n] - pv[n]), -a.kd * float(pv[n] - pv[n - 1]) / H if n else 0.0
        ahead = F if rule is Rule.FORWARD or not n else F + H / Ti * P  # backward: solved for a free output
        u = clip(P + ahead + D)
        R = u if math.isnan(signal[n]) else float(signal[n])
        if rule is Rule.FORWARD:
            F += H / Ti * (R - D - F)
        else:
            F = (Ti * F + H * (R - D)) / (Ti + H) if n else F + H / (Ti + H) * (R - U0)  # the first scan adds no error
        assert scan(state, float(sp[n]), float(pv[n]), 1.0, math.nan, float(signal[n])) == pytest.approx(u, rel=1e-9, abs=1e-9)
        I = state[[q.name for q in p.states].index("I")]  # noqa: E741
        assert I == pytest.approx(F, rel=1e-9, abs=1e-9)  # terms of a thousand, rounded 120 times


def fast_beyond(low: float, high: float) -> Scheme[float]:
    return WindupExternalReset(scheme="external-reset", fast_return=FastReturn(factor=16.0, low=low, high=high))


@given(pid=pids, seed=seeds)
def test_from_beyond_its_own_limits_the_integral_comes_back_sixteen_times_as_fast_as_by_hand(pid: Algorithm, seed: int) -> None:
    a, (sp, pv) = changed(pid, integral__windup=fast_beyond(10.0, 90.0)), signals(seed, amplitude=60.0)
    expected = loop(a, sp, pv, external_reset_with_fast_return(a.kp / a.ki))
    scale = 16 * 120 * (a.kp + a.kd / H + a.ki * H * 120)  # sums in another order, as above
    for one, other in zip(expected, states_of(program(a), sp, pv, "u", "I"), strict=True):
        assert np.max(np.abs(one - other)) <= 1e-12 * scale


def test_the_fast_return_ends_at_its_own_limit_and_never_begins_at_the_outputs() -> None:
    """I alone, an error of -10: 0.05 % a scan, 0.8 % above 90 %. Limits at those of the output are never exceeded."""
    sp, pv = np.array([60.0] * 2 + [40.0] * 40), np.full(42, 50.0)

    def moves(low: float, high: float) -> Floats:
        a = algorithm(ki=0.01, Ti=100.0, windup=fast_beyond(low, high))
        return np.diff(outputs(build(a, H, limits=(LOW, HIGH), initial_output=99.0), sp, pv))[1:]

    assert moves(0.0, 100.0) == pytest.approx([-0.05] * 40, abs=1e-12)
    fast = moves(10.0, 90.0)
    assert fast[:11] == pytest.approx([-0.8] * 11, abs=1e-12)  # 99.05 to 90.25
    assert fast[11] == pytest.approx(-0.25, abs=1e-12)
    assert fast[12:] == pytest.approx([-0.05] * 28, abs=1e-12)


def test_deltavs_limits_of_the_windup_are_levels_of_its_output_and_do_nothing_unless_they_are_given() -> None:
    card = pidemu.load_card("emerson/deltav")
    for structure in ("1", "2", "5", "6", "7"):
        plain = card.settings(GAIN=2, RESET=60, STRUCTURE=structure).algorithm()
        assert plain.integral.windup == EXTERNAL_RESET
    given = card.settings(GAIN=2, RESET=60, ARW_HI_LIM=18, ARW_LO_LIM=5, op_range=(4, 20))
    assert given.algorithm().integral.windup == fast_beyond(6.25, 87.5)
    assert given.algorithm().linear.integral.windup == EXTERNAL_RESET
    assert given.algorithm().beyond_the_law == ["integral 16 times as fast on the way back from below 6.25 or above 87.5"]


def test_deltavs_nonlinear_gain_is_a_gap_of_p_and_i_and_its_filters_are_off_unless_they_are_given() -> None:
    card = pidemu.load_card("emerson/deltav")
    plain = card.settings(GAIN=2, RESET=60).algorithm()
    assert (plain.error, plain.measurement.filter, plain.setpoint.filter) == (ErrorShape(), None, None)
    given = card.settings(GAIN=2, RESET=60, NL_GAP=3, NL_MINMOD=0.25, PV_FTIME=2, SP_FTIME=4)
    assert given.options["FRSIPID_OPTS"] == "nonlinear gain"
    a = given.algorithm()
    assert a.error == ErrorShape(shape="gap", band=3.0, gain=0.25, linearity=1.0)
    assert (a.measurement.filter, a.setpoint.filter) == (SignalFilter(time=2.0), SignalFilter(time=4.0))


# --- external reset where P does not see the whole error ---------------------------------------------------------------


@pytest.mark.parametrize("b", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("kp", [0.0, 2.0], ids=["I alone", "PI"])
def test_positive_feedback_of_output_and_unseen_error_is_what_the_exact_solution_says(kp: float, b: float) -> None:
    """``Ti F' = u + K (e - p) - F`` with ``u = clip(kp p + F)``, solved by SciPy's integrator; p is what P acts on.

    The scan program's error is of first order in h: half a scan's integration and what the limits cut off at scans only.
    """
    Ti, K, h = 20.0, kp or 2.0, 0.002
    t = np.arange(0.0, 120.0, h)
    r = np.where(t < 60.0, 60.0, 45.0)
    y = 50.0 - 4.0 * np.sin(t / 15.0)

    def unseen(t: float) -> tuple[float, float]:
        sp, pv = (60.0 if t < 60.0 else 45.0), 50.0 - 4.0 * math.sin(t / 15.0)
        p = b * sp - pv if kp else 0.0
        return p, sp - pv - p

    def slope(t: float, F: Floats) -> Floats:
        p, rest = unseen(t)
        return np.asarray((np.clip(kp * p + F, LOW, HIGH) + K * rest - F) / Ti)

    F0 = U0 - kp * unseen(0.0)[0]
    exact: list[float] = []
    for begin, end, start in ((0.0, 60.0, None), (60.0, 120.0, "before")):
        at = t[(t >= begin) & (t < end)]
        F = F0 if start is None else exact[-1]
        exact.extend(solve_ivp(slope, (begin, end), [F], t_eval=at, rtol=1e-9, atol=1e-9, max_step=0.05).y[0])
    expected = np.clip(kp * np.array([unseen(x)[0] for x in t]) + exact, LOW, HIGH)
    a = algorithm(kp=kp, ki=K / Ti, b=b, Ti=Ti, windup=EXTERNAL_RESET)
    found = outputs(build(a, h, limits=(LOW, HIGH), initial_output=U0), r, y)
    assert expected.max() == HIGH
    assert expected.min() < HIGH
    assert np.max(np.abs(found - expected)) <= 2 * h * K * 20 / Ti  # two scans of the largest error, 20 %


@pytest.mark.parametrize("b", [0.0, 0.4, 1.0])
def test_at_a_limit_the_sum_rests_the_gain_times_the_error_beyond_so_that_the_output_leaves_as_the_error_turns(b: float) -> None:
    a = algorithm(kp=2.0, ki=0.1, b=b, Ti=20.0, windup=EXTERNAL_RESET)
    pv = np.concatenate([np.full(4000, 40.0), np.linspace(40.0, 60.0, 20_001)])  # the error turns very slowly, at 50 %
    sp = np.full(pv.size, 50.0)
    u, I = states_of(program(a), sp, pv, "u", "I")  # noqa: E741
    p = b * sp - pv
    rest = 2.0 * p[3999] + I[3999]  # after the cut, before the next increment
    assert rest == pytest.approx(HIGH + 2.0 * 10.0, rel=1e-9)
    left = int(np.argmax(u[4000:] < HIGH))  # the setpoint stands still, and with it K (e - p)
    assert abs(left - 10_000) <= 1


def test_integral_alone_leaves_the_limit_as_late_as_the_lag_of_what_rested_beyond_it() -> None:
    """``v - 100`` goes from ``K e1`` towards ``K e2`` in Ti: it is 0 after ``Ti ln((e1 - e2)/-e2)``, 60 ln 9 = 131.8 s."""
    a = algorithm(ki=3.0 / 60.0, Ti=60.0, windup=EXTERNAL_RESET)
    sp, pv = np.full(5000, 60.0), np.array([20.0] * 4000 + [65.0] * 1000)
    u = outputs(build(a, H, limits=(LOW, HIGH), initial_output=U0), sp, pv)
    left = (int(np.argmax(u[4000:] < HIGH)) + 1) * H
    assert left == pytest.approx(60.0 * math.log(9.0), abs=2 * H)  # the backward lag of 120 scans is half a scan late


# --- a constant error brings the output to its limit -------------------------------------------------------------------


@pytest.mark.parametrize("card_id", pidemu.cards())
def test_under_a_constant_error_the_output_of_every_card_reaches_its_limit(card_id: str) -> None:
    """No card stops short of it; one whose source says so would be an exception here, with that source."""
    for variant in variants(pidemu.load_card(card_id)):
        try:
            settings = plausible(variant)
            settings = settings.changed(_out_of_the_way(variant.equation))
            a = settings.algorithm(own_units=True)
        except UndefinedError:
            continue
        if not a.ki and a.dahlin is None:
            continue
        ends = [_ends(settings, error) for error in (-7.31, 7.31)]
        assert sorted(ends) == [0.0, 100.0], variant.choice_text  # which is which, the sign of the gain decides


def _out_of_the_way(equation: Equation) -> dict[str, float]:
    """Return wide limits of the integral, which stop it before the output's limit as they are meant to, and no rate limit."""
    limits = equation.integral.limits
    low = None if limits is None else limits.low
    wide = {n: -1000.0 if low == n else 1000.0 for n, s in equation.settings.items() if _narrow(s)}
    rest = {n: s.default for n, s in equation.settings.items() if s.sets in ("integral-limit", "output-rate")}
    return {n: x for n, x in rest.items() if x is not None} | wide


def _narrow(s: Setting) -> bool:
    """Tell whether a dial limits the integral to less than the output needs."""
    return s.sets == "integral-limit" and (s.default is None or abs(s.default) < 1000)


def _ends(settings: pidemu.Settings, error: float) -> float:
    """The output that a constant error leads to in four times what the integral alone would take."""
    a = settings.algorithm(own_units=True)
    controller = pidemu.Controller(settings, output_limits=(0.0, 100.0), initial_output=50.0)
    scans = 400 if a.dahlin is not None else math.ceil(100.0 / abs(a.ki * controller.interval * error)) + 100
    scans = max(scans, 500)  # a setpoint with a rate limit starts at zero
    scans *= 20 if a.error.shape == "squared" else 2  # 7 % of the error count then
    controller.run(50.0, [50.0] * 3)
    return float(controller.run(50.0 + error, [50.0] * scans)[-1])


# --- tracking times and limits as cards state them -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"tracking-time": "Ti"}, 8.0),
        ({"tracking-time": "sqrt(Ti Td)"}, 4.0),  # sqrt(kd/ki), with Ti = 8 s and Td = 2 s
        ({"tracking-time": 3.0}, 3.0),
        ({"tracking-time": 3.0, "times": "Ti"}, 24.0),
        ({"tracking-time": "Tt"}, 6.0),
        ({"tracking-time": "Tt", "when-off": "Ti"}, 6.0),
    ],
    ids=str,
)
def test_the_tracking_time_of_a_card_is_what_it_says(said: dict[str, Any], expected: float) -> None:
    dials = {"kp": ("gain", "%/%"), "ki": ("integral", "1/s"), "kd": ("derivative", "s"), "Tt": ("tracking-time", "s")}
    settings: dict[str, dict[str, Any]] = {name: {"sets": role, "unit": unit} for name, (role, unit) in dials.items()}
    settings["Tt"] |= {"off": 0, "default": 0}
    card = made_up_card(integral={"rule": "backward", "windup": {"scheme": "back-calculation"} | said}, settings=settings)
    given: dict[str, object] = {"kp": 2, "ki": 0.25, "kd": 4}
    assert tracking_time(card.settings({**given, "Tt": 6}).algorithm()) == pytest.approx(expected, rel=1e-15)
    if "when-off" in said:
        assert tracking_time(card.settings(given).algorithm()) == 8.0


def tracking_time(a: Algorithm) -> float:
    assert isinstance(a.integral.windup, WindupBackCalculation)
    return float(a.integral.windup.Tt)


# --- over all schemes ------------------------------------------------------------------------------------------------

EVERY: dict[str, dict[str, Any]] = {name: how for name, (_, how) in SCHEMES.items()} | {
    scheme.scheme: windup(scheme) for scheme in (NONE, CLAMP, FREEZE, CONDITIONAL, EXTERNAL_RESET)
}


@pytest.mark.parametrize("name", EVERY)
@given(pid=pids, seed=seeds)
def test_away_from_the_limits_every_scheme_integrates_the_error(name: str, pid: Algorithm, seed: int) -> None:
    """Once saturation has ended the integral grows by ``ki h e`` again: nothing of the saturation is left."""
    a, (sp, pv) = changed(pid, **EVERY[name]), signals(seed, amplitude=60.0)
    u, I = states_of(program(a), sp, pv, "u", "I")  # noqa: E741
    e, D = sp - pv, -a.kd * np.diff(pv, prepend=pv[0]) / H
    inner = a.kp * e + I
    free = (u > LOW) & (u < HIGH) & (np.abs(a.kp * e) <= HIGH - LOW) & (inner > LOW) & (inner < HIGH)
    free &= (I > LOW) & (I < 30) if a.integral.limits else (I > LOW) & (I < HIGH) if "clamp" in name else True
    ahead = I[:-1] + (a.kp * e + a.ki * H * e + D)[1:]  # what conditional looks at
    both = free[1:] & free[:-1] & (ahead > LOW) & (ahead < HIGH)
    scale = 1 + np.max(np.abs(I)) + np.max(np.abs(a.kp * e)) + np.max(np.abs(D))
    assert np.all(np.abs(np.diff(I) - a.ki * H * e[1:])[both] <= 1e-12 * scale)  # a difference of two sums of that size


@pytest.mark.parametrize("name", EVERY)
@given(pid=pids, seed=seeds)
def test_the_output_is_inside_the_limits_whatever_the_scheme(name: str, pid: Algorithm, seed: int) -> None:
    sp, pv = signals(seed, amplitude=300.0)
    u = outputs(program(changed(pid, **EVERY[name])), sp, pv)
    assert np.all((u >= LOW) & (u <= HIGH))


@pytest.mark.parametrize("name", EVERY)
@given(kp=st.floats(0.1, 10), seed=seeds)
def test_a_proportional_controller_has_no_integral_that_a_scheme_could_move(name: str, kp: float, seed: int) -> None:
    a, (sp, pv) = changed(PLAIN, kp=kp, ki=0.0, kd=0.0, Ti=0.0, **EVERY[name]), signals(seed, amplitude=60.0)
    p = program(a)
    assert "I" not in [q.name for q in p.states]
    assert outputs(p, sp, pv).tolist() == np.clip(kp * (sp - pv), LOW, HIGH).tolist()
