"""Truncated power series in ``s``: what a law is at low frequencies, term by term."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import zip_longest

_TERMS = 8
"""Terms kept, from ``s^-1`` on; a product with an integrator loses the last one."""


@dataclass(frozen=True, slots=True)
class Series:
    """A power series in ``s`` that may have a simple pole at zero, truncated.

    Attributes
    ----------
    terms : tuple of float
        Coefficients of ``s^-1, 1, s, s^2, ...``.
    """

    terms: tuple[float, ...]

    def __add__(self, other: Series | float) -> Series:
        return Series(tuple(a + b for a, b in zip_longest(self.terms, _series(other).terms, fillvalue=0.0)))

    def __mul__(self, other: Series | float) -> Series:
        if not isinstance(other, Series):
            return Series(tuple(other * a for a in self.terms))
        a, b = self.terms, other.terms
        if a[0] and b[0]:
            raise ValueError("a product of two integrators has a double pole, which no controller has")
        return Series(
            tuple(sum(a[i] * b[k + 1 - i] for i in range(max(0, k + 2 - len(b)), min(k + 2, len(a)))) for k in range(_TERMS))
        )

    def __sub__(self, other: Series | float) -> Series:
        return self + -1.0 * _series(other)

    def __rsub__(self, other: float) -> Series:
        return -1.0 * self + other

    def __truediv__(self, other: Series | float) -> Series:
        return self * (1 / other)

    def __rtruediv__(self, other: float) -> Series:
        lead = next(i for i, x in enumerate(self.terms) if x)  # the series begins with s^(lead - 1)
        if lead not in (1, 2):
            raise ValueError("only a series that begins with 1 or s has a reciprocal with at most a simple pole")
        d = (*self.terms[lead:], *[0.0] * lead)
        out: list[float] = []
        for k in range(_TERMS):
            out.append(((other if k == 0 else 0.0) - sum(d[j] * out[k - j] for j in range(1, k + 1))) / d[0])
        return Series(tuple([0.0] * (2 - lead) + out)[:_TERMS])

    __radd__ = __add__
    __rmul__ = __mul__


def _series(x: Series | float) -> Series:
    return x if isinstance(x, Series) else Series((0.0, float(x), *[0.0] * (_TERMS - 2)))


def one_minus_delay(h: float) -> Series:
    """Return ``1 - exp(-h s)``, one scan of `h` [s]."""
    return Series((0.0, 0.0, *(-((-h) ** n) / math.factorial(n) for n in range(1, _TERMS - 1))))


def hold(h: float) -> Series:
    """Return ``(1 - exp(-h s))/(h s)``: an output that is held for a scan of `h` [s]."""
    return Series((0.0, *((-h) ** n / math.factorial(n + 1) for n in range(_TERMS - 1))))
