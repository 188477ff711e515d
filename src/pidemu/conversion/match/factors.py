"""What closed forms share: factors of a numerator, and differences that are only rounding."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pidemu.card.model.base import Form
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target

ROUNDING = 1e-12
"""Relative size below which a difference of two products is their rounding."""


def clean(difference: float, scale: float) -> float:
    """Return a difference of two products, 0 where it is only their rounding."""
    return 0.0 if abs(difference) <= ROUNDING * abs(scale) else difference


def without_rounding(moments: Sequence[float]) -> tuple[float, float, float]:
    """Return the moments with an ``m2`` that is only the rounding of its neighbours made zero."""
    m0, m1, m2 = moments
    return m0, m1, clean(m2, abs(m1 * m1 / m0) if m0 else abs(m2))


def leads(n0: float, n1: float, n2: float) -> tuple[float, ...]:
    """Return the time constants that ``n0 + n1 s + n2 s^2`` is factored into, the smaller first: derivative times of a series form.

    Raises
    ------
    NoMatchError
        The zeros are complex.
    """
    root = n1 * n1 - 4 * n0 * n2
    if root < -ROUNDING * n1 * n1:
        raise NoMatchError(_complex_zeros(n0, n1, n2), fundamental=True)
    sum_ = n1 + math.copysign(math.sqrt(max(root, 0.0)), n1)
    if not n2:
        return (0.0,)
    return (2 * n2 / sum_, sum_ / (2 * n0)) if n0 else (2 * n2 / sum_,)


def _complex_zeros(n0: float, n1: float, n2: float) -> str:
    ratio = n1 * n1 / (n0 * n2)
    return (
        "the source has complex zeros: as a standard form its integral time is "
        f"{apart(ratio, 4.0)[0]} times its derivative time, and a series form needs 4 times or more"
    )


def apart(x: float, y: float) -> tuple[str, str]:
    """Return two numbers with four digits, or as many more as tell them apart."""
    digits = next((d for d in range(4, 16) if f"{x:.{d}g}" != f"{y:.{d}g}"), 16)
    return f"{x:.{digits}g}", f"{y:.{digits}g}"


def behind_signal_filter(n0: float, n1: float, n2: float, Tf: float | None, form: Form) -> Iterator[Numbers]:
    """Return the numbers for a target whose filter multiplies the whole feedback path, of ``n0 + n1 s + n2 s^2`` before it.

    The filter time is ``None`` where the filter is not free.
    """
    if form is not Form.SERIES:
        yield Numbers(n1, n0, n2, Tf)
        return
    for lead in leads(n0, n1, n2):
        K = n1 - n0 * lead
        yield Numbers(K, n0, K * lead, Tf)


def without_proportional(m0: float, m2: float, target: Target, gain: float) -> Numbers:
    """Return the numbers of a target that has no proportional term; `gain` then only scales its times."""
    if target.form is Form.PARALLEL:
        return Numbers(0.0, m0, m2)
    return Numbers(math.copysign(gain, m0 or m2), m0, m2)
