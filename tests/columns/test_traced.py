"""Numbers that record what is computed from them, and what was recorded done with columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pidemu.columns.functions import (
    as_written,
    each,
    exp,
    expm1,
    is_traced,
    isfinite,
    isinf,
    isnan,
    plain,
    sign_of,
    single,
    sqrt,
    standing_for,
    whole,
)
from pidemu.columns.replay import Recording
from pidemu.columns.traced import NotTracedError, Tape
from pidemu.plausible import plain_number

Computation = Callable[..., Sequence[Any]]
NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)


def recorded(computation: Computation, *numbers: float) -> Recording:
    tape = Tape()
    return Recording.of(tape, numbers, computation(*(tape.number(x) for x in numbers)))


def arithmetic(a: Any, b: Any) -> list[Any]:
    c = a * 3 + b / 7 - 1
    found = [a + b, 2 - a, c * c, -a, abs(b), math.floor(a) + 1, math.ceil(b) - 1, round(a), a // 1.0, 1.5]
    if b:
        found.append(a / b)
    found.append(exp(-abs(a)))
    return [*found, max(a, b), min(a, 1.0), plain(single(a) * single(b)), sqrt(abs(b)) if b > 1 else expm1(b)]


@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=20))
def test_what_fits_is_the_same_to_the_last_bit_and_what_does_not_is_said(pairs: list[tuple[float, float]]) -> None:
    small = [(a, b) for a, b in pairs if abs(a) < 1e9 and abs(b) < 700] or [(1.0, 2.0)]
    recording = recorded(arithmetic, *small[0])
    found, fits = recording.replay(np.array(small).T)
    assert fits[0]
    for (a, b), column, fit in zip(small, found.T, fits, strict=True):
        if fit:
            assert column.tolist() == [float(x) for x in arithmetic(a, b)]
        else:  # one of the decisions comes out otherwise
            here, there = small[0], (a, b)
            ways = [(x[1] != 0, x[0] > x[1], x[0] < 1.0, x[1] > 1, x[1] < x[0]) for x in (here, there)]
            assert ways[0] != ways[1]


def test_every_decision_is_a_guard() -> None:
    decisions: list[Callable[[Any], bool]] = [
        lambda x: x < 2, lambda x: 2 > x, lambda x: x == 1, lambda x: x != 1, lambda x: bool(x - 1), lambda x: x >= 2,
        lambda x: x <= 1, lambda x: x in (0.0, 1.0), lambda x: sign_of(x - 1.5) > 0, lambda x: x == 2 or isinf(1 / (2 - x)),
        isnan, lambda x: not isfinite(x), lambda x: x == "1", lambda x: x != "1",
    ]  # fmt: skip
    for decide in decisions:
        recording = recorded(lambda x, decide=decide: [float(decide(x))], 1.0)
        found, fits = recording.replay(np.array([[1.0, 2.0, math.nan, math.inf]]))
        for i, x in enumerate((1.0, 2.0, math.nan, math.inf)):
            assert not fits[i] or found[0, i] == float(decide(x))


def test_a_whole_number_that_counts_something_is_part_of_the_structure() -> None:
    recording = recorded(lambda x: [x + i for i in range(round(x))], 2.0)
    found, fits = recording.replay(np.array([[2.0, 2.4, 3.0]]))
    assert fits.tolist() == [True, True, False]
    assert found[:, :2].T.tolist() == [[2.0, 3.0], [2.4, 3.4]]


def test_a_traced_number_is_refused_where_its_origin_would_be_lost() -> None:
    x = Tape().number(2.0)
    takers: list[Callable[[Any], Any]] = [float, math.exp, math.isfinite, np.float64, lambda x: np.array([x], float)]
    for taken in takers:
        with pytest.raises((NotTracedError, TypeError)):
            taken(x)
    with pytest.raises(NotTracedError, match="the sign of zero is not recorded"):
        sign_of(x - 2)
    with pytest.raises(NotTracedError, match="two loops' numbers in one operation"):
        x + Tape().number(1.0)
    assert (f"{x:g}", repr(x), x.imag, x.real is x, is_traced(1.0, x), is_traced(1.0)) == ("2", "2.0", 0.0, True, True, False)


def test_a_division_by_zero_is_one_and_guarded() -> None:
    with pytest.raises(ZeroDivisionError):
        recorded(lambda x: [1 / x], 0.0)
    _, fits = recorded(lambda x: [1 / x], 2.0).replay(np.array([[2.0, 0.0]]))
    assert fits.tolist() == [True, False]


def test_who_refuses_a_number_loses_that_loop_only() -> None:
    def odd(x: float) -> float:
        if x == 3:
            raise KeyError(x)
        return x + 0.5

    found, fits = recorded(lambda x: [each(odd, x), exp(x)], 1.0).replay(np.array([[1.0, 3.0, 2.0, 1000.0]]))
    assert fits.tolist() == [True, False, True, False]
    assert found[:, 2].tolist() == [2.5, math.exp(2.0)]


def test_a_function_of_columns_is_called_once_for_all() -> None:
    calls = []

    def both(a: Any, b: Any) -> tuple[Any, Any]:
        calls.append(len(a))
        return np.stack([a + b, a * b], axis=1), a != 4

    def compute(a: Any, b: Any) -> list[Any]:
        total, product = whole(
            both,
            (
                a,
                b,
            ),
            (3.0, 2.0),
        )
        return [total - product]

    recording = recorded(compute, 1.0, 2.0)
    found, fits = recording.replay(np.array([[1.0, 3.0, 4.0], [2.0, 5.0, 1.0]]))
    assert calls == [1, 3]
    assert (found[0, :2].tolist(), fits.tolist()) == ([1.0, -7.0], [True, True, False])


def test_what_nothing_depends_on_is_not_done() -> None:
    def compute(x: Any) -> list[Any]:
        exp(x * 5)
        return [x + 1]

    assert sum(step is not None for step in recorded(compute, 1.0).steps) == 3  # the input, 1, and their sum


def test_a_recording_that_does_not_give_back_its_own_numbers_is_refused() -> None:
    tape = Tape()
    x = tape.number(1.0)
    state = [x]

    def cheats(x: float) -> float:
        state.append(x)  # type: ignore[arg-type]
        return x + len(state)

    y = each(cheats, x)
    with pytest.raises(NotTracedError, match="what was recorded does not give back what it was recorded from"):
        Recording.of(tape, (1.0,), [y])


def test_words_stand_for_traced_numbers_where_a_text_is_read() -> None:
    x = Tape().number(2.5)
    with standing_for({"0001": x}):
        assert plain_number(" 0001 ") is x  # type: ignore[comparison-overlap]
        assert plain_number("0002") == 2.0
    assert as_written("0001") is None
    assert plain_number("0001") == 1.0
