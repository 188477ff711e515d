"""Expressions and names as C99 text that is C++ as well."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from pidemu.program.ir import Assign, Binary, Cast, Expr, Floor, Line, Name, Number, Precision, Program, Quantity, Select

_PRECEDENCE: Final = {
    "or": 1, "and": 2, "<": 4, ">": 4, "<=": 4, ">=": 4, "==": 4, "!=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
}  # fmt: skip
_SYMBOL: Final = {"and": "&&", "or": "||"}
_BITWISE: Final = {"and": "&", "or": "|"}
_SELECT: Final = 0
_UNARY: Final = 7
_ATOM: Final = 9

_WORDS: Final = """
alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool break case catch char
char8_t char16_t char32_t class co_await co_return co_yield compl complex concept const const_cast consteval constexpr
constinit continue decltype default delete do double dynamic_cast else enum explicit export extern false float for
friend goto if imaginary inline int long mutable namespace new noexcept not not_eq nullptr operator or or_eq private
protected public reflexpr register reinterpret_cast requires restrict return short signed sizeof static static_assert
static_cast struct switch synchronized template this thread_local throw true try typedef typeid typename typeof
typeof_unqual union unsigned using virtual void volatile wchar_t while xor
xor_eq NULL NAN INFINITY isfinite floor floorf size_t
"""
RESERVED: Final = frozenset(_WORDS.split())
"""Words of C (to C23) and C++ (to C++23), and what the printed text takes from the standard headers."""
_OWN: Final = frozenset({"settings", "state", "fixed", "now", "n", "i", "none"})
"""What the printed functions call their own arguments and variables."""


def identifiers(program: Program) -> dict[str, str]:
    """Return the C name of every name of a program; those of C and C++ are spelt otherwise: ``auto`` is ``automatic``.

    Parameters
    ----------
    program : Program
        The program.
    """
    named: tuple[Quantity | Line | Assign, ...] = (
        *program.inputs,
        *program.coefficients,
        *program.states,
        *program.lines,
        *program.body,
    )
    names = dict.fromkeys(x.name for x in named)
    found: dict[str, str] = {}
    for name in names:
        spelt = "automatic" if name == "auto" else name
        while spelt in RESERVED | _OWN or (spelt != name and spelt in names):
            spelt += "_"
        found[name] = spelt
    return found


def literal(value: float, precision: Precision) -> str:
    """Return a number as C text that is read back exactly, rounded to a precision.

    Parameters
    ----------
    value : float
        The number.
    precision : {"float64", "float32"}
        What it is a number in.
    """
    narrow = precision == "float32"
    if narrow:
        with np.errstate(over="ignore"):
            rounded = np.float32(value)
        if np.isfinite(rounded):
            return f"{rounded!s}f"
        value = float(rounded)
    if math.isfinite(value):
        return repr(value)
    word = "NAN" if math.isnan(value) else "INFINITY"
    return f"{'-' if value < 0 else ''}{word if narrow else f'(double){word}'}"


class Writer:
    """Prints expressions whose precisions are explicit (`pidemu.program.precision.explicit`).

    Parameters
    ----------
    program : Program
        The program.
    names : mapping
        C name by name of the program.
    floor : str
        The C function for whole numbers; that for float has an ``f`` at the end.
    branchless : bool
        Truth values are combined without branches, so that a compiler can compute several loops at once.
    """

    def __init__(self, program: Program, names: Mapping[str, str], floor: str, *, branchless: bool = False) -> None:
        self._symbol = _BITWISE if branchless else _SYMBOL
        self._program = program
        self._names = names
        self._floor = floor

    def text(self, x: Expr) -> str:
        """Return an expression as C."""
        return self._render(x)[0]

    def is_float(self, x: Expr) -> bool:
        """Tell whether C computes an expression in float."""
        match x:
            case Name(id=name):
                return not self._program.is_wide(name)
            case Cast(precision=precision):
                return precision == "float32"
            case Select(yes=left, no=right) | Binary(left=left, right=right):
                return self.is_float(left) and self.is_float(right)
            case Floor(operand=operand):
                return self.is_float(operand)
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
            case Cast(
                operand=Select(condition=condition, yes=Number() | Select() as yes, no=Number() | Select() as no), precision=p
            ):
                return self._render(Select(condition, Cast(yes, p), Cast(no, p)))
            case Cast(operand=operand, precision=precision):
                return f"({'float' if precision == 'float32' else 'double'}){self._wrapped(operand, _UNARY)}", _UNARY
            case Binary(operator=operator, left=left, right=right):
                return self._binary(operator, left, right)
            case Floor(operand=operand):
                return f"{self._floor}{'f' if self.is_float(operand) else ''}({self.text(operand)})", _ATOM
        raise TypeError(f"no C for {type(x).__name__}")

    def _binary(self, operator: str, left: Expr, right: Expr) -> tuple[str, int]:
        level = _PRECEDENCE[operator]
        if level <= _PRECEDENCE["and"]:  # compilers warn of && within || without parentheses
            one, other = (self._wrapped(part, level if _is(part, operator) else 3) for part in (left, right))
        else:
            compares = level == _PRECEDENCE["<"]  # and of a < b < c
            one, other = self._wrapped(left, level + compares), self._wrapped(right, level + 1)
        return f"{one} {self._symbol.get(operator, operator)} {other}", level

    def _wrapped(self, x: Expr, least: int) -> str:
        text, level = self._render(x)
        return text if level >= least else f"({text})"


def _number(value: float, precision: Precision) -> tuple[str, int]:
    text = literal(value, precision)
    return text, _UNARY if text[0] in "-(" else _ATOM


def _is(x: Expr, operator: str) -> bool:
    return isinstance(x, Binary) and x.operator == operator
