"""The precision of every operation of a float32 program, made explicit (specs/equations.md, section 7).

A program says which names are float32 and which float64. An operation of two float32 numbers is one in float32, any other one in
float64. A number of the program text takes the precision of the other operand, or is float64 where the card says so
(`Program.wide_literals`). What is assigned is rounded to the precision of its name.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pidemu.program.ir import Assign, Binary, Cast, Expr, Floor, Name, Number, Operator, Precision, Program, Select

_LOGICAL: Final = ("and", "or")
_ARITHMETIC: Final = ("+", "-", "*", "/")
_Typed = tuple[Expr, Precision | None]
"""An expression and its precision; a number of the text has none of its own."""


def explicit(program: Program) -> tuple[Assign, ...]:
    """Return the assignments with a `Cast` wherever a precision is not that of the operands.

    Parameters
    ----------
    program : Program
        The program; one in float64 throughout has no casts.
    """
    if program.precision == "float64":
        return program.body
    return tuple(replace(a, value=_to(_of(program, a.name), _typed(program, a.value))) for a in program.body)


def _of(program: Program, name: str) -> Precision:
    return "float64" if program.is_wide(name) else "float32"


def _to(wanted: Precision, x: _Typed) -> Expr:
    return x[0] if x[1] == wanted else Cast(x[0], wanted)


def _typed(program: Program, x: Expr) -> _Typed:
    match x:
        case Number():
            return x, None
        case Name(id=name):
            return x, _of(program, name)
        case Select(condition=condition, yes=yes, no=no):
            branches = (_typed(program, yes), _typed(program, no))
            common = _common(*branches)
            one, other = (b[0] if common is None else _to(common, b) for b in branches)
            return Select(_typed(program, condition)[0], one, other), common
        case Binary(operator=operator, left=left, right=right) if operator in _LOGICAL:
            return Binary(operator, _typed(program, left)[0], _typed(program, right)[0]), None
        case Binary(operator=operator, left=left, right=right):
            typed = _operand if operator in _ARITHMETIC else _typed
            return _operation(operator, typed(program, left), typed(program, right))
        case Floor(operand=operand):
            inner, precision = _operand(program, operand)
            return Floor(inner), precision
    raise TypeError(f"no precision for {type(x).__name__}")


def _operand(program: Program, x: Expr) -> _Typed:
    """Return an operand; where the card's literals are wide, a number is float64, and so becomes what is computed with it."""
    return (Cast(x, "float64"), "float64") if isinstance(x, Number) and program.wide_literals else _typed(program, x)


def _operation(operator: Operator, left: _Typed, right: _Typed) -> _Typed:
    """Return an operation; a float32 operand is promoted without being told, a number of the text takes the other's precision."""
    common = _common(left, right)
    one, other = (x if precision or common is None else Cast(x, common) for x, precision in (left, right))
    return Binary(operator, one, other), common


def _common(left: _Typed, right: _Typed) -> Precision | None:
    precisions = {left[1], right[1]}
    return "float64" if "float64" in precisions else "float32" if "float32" in precisions else None
