"""Numbers without rounding: fractions, and ``a + b sqrt(d)`` with fractions a and b.

A proof that two laws are the same (specs/equations.md, section 9) computes with these. Dials are decimals, unit conversions are
fractions, and the only roots are those of one quadratic, the factors of a series form; so every number of one proof lies in
Q(sqrt d) for one whole number d. A rounded number cannot get in: an operation with a float works only where its decimal text and
its binary value are the same number, such as 0.5 or 2.0, and raises `InexactError` otherwise.
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import lru_cache, total_ordering
from typing import Any, Final

_DIGITS: Final = 15
"""Significant digits up to which a float is the decimal that was typed: every such decimal has a float of its own."""
_SIMPLE: Final = 10**10
"""A fraction whose numerator times denominator is below this is no coincidence: about one double in a million is as near to one."""
_LONG: Final = 10**12
"""Whole numbers from here on are not printed as fractions."""
_SHORT: Final = 1000
"""A fraction of numbers below this is printed as such even where it ends as a decimal."""
_SHOWN: Final = 20
"""Significant digits of numbers that are too long to print as fractions."""
_ROOT_DIGITS: Final = 60
"""Decimal digits of a root where its size is needed."""


class InexactError(ArithmeticError):
    """A number is not known exactly: rounded, infinite, or of two different square roots."""


@total_ordering
class Exact:
    """A number ``a + b sqrt(d)`` without rounding.

    Parameters
    ----------
    a, b : Fraction, int or str
        The two coefficients.
    d : int
        What the root is taken of: positive and not a square; 0 where `b` is 0.

    Examples
    --------
    >>> root = sqrt(Fraction(5))
    >>> (3 + root) / 2 * ((3 - root) / 2)
    Exact(1)
    >>> print((3 + root) / 2)
    (3 + sqrt(5))/2
    """

    __slots__ = ("d", "p", "q", "r")  # the number is (p + r sqrt(d))/q, in lowest terms

    def __init__(self, a: Fraction | int | str, b: Fraction | int | str = 0, d: int = 0) -> None:
        x, y = Fraction(a), Fraction(b)
        self.q = math.lcm(x.denominator, y.denominator)
        self.p, self.r = x.numerator * (self.q // x.denominator), y.numerator * (self.q // y.denominator)
        self.d = d if self.r else 0

    @property
    def a(self) -> Fraction:
        """The rational part."""
        return Fraction(self.p, self.q)

    @property
    def b(self) -> Fraction:
        """What the root is multiplied by."""
        return Fraction(self.r, self.q)

    def _root_with(self, o: Exact) -> int:
        """Return what the root of both numbers is taken of."""
        if self.d and o.d and self.d != o.d:
            raise InexactError(f"sqrt({self.d}) and sqrt({o.d}) have no common field of two dimensions")
        return self.d or o.d

    def __add__(self, other: object) -> Exact:
        if not isinstance(other, _NUMBERS):
            return NotImplemented
        o = other if type(other) is Exact else exact(other)
        d = self._root_with(o)
        return _made(self.p * o.q + o.p * self.q, self.r * o.q + o.r * self.q, self.q * o.q, d)

    def __neg__(self) -> Exact:
        return _made(-self.p, -self.r, self.q, self.d)

    def __sub__(self, other: object) -> Exact:
        return self + -exact(other) if isinstance(other, _NUMBERS) else NotImplemented

    def __rsub__(self, other: Fraction | float) -> Exact:
        return -self + exact(other)

    def __mul__(self, other: object) -> Exact:
        if not isinstance(other, _NUMBERS):
            return NotImplemented
        o = other if type(other) is Exact else exact(other)
        d = self._root_with(o)
        return _made(self.p * o.p + self.r * o.r * d, self.p * o.r + self.r * o.p, self.q * o.q, d)

    def __truediv__(self, other: object) -> Exact:
        if not isinstance(other, _NUMBERS):
            return NotImplemented
        o = other if type(other) is Exact else exact(other)
        d = self._root_with(o)
        norm = o.p * o.p - o.r * o.r * d  # 0 for 0 only, as d is not a square
        if not norm:
            raise ZeroDivisionError(f"{self} divided by zero")
        return self * _made(o.q * o.p, -o.q * o.r, norm, d)

    def __rtruediv__(self, other: Fraction | float) -> Exact:
        return exact(other) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def __eq__(self, other: object) -> bool:
        if isinstance(other, float) and not math.isfinite(other):
            return False
        if not isinstance(other, _NUMBERS):
            return NotImplemented
        o = exact(other)
        return (self.p, self.r, self.q, self.d) == (o.p, o.r, o.q, o.d)

    def __lt__(self, other: object) -> bool:
        if isinstance(other, float) and math.isinf(other):
            return other > 0
        return (self - other).sign < 0

    def __hash__(self) -> int:
        return hash((self.p, self.r, self.q, self.d)) if self.r else hash(self.a)

    def __bool__(self) -> bool:
        return bool(self.p or self.r)

    def __abs__(self) -> Exact:
        return -self if self.sign < 0 else self

    @property
    def sign(self) -> int:
        """-1, 0 or 1."""
        a, b = _sign(self.p), _sign(self.r)
        return (a or b) if a * b >= 0 else a * _sign(self.p * self.p - self.r * self.r * self.d)

    @property
    def near(self) -> Fraction:
        """A fraction that agrees to dozens of digits."""
        return self.a + self.b * _root(self.d) if self.r else self.a

    def __float__(self) -> float:
        return float(self.near)

    def __format__(self, spec: str) -> str:
        return format(float(self), spec) if spec else str(self)

    def __repr__(self) -> str:
        return f"Exact({self.a})" if not self.r else f"Exact({self.a}, {self.b}, {self.d})"

    def __str__(self) -> str:
        """The number as written by hand: a fraction, or a decimal where that is shorter; dots stand for digits left out."""
        p, r, q = self.p, self.r, self.q
        if max(abs(p), abs(r), q, self.d) >= _LONG:
            return _decimal(self.near)
        if not r:
            short = q == 1 or max(abs(p), q) < _SHORT or "..." in (decimal := _decimal(self.a))
            return str(self.a) if short else decimal
        root = f"sqrt({self.d})" if abs(r) == 1 else f"{abs(r)} sqrt({self.d})"
        top = ("-" if r < 0 else "") + root if not p else f"{p} {'-' if r < 0 else '+'} {root}"
        return top if q == 1 else f"({top})/{q}" if p else f"{top}/{q}"


_NUMBERS: Final = (Exact, Fraction, int, float)


def _made(p: int, r: int, q: int, d: int) -> Exact:
    """Return ``(p + r sqrt(d))/q`` in lowest terms."""
    common = math.gcd(p, r, q)
    if q < 0:
        common = -common
    x = object.__new__(Exact)
    x.p, x.r, x.q = p // common, r // common, q // common
    x.d = d if r else 0
    return x


_SMALL: Final = {float(n): _made(n, 0, 1, 0) for n in (-1, 0, 1, 2)}
"""Whole numbers that equations are written with."""


@lru_cache(maxsize=32)
def _root(d: int) -> Fraction:
    """Return a square root to dozens of digits."""
    scale: int = 10**_ROOT_DIGITS
    return Fraction(math.isqrt(d * scale * scale), scale)


def _sign(x: int) -> int:
    return (x > 0) - (x < 0)


def _decimal(x: Fraction) -> str:
    """Return a decimal: all of it where it ends within the digits shown, otherwise its beginning and dots."""
    with localcontext() as context:
        context.prec = _SHOWN
        value = Decimal(x.numerator) / Decimal(x.denominator)
    text = f"{value:f}" if -7 < value.adjusted() < _SHOWN else str(value)
    return text if Fraction(value) == x else f"{text}..."


def exact(x: Any) -> Exact:
    """Return a number that is known exactly as it stands.

    Raises
    ------
    InexactError
        A float that is the rounding of something: its decimal text is not its binary value, or it is infinite.
    """
    if isinstance(x, Exact):
        return x
    if isinstance(x, float):
        if x.is_integer():
            return _SMALL.get(x) or _made(int(x), 0, 1, 0)
        if math.isfinite(x) and Fraction(x) == Fraction(repr(float(x))):
            return Exact(Fraction(x))
    elif isinstance(x, Fraction | int):
        return Exact(x)
    raise InexactError(f"{x!r} is not known exactly")


@lru_cache(maxsize=4096)
def as_typed(x: float) -> Exact:
    """Return the number that a float stands for: the decimal that was typed, or the simple fraction that it was computed as.

    Parameters
    ----------
    x : float
        A dial, a constant of a card.

    Raises
    ------
    InexactError
        It is infinite or not a number.

    Examples
    --------
    >>> as_typed(0.1), as_typed(20 / 60), as_typed(133 / 36)
    (Exact(1/10), Exact(1/3), Exact(133/36))
    """
    if not math.isfinite(x):
        raise InexactError(f"{x!r} is not known exactly")
    typed = Fraction(repr(float(x)))
    if len(Decimal(repr(float(x))).as_tuple().digits) <= _DIGITS or not x:
        return Exact(typed)
    most = max(1, math.isqrt(int(_SIMPLE / min(abs(typed), Fraction(_SIMPLE)))))
    simple = typed.limit_denominator(most)
    small = abs(simple.numerator) * simple.denominator < _SIMPLE
    return Exact(simple if small and float(simple) == x else typed)


def sqrt(x: Fraction) -> Exact:
    """Return the square root of a fraction that is not negative.

    Raises
    ------
    ValueError
        It is negative.
    """
    if x < 0:
        raise ValueError(f"{x} is negative")
    whole, bottom = x.numerator * x.denominator, Fraction(1, x.denominator)
    for prime in _PRIMES:
        while whole and whole % (prime * prime) == 0:
            whole, bottom = whole // (prime * prime), bottom * prime
    root = math.isqrt(whole)
    return Exact(root * bottom) if root * root == whole else Exact(0, bottom, whole)


_PRIMES: Final = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97)
