"""Laws without rounding, against the laws in floats of every card, and against laws written out by hand in sympy."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.certificate.exact_law import ExactLaw, difference, divide, exact_algorithm, exact_paths, polynomial_text, trimmed
from pidemu.law.exact import Exact
from pidemu.law.rational import multiply
from pidemu.settings.settings import Settings
from tests.conversion.usual import CARDS, SOURCES
from tests.helpers import settings_of

s = sp.Symbol("s")
COEFFICIENTS = st.lists(st.fractions(-20, 20, max_denominator=50), min_size=1, max_size=4)
W = np.geomspace(1e-4, 1e2, 13)


def rational(text: str) -> Any:
    return sp.Rational(text)


def symbolic(law: ExactLaw) -> Any:
    num, den = (sum(rational(str(x.a)) * s**k for k, x in enumerate(p)) for p in (law.num, law.den))
    return num / den


def response(law: ExactLaw, w: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    num, den = (np.polynomial.Polynomial([float(x) for x in p])(1j * w) for p in (law.num, law.den))
    return np.asarray(num / den)


@given(data=st.data())
@settings(max_examples=300)
def test_the_exact_law_is_the_law_in_floats_whatever_the_card_and_its_settings(data: st.DataObject) -> None:
    card = pidemu.load_card(data.draw(st.sampled_from(CARDS)))
    drawn = settings_of(data, card)
    assume(any(drawn.law().moments()))
    laws = exact_paths(exact_algorithm(drawn), ("feedback", "setpoint"))
    for name in ("feedback", "setpoint"):
        # 1e-9: both are sums of a few terms in double, which cancel by some orders of magnitude at most
        assert np.allclose(response(laws[name], W), drawn.law().response(W, name), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("card_id", "chosen"), SOURCES)
def test_the_numbers_of_the_algorithm_are_the_exact_ones_rounded(card_id: str, chosen: Settings) -> None:
    rounded, found = chosen.algorithm(), exact_algorithm(chosen)
    for name in ("kp", "ki", "kd", "b", "c", "Tf"):
        # a few products and quotients in double
        assert math.isclose(float(getattr(found, name)), getattr(rounded, name), rel_tol=1e-14), f"{card_id}: {name}"


def provox() -> Any:
    """2 %/%, 4 repeats per minute, 0.1 min; lead-lag with 1/8."""
    return 2 * (1 + 1 / (15 * s)) * (1 + 6 * s) / (1 + rational("3/4") * s)


def deltav_series() -> Any:
    """2.5, 20 s, 4 s, filter 0.1 on the derivative term of the series form."""
    return rational("5/2") * (1 + 1 / (20 * s)) * (1 + 4 * s / (1 + rational("2/5") * s))


def plc5() -> Any:
    """ISA: 2, 1 min, 0.1 min, derivative gain 16."""
    return 2 * (1 + 1 / (60 * s) + 6 * s / (1 + rational("6/16") * s))


def ia() -> Any:
    """Band 50 %, 1 min, 0.1 min; Butterworth of a tenth of ``Ti Td/(Ti + Td)`` on the measurement."""
    Tf = rational("1/10") * 60 * 6 / 66
    return 2 * (1 + 1 / (60 * s)) * (1 + 6 * s) / (1 + Tf * s + Tf**2 * s**2 / 2)


@pytest.mark.parametrize(
    ("card_id", "dials", "law"),
    [
        ("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.1}, provox()),
        ("emerson/deltav", {"GAIN": 2.5, "RESET": 20, "RATE": 4, "ALPHA": 0.1, "FORM": "Series"}, deltav_series()),
        ("allen-bradley/plc5", {"EQUATION": "ISA", "KC": 2, "TI": 1, "TD": 0.1}, plc5()),
        ("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0.1}, ia()),
    ],
)
def test_a_law_written_out_by_hand_is_the_exact_law(card_id: str, dials: dict[str, object], law: Any) -> None:
    chosen = pidemu.load_card(card_id).settings(**dials)
    assert sp.simplify(symbolic(exact_paths(exact_algorithm(chosen), ["feedback"])["feedback"]) - law) == 0


@given(a=COEFFICIENTS, b=COEFFICIENTS, c=COEFFICIENTS)
def test_a_common_factor_cancels_and_changes_nothing(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> None:
    assume(any(b) and any(c))
    top, bottom, common = (trimmed(x) for x in (a, b, c))
    plain, longer = ExactLaw.of(top, bottom), ExactLaw.of(multiply(top, common), multiply(bottom, common))
    assert plain == longer
    assert plain.equals(longer)


@given(a=COEFFICIENTS, b=COEFFICIENTS)
def test_quotient_and_remainder_are_those_of_sympy(a: list[Fraction], b: list[Fraction]) -> None:
    assume(b[-1] and a[-1])
    quotient, rest = divide(trimmed(a), trimmed(b))
    polys = [sp.Poly([rational(str(x)) for x in reversed(p)], s, domain="QQ") for p in (a, b)]
    expected = sp.div(*polys)
    assert [sp.Poly([rational(str(x.a)) for x in reversed(p)], s, domain="QQ") for p in (quotient, rest)] == list(expected)


def test_the_difference_is_relative_to_what_a_coefficient_is_the_sum_of() -> None:
    card = pidemu.load_card("generic/parallel")
    one, other = (exact_algorithm(card.settings(kp=kp, ki=1)) for kp in (2, 2.002))
    assert math.isclose(difference(one, other, "feedback", Exact(1)), 0.002 / 2.002, rel_tol=1e-12)
    assert not exact_paths(one, ["feedback"])["feedback"].equals(exact_paths(other, ["feedback"])["feedback"])


def test_rounded_numbers_that_cancel_make_no_more_of_a_difference() -> None:
    card = pidemu.load_card("generic/parallel")
    plain = exact_algorithm(card.settings(kp=1, ki=1))
    filtered = exact_algorithm(card.settings(kp=1, ki=1, kd="1e-14 s", Tf=100))
    assert difference(plain, filtered, "feedback", Exact(1)) < 1e-14


def test_polynomials_are_printed_as_written_by_hand() -> None:
    root = Exact(0, 1, 5)
    assert polynomial_text([Exact("2/15"), Exact(0), Exact(-1), (3 + root) / 2]) == "2/15 - s^2 + (3 + sqrt(5))/2 s^3"
    assert polynomial_text([Exact(0), 1 + root]) == "(1 + sqrt(5)) s"
    assert str(ExactLaw.of([1, 1], [0, 0, 1, 2])) == "(1 + s)/(s^2 (1 + 2 s))"
    assert str(ExactLaw.of([3], [0, 4])) == "(3/4)/s"
    assert str(ExactLaw.of([0], [5, 4])) == "0"
