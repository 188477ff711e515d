"""Conversions proven by algebra: from block diagrams and recursions to the tables of specs/equations.md, and on to the code."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.parsing.sympy_parser import convert_xor, implicit_multiplication, parse_expr, standard_transformations

import pidemu
from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Card
from pidemu.card.model.base import Rule
from pidemu.law.law import Law
from tests.algorithms import changed
from tests.helpers import made_up_card

Expr = Any
"""A sympy expression; sympy has no types."""

SPEC = (Path(__file__).parents[2] / "specs" / "equations.md").read_text(encoding="utf-8")

s, R, Q = sp.symbols("s R Q")
x = sp.Symbol("x")
K, Ti, Td, Tf, alpha, kp, ki, kd, h, w = sp.symbols("K Ti Td Tf alpha kp ki kd h w", positive=True)
rho, tau, beta = sp.symbols("rho tau beta", positive=True)
m = sp.symbols("m0 m1 m2", positive=True)
n = sp.symbols("n0 n1 n2", positive=True)
d1 = sp.Symbol("d1", positive=True)
q = sp.symbols("q0 q1 q2")
NAMES = {str(v): v for v in (K, Ti, Td, Tf, alpha, kp, ki, kd, h, x, *q)}

LEAD_LAG, SERIES, FIRST, SECOND = (
    "series, lead-lag",
    "series, D term filtered",
    "standard, measurement or output filtered, 1st order",
    "standard, measurement filtered, 2nd order Butterworth",
)
PARALLEL, STANDARD = "parallel, D term filtered", "standard, D term filtered"


def diagram(form: str, lag: Expr = Tf, gains: Mapping[Expr, Expr] | None = None) -> Expr:
    """Feedback path as its block diagram is drawn; `lag` is the time of the filter."""
    pi, ideal = K * (1 + 1 / (Ti * s)), K * (1 + 1 / (Ti * s) + Td * s)
    found = {
        PARALLEL: kp + ki / s + kd * s / (1 + lag * s),
        STANDARD: K * (1 + 1 / (Ti * s) + Td * s / (1 + lag * s)),
        FIRST: ideal / (1 + lag * s),
        SECOND: ideal / (1 + lag * s + lag**2 * s**2 / 2),
        LEAD_LAG: pi * (1 + Td * s) / (1 + lag * s),
        SERIES: pi * (1 + Td * s / (1 + lag * s)),
        "series, measurement filtered, 1st order": pi * (1 + Td * s) / (1 + lag * s),
        "series, measurement filtered, 2nd order": pi * (1 + Td * s) / (1 + lag * s + lag**2 * s**2 / 2),
    }[form]
    return found.subs(gains, simultaneous=True) if gains else found


EFFECTIVE = Ti * Td / (Ti + Td)
SOURCES = {
    PARALLEL: diagram(PARALLEL),
    STANDARD: diagram(STANDARD),
    FIRST: diagram(FIRST),
    SECOND: diagram(SECOND),
    LEAD_LAG: diagram(LEAD_LAG, alpha * Td),
    SERIES: diagram(SERIES),
    "series, D term filtered, ratio": diagram(SERIES, alpha * Td),
    "series, measurement filtered, ratio of the effective derivative": diagram(
        "series, measurement filtered, 2nd order", alpha * EFFECTIVE
    ),
}


def over_s(C: Expr) -> tuple[Expr, Expr]:
    """Numerator and denominator of ``s C(s)``, polynomials in ``s`` without a common power of it."""
    top, bottom = sp.fraction(sp.together(s * C))
    a, b = (sp.Poly(sp.expand(p), s) for p in (top, bottom))
    low = min(min(k for (k,), _ in p.terms()) for p in (a, b))
    return sp.Poly(a.as_expr() / s**low, s), sp.Poly(b.as_expr() / s**low, s)


def expansion(C: Expr, terms: int = 3) -> list[Expr]:
    """Return the first coefficients of ``s C(s)`` in powers of ``s``, by long division."""
    top, bottom = (p.all_coeffs()[::-1] + [sp.Integer(0)] * terms for p in over_s(C))
    out: list[Expr] = []
    for k in range(terms):
        out.append(sp.together((top[k] - sum(bottom[j] * out[k - j] for j in range(1, k + 1))) / bottom[0]))
    return out


def is_zero(e: Expr, *roots: tuple[Expr, Expr]) -> bool:
    """Tell whether an expression vanishes identically, with symbols that stand for square roots: pairs of symbol and square."""
    top = sp.expand(sp.fraction(sp.together(e))[0])
    for root, square in roots:
        divisor = sp.fraction(sp.together(root**2 - square))[0]
        top = sp.expand(sp.fraction(sp.together(sp.rem(top, divisor, root)))[0])
    return bool(top == 0)


def table(first: str) -> list[list[str]]:
    """Return the rows of the table in specs/equations.md whose header begins so."""
    lines = SPEC.split(f"\n{first}", 1)[1].split("\n")[2:]
    rows = lines[: next(i for i, line in enumerate(lines) if not line.startswith("|"))]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def read(cell: str) -> Expr:
    """Read a formula as the specification writes it."""
    return parse_expr(
        cell, local_dict=dict(NAMES), transformations=(*standard_transformations, implicit_multiplication, convert_xor)
    )


def named(label: str) -> Expr:
    return SOURCES[next(name for name in SOURCES if label.startswith(name))]


@pytest.mark.parametrize("row", table("| form and filter | n0 |"), ids=lambda row: row[0])
def test_the_five_coefficients_of_the_specification_are_those_of_the_block_diagram(row: list[str]) -> None:
    n0, n1, n2, e1, e2 = map(read, row[1:])
    assert is_zero((n0 + n1 * s + n2 * s**2) / (s * (1 + e1 * s + e2 * s**2)) - named(row[0]))


@pytest.mark.parametrize("row", table("| form and filter | m0 |"), ids=lambda row: row[0])
def test_the_moments_of_the_specification_are_those_of_the_block_diagram(row: list[str]) -> None:
    assert all(is_zero(read(cell) - found) for cell, found in zip(row[1:], expansion(named(row[0])), strict=True))


def test_the_tables_of_the_specification_hold_every_form() -> None:
    assert [row[0] for row in table("| form and filter | n0 |")][:2] == [PARALLEL, STANDARD]
    assert {row[0].split(" `")[0].rstrip(",") for row in table("| form and filter | n0 |")} == {
        row[0] for row in table("| form and filter | m0 |")
    }
    assert len(table("| form and filter | m0 |")) == 6


def test_a_filter_on_the_derivative_term_is_first_seen_in_the_fourth_moment() -> None:
    assert is_zero(expansion(diagram(PARALLEL), 4)[3] + kd * Tf)


def test_a_lead_lag_is_a_filtered_derivative_term_of_the_smaller_strength() -> None:
    assert is_zero(diagram(LEAD_LAG) - diagram(SERIES, gains={Td: Td - Tf}))


def test_the_larger_root_is_the_same_controller_where_the_filter_is_free() -> None:
    swapped = {K: K * Td / Ti, Ti: Td, Td: Ti}
    assert is_zero(diagram(LEAD_LAG) - diagram(LEAD_LAG, gains=swapped))


@dataclass(frozen=True)
class Goal:
    """Numbers of a target by the closed forms of section 3; `R` and `Q` stand for square roots."""

    form: str
    lag: Expr
    numbers: Mapping[Expr, Expr]
    roots: tuple[tuple[Expr, Expr], ...] = ()
    card: str = ""
    dials: Mapping[str, float] | None = None

    @property
    def law(self) -> Expr:
        """The target with these numbers."""
        return diagram(self.form, self.lag, self.numbers)

    def solved(self, name: Expr) -> Expr:
        """Return a number with the roots written out."""
        found = self.numbers[name]
        for root, square in self.roots:
            found = found.subs(root, sp.sqrt(square))
        return found


def by_series(form: str, sigma: Expr, fixed: Expr, lag: Expr, lead: Callable[[Expr], Expr]) -> Goal:
    """``m0 (1 + sigma) D^2 - (m1 - m0 tau) D + m2 = 0``, the smaller root."""
    m0, m1, m2 = m
    linear, square = m1 - m0 * fixed, m0 * (1 + sigma)
    D = (linear - R) / (2 * square)
    gain = m1 - m0 * D
    return Goal(form, lag, {K: gain, Ti: gain / m0, Td: lead(D)}, ((R, linear**2 - 4 * square * m2),))


def behind_a_filter(form: str, k: Expr, ratio: Expr | None) -> Goal:
    """The whole measurement filtered, with ``Tf = rho Td``, or with ``Tf = tau`` where there is no ratio."""
    m0, m1, m2 = m
    if ratio is None:
        n0, n1, n2 = m0, m1 + m0 * tau, m2 + m1 * tau + (1 - k) * m0 * tau**2
        return Goal(form, tau, {K: n1, Ti: n1 / n0, Td: n2 / n1})
    square, linear = m0 * ratio * (1 - (1 - k) * ratio), m1 * (1 - ratio)
    time = (R - linear) / (2 * square)
    gain = m1 + m0 * ratio * time
    return Goal(form, ratio * Td, {K: gain, Ti: gain / m0, Td: time}, ((R, linear**2 + 4 * square * m2),))


def factored(form: str, k: Expr) -> Goal:
    """The same in series form: `Q` is the root of the factorisation, around the one of the filter."""
    ideal = behind_a_filter(FIRST, k, rho)
    gain, time = ideal.numbers[K], ideal.numbers[Td]
    lead = (gain - Q) / (2 * m[0])
    inner = gain - m[0] * lead
    numbers = {K: inner, Ti: inner / m[0], Td: lead}
    return Goal(form, rho * EFFECTIVE, numbers, ((Q, gain**2 - 4 * m[0] * gain * time), *ideal.roots))


HALF = sp.Rational(1, 2)
LOW: dict[str, Goal] = {
    "parallel": Goal(PARALLEL, tau, dict(zip((ki, kp, kd), m, strict=True))),
    "standard": Goal(STANDARD, tau, {K: m[1], Ti: m[1] / m[0], Td: m[2] / m[1]}),
    "series lead-lag, ratio": by_series(LEAD_LAG, beta / (1 - beta), sp.Integer(0), beta * Td, lambda D: D / (1 - beta)),
    "series lead-lag, time": by_series(LEAD_LAG, sp.Integer(0), tau, tau, lambda D: D + tau),
    "series term, ratio": by_series(SERIES, beta, sp.Integer(0), beta * Td, lambda D: D),
    "series term, time": by_series(SERIES, sp.Integer(0), tau, tau, lambda D: D),
    "standard measurement, ratio": behind_a_filter(FIRST, sp.Integer(1), rho),
    "standard measurement, time": behind_a_filter(FIRST, sp.Integer(1), None),
    "standard measurement 2nd order, ratio": behind_a_filter(SECOND, HALF, rho),
    "standard measurement 2nd order, time": behind_a_filter(SECOND, HALF, None),
    "series measurement, effective ratio": factored("series, measurement filtered, 1st order", sp.Integer(1)),
    "series measurement 2nd order, effective ratio": factored("series, measurement filtered, 2nd order", HALF),
}
MOMENTS = {name: expansion(C) for name, C in SOURCES.items()}
PAIRS = [(source, target) for target in LOW for source in MOMENTS if "effective" not in source + target]
"""The two with nested roots are proven for any moments; with those of another form put in, the algebra takes minutes."""


@pytest.fixture(scope="module")
def reached() -> dict[str, list[Expr]]:
    """The targets' moments in terms of those asked for, not yet simplified."""
    return {name: expansion(goal.law) for name, goal in LOW.items()}


@pytest.mark.parametrize("target", LOW)
def test_low_frequency_numbers_give_the_target_any_moments_that_are_asked_for(target: str, reached: dict[str, list[Expr]]) -> None:
    assert all(is_zero(found - wanted, *LOW[target].roots) for wanted, found in zip(m, reached[target], strict=True))


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_low_frequency_numbers_give_the_target_the_moments_of_the_source(
    source: str, target: str, reached: dict[str, list[Expr]]
) -> None:
    given = dict(zip(m, MOMENTS[source], strict=True))
    roots = [(root, square.subs(given, simultaneous=True)) for root, square in LOW[target].roots]
    for wanted, found in zip(m, reached[target], strict=True):
        assert is_zero((found - wanted).subs(given, simultaneous=True), *roots)


LEADS = ((R, n[1] ** 2 - 4 * n[0] * n[2]),)
"""The roots of ``n0 T^2 - n1 T + n2``."""
LARGE, SMALL = (n[1] + R) / (2 * n[0]), (n[1] - R) / (2 * n[0])
GAIN = n[1] - n[0] * d1
EXACT = {
    PARALLEL: Goal(PARALLEL, d1, {ki: n[0], kp: GAIN, kd: n[2] - GAIN * d1}),
    STANDARD: Goal(STANDARD, d1, {K: GAIN, Ti: GAIN / n[0], Td: (n[2] - GAIN * d1) / GAIN}),
    FIRST: Goal(FIRST, d1, {K: n[1], Ti: n[1] / n[0], Td: n[2] / n[1]}),
    SECOND: Goal(SECOND, d1, {K: n[1], Ti: n[1] / n[0], Td: n[2] / n[1]}),
    LEAD_LAG: Goal(LEAD_LAG, d1, {K: n[0] * LARGE, Ti: LARGE, Td: SMALL}, LEADS),
    SERIES: Goal(SERIES, d1, {K: n[0] * LARGE, Ti: LARGE, Td: SMALL - d1}, LEADS),
}
HUB = {row[0].split(" `")[0].rstrip(","): list(map(read, row[1:])) for row in table("| form and filter | n0 |")}


@pytest.mark.parametrize(("source", "target"), [(a, b) for b in EXACT for a in HUB if (a == SECOND) == (b == SECOND)])
def test_exact_numbers_give_the_target_the_whole_law_of_the_source(source: str, target: str) -> None:
    *numerator, first, _ = HUB[source]
    given = dict(zip((*n, d1), (*numerator, first), strict=True))
    goal = EXACT[target]
    roots = [(root, square.subs(given, simultaneous=True)) for root, square in goal.roots]
    assert is_zero(goal.law.subs(given, simultaneous=True) - SOURCES[source], *roots)


def test_an_overall_multiplier_makes_a_fixed_filter_ratio_exact() -> None:
    ratio = sp.Symbol("ratio")
    strength = EXACT[PARALLEL].numbers[kd]
    multiplier = ratio * strength / d1
    assert is_zero(ratio * (strength / multiplier) - d1)


@pytest.mark.parametrize("place", [0, 1])
def test_the_textbook_rule_is_the_low_frequency_match_where_there_is_no_filter(place: int) -> None:
    there = {kp: K * (1 + Td / Ti), ki: K / Ti, kd: K * Td}
    interacting = diagram(LEAD_LAG, sp.Integer(0))
    noninteracting = diagram(STANDARD, sp.Integer(0), {K: K * (1 + Td / Ti), Ti: Ti + Td, Td: EFFECTIVE})
    both = [diagram(PARALLEL, sp.Integer(0), there), noninteracting]
    assert is_zero(interacting - both[place])


def test_at_a_frequency_the_closed_form_of_the_specification_gives_the_response() -> None:
    real, imaginary = sp.symbols("real imaginary", real=True)
    strength = (imaginary + m[0] / w) * (1 + Tf**2 * w**2) / w
    gains = {ki: m[0], kd: strength, kp: real - strength * Tf * w**2 / (1 + Tf**2 * w**2)}
    assert sp.simplify(diagram(PARALLEL, gains=gains).subs(s, sp.I * w) - real - sp.I * imaginary) == 0


def test_the_moments_of_the_setpoint_path_are_linear_in_the_weights() -> None:
    b, c = sp.symbols("b c")
    path = expansion(b * kp + ki / s + c * kd * s / (1 + Tf * s))
    assert path == [ki, b * kp, c * kd]
    pi, lead = K * (1 + 1 / (Ti * s)), Td * s / (1 + Tf * s)
    interacting = expansion(pi * (1 + c * lead) + K * (b - 1))
    assert all(sp.diff(e, one, two) == 0 for e in interacting for one in (b, c) for two in (b, c))
    assert is_zero(sp.diff(interacting[1], b) - K)
    assert is_zero(sp.diff(interacting[1], c) - K * Td / Ti)


def test_the_setpoint_filter_of_the_specification_takes_one_pi_path_to_the_other() -> None:
    b = sp.Symbol("b")
    target = K * (1 + 1 / (Ti * s))
    source = K * (b + 1 / (Ti * s))  # the same integral gain, and b times the kick
    assert is_zero(source / target - (1 + b * Ti * s) / (1 + Ti * s))


# From here on sampled: x stands for z^-1, one scan.

INTEGRAL = {
    Rule.BACKWARD: h / (1 - x),
    Rule.FORWARD: h * x / (1 - x),
    Rule.TRAPEZOIDAL: h * (1 + x) / (2 * (1 - x)),
}
"""The recursions of section 4, ``I_n = I_{n-1} + ...``, solved for ``I`` per ``ki x_n``."""
KEPT = sp.Symbol("a", positive=True)
"""``exp(-h/Tf)``."""
UNFILTERED = (1 - x) / h
DERIVATIVE = {
    Rule.BACKWARD: (1 - x) / ((Tf + h) - Tf * x),
    Rule.FORWARD: (1 - x) / Tf / (1 - (1 - h / Tf) * x),
    Rule.TRAPEZOIDAL: 2 * (1 - x) / ((2 * Tf + h) - (2 * Tf - h) * x),
    Rule.EXACT: (1 - KEPT) * (1 - x) / h / (1 - KEPT * x),
    Rule.LAGGED_DIFFERENCE: (1 - (1 - KEPT) / (1 - KEPT * x)) / Tf,
    Rule.FOUR_POINT: (3 * (1 - x**3) + x - x**2) / (10 * h),
}
"""The same for ``D`` per ``kd x_n``."""
ONE_SCAN = sum((-s * h) ** k / sp.factorial(k) for k in range(8))
"""``exp(-s h)``, to an order beyond any used here."""


def held(C: Expr) -> Expr:
    """What a process sees of a law: sampled, and held from scan to scan."""
    return (C * (1 - x) / (s * h)).subs(x, ONE_SCAN)


def pid(integral: Expr, derivative: Expr) -> Expr:
    return kp + ki * integral + kd * derivative


@pytest.mark.parametrize("row", table("| integral rule | q0 |"), ids=lambda row: row[0])
def test_the_increments_of_the_specification_are_those_of_the_recursion(row: list[str]) -> None:
    C = pid(INTEGRAL[Rule(row[0])], UNFILTERED)
    wanted = list(map(read, row[1:4]))
    assert is_zero(C * (1 - x) - sum(c * x**k for k, c in enumerate(wanted)))
    back = [read(cell).subs(dict(zip(q, wanted, strict=True)), simultaneous=True) for cell in row[4:]]
    assert [sp.simplify(e) for e in back] == [kp, ki, kd]


@pytest.mark.parametrize("row", table("| integral rule | s C"), ids=lambda row: row[0])
def test_the_sampled_and_held_law_of_the_specification_is_that_of_the_recursion(row: list[str]) -> None:
    C = pid(INTEGRAL[Rule(row[0])], UNFILTERED)
    assert is_zero(C * (1 - x) / h - read(row[1]))
    assert all(is_zero(read(cell) - found) for cell, found in zip(row[2:], expansion(held(C)), strict=True))


@pytest.mark.parametrize("rule", DERIVATIVE, ids=lambda r: r.value)
@pytest.mark.parametrize("row", table("| integral rule | s C"), ids=lambda row: row[0])
def test_a_filter_on_the_derivative_is_in_the_fourth_moment_only(row: list[str], rule: Rule) -> None:
    strength = kd * (h / Tf) * KEPT / (1 - KEPT) if rule is Rule.LAGGED_DIFFERENCE else kd
    late = {
        Rule.BACKWARD: Tf + h,
        Rule.FORWARD: Tf,
        Rule.TRAPEZOIDAL: Tf + h / 2,
        Rule.EXACT: h / (1 - KEPT),
        Rule.LAGGED_DIFFERENCE: h / (1 - KEPT),
        Rule.FOUR_POINT: 2 * h,
    }[rule]
    found = expansion(held(pid(INTEGRAL[Rule(row[0])], DERIVATIVE[rule])), 4)
    wanted = [read(cell).subs(kd, strength) for cell in row[2:]]
    assert all(is_zero(a - b) for a, b in zip(found, wanted, strict=False))
    assert is_zero(sp.diff(found[3], kd) + sp.diff(strength, kd) * late)


def test_without_a_filter_the_derivative_is_late_by_one_scan() -> None:
    assert is_zero(sp.diff(expansion(held(pid(0, UNFILTERED)), 4)[3], kd) + h)


def test_at_one_interval_equal_moments_are_equal_increments() -> None:
    law = sum(c * x**k for k, c in enumerate(q)) / (1 - x)
    found = expansion(held(law))
    assert all(is_zero(a - b) for a, b in zip(found, (sum(q) / h, -q[1] - 2 * q[2], h * (q[1] + 4 * q[2]) / 2), strict=True))
    assert sp.solve(found, q, dict=True) == [dict.fromkeys(q, 0)]


def test_a_backward_integral_behind_a_hold_is_the_continuous_one() -> None:
    assert is_zero((ki * INTEGRAL[Rule.BACKWARD] * (1 - x) / (s * h)) - ki / s)


def test_a_series_form_by_one_rule_is_its_standard_form_by_that_rule() -> None:
    step = sp.Symbol("step")  # what stands for s
    interacting = K * (1 + 1 / (Ti * step)) * (1 + Td * step)
    assert is_zero(interacting - K * ((1 + Td / Ti) + 1 / (Ti * step) + Td * step))


# And from the expressions to the code.

RNG_SEEDS = range(5)


def values(seed: int, *names: Expr) -> dict[Expr, float]:
    """Draw numbers for which every root is real: integral time long, derivative short, filters shorter."""
    rng = np.random.default_rng(seed)
    ranges = {K: (0.2, 5), Ti: (20, 80), Td: (1, 4), Tf: (0.2, 1), alpha: (0.05, 0.3), rho: (0.05, 0.3), beta: (0.05, 0.3),
              tau: (0.2, 1), kp: (0.2, 5), ki: (0.01, 0.1), kd: (0.3, 3), h: (0.1, 0.9)}  # fmt: skip
    return {name: float(rng.uniform(*ranges[name])) for name in names}


def numbers(e: Expr, at: Mapping[Expr, float]) -> Any:
    """Evaluate an expression, compiled for numbers."""
    return sp.lambdify(list(at), e, "math")(*at.values())


def bench(form: str, **derivative: object) -> Card:
    """Return a made-up card of a form, all on the error, with a filter."""
    dials: dict[str, tuple[str, str, dict[str, object]]] = {
        "K": ("gain", "%/%", {}),
        "Ti": ("integral", "s", {"off": "inf"}),
        "Td": ("derivative", "s", {"off": 0, "default": 0}),
    }
    return made_up_card(
        form=form,
        derivative={"on": "error", "filter": derivative},
        settings={name: {"sets": sets, "unit": unit, **more} for name, (sets, unit, more) in dials.items()},
        examples=[{"given": {"K": 1, "Ti": 1}, "canonical": {"kp": 1, "ki": 1, "kd": 0}}],
    )


def target_of(name: str, filt: float) -> tuple[str | Card, dict[str, object]]:
    """Return the card that a goal is about, and the dial of its filter."""
    if name in ("parallel", "standard"):
        return f"generic/{name}", {"Tf": filt}
    if name == "series lead-lag, ratio":
        return "generic/series", {"alpha": filt}
    kind = "ratio" if "ratio" in name else "time"
    place = next(p for p in ("lead-lag", "term", "measurement") if p in name)
    more: dict[str, object] = {"of": "effective-derivative"} if "effective" in name else {}
    if "2nd order" in name:
        more["order"] = 2
    return bench(name.split(maxsplit=1)[0], **{"applies-to": place, kind: filt, **more}), {}


GENERIC: dict[str, tuple[str, tuple[Expr, ...], Expr]] = {
    "generic/parallel": (PARALLEL, (kp, ki, kd, Tf), SOURCES[PARALLEL]),
    "generic/standard": (STANDARD, (K, Ti, Td, Tf), SOURCES[STANDARD]),
    "generic/series": (LEAD_LAG, (K, Ti, Td, alpha), SOURCES[LEAD_LAG]),
}


@pytest.mark.parametrize("target", LOW)
@pytest.mark.parametrize("source", GENERIC)
def test_the_code_finds_the_numbers_of_the_closed_form(source: str, target: str) -> None:
    form, names, _ = GENERIC[source]
    goal = LOW[target]
    (filt,) = (goal.lag.free_symbols | goal.law.free_symbols) & {rho, tau, beta}
    wanted = {
        str(name): goal.solved(name).subs(dict(zip(m, MOMENTS[form], strict=True)), simultaneous=True) for name in goal.numbers
    }
    for seed in RNG_SEEDS:
        at = values(seed, *names, filt)
        card, dial = target_of(target, at[filt])
        settings = pidemu.load_card(source).settings({str(name): at[name] for name in names})
        found = pidemu.convert(settings, card, given=dial, match="low-frequency", emulate=False).settings
        for name, e in wanted.items():
            # the difference in a root loses some digits: Td is a hundredth of Ti
            assert found[name].canonical ** (-1 if name == "Ti" else 1) == pytest.approx(numbers(e, at), rel=1e-9), name


@pytest.mark.parametrize("target", GENERIC)
@pytest.mark.parametrize("source", GENERIC)
def test_the_code_finds_the_numbers_of_the_exact_match(source: str, target: str) -> None:
    form, names, _ = GENERIC[source]
    goal = EXACT[GENERIC[target][0]]
    given = dict(zip((*n, d1), HUB[form][:4], strict=True))
    wanted = {str(name): goal.solved(name).subs(given, simultaneous=True) for name in goal.numbers}
    for seed in RNG_SEEDS:
        at = values(seed, *names)
        settings = pidemu.load_card(source).settings({str(name): at[name] for name in names})
        conversion = pidemu.convert(settings, target, match="exact", emulate=False)
        assert conversion.certificate.feedback.is_exact
        for name, e in wanted.items():
            found = conversion.settings[name].canonical ** (-1 if name == "Ti" else 1)
            assert found == pytest.approx(numbers(e, at), rel=1e-9), name


def plain(at: Mapping[Expr, float]) -> Algorithm:
    """Return a parallel controller with these gains."""
    gains = {str(name): at.get(name, 0.0) for name in (kp, ki, kd, Tf)}
    return pidemu.load_card("generic/parallel").settings(gains).algorithm()


@pytest.mark.parametrize("derivative", DERIVATIVE, ids=lambda r: r.value)
@pytest.mark.parametrize("integral", INTEGRAL, ids=lambda r: r.value)
def test_the_code_expands_the_sampled_and_held_law_of_every_rule(integral: Rule, derivative: Rule) -> None:
    wanted = expansion(held(pid(INTEGRAL[integral], DERIVATIVE[derivative])), 5)
    for seed in RNG_SEEDS:
        at = values(seed, kp, ki, kd, Tf, h)
        at[Tf] += at[h]  # the forward rule is stable for Tf > h/2 only
        a = changed(plain(at), integral__rule=integral, derivative__rule=derivative)
        a = changed(a, Tf=0.0) if derivative is Rule.FOUR_POINT else a  # which has no filter
        exact = [numbers(e, {**at, KEPT: math.exp(-at[h] / at[Tf])}) for e in wanted]
        # what stays of sums of kp h^k/k! and kd h^k terms with both signs
        assert Law(a, at[h]).held_expansion(5) == pytest.approx(exact, rel=1e-9, abs=1e-11)


@pytest.mark.parametrize("rule", INTEGRAL, ids=lambda r: r.value)
def test_the_code_has_the_increments_of_the_table(rule: Rule) -> None:
    row = next(row for row in table("| integral rule | q0 |") if row[0] == rule.value)
    for seed in RNG_SEEDS:
        at = values(seed, kp, ki, kd, h)
        found = Law(changed(plain(at), integral__rule=rule), at[h]).impulse(6)
        steps = np.diff(found, prepend=0.0)
        assert steps == pytest.approx([*(numbers(read(cell), at) for cell in row[1:4]), 0, 0, 0], abs=1e-12)


@pytest.mark.parametrize(
    "rules", [(a, b) for a in INTEGRAL for b in INTEGRAL if a is not b], ids=lambda r: "-".join(x.value for x in r)
)
def test_the_code_converts_an_unfiltered_pid_exactly_from_rule_to_rule(rules: tuple[Rule, Rule]) -> None:
    rows = {row[0]: row for row in table("| integral rule | q0 |")}
    cards = [made_up_card(integral={"rule": rule.value, "windup": {"scheme": "none"}}) for rule in rules]
    for seed in RNG_SEEDS:
        at = values(seed, kp, ki, kd, h)
        increments = {v: numbers(read(cell), at) for v, cell in zip(q, rows[rules[0].value][1:4], strict=True)}
        wanted = [numbers(read(cell), {**increments, h: at[h]}) for cell in rows[rules[1].value][4:]]
        source = cards[0].settings({str(name): at[name] for name in (kp, ki, kd)})
        conversion = pidemu.convert(source, cards[1], scan=at[h], compensate=True)
        assert [conversion.settings[name].value for name in ("kp", "ki", "kd")] == pytest.approx(wanted, rel=1e-9)
        assert conversion.verdict == "exact"
