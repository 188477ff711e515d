"""The fine print of windup schemes by hand, and what holds for all of them (specs/equations.md, section 5).

The plain schemes stand in test_programs.py. All loops are of a parallel PID with P on error, unfiltered D on PV and backward rules.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pidemu.algorithm import Algorithm, Gate, Scheme
from pidemu.card.base import Rule
from pidemu.scan.build import build
from pidemu.scan.program import Program
from pidemu.targets.python import compiled
from tests.helpers import Floats, made_up_card, outputs
from tests.scan.support import signals, states_of

LOW, HIGH, H, U0 = 0.0, 100.0, 0.5, 40.0
PLAIN = Algorithm(series=False, kp=2.0, ki=0.5, kd=1.0, c=0.0)

seeds = st.integers(0, 2**32 - 1)
pids = st.builds(
    lambda kp, Ti, kd: replace(PLAIN, kp=kp, ki=kp / Ti, kd=kd, tracking_time=Ti),
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


def freeze_with_fast_return(x: Scan) -> tuple[float, float]:
    stopped = (x.u == HIGH and x.dI > 0) or (x.u == LOW and x.dI < 0)
    before = x.P + x.I + x.D
    dI = x.dI
    if before + dI > HIGH and dI < 0:
        dI = max(16 * dI, HIGH - before)
    elif before + dI < LOW and dI > 0:
        dI = min(16 * dI, LOW - before)
    I = x.I + (0.0 if stopped else dI)  # noqa: E741
    return clip(x.P + I + x.D), I


def reset_outside_band(x: Scan) -> tuple[float, float]:
    I = x.I + x.dI  # noqa: E741
    return clip(x.P + I + x.D), 0.0 if abs(x.P) > HIGH - LOW else I


def limits_of_its_own(x: Scan) -> tuple[float, float]:
    I = clip(x.I + x.dI, -15.0, 30.0)  # noqa: E741
    return clip(x.P + I + x.D), I


def lower_limit_of_the_output(x: Scan) -> tuple[float, float]:
    I = clip(x.I + x.dI, LOW, 30.0)  # noqa: E741
    return clip(x.P + I + x.D), I


def back_calculation(x: Scan) -> tuple[float, float]:
    v = x.P + (x.I + x.dI) + x.D
    return clip(v), x.I + x.dI + H / 4.0 * (clip(v) - v)


SCHEMES: dict[str, tuple[Callable[[], Callable[[Scan], tuple[float, float]]], dict[str, Any]]] = {
    "recompute": (lambda: recompute, {"windup": "recompute"}),
    "recompute without derivative": (
        lambda: recompute_without_derivative, {"windup": "recompute", "gate": Gate(without_derivative=True)},
    ),
    "recompute, clamped": (lambda: recompute_clamped, {"windup": "recompute", "gate": Gate(clamped=True)}),
    "freeze in both directions": (lambda: freeze_both, {"windup": "freeze", "gate": Gate(both=True)}),
    "freeze by the sum without derivative": (freeze_on_inner_sum, {"windup": "freeze", "gate": Gate(without_derivative=True)}),
    "conditional by error times output": (
        lambda: conditional_by_sign, {"windup": "conditional", "gate": Gate(by_output_sign=True)},
    ),
    "fast return": (lambda: freeze_with_fast_return, {"windup": "freeze", "gate": Gate(fast_return=16.0)}),
    "reset outside the band": (lambda: reset_outside_band, {"windup": "reset-outside-band"}),
    "integral limits": (lambda: limits_of_its_own, {"integral_limits": (-15.0, 30.0)}),
    "integral limits, the lower one the output's": (lambda: lower_limit_of_the_output, {"integral_limits": (None, 30.0)}),
    "back-calculation": (lambda: back_calculation, {"windup": "back-calculation", "tracking_time": 4.0}),
}  # fmt: skip


def program(a: Algorithm, **more: Any) -> Program:
    return build(a, H, limits=(LOW, HIGH), initial_output=U0, **more)


@pytest.mark.parametrize("name", SCHEMES)
@given(pid=pids, seed=seeds)
def test_output_and_integral_are_those_of_the_loop_written_by_hand(name: str, pid: Algorithm, seed: int) -> None:
    by_hand, how = SCHEMES[name]
    a, (sp, pv) = replace(pid, **how), signals(seed, amplitude=60.0)
    expected = loop(a, sp, pv, by_hand())
    # sums in another order: 120 roundings of 1e-16 of the largest term
    scale = 16 * 120 * (a.kp + a.kd / H + a.ki * H * 120)
    for one, other in zip(expected, states_of(program(a), sp, pv, "u", "I"), strict=True):
        assert np.max(np.abs(one - other)) <= 1e-12 * scale


@pytest.mark.parametrize("name", SCHEMES)
def test_the_signals_tell_each_scheme_from_integrating_always(name: str) -> None:
    sp, pv = signals(1, amplitude=60.0)
    always = states_of(program(PLAIN), sp, pv, "I")[0]
    assert always.tolist() != loop(replace(PLAIN, **SCHEMES[name][1]), sp, pv, SCHEMES[name][0]())[1].tolist()


# --- external reset and fast return ----------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [Rule.BACKWARD, Rule.FORWARD])
@given(pid=pids, seed=seeds)
def test_with_an_external_signal_the_integral_is_its_lag_less_the_derivative(rule: Rule, pid: Algorithm, seed: int) -> None:
    """``Ti F' = R - D - F``: what the valve did, whatever this controller asked for; NaN stands for the output itself."""
    a = replace(pid, windup="external-reset", integral_rule=rule)
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


@pytest.mark.parametrize("scheme", ["freeze", "conditional", "external-reset"])
def test_the_way_back_from_a_limit_is_sixteen_times_as_fast(scheme: Scheme) -> None:
    """P on PV keeps the sum far beyond the limit while the error asks for less: all that moves is the integral."""
    sp, pv = np.array([50.0, *[20.0] * 3]), np.array([50.0, *[30.0] * 3])
    a = Algorithm(series=False, kp=10.0, ki=0.01, kd=0.0, b=0.0, windup=scheme, tracking_time=1e9)  # no cut-off is taken out
    slow, fast = (np.diff(states_of(program(replace(a, gate=Gate(fast_return=f))), sp, pv, "I")[0]) for f in (1.0, 16.0))
    assert slow == pytest.approx([-0.05] * 3, rel=1e-5)  # 0.01 times 0.5 s times an error of -10; 1e-7 of the cut-off are taken out
    assert fast == pytest.approx([-0.8, -0.8, -0.8], rel=1e-5)


# --- tracking times and limits as cards state them -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("windup", "expected"),
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
def test_the_tracking_time_of_a_card_is_what_it_says(windup: dict[str, Any], expected: float) -> None:
    dials = {"kp": ("gain", "%/%"), "ki": ("integral", "1/s"), "kd": ("derivative", "s"), "Tt": ("tracking-time", "s")}
    settings: dict[str, dict[str, Any]] = {name: {"sets": role, "unit": unit} for name, (role, unit) in dials.items()}
    settings["Tt"] |= {"off": 0, "default": 0}
    card = made_up_card(integral={"rule": "backward", "windup": {"scheme": "back-calculation"} | windup}, settings=settings)
    given: dict[str, object] = {"kp": 2, "ki": 0.25, "kd": 4}
    assert card.settings({**given, "Tt": 6}).algorithm().tracking_time == pytest.approx(expected, rel=1e-15)
    if "when-off" in windup:
        assert card.settings(given).algorithm().tracking_time == 8.0


# --- over all schemes ------------------------------------------------------------------------------------------------

EVERY: dict[str, dict[str, Any]] = {name: how for name, (_, how) in SCHEMES.items()} | {
    name: {"windup": name} for name in ("none", "clamp", "freeze", "conditional", "external-reset")
}


@pytest.mark.parametrize("name", EVERY)
@given(pid=pids, seed=seeds)
def test_away_from_the_limits_every_scheme_integrates_the_error(name: str, pid: Algorithm, seed: int) -> None:
    """Once saturation has ended the integral grows by ``ki h e`` again: nothing of the saturation is left."""
    a, (sp, pv) = replace(pid, **EVERY[name]), signals(seed, amplitude=60.0)
    u, I = states_of(program(a), sp, pv, "u", "I")  # noqa: E741
    e, D = sp - pv, -a.kd * np.diff(pv, prepend=pv[0]) / H
    inner = a.kp * e + I
    free = (u > LOW) & (u < HIGH) & (np.abs(a.kp * e) <= HIGH - LOW) & (inner > LOW) & (inner < HIGH)
    free &= (I > LOW) & (I < 30) if a.integral_limits else (I > LOW) & (I < HIGH) if "clamp" in name else True
    ahead = I[:-1] + (a.kp * e + a.ki * H * e + D)[1:]  # what conditional looks at
    both = free[1:] & free[:-1] & (ahead > LOW) & (ahead < HIGH)
    scale = 1 + np.max(np.abs(I)) + np.max(np.abs(a.kp * e)) + np.max(np.abs(D))
    assert np.all(np.abs(np.diff(I) - a.ki * H * e[1:])[both] <= 1e-12 * scale)  # a difference of two sums of that size


@pytest.mark.parametrize("name", EVERY)
@given(pid=pids, seed=seeds)
def test_the_output_is_inside_the_limits_whatever_the_scheme(name: str, pid: Algorithm, seed: int) -> None:
    sp, pv = signals(seed, amplitude=300.0)
    u = outputs(program(replace(pid, **EVERY[name])), sp, pv)
    assert np.all((u >= LOW) & (u <= HIGH))


@pytest.mark.parametrize("name", EVERY)
@given(kp=st.floats(0.1, 10), seed=seeds)
def test_a_proportional_controller_has_no_integral_that_a_scheme_could_move(name: str, kp: float, seed: int) -> None:
    a, (sp, pv) = replace(PLAIN, kp=kp, ki=0.0, kd=0.0, **EVERY[name]), signals(seed, amplitude=60.0)
    p = program(a)
    assert "I" not in [q.name for q in p.states]
    assert outputs(p, sp, pv).tolist() == np.clip(kp * (sp - pv), LOW, HIGH).tolist()
