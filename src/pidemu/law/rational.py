"""Rational functions of one operator, ``s`` or ``q = z^-1``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Response = npt.NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Rational:
    """A quotient of two polynomials in one operator; coefficients ascend from the constant.

    Attributes
    ----------
    num, den : tuple of float
        Coefficients of numerator and denominator.
    """

    num: tuple[float, ...]
    den: tuple[float, ...] = (1.0,)

    def __add__(self, other: Rational | float) -> Rational:
        o = _rational(other)
        return Rational(add(multiply(self.num, o.den), multiply(o.num, self.den)), multiply(self.den, o.den))

    def __mul__(self, other: Rational | float) -> Rational:
        o = _rational(other)
        return Rational(multiply(self.num, o.num), multiply(self.den, o.den))

    __radd__ = __add__
    __rmul__ = __mul__

    def __call__(self, x: npt.ArrayLike) -> Response:
        """Return the value at the operator's values `x`."""
        at = np.asarray(x, dtype=np.complex128)
        value: Response = _horner(self.num, at) / _horner(self.den, at)
        return value


def _rational(x: Rational | float) -> Rational:
    return x if isinstance(x, Rational) else Rational((x + 0.0,))  # no call of float(), which would round an exact number


def add(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, ...]:
    """Return the sum of two polynomials, coefficients ascending: floats, or exact numbers."""
    n = max(len(a), len(b))
    return tuple((a[i] if i < len(a) else 0.0) + (b[i] if i < len(b) else 0.0) for i in range(n))


def multiply(a: Sequence[Any], b: Sequence[Any]) -> tuple[Any, ...]:
    """Return the product of two polynomials, coefficients ascending: floats, or exact numbers."""
    out: list[Any] = [0.0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        if x:
            for j, y in enumerate(b):
                if y:
                    out[i + j] = out[i + j] + x * y if out[i + j] else x * y
    return tuple(out)


def _horner(coefficients: Sequence[float], x: Response) -> Response:
    value = np.zeros_like(x)
    for c in reversed(coefficients):
        value = value * x + c
    return value
