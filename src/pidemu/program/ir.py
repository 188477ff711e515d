"""The scan program: named inputs, coefficients and states, and a straight list of assignments.

Every back end prints or runs this same list, so all give the same bits. There are no branches: a choice is a `Select`, of which
both sides are numbers. Truth values are numbers too where they are kept in a state (0.0 or 1.0).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal, NamedTuple

Operator = Literal["+", "-", "*", "/", "<", ">", "<=", ">=", "==", "!=", "and", "or"]


class StateRole(StrEnum):
    """States that others than the blocks of a program ask for, by what they are for; the value is the state's name in programs."""

    INTEGRAL = "I"
    OUTPUT = "u"
    OWN_OUTPUT = "own"  # as the algorithm knows it, where the real one is stepped or not used
    MODE = "on"  # whether the last scan was automatic
    BEGUN = "begun"  # whether there has been a scan
    INNER_SUM = "inner"  # the last sum without the derivative
    COUNTS = "M"  # the output sum of integer arithmetic
    INTEGRAL_REMAINDER = "Ir"
    DERIVATIVE_REMAINDER = "Dr"


DERIVATIVE_STATES: Final = ("x1", "x2", "x3", "D")
"""Names of the states that the derivative may have: its signal one, two and three scans ago, and the filtered term."""


class Expr:
    """A value computed within one scan; operators build larger ones. Expressions are equal where they are written alike."""

    __slots__ = ()

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


@dataclass(frozen=True, slots=True)
class Number(Expr):
    """A constant of the program text."""

    value: float


@dataclass(frozen=True, slots=True)
class Name(Expr):
    """An input, a coefficient, a state or an earlier assignment."""

    id: str


@dataclass(frozen=True, slots=True)
class Binary(Expr):
    """Two operands."""

    operator: Operator
    left: Expr
    right: Expr


@dataclass(frozen=True, slots=True)
class Select(Expr):
    """``yes`` where ``condition`` holds, else ``no``."""

    condition: Expr
    yes: Expr
    no: Expr


@dataclass(frozen=True, slots=True)
class Floor(Expr):
    """The largest whole number that is not above the operand."""

    operand: Expr


Precision = Literal["float64", "float32"]


@dataclass(frozen=True, slots=True)
class Cast(Expr):
    """The operand rounded to a precision, or a number of the program text in that precision."""

    operand: Expr
    precision: Precision


Operand = Expr | float | int


def expr(x: Operand) -> Expr:
    """Return a number as an expression."""
    return x if isinstance(x, Expr) else Number(float(x))


def select(condition: Expr, yes: Operand, no: Operand) -> Expr:
    """Return ``yes`` where ``condition`` holds, else ``no``."""
    return Select(condition, expr(yes), expr(no))


def equal(left: Operand, right: Operand) -> Expr:
    """Return whether two values are equal (``==`` tells whether two expressions are written alike)."""
    return Binary("==", expr(left), expr(right))


def names_in(x: Expr) -> set[str]:
    """Return every name that an expression reads."""
    found: set[str] = set()
    left = [x]
    while left:
        match left.pop():
            case Name(id=name):
                found.add(name)
            case Select(condition=condition, yes=yes, no=no):
                left += (condition, yes, no)
            case Binary(left=one, right=other):
                left += (one, other)
            case Floor(operand=operand) | Cast(operand=operand):
                left.append(operand)
    return found


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
    unit : str
        Unit of the value.
    """

    name: str
    value: Expr
    text: str
    unit: str = "%"


@dataclass(frozen=True, slots=True)
class Line:
    """A delay line: under its name a scan reads what another name held at the end of an earlier scan, and 0 before that.

    Attributes
    ----------
    name : str
        Its name in the program; it is only read.
    text : str
        What it is.
    unit : str
        Its unit.
    source : str
        The name whose value enters the line at the end of every scan.
    """

    name: str
    text: str
    unit: str
    source: str


class Structure(NamedTuple):
    """What programs have in common that differ in numbers only: they share compiled code."""

    inputs: tuple[str, ...]
    coefficients: tuple[str, ...]
    states: tuple[str, ...]
    lines: tuple[tuple[str, str], ...]
    body: tuple[tuple[str, Expr], ...]
    recorded: tuple[str, ...]
    precision: Precision
    wide_literals: bool
    wide: frozenset[str]

    def bare(self) -> Program:
        """Return a program of this structure without texts, its numbers all zero."""
        return Program(
            title="",
            inputs=_bare(self.inputs),
            coefficients=_bare(self.coefficients),
            values=(0.0,) * len(self.coefficients),
            states=_bare(self.states),
            initial=(0.0,) * len(self.states),
            body=tuple(Assign(name, value, "") for name, value in self.body),
            output=self.recorded[0],
            precision=self.precision,
            wide_literals=self.wide_literals,
            wide=self.wide,
            lines=tuple(Line(name, "", "", source) for name, source in self.lines),
            lengths=(1,) * len(self.lines),
            also=self.recorded[1:],
        )


def _bare(names: tuple[str, ...]) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, "", "") for name in names)


@dataclass(frozen=True, slots=True)
class Program:
    """What one controller, or one closed loop, does in one scan.

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
    wide : frozenset of str
        With float32: names that are float64 all the same, those of the process in a closed loop.
    lines : tuple of Line
        Delay lines.
    lengths : tuple of int
        How many scans each of them delays by, at least 1.
    also : tuple of str
        Names that a run records besides the output.
    """

    title: str
    inputs: tuple[Quantity, ...]
    coefficients: tuple[Quantity, ...]
    values: tuple[float, ...]
    states: tuple[Quantity, ...]
    initial: tuple[float, ...]
    body: tuple[Assign, ...]
    output: str = "u"
    precision: Precision = "float64"
    wide_literals: bool = False
    wide: frozenset[str] = frozenset()
    lines: tuple[Line, ...] = ()
    lengths: tuple[int, ...] = ()
    also: tuple[str, ...] = ()

    @property
    def recorded(self) -> tuple[str, ...]:
        """The names whose values a run returns for every scan, the output first."""
        return (self.output, *self.also)

    @property
    def structure(self) -> Structure:
        """What the program shares with others that differ in their numbers only."""
        return Structure(
            tuple(q.name for q in self.inputs),
            tuple(q.name for q in self.coefficients),
            tuple(q.name for q in self.states),
            tuple((line.name, line.source) for line in self.lines),
            tuple((assign.name, assign.value) for assign in self.body),
            self.recorded,
            self.precision,
            self.wide_literals,
            self.wide,
        )

    def is_wide(self, name: str) -> bool:
        """Tell whether a name holds a float64 number."""
        return self.precision == "float64" or name in self.wide
