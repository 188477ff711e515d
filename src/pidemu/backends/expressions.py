"""Expressions as Python text."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pidemu.program.ir import Binary, Cast, Expr, Floor, Name, Number, Select

_PRECEDENCE: Final = {
    "or": 1, "and": 2, "<": 4, ">": 4, "<=": 4, ">=": 4, "==": 4, "!=": 4, "|": 5, "&": 6, "+": 7, "-": 7, "*": 8, "/": 8,
}  # fmt: skip
_BITWISE: Final = {"and": "&", "or": "|"}
_SELECT: Final = 0
_ATOM: Final = 10


def literal(value: float) -> str:
    """Return a number as Python."""
    return repr(value) if math.isfinite(value) else f'float("{value!r}")'


@dataclass(frozen=True, slots=True)
class Dialect:
    """How expressions are written.

    Attributes
    ----------
    typed : bool
        For Numba: a float32 number of the text says so, since there it does not give way to the other operand by itself.
    branchless : bool
        Truth values are combined without branches, so that a compiler can compute several loops at once.
    """

    typed: bool = False
    branchless: bool = False


PYTHON: Final = Dialect()
NUMBA: Final = Dialect(typed=True)
NUMBA_BLOCK: Final = Dialect(typed=True, branchless=True)


def render(x: Expr, dialect: Dialect = PYTHON) -> str:
    """Return an expression as Python.

    Parameters
    ----------
    x : Expr
        What to print.
    dialect : Dialect
        For whom.
    """
    return _render(x, dialect)[0]


def _render(x: Expr, dialect: Dialect) -> tuple[str, int]:
    match x:
        case Number(value=value):
            text = str(value) if dialect.typed and not math.isfinite(value) else literal(value)
            return text, _ATOM if value >= 0 else 9
        case Name(id=name):
            return name, _ATOM
        case Select(condition=condition, yes=yes, no=no):
            test, then = (_wrapped(part, 1, dialect) for part in (condition, yes))
            return f"{then} if {test} else {_wrapped(no, _SELECT, dialect)}", _SELECT
        case Cast(operand=operand, precision=precision):
            return f"{precision}({_render(operand, dialect)[0]})", _ATOM
        case Binary():
            return _binary(x, dialect)
        case Floor(operand=operand):
            return f"{_wrapped(operand, _PRECEDENCE['*'], dialect)} // 1.0", _PRECEDENCE["/"]
    raise TypeError(f"no Python for {type(x).__name__}")


def _binary(x: Binary, dialect: Dialect) -> tuple[str, int]:
    symbol = _BITWISE.get(x.operator, x.operator) if dialect.branchless else x.operator
    level = _PRECEDENCE[symbol]
    compares = level == _PRECEDENCE["<"]  # Python chains comparisons: a < b < c is not (a < b) < c
    before, after = level + compares, level + (level > _PRECEDENCE["and"])
    left, right = (x.left, x.right) if dialect.typed else (_weak(x.left), _weak(x.right))
    return f"{_wrapped(left, before, dialect)} {symbol} {_wrapped(right, after, dialect)}", level


def _weak(x: Expr) -> Expr:
    """Return an operand; a plain number gives way to a float32 one by itself."""
    return x.operand if isinstance(x, Cast) and isinstance(x.operand, Number) and x.precision == "float32" else x


def _wrapped(x: Expr, least: int, dialect: Dialect) -> str:
    text, level = _render(x, dialect)
    return text if level >= least else f"({text})"
