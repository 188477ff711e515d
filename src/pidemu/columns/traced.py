"""Numbers that record what is computed from them, so that the same can be computed for many others at once.

`pidemu` computes with one loop's numbers at a time, and decides by them: no derivative, no filter, a dead time of so many scans. A
thousand loops of one kind take the same decisions. So one of them is computed with `Traced` numbers, which write each operation on
a `Tape`, and each decision as a guard. `pidemu.columns.replay` does what is on the tape with columns, and says for which loops the
guards hold; the others are of another structure.

A traced number is no `float`, on purpose: a function that does not know it, as those of `math` do, refuses it instead of computing
with a number whose origin is lost. Those of `pidemu.columns.functions` know both.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Final

_COMPARE: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip
_COMPUTE: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "//": operator.floordiv,
}  # fmt: skip

Step = tuple[Any, tuple[int, ...]]
"""An operation and the places of its operands on the tape. The operation is a sign, a word, or what `Each` and `Whole` hold."""
Guard = tuple[str, int, int, bool]
"""A comparison, the places of its operands, and how it came out."""


class NotTracedError(Exception):
    """A traced number was taken for a plain one: its origin would be lost. No code on its way expects this error."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A number that is the same for all loops."""

    value: Any


@dataclass(frozen=True, slots=True)
class Each:
    """A function of plain numbers, which is called for one loop after the other."""

    function: Callable[..., float]


@dataclass(frozen=True, slots=True)
class Whole:
    """A function of columns, shape (loops,) each.

    It returns its results, shape (loops, results), and for which loops they count.
    """

    function: Callable[..., tuple[Any, Any]]


@dataclass(slots=True)
class Tape:
    """What was computed, step by step; the inputs come first.

    Attributes
    ----------
    steps : list of Step
        The operations.
    guards : list of Guard
        The decisions.
    """

    steps: list[Step] = field(default_factory=list)
    guards: list[Guard] = field(default_factory=list)
    _places: dict[Any, int] = field(default_factory=dict)

    def number(self, value: float) -> Traced:
        """Return a number that differs from loop to loop: the next input."""
        self.steps.append(("input", ()))
        return Traced(value, self, len(self.steps) - 1)

    def note(self, operation: Any, operands: Sequence[Any], value: Any) -> Traced:
        """Return the result of an operation."""
        return Traced(value, self, self._place(operation, tuple(self._of(x) for x in operands)))

    def decide(self, comparison: str, one: Any, other: Any) -> bool:
        """Return how two numbers compare; loops with which it comes out otherwise are of another structure."""
        outcome = bool(_COMPARE[comparison](value_of(one), value_of(other)))
        guard = (comparison, self._of(one), self._of(other), outcome)
        if guard not in self._places:
            self._places[guard] = len(self.guards)
            self.guards.append(guard)
        return outcome

    def _place(self, operation: Any, operands: tuple[int, ...]) -> int:
        """Return where the result of an operation stands; it is computed once."""
        key = (operation, operands)
        found = self._places.get(key)
        if found is None:
            self.steps.append(key)
            found = self._places[key] = len(self.steps) - 1
        return found

    def _of(self, x: Any) -> int:
        """Return where a number stands."""
        if isinstance(x, Traced):
            if x.tape is not self:
                raise NotTracedError("two loops' numbers in one operation")
            return x.place
        key = ("constant", type(x), repr(x))  # 0.0 and -0.0 are equal, and two numbers
        found = self._places.get(key)
        if found is None:
            self.steps.append((Constant(x), ()))
            found = self._places[key] = len(self.steps) - 1
        return found


class Traced:
    """A number of one loop that records what is computed from it.

    Parameters
    ----------
    value : float
        The number.
    tape : Tape
        Where it is recorded.
    place : int
        Its place there.
    """

    __slots__ = ("place", "tape", "value")
    __array_ufunc__ = None
    """NumPy's numbers leave an operation with this one to it."""

    def __init__(self, value: Any, tape: Tape, place: int) -> None:
        self.value, self.tape, self.place = value, tape, place

    __hash__ = object.__hash__  # in a cache, the same number is found by what it is

    def __float__(self) -> float:
        raise NotTracedError("a traced number was made a plain one")

    def __bool__(self) -> bool:
        return self.tape.decide("!=", self, 0.0)

    def __index__(self) -> int:
        """Return a whole number that decides about the structure."""
        self.tape.decide("==", self, self.value)
        return int(self.value)

    def __format__(self, how: str) -> str:
        return format(self.value, how)

    def __repr__(self) -> str:
        return repr(self.value)

    @property
    def real(self) -> Traced:
        """Itself: it can stand for a root of a polynomial."""
        return self

    @property
    def imag(self) -> float:
        """Nothing."""
        return 0.0

    def _with(self, sign: str, one: Any, other: Any) -> Traced:
        if sign in ("/", "//") and isinstance(other, Traced) and not other:
            raise ZeroDivisionError("float division by zero")
        return self.tape.note(sign, (one, other), _COMPUTE[sign](value_of(one), value_of(other)))

    def __add__(self, other: Any) -> Traced:
        return self._with("+", self, other)

    def __radd__(self, other: Any) -> Traced:
        return self._with("+", other, self)

    def __sub__(self, other: Any) -> Traced:
        return self._with("-", self, other)

    def __rsub__(self, other: Any) -> Traced:
        return self._with("-", other, self)

    def __mul__(self, other: Any) -> Traced:
        return self._with("*", self, other)

    def __rmul__(self, other: Any) -> Traced:
        return self._with("*", other, self)

    def __truediv__(self, other: Any) -> Traced:
        return self._with("/", self, other)

    def __rtruediv__(self, other: Any) -> Traced:
        return self._with("/", other, self)

    def __floordiv__(self, other: Any) -> Traced:
        return self._with("//", self, other)

    def __neg__(self) -> Traced:
        return self.tape.note("negative", (self,), -self.value)

    def __abs__(self) -> Traced:
        return self.tape.note("absolute", (self,), abs(self.value))

    def __floor__(self) -> Traced:
        return self.tape.note("floor", (self,), math.floor(self.value))

    def __ceil__(self) -> Traced:
        return self.tape.note("ceil", (self,), math.ceil(self.value))

    def __round__(self) -> Traced:
        return self.tape.note("rint", (self,), round(self.value))

    def __lt__(self, other: Any) -> bool:
        return self.tape.decide("<", self, other)

    def __gt__(self, other: Any) -> bool:
        return self.tape.decide(">", self, other)

    def __le__(self, other: Any) -> bool:
        return self.tape.decide("<=", self, other)

    def __ge__(self, other: Any) -> bool:
        return self.tape.decide(">=", self, other)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Real) and self.tape.decide("==", self, other)

    def __ne__(self, other: object) -> bool:
        return not isinstance(other, Real) or self.tape.decide("!=", self, other)


Real.register(Traced)


@dataclass(frozen=True, slots=True, eq=False)
class TracedRoot:
    """One of a pair of complex roots of a polynomial.

    Attributes
    ----------
    real, imag : Traced
        Its parts.
    """

    real: Traced
    imag: Traced


def value_of(x: Any) -> Any:
    """Return the number of the loop that is computed."""
    return x.value if isinstance(x, Traced) else x
