"""The scan program: named inputs, coefficients and states, and a straight list of assignments.

Every back end prints or runs this same list, so all give the same bits. There are no branches: a choice is a `Select`, of which
both sides are numbers. Truth values are numbers too where they are kept in a state (0.0 or 1.0).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

Operator = Literal["+", "-", "*", "/", "<", ">", "<=", ">=", "==", "!=", "and", "or"]


class Expr:
    """A value computed within one scan; operators build larger ones."""

    __slots__ = ()
    __hash__ = object.__hash__

    def __add__(self, other: Operand) -> Expr:
        return Binary("+", self, expr(other))

    def __radd__(self, other: Operand) -> Expr:
        return Binary("+", expr(other), self)

    def __sub__(self, other: Operand) -> Expr:
        return Binary("-", self, expr(other))

    def __rsub__(self, other: Operand) -> Expr:
        return Binary("-", expr(other), self)

    def __mul__(self, other: Operand) -> Expr:
        return Binary("*", self, expr(other))

    def __rmul__(self, other: Operand) -> Expr:
        return Binary("*", expr(other), self)

    def __truediv__(self, other: Operand) -> Expr:
        return Binary("/", self, expr(other))

    def __lt__(self, other: Operand) -> Expr:
        return Binary("<", self, expr(other))

    def __gt__(self, other: Operand) -> Expr:
        return Binary(">", self, expr(other))

    def __le__(self, other: Operand) -> Expr:
        return Binary("<=", self, expr(other))

    def __ge__(self, other: Operand) -> Expr:
        return Binary(">=", self, expr(other))

    def __and__(self, other: Expr) -> Expr:
        return Binary("and", self, other)

    def __or__(self, other: Expr) -> Expr:
        return Binary("or", self, other)


@dataclass(frozen=True, slots=True, eq=False)
class Number(Expr):
    """A constant of the program text."""

    value: float


@dataclass(frozen=True, slots=True, eq=False)
class Name(Expr):
    """An input, a coefficient, a state or an earlier assignment."""

    id: str


@dataclass(frozen=True, slots=True, eq=False)
class Binary(Expr):
    """Two operands."""

    operator: Operator
    left: Expr
    right: Expr


@dataclass(frozen=True, slots=True, eq=False)
class Select(Expr):
    """``yes`` where ``condition`` holds, else ``no``."""

    condition: Expr
    yes: Expr
    no: Expr


@dataclass(frozen=True, slots=True, eq=False)
class Floor(Expr):
    """The largest whole number that is not above the operand."""

    operand: Expr


Operand = Expr | float | int


def expr(x: Operand) -> Expr:
    """Return a number as an expression."""
    return x if isinstance(x, Expr) else Number(float(x))


def select(condition: Expr, yes: Operand, no: Operand) -> Expr:
    """Return ``yes`` where ``condition`` holds, else ``no``."""
    return Select(condition, expr(yes), expr(no))


def equal(left: Operand, right: Operand) -> Expr:
    """Return whether two values are equal (``==`` compares the expressions themselves)."""
    return Binary("==", expr(left), expr(right))


def names_in(x: Expr) -> Iterator[str]:
    """Yield every name that an expression reads."""
    match x:
        case Name(id=name):
            yield name
        case Select(condition=condition, yes=yes, no=no):
            for part in (condition, yes, no):
                yield from names_in(part)
        case Binary(left=left, right=right):
            yield from names_in(left)
            yield from names_in(right)
        case Floor(operand=operand):
            yield from names_in(operand)


def has_literal(x: Expr) -> bool:
    """Tell whether an arithmetic operation of an expression has a number of the program text as operand."""
    match x:
        case Select(condition=condition, yes=yes, no=no):
            return any(has_literal(part) for part in (condition, yes, no))
        case Binary(operator="+" | "-" | "*" | "/", left=left, right=right):
            return isinstance(left, Number) or isinstance(right, Number) or has_literal(left) or has_literal(right)
        case Binary(left=left, right=right):
            return has_literal(left) or has_literal(right)
        case Floor(operand=operand):
            return has_literal(operand)
    return False


@dataclass(frozen=True, slots=True)
class Quantity:
    """An input, a coefficient or a state.

    Attributes
    ----------
    name : str
        Its name in the program.
    text : str
        What it is.
    unit : str
        Its unit.
    """

    name: str
    text: str
    unit: str


@dataclass(frozen=True, slots=True)
class Assign:
    """One assignment, to a local name or to a state.

    Attributes
    ----------
    name : str
        What is assigned.
    value : Expr
        To what.
    text : str
        The block it belongs to, with its section of specs/equations.md.
    """

    name: str
    value: Expr
    text: str


@dataclass(frozen=True, slots=True)
class Program:
    """What one controller does in one scan.

    Attributes
    ----------
    title : str
        Which controller.
    inputs : tuple of Quantity
        Signals read each scan, in order: ``sp, pv, auto, manual``, then those asked for. ``manual`` is NaN where the operator has
        set nothing; so are ``cascade`` (remote setpoint), ``track`` (output to follow) and ``reset`` (external reset) where there
        is none.
    coefficients : tuple of Quantity
        Numbers fixed by settings and scan interval.
    values : tuple of float
        The coefficients' values.
    states : tuple of Quantity
        What is kept from scan to scan.
    initial : tuple of float
        The states' values before the first scan.
    body : tuple of Assign
        The assignments, in order.
    output : str
        The name that holds the output when the scan ends.
    precision : {"float64", "float32"}
        What every operation is rounded to.
    wide_literals : bool
        With float32: numbers of the program text are float64, and so is what is computed with them until it is assigned.
    """

    title: str
    inputs: tuple[Quantity, ...]
    coefficients: tuple[Quantity, ...]
    values: tuple[float, ...]
    states: tuple[Quantity, ...]
    initial: tuple[float, ...]
    body: tuple[Assign, ...]
    output: str = "u"
    precision: Literal["float64", "float32"] = "float64"
    wide_literals: bool = False
