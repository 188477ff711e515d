"""Numbers of Q(sqrt d), against sympy, which has its own algebra of square roots."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st

from pidemu.law.exact import Exact, InexactError, as_typed, exact, sqrt

FRACTIONS = st.fractions(min_value=-100, max_value=100, max_denominator=1000)
ROOTS = st.sampled_from([2, 3, 5, 6, 10, 12, 18])


def symbolic(x: Exact) -> Any:
    return sp.Rational(x.a.numerator, x.a.denominator) + sp.Rational(x.b.numerator, x.b.denominator) * sp.sqrt(x.d)


@given(a=FRACTIONS, b=FRACTIONS, c=FRACTIONS, e=FRACTIONS, d=ROOTS)
@pytest.mark.parametrize("operation", [operator.add, operator.sub, operator.mul, operator.truediv])
def test_arithmetic_is_that_of_sympy(
    operation: Callable[[Any, Any], Any], a: Fraction, b: Fraction, c: Fraction, e: Fraction, d: int
) -> None:
    x, y = Exact(a, b, d), Exact(c, e, d)
    assume(y or operation is not operator.truediv)
    assert sp.nsimplify(sp.radsimp(operation(symbolic(x), symbolic(y)) - symbolic(operation(x, y)))) == 0


@given(a=FRACTIONS, b=FRACTIONS, d=ROOTS)
def test_sign_and_order_are_those_of_sympy(a: Fraction, b: Fraction, d: int) -> None:
    x = Exact(a, b, d)
    assert x.sign == sp.sign(symbolic(x))
    assert (x < 1) == bool(symbolic(x) < 1)
    assert abs(x).sign == abs(x.sign)
    assert math.isclose(float(x), float(symbolic(x).evalf(30)), rel_tol=1e-15)  # both rounded once


@given(x=st.fractions(min_value=0, max_value=10**6, max_denominator=10**6))
def test_a_square_root_squared_is_the_number(x: Fraction) -> None:
    root = sqrt(x)
    assert root * root == x
    assert root.sign == (x > 0)
    assert sqrt(x * x) == Exact(x)  # a perfect square has no root left


def test_a_negative_number_has_no_square_root_here() -> None:
    with pytest.raises(ValueError, match="negative"):
        sqrt(Fraction(-1))


def test_a_rounded_number_cannot_get_in() -> None:
    assert Exact("1/3") + 0.5 == Exact("5/6")  # 0.5 is what its text says, in binary too
    for operation in (operator.add, operator.sub, operator.mul, operator.truediv):
        with pytest.raises(InexactError, match=r"0\.1 is not known exactly"):
            operation(Exact(1), 0.1)
        with pytest.raises(InexactError, match=r"0\.1 is not known exactly"):
            operation(0.1, Exact(1))
    with pytest.raises(InexactError, match="inf is not known exactly"):
        Exact(1) * math.inf


def test_two_roots_have_no_common_field() -> None:
    with pytest.raises(InexactError, match=r"sqrt\(2\) and sqrt\(3\)"):
        sqrt(Fraction(2)) + sqrt(Fraction(3))


def test_a_float_is_the_decimal_that_was_typed() -> None:
    assert as_typed(0.1) == Exact("1/10")
    assert as_typed(3.69444) == Exact("3.69444")
    assert as_typed(123456.789012345) == Exact("123456.789012345")
    assert as_typed(1e-9) == Exact(Fraction(1, 10**9))


def test_a_float_of_all_digits_is_the_simple_fraction_that_it_was_computed_as() -> None:
    assert as_typed(133 / 36) == Exact("133/36")
    assert as_typed(12.345 / 3600) == Exact("823/240000")
    assert as_typed(400 / 300) == Exact("4/3")
    assert as_typed(1 / 3 * (1 + 1e-12)) != Exact("1/3")


@given(x=st.floats(min_value=0, exclude_min=True, allow_infinity=False))
def test_what_a_float_stands_for_rounds_to_it(x: float) -> None:
    assert float(as_typed(x)) == x
    assert as_typed(-x) == -as_typed(x)


def test_numbers_are_printed_as_written_by_hand() -> None:
    root = sqrt(Fraction(5))
    shown = {
        "27/10": Exact("2.7"),
        "-3": Exact(-3),
        "1.2345678": Exact("1.2345678"),
        "(3 + sqrt(5))/2": (3 + root) / 2,
        "1 - 2 sqrt(5)": 1 - 2 * root,
        "-sqrt(5)/3": -root / 3,
        "0.33333333333333222222...": Exact(Fraction(10**14, 3 * 10**14 + 1)),
    }
    assert {str(x): x for x in shown.values()} == shown
    assert f"{(3 + root) / 2:.4g}" == "2.618"


def test_exact_passes_on_what_is_exact() -> None:
    assert [exact(x) for x in (3, 2.0, 0.25, Fraction(1, 7))] == [Exact(3), Exact(2), Exact("1/4"), Exact("1/7")]
