"""Functions of numbers that may be traced, under the names that they have for plain ones."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from typing import Any

from pidemu.columns.traced import Each, NotTracedError, Traced, TracedRoot, Whole, value_of

_WRITTEN: ContextVar[Mapping[str, Traced] | None] = ContextVar("numbers that words stand for", default=None)


@contextlib.contextmanager
def standing_for(numbers: Mapping[str, Traced]) -> Iterator[None]:
    """Let words stand for traced numbers where a text is read (`as_written`)."""
    before = _WRITTEN.set(numbers)
    try:
        yield
    finally:
        _WRITTEN.reset(before)


def as_written(word: str) -> Traced | None:
    """Return the traced number that a word stands for, if it does for one."""
    numbers = _WRITTEN.get()
    return None if numbers is None else numbers.get(word)


def each(function: Callable[..., float], *numbers: Any) -> Any:
    """Return a function of plain numbers; of traced ones it is recorded whole, and called loop by loop."""
    for x in numbers:
        if isinstance(x, Traced):
            return x.tape.note(Each(function), numbers, function(*map(value_of, numbers)))
    return function(*numbers)


def whole(function: Callable[..., tuple[Any, Any]], numbers: Sequence[Any], results: Sequence[float]) -> list[Traced]:
    """Return the results of a function of columns, of which one loop's are known.

    Parameters
    ----------
    function : callable
        From columns, one per number, to results, shape (loops, results), and to which loops they count for.
    numbers : sequence
        Its arguments, at least one of them traced.
    results : sequence of float
        What it returns for them.
    """
    tape = next(x.tape for x in numbers if isinstance(x, Traced))
    all_of_them = tape.note(Whole(function), numbers, math.nan)
    return [tape.note(("result", i), (all_of_them,), x) for i, x in enumerate(results)]


def is_traced(*numbers: Any) -> bool:
    """Tell whether one of the numbers is traced."""
    return any(isinstance(x, Traced | TracedRoot) for x in numbers)


def plain(x: Any) -> Any:
    """Return a number as a float; a traced one in that precision."""
    if isinstance(x, Traced):
        return x if type(x.value) in (float, int) else x.tape.note("double", (x,), float(x.value))
    return float(x)


def single(x: Any) -> Any:
    """Return a number rounded to float32."""
    import numpy as np  # who reads a card needs none of it

    return x.tape.note("single", (x,), np.float32(x.value)) if isinstance(x, Traced) else np.float32(x)


def isfinite(x: Any) -> bool:
    """Tell whether a number is finite."""
    return abs(x) < math.inf if isinstance(x, Traced) else math.isfinite(x)


def isnan(x: Any) -> bool:
    """Tell whether it is not a number."""
    return x != x if isinstance(x, Traced) else math.isnan(x)  # noqa: PLR0124 (only NaN differs from itself)


def isinf(x: Any) -> bool:
    """Tell whether a number is infinite."""
    return abs(x) == math.inf if isinstance(x, Traced) else math.isinf(x)


def sign_of(x: Any) -> float:
    """Return 1.0 with the sign of a number; a traced one has to be above or below zero."""
    if isinstance(x, Traced):
        if x > 0:
            return 1.0
        if x < 0:
            return -1.0
        raise NotTracedError("the sign of zero is not recorded")
    return math.copysign(1.0, x)


def exp(x: Any) -> Any:
    """Return ``e**x``."""
    return each(math.exp, x)


def expm1(x: Any) -> Any:
    """Return ``e**x - 1``."""
    return each(math.expm1, x)


def sqrt(x: Any) -> Any:
    """Return the square root."""
    return each(math.sqrt, x)
