"""Numbers, expressions and assignments as Structured Text: a choice is a statement, a flag says whether a signal is there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Final, Literal

import numpy as np

from pidemu.backends.structured_text_names import given_flag
from pidemu.backends.structured_text_numbers import TINY
from pidemu.program.ir import Assign, Binary, Cast, Expr, Floor, Name, Number, Precision, Program, Select

Dialect = Literal["iec", "scl", "rockwell"]
DIALECTS: Final[tuple[Dialect, ...]] = ("iec", "scl", "rockwell")
TYPES: Final[Mapping[Precision, str]] = {"float64": "LREAL", "float32": "REAL"}
_LARGEST: Final[Mapping[Precision, str]] = {"float64": "1.7976931348623157E308", "float32": "3.4028235E38"}
_PRECEDENCE: Final = {
    "or": 1, "and": 2, "==": 3, "!=": 3, "<": 4, ">": 4, "<=": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
}  # fmt: skip
_SYMBOL: Final = {"and": "AND", "or": "OR", "==": "=", "!=": "<>"}
_UNARY: Final = 7
_ATOM: Final = 9


def literal(value: float, precision: Precision) -> str:
    """Return a number as Structured Text, which knows no infinity: the largest number stands for it.

    Parameters
    ----------
    value : float
        The number; not NaN.
    precision : {"float64", "float32"}
        What it is a number in.
    """
    if precision == "float32":
        with np.errstate(over="ignore"):
            value = float(str(np.float32(value)))
    if math.isinf(value):
        return ("-" if value < 0 else "") + _LARGEST[precision]
    mantissa, _, exponent = repr(value).partition("e")
    whole = mantissa if "." in mantissa else f"{mantissa}.0"
    return f"{whole}E{int(exponent)}" if exponent else whole


def is_given(x: Expr, program: Program) -> tuple[str, bool] | None:
    """Return the input that an expression asks for, and whether for its being there: ``manual == manual`` is a question for NaN."""
    inputs = {q.name for q in program.inputs}
    match x:
        case Binary(operator="==" | "!=" as operator, left=Name(id=one), right=Name(id=other)) if one == other and one in inputs:
            return one, operator == "=="
    return None


def is_automatic(x: Expr) -> bool:
    """Tell whether an expression asks for the mode."""
    return x in (Binary(">", Name("auto"), Number(0.0)), Binary(">", Name("auto"), Cast(Number(0.0), "float32")))


def lifted(x: Expr) -> Expr:
    """Return an expression whose choices are outermost: what was computed with a choice is computed on both of its sides.

    Parameters
    ----------
    x : Expr
        Any expression; the result has the same bits.
    """
    match x:
        case Select(condition=condition, yes=yes, no=no):
            return _chosen(lifted(condition), lambda test: Select(test, lifted(yes), lifted(no)))
        case Cast(operand=operand, precision=precision):
            return _chosen(lifted(operand), lambda inner: Cast(inner, precision))
        case Floor(operand=operand):
            return _chosen(lifted(operand), Floor)
        case Binary(operator=operator, left=left, right=right):
            one, other = lifted(left), lifted(right)
            return _chosen(one, lambda a: _chosen(other, lambda b: Binary(operator, a, b)))
    return x


def _chosen(x: Expr, then: Callable[[Expr], Expr]) -> Expr:
    if isinstance(x, Select):
        return Select(x.condition, _chosen(x.yes, then), _chosen(x.no, then))
    return then(x)


class StatementWriter:
    """Prints assignments whose precisions are explicit (`pidemu.program.precision.explicit`).

    Parameters
    ----------
    program : Program
        The program.
    names : mapping
        Name in Structured Text by name of the program, with those that tell whether an input is there.
    dialect : {"iec", "scl", "rockwell"}
        For whom.
    """

    def __init__(self, program: Program, names: Mapping[str, str], dialect: Dialect) -> None:
        self._program = program
        self._names = names
        self._dialect = dialect

    def name(self, name: str) -> str:
        """Return a name as it stands in statements."""
        spelt = self._names[name]
        return f"#{spelt}" if self._dialect == "scl" else spelt

    def statements(self, assign: Assign, said: str) -> Iterator[str]:
        """Yield the lines that assign a value.

        Parameters
        ----------
        assign : Assign
            What is assigned; no `Floor` within an expression.
        said : str
            A comment, behind the first line.
        """
        for k, line in enumerate(self._choice(assign.name, lifted(assign.value))):
            yield f"{line:<55} (* {said} *)" if k == 0 and said else line

    def _choice(self, name: str, x: Expr) -> Iterator[str]:
        if not isinstance(x, Select):
            yield f"{self.name(name)} := {self.text(_without(x) if self._dialect == 'rockwell' else x)};"
            return
        if x.yes == Name(name):
            yield f"IF NOT {self._wrapped(x.condition, _UNARY)} THEN"
            yield from _indented(self._choice(name, x.no))
        else:
            yield f"IF {self.text(x.condition)} THEN"
            yield from _indented(self._choice(name, x.yes))
            rest = x.no
            while isinstance(rest, Select) and rest.yes != Name(name):
                yield f"ELSIF {self.text(rest.condition)} THEN"
                yield from _indented(self._choice(name, rest.yes))
                rest = rest.no
            if rest != Name(name):
                yield "ELSE"
                yield from _indented(self._choice(name, rest))
        yield "END_IF;"

    def text(self, x: Expr) -> str:
        """Return an expression without choices."""
        return self._render(x)[0]

    def _precision(self, x: Expr) -> Precision | None:
        """Return the precision that an expression is computed in; a number of the text has none of its own."""
        match x:
            case Name(id=name):
                return "float64" if self._program.is_wide(name) else "float32"
            case Cast(precision=precision):
                return precision
            case Binary(left=left, right=right):
                found = {self._precision(left), self._precision(right)} - {None}
                return "float64" if "float64" in found else "float32" if found else None
        return None

    def _render(self, x: Expr) -> tuple[str, int]:
        asked = is_given(x, self._program)
        if asked is not None:
            flag = self.name(given_flag(asked[0]))
            return (flag, _ATOM) if asked[1] else (f"NOT {flag}", _UNARY)
        if is_automatic(x):
            return self.name("auto"), _ATOM
        match x:
            case Number(value=value):
                return _number(value, "float64")
            case Name(id=name):
                return self.name(name), _ATOM
            case Cast(operand=Number(value=value), precision=precision):
                return _number(value, precision)
            case Cast(operand=operand, precision=precision):
                return self._converted(operand, precision), _ATOM
            case Binary(operator="-", left=Number(value=0.0), right=Name(id=name)) if name == TINY:
                return f"-{self.name(name)}", _UNARY
            case Binary():
                return self._binary(x)
        raise TypeError(f"no Structured Text for {type(x).__name__}")

    def _converted(self, x: Expr, precision: Precision) -> str:
        old = self._precision(x)
        if old in (None, precision) or self._dialect == "rockwell":
            return self._wrapped(x, _ATOM)
        return f"{TYPES[old]}_TO_{TYPES[precision]}({self.text(x)})" if old else self._wrapped(x, _ATOM)

    def _binary(self, x: Binary) -> tuple[str, int]:
        level = _PRECEDENCE[x.operator]
        left, right = x.left, x.right
        wide = "float64" in (self._precision(left), self._precision(right))
        if wide:  # the languages do not mix types of themselves
            left, right = (Cast(part, "float64") if self._precision(part) == "float32" else part for part in (left, right))
        if level <= _PRECEDENCE["and"]:  # dialects do not agree on what binds tighter
            same = [_is(part, x.operator) for part in (left, right)]
            one, other = (self._wrapped(part, level if alike else _UNARY) for part, alike in zip((left, right), same, strict=True))
        else:
            one, other = self._wrapped(left, level), self._wrapped(right, level + 1)
        return f"{one} {_SYMBOL.get(x.operator, x.operator)} {other}", level

    def _wrapped(self, x: Expr, least: int) -> str:
        text, level = self._render(x)
        return text if level >= least else f"({text})"


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"    {line}" for line in lines)


def _is(x: Expr, operator: str) -> bool:
    return isinstance(x, Binary) and x.operator == operator


def _without(x: Expr) -> Expr:
    """Return what an assignment rounds by itself."""
    return x.operand if isinstance(x, Cast) and not isinstance(x.operand, Number) else x


def _number(value: float, precision: Precision) -> tuple[str, int]:
    text = literal(value, precision)
    return text, _UNARY if text[0] == "-" else _ATOM
