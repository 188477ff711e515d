"""Laws without rounding: quotients of polynomials in ``s`` with exact coefficients (specs/equations.md, section 2)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Final, Literal, TypeVar, cast

from pidemu.algorithm.model import Algorithm
from pidemu.algorithm.resolve import Reader, algorithm_as_read
from pidemu.card.model.card_file import default_scan
from pidemu.card.model.signals import SignalFilter
from pidemu.law import law as laws
from pidemu.law.exact import Exact, as_typed, exact
from pidemu.law.rational import Rational, add, multiply
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings
from pidemu.units import Spans, parse_unit, to_canonical, to_canonical_exactly

Polynomial = tuple[Exact, ...]
PathName = Literal["feedback", "setpoint", "setpoint in cascade"]
X = TypeVar("X", Exact, float)
_ZERO: Final = Exact(0)


def trimmed(coefficients: Sequence[Any]) -> Polynomial:
    """Return a polynomial of exact numbers without leading zeros; ``(0,)`` where it is zero."""
    found = [exact(x) for x in coefficients]
    while len(found) > 1 and not found[-1]:
        found.pop()
    return tuple(found) or (_ZERO,)


def divide(num: Polynomial, den: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Return quotient and remainder of two polynomials."""
    rest = list(num)
    quotient = [_ZERO] * max(1, len(num) - len(den) + 1)
    for k in range(len(num) - len(den), -1, -1):
        quotient[k] = rest[k + len(den) - 1] / den[-1]
        for i, x in enumerate(den):
            rest[k + i] = rest[k + i] - quotient[k] * x
    return trimmed(quotient), trimmed(rest[: len(den) - 1])


@dataclass(frozen=True, slots=True)
class ExactLaw:
    """One path of a controller, as a quotient of polynomials without a common factor.

    Attributes
    ----------
    num, den : tuple of Exact
        Coefficients in rising powers of ``s``; the lowest of the denominator is 1.
    """

    num: Polynomial
    den: Polynomial

    @classmethod
    def of(cls, num: Sequence[Any], den: Sequence[Any]) -> ExactLaw:
        """Return a quotient in lowest terms."""
        top, bottom = trimmed(num), trimmed(den)
        a, b = bottom, top
        while any(b):  # Euclid's algorithm
            a, b = b, divide(a, b)[1]
        top, bottom = divide(top, a)[0], divide(bottom, a)[0]
        lowest = next(x for x in bottom if x)
        return cls(tuple(x / lowest for x in top), tuple(x / lowest for x in bottom))

    def times(self, num: Sequence[Any], den: Sequence[Any] = (1,)) -> ExactLaw:
        """Return the law multiplied by a quotient of polynomials."""
        return ExactLaw.of(multiply(self.num, trimmed(num)), multiply(self.den, trimmed(den)))

    def __call__(self, s: int) -> Exact:
        """Return the value at a whole number above zero."""
        top, bottom = (sum((x * s**k for k, x in enumerate(p)), _ZERO) for p in (self.num, self.den))
        return top / bottom

    def equals(self, other: ExactLaw) -> bool:
        """Whether both are the same function: the cross products agree term by term, as both are in lowest terms."""
        return self.num == other.num and self.den == other.den

    def __str__(self) -> str:
        """The quotient as written by hand, such as ``(2/15 + 14/5 s + 12 s^2)/(s (1 + 3/4 s))``."""
        lowest = next(k for k, x in enumerate(self.den) if x)
        factors = [power_text(lowest)] if lowest else []
        if len(self.den) > lowest + 1:
            factors.append(f"({polynomial_text(self.den[lowest:])})")
        if not factors:
            return polynomial_text(self.num)
        bottom = factors[0] if len(factors) == 1 else f"({' '.join(factors)})"
        top = polynomial_text(self.num)
        return f"({top})/{bottom}" if " " in top or "/" in top else f"{top}/{bottom}"


def power_text(k: int) -> str:
    """Return a power of ``s`` as written by hand."""
    return "" if k == 0 else "s" if k == 1 else f"s^{k}"


def polynomial_text(p: Sequence[Exact]) -> str:
    """Return a polynomial as written by hand, such as ``2/15 + 14/5 s + 12 s^2``."""
    text = ""
    for k, x in enumerate(p):
        if not x:
            continue
        size, name = abs(x), power_text(k)
        number = "" if size == 1 and name else str(size)
        term = " ".join(part for part in (f"({number})" if name and " " in number and number[0] != "(" else number, name) if part)
        text += f" {'-' if x < 0 else '+'} {term}" if text else f"{'-' if x < 0 else ''}{term}"
    return text or "0"


@dataclass(frozen=True)
class ExactReader(Reader[Exact]):
    """Reads a card's dials and numbers without rounding.

    Attributes
    ----------
    dials : mapping
        Exact values of dials [the dial's unit], by name, in place of those of the settings.
    """

    dials: Mapping[str, Exact] = field(default_factory=dict)

    def dial(self, name: str) -> Exact:
        """Return a dial's value [the dial's unit]."""
        return self.dials[name] if name in self.dials else as_typed(self.settings[name].value)

    def value(self, name: str) -> Any:
        """Return a dial's canonical value; 0 where it is off."""
        value = self.settings[name]
        if name not in self.dials:
            if value.off:
                return _ZERO
            if math.isinf(value.value):
                return to_canonical(value.role, value.value, parse_unit(value.unit))
        return to_canonical_exactly(value.role, self.dial(name), parse_unit(value.unit), self.spans)

    def number(self, x: float) -> Any:
        """Return a constant of the card; its decimal text is what the card says."""
        return x if math.isinf(x) else as_typed(x)

    @property
    def span_ratio(self) -> Any:
        """Percent gain that one output unit per measurement unit amounts to [%/%]."""
        return exact(self.spans.ratio)


def exact_spans(settings: Settings) -> Spans:
    """Return signal spans as the ranges were typed; 100 where no range was given."""

    def span(given: SignalRange | None) -> Fraction:
        return Fraction(100) if given is None else as_typed(given.high).a - as_typed(given.low).a

    scan = as_typed(default_scan(settings.equation) if settings.scan is None else settings.scan).a
    spans = cast(tuple[float, float, float], (span(settings.pv_range), span(settings.op_range), scan))
    return Spans(*spans, settings.spans.degree)


def exact_algorithm(settings: Settings, dials: Mapping[str, Exact] | None = None) -> Algorithm[Exact]:
    """Return the algorithm with exact numbers in the law's part.

    Parameters
    ----------
    settings : Settings
        The settings.
    dials : mapping, optional
        Exact values that take the place of some dials [the dial's unit], by name.

    Raises
    ------
    InexactError
        A number is not known exactly.
    """
    read = algorithm_as_read(ExactReader(settings, exact_spans(settings), dials=dials or {}), settings.scan)
    if settings.pace != 1:
        read = read.paced(as_typed(settings.pace))
    if settings.lag and read.measurement.filter is None:
        read = read.filtered(SignalFilter(time=as_typed(settings.lag)))
    return read


def in_mode(a: Algorithm[Exact], path: PathName) -> Algorithm[Exact]:
    """Return the algorithm with the setpoint weight of the mode that a path is of."""
    return a.in_cascade if path == "setpoint in cascade" else a


def exact_paths(a: Algorithm[Exact], names: Sequence[PathName], factor: Exact | int = 1) -> dict[PathName, ExactLaw]:
    """Return paths of the continuous law of an algorithm with exact numbers, by name.

    Parameters
    ----------
    a : Algorithm
        The algorithm.
    names : sequence of {"feedback", "setpoint", "setpoint in cascade"}
        Which paths.
    factor : Exact or int
        What they are multiplied by.

    Raises
    ------
    InexactError
        A number is not known exactly.
    UndefinedError
        There is no continuous law.
    """
    made = _quotients(a, names)
    return {name: ExactLaw.of([x * factor for x in trimmed(path.num)], path.den) for name, path in made.items()}


def _quotients(a: Algorithm[Any], names: Sequence[PathName]) -> dict[PathName, Rational]:
    """Return paths as their terms make them, not in lowest terms."""
    feedback, setpoint = laws.paths(a, laws.CONTINUOUS)
    found: dict[PathName, Rational] = {"feedback": feedback, "setpoint": setpoint, "setpoint in cascade": setpoint}
    if a.cascade_b is not None and "setpoint in cascade" in names:
        found["setpoint in cascade"] = laws.paths(a.in_cascade, laws.CONTINUOUS)[1]
    return {name: found[name] for name in names}


def difference(source: Algorithm[Exact], target: Algorithm[Exact], name: PathName, factor: Exact) -> float:
    """Return the largest difference of the coefficients of the cross products of two paths.

    Each is relative to the sum of the sizes of everything that the coefficient is the sum of, so that rounded numbers that cancel
    make no more of a difference than rounded numbers that do not.

    Parameters
    ----------
    source, target : Algorithm
        Two algorithms with exact numbers.
    name : {"feedback", "setpoint", "setpoint in cascade"}
        Which path.
    factor : Exact
        What the source is multiplied by.
    """
    left, right = _cross_products(source, target, name, factor)
    sizes = _cross_products(_sizes(source), _sizes(target), name, abs(float(factor)))
    largest = 0.0
    for k, x in enumerate(add(left, [-y for y in right])):
        size = max((float(part[k]) for part in sizes if k < len(part)), default=0.0)
        largest = max(largest, abs(float(exact(x))) / size if size else 0.0)
    return largest


def _cross_products(source: Algorithm[X], target: Algorithm[X], name: PathName, factor: X) -> tuple[Sequence[X], Sequence[X]]:
    """Return numerator times the other's denominator, of the source multiplied by a factor and of the target."""
    a, b = (_quotients(x, (name,))[name] for x in (source, target))
    return multiply([x * factor for x in a.num], b.den), multiply(b.num, a.den)


def _sizes(a: Algorithm[Exact]) -> Algorithm[float]:
    """Return an algorithm whose law is the sum of the sizes of all terms."""
    ki, kd, c, Tf = (abs(float(x)) for x in (a.ki, a.kd, a.c, a.Tf))
    found = cast(Algorithm[float], replace(a, kp=abs(float(a.kp)), ki=ki, kd=kd, c=c, Tf=Tf))  # type: ignore[arg-type]
    parts = {name: replace(part, filter=_sized(part.filter)) for name, part in _filtered(found).items()}
    cascade = None if a.cascade_b is None else _size_of_weight(a, a.cascade_b)
    return replace(found, b=_size_of_weight(a, a.b), cascade_b=cascade, **parts)


def _filtered(a: Algorithm[float]) -> dict[str, Any]:
    """Return the parts whose signals may be filtered, by name."""
    return {"setpoint": a.setpoint, "measurement": a.measurement, "error": a.error}


def _sized(lag: SignalFilter[Any] | None) -> SignalFilter[float] | None:
    return None if lag is None else SignalFilter(time=float(lag.seconds))


def _size_of_weight(a: Algorithm[Exact], b: Any) -> float:
    """Return the size of a weight; the series form takes P on the error, and adds what b is beyond 1."""
    return 1 + abs(float(b) - 1) if a.series and a.c else abs(float(b))
