"""Expressions as Python text."""

from __future__ import annotations

import math
from typing import Final

from pidemu.scan.program import Binary, Cast, Expr, Floor, Name, Number, Select

_PRECEDENCE: Final = {
    "or": 1, "and": 2, "<": 4, ">": 4, "<=": 4, ">=": 4, "==": 4, "!=": 4, "|": 5, "&": 6, "+": 7, "-": 7, "*": 8, "/": 8,
}  # fmt: skip
_BITWISE: Final = {"and": "&", "or": "|"}
_SELECT: Final = 0
_ATOM: Final = 10


def literal(value: float) -> str:
    """Return a number as Python."""
    return repr(value) if math.isfinite(value) else f'float("{value!r}")'


def render(x: Expr, *, for_compiler: bool = False) -> str:
    """Return an expression as Python.

    Parameters
    ----------
    x : Expr
        What to print.
    for_compiler : bool
        For Numba: truth values are combined without branches, and a float32 number of the text says so, since there it does not
        give way to the other operand by itself.
    """
    return _render(x, for_compiler)[0]


def _render(x: Expr, strict: bool) -> tuple[str, int]:
    match x:
        case Number(value=value):
            text = str(value) if strict and not math.isfinite(value) else literal(value)
            return text, _ATOM if value >= 0 else 9
        case Name(id=name):
            return name, _ATOM
        case Select(condition=condition, yes=yes, no=no):
            test, then = (_wrapped(part, 1, strict) for part in (condition, yes))
            return f"{then} if {test} else {_wrapped(no, _SELECT, strict)}", _SELECT
        case Cast(operand=operand, precision=precision):
            return f"{precision}({_render(operand, strict)[0]})", _ATOM
        case Binary(operator=operator, left=left, right=right):
            symbol = _BITWISE.get(operator, operator) if strict else operator
            level = _PRECEDENCE[symbol]
            compares = level == _PRECEDENCE["<"]  # Python chains comparisons: a < b < c is not (a < b) < c
            before, after = level + compares, level + (level > _PRECEDENCE["and"])
            if not strict:
                left, right = _weak(left), _weak(right)
            return f"{_wrapped(left, before, strict)} {symbol} {_wrapped(right, after, strict)}", level
        case Floor(operand=operand):
            return f"{_wrapped(operand, _PRECEDENCE['*'], strict)} // 1.0", _PRECEDENCE["/"]
    raise TypeError(f"no Python for {type(x).__name__}")


def _weak(x: Expr) -> Expr:
    """Return an operand; a plain number gives way to a float32 one by itself."""
    return x.operand if isinstance(x, Cast) and isinstance(x.operand, Number) and x.precision == "float32" else x


def _wrapped(x: Expr, least: int, strict: bool) -> str:
    text, level = _render(x, strict)
    return text if level >= least else f"({text})"
