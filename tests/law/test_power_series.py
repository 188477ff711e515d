"""Truncated power series in s, against exact fractions: long division and multiplication by definition."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

from pidemu.law.power_series import Series, hold, one_minus_delay

TERMS = 8
"""From 1/s on to s^6."""
KNOWN = 6
"""Terms of the reciprocal of a series that begins with s: two of those that it would need are beyond s^6. The law uses five."""
EXACT = 1e-12
"""A few sums of at most eight products each, of numbers that do not cancel by more than three digits."""

numbers = st.integers(-20, 20)
laurent = st.lists(numbers, min_size=TERMS, max_size=TERMS)


def series(terms: list[int] | list[Fraction]) -> Series:
    return Series(tuple(float(x) for x in terms))


def product(a: list[int], b: list[int]) -> list[Fraction]:
    """Coefficients of 1/s, 1, s, ...; of two series that begin with 1/s."""
    found = [Fraction(0)] * (2 * TERMS - 1)  # of s^-2, s^-1, ...
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            found[i + j] += Fraction(x) * y
    assert found[0] == 0
    return found[1:]


def quotient(a: list[int], b: list[int]) -> list[Fraction]:
    """Coefficients of 1/s, 1, s, ... of a/b by long division, where b begins with 1 or s and a does not integrate."""
    lead = next(i for i, x in enumerate(b) if x)
    rest, divisor, found = [Fraction(x) for x in a], [Fraction(x) for x in b[lead:]], []
    for k in range(TERMS):
        digit = rest[k] / divisor[0]
        found.append(digit)
        for j in range(len(divisor)):
            if k + j < len(rest):
                rest[k + j] -= digit * divisor[j]
    return found[lead - 1 :]


@given(laurent, laurent)
def test_sums_and_differences_are_those_of_the_terms(a: list[int], b: list[int]) -> None:
    assert (series(a) + series(b)).terms == tuple(float(x + y) for x, y in zip(a, b, strict=True))
    assert (series(a) - series(b)).terms == tuple(float(x - y) for x, y in zip(a, b, strict=True))


@given(laurent, numbers)
def test_a_number_is_added_to_the_constant_term_from_either_side(a: list[int], x: int) -> None:
    wanted = tuple(float(t + x if i == 1 else t) for i, t in enumerate(a))
    assert (series(a) + x).terms == (x + series(a)).terms == wanted
    assert (series(a) - x).terms == tuple(float(t - x if i == 1 else t) for i, t in enumerate(a))
    assert (x - series(a)).terms == tuple(float(x - t if i == 1 else -t) for i, t in enumerate(a))


@given(laurent, numbers)
def test_a_number_multiplies_every_term_from_either_side(a: list[int], x: int) -> None:
    assert (series(a) * x).terms == (x * series(a)).terms == tuple(float(t * x) for t in a)


@given(laurent, laurent, st.sampled_from(["neither", "left", "right"]))
def test_products_are_those_of_exact_fractions(a: list[int], b: list[int], integrates: str) -> None:
    a[0] = a[0] if integrates == "left" else 0
    b[0] = b[0] if integrates == "right" else 0
    found, wanted = (series(a) * series(b)).terms, product(a, b)
    exact = TERMS if integrates == "neither" else TERMS - 1  # an integrator brings down a term that is not kept
    assert found[:exact] == tuple(float(x) for x in wanted[:exact])
    assert len(found) == TERMS


def test_two_integrators_are_refused() -> None:
    with pytest.raises(ValueError, match="double pole"):
        series([1, *[0] * 7]) * series([2, *[0] * 7])


@given(laurent, laurent, st.booleans())
def test_quotients_are_those_of_long_division(a: list[int], b: list[int], differentiates: bool) -> None:
    a[0], b[0] = 0, 0
    b[1] = 0 if differentiates else b[1]
    lead = 2 if differentiates else 1
    assume(abs(b[lead]) >= 5 and all(abs(x) <= 2 * abs(b[lead]) for x in b))  # terms that do not grow beyond all bounds
    found, wanted = (series(a) / series(b)).terms, quotient(a, b)
    size = max(1.0, *(abs(float(x)) for x in wanted))
    known = TERMS if lead == 1 else KNOWN
    for x, y in zip(found[:known], wanted[:known], strict=True):
        assert abs(x - float(y)) <= EXACT * size


@given(laurent, st.integers(1, 20))
def test_a_series_times_its_reciprocal_is_one(b: list[int], first: int) -> None:
    b[0], b[1] = 0, first
    assume(all(abs(x) <= 2 * first for x in b))
    back = (series(b) * (1 / series(b))).terms
    size = max(abs(x) for x in (1 / series(b)).terms) * max(map(abs, b))
    assert back == pytest.approx([0, 1, *[0] * 6], abs=EXACT * max(1.0, size))


@pytest.mark.parametrize("begin", [0, 3, 5])
def test_what_has_no_reciprocal_with_a_simple_pole_is_refused(begin: int) -> None:
    terms = [0] * TERMS
    terms[begin] = 2
    with pytest.raises(ValueError, match="begins with 1 or s"):
        1 / series(terms)


s = sympy.Symbol("s")


def expanded(e: Any, h: Fraction) -> list[float]:
    """Coefficients of 1/s, 1, s, ..., s^6, by sympy, for exact numbers."""
    whole = sympy.series(s * e.subs("h", sympy.Rational(h.numerator, h.denominator)), s, 0, TERMS).removeO()
    return [float(whole.coeff(s, k)) for k in range(TERMS)]


H = sympy.Symbol("h")
DELAY = sympy.exp(-s * H)


@pytest.mark.parametrize("h", [Fraction(1, 10), Fraction(1), Fraction(7, 2)])
def test_a_scan_and_a_hold_are_those_of_the_exponential_function(h: Fraction) -> None:
    assert one_minus_delay(float(h)).terms == pytest.approx(expanded(1 - DELAY, h), rel=1e-15)
    assert hold(float(h)).terms == pytest.approx(expanded((1 - DELAY) / (s * H), h), rel=1e-15)


@pytest.mark.parametrize("h", [Fraction(1, 10), Fraction(1), Fraction(7, 2)])
def test_a_held_sum_is_an_integrator(h: Fraction) -> None:
    rest = one_minus_delay(float(h))
    found = (hold(float(h)) * (float(h) / rest)).terms  # h/(1 - q) is the backward integral
    assert found[:KNOWN] == pytest.approx([1, *[0] * 5], abs=EXACT * max(1.0, float(h)) ** 6)


@pytest.mark.parametrize("h", [Fraction(1, 10), Fraction(1), Fraction(7, 2)])
@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("backward", (1 - DELAY) / H),
        ("forward", (1 - DELAY) / (H * DELAY)),
        ("trapezoidal", 2 * (1 - DELAY) / (H * (1 + DELAY))),
    ],
)
def test_lags_and_integrals_by_every_rule_are_expanded_as_sympy_does(h: Fraction, name: str, written: Any) -> None:
    rest, time = one_minus_delay(float(h)), 1.25
    step = {
        "backward": rest / float(h),
        "forward": rest / (float(h) * (1 - rest)),
        "trapezoidal": 2 * rest / (float(h) * (2 - rest)),
    }
    found = step[name]
    size = max(1.0, float(h)) ** 6
    assert (1 / found).terms[:KNOWN] == pytest.approx(expanded(1 / written, h)[:KNOWN], rel=1e-11, abs=EXACT * size)
    lag = 1 / (1 + time * found)
    assert lag.terms == pytest.approx(expanded(1 / (1 + sympy.Rational(5, 4) * written), h), rel=1e-11, abs=EXACT * size)


def test_eight_terms_are_kept_of_whatever_is_done() -> None:
    rest = one_minus_delay(0.5)
    for made in (rest * rest, rest + 1, 1 - rest, 1 / rest, rest / (1 + rest), hold(0.5) * (1 / rest)):
        assert len(made.terms) == TERMS
        assert all(math.isfinite(x) for x in made.terms)
