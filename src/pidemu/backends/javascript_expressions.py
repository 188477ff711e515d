"""Expressions and numbers as JavaScript, where every number is a float64 and `Math.fround` makes a float32 of one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from pidemu.program.ir import Binary, Cast, Expr, Floor, Name, Number, Precision, Program, Select

_PRECEDENCE: Final = {
    "or": 1, "and": 2, "==": 3, "!=": 3, "<": 4, ">": 4, "<=": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
}  # fmt: skip
_SYMBOL: Final = {"and": "&&", "or": "||", "==": "===", "!=": "!=="}
_ARITHMETIC: Final = ("+", "-", "*", "/")
_SELECT: Final = 0
_UNARY: Final = 7
_ATOM: Final = 9

_WORDS: Final = """
abstract arguments async await boolean break byte case catch char class const continue debugger default delete do double else enum
eval export extends false final finally float for from function get globalThis goto if implements import in instanceof int interface
let long native new null of package private protected public return set short static super switch synchronized this throw throws
transient true try typeof undefined var void volatile while with yield Infinity Math NaN Array module
"""
WORDS: Final = frozenset(_WORDS.split())
"""Words of JavaScript, of any edition, and what the printed text takes from it."""


def literal(value: float, precision: Precision) -> str:
    """Return a number as JavaScript that is read back exactly, rounded to a precision.

    Parameters
    ----------
    value : float
        The number.
    precision : {"float64", "float32"}
        What it is a number in.
    """
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    short = abs(value) < 2**24 and value == round(value)
    return repr(value) if precision == "float64" or short else f"Math.fround({value!r})"


class ScriptWriter:
    """Prints expressions whose precisions are explicit (`pidemu.program.precision.explicit`).

    An operation of two float32 numbers is rounded once by `Math.fround`: computed in float64 first, it has the same bits, since
    float64 has more than twice the digits.

    Parameters
    ----------
    program : Program
        The program.
    names : mapping
        JavaScript's name by name of the program.
    """

    def __init__(self, program: Program, names: Mapping[str, str]) -> None:
        self._program = program
        self._names = names

    def text(self, x: Expr) -> str:
        """Return an expression as JavaScript."""
        return self._render(x)[0]

    def _is_narrow(self, x: Expr) -> bool:
        match x:
            case Name(id=name):
                return not self._program.is_wide(name)
            case Cast(precision=precision):
                return precision == "float32"
            case Select(yes=left, no=right) | Binary(left=left, right=right):
                return self._is_narrow(left) and self._is_narrow(right)
            case Floor(operand=operand):
                return self._is_narrow(operand)
        return False

    def _render(self, x: Expr) -> tuple[str, int]:
        match x:
            case Number(value=value):
                return _number(value, "float64")
            case Name(id=name):
                return self._names[name], _ATOM
            case Select(condition=condition, yes=yes, no=no):
                test, then = (self._wrapped(part, 1) for part in (condition, yes))
                return f"{test} ? {then} : {self._wrapped(no, _SELECT)}", _SELECT
            case Cast(operand=Number(value=value), precision=precision):
                return _number(value, precision)
            case Cast(operand=operand, precision="float64"):
                return self._render(operand)
            case Cast(operand=operand):
                return f"Math.fround({self.text(operand)})", _ATOM
            case Binary():
                return self._binary(x)
            case Floor(operand=operand):
                return f"floor({self.text(operand)})", _ATOM
        raise TypeError(f"no JavaScript for {type(x).__name__}")

    def _binary(self, x: Binary) -> tuple[str, int]:
        level = _PRECEDENCE[x.operator]
        text = f"{self._wrapped(x.left, level)} {_SYMBOL.get(x.operator, x.operator)} {self._wrapped(x.right, level + 1)}"
        return (f"Math.fround({text})", _ATOM) if x.operator in _ARITHMETIC and self._is_narrow(x) else (text, level)

    def _wrapped(self, x: Expr, least: int) -> str:
        text, level = self._render(x)
        return text if level >= least else f"({text})"


def _number(value: float, precision: Precision) -> tuple[str, int]:
    text = literal(value, precision)
    return text, _UNARY if text[0] == "-" else _ATOM
