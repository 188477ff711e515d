"""Numbers that a compiler of Structured Text may refuse: infinity, and what is beyond the range of REAL."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from pidemu.program.ir import Binary, Cast, Expr, Floor, Name, Number, Program, Quantity, Select, names_in

TINY: Final = "tiny"
"""Stands for 1e-300, below which a state is set to zero."""
_TINY: Final = 1e-300


def without_infinity(program: Program) -> Program:
    """Return a program in which nothing is compared with a limit that is none, and such limits are gone where nobody reads them.

    Parameters
    ----------
    program : Program
        The program; the result has the same bits.
    """
    infinite = {q.name: x for q, x in zip(program.coefficients, program.values, strict=True) if math.isinf(x)}
    if not infinite:
        return program
    body = tuple(replace(a, value=_compared(a.value, infinite)) for a in program.body)
    read = {name for a in body for name in names_in(a.value)}
    kept = [(q, x) for q, x in zip(program.coefficients, program.values, strict=True) if q.name not in infinite or q.name in read]
    return replace(program, body=body, coefficients=tuple(q for q, _ in kept), values=tuple(x for _, x in kept))


def _compared(x: Expr, infinite: Mapping[str, float]) -> Expr:
    match x:
        case Select(condition=condition, yes=yes, no=no):
            test, one, other = (_compared(part, infinite) for part in (condition, yes, no))
            if isinstance(test, Number):
                return one if test.value else other
            return Select(test, one, other)
        case Binary(operator=operator, left=left, right=right):
            if isinstance(right, Name) and (operator, infinite.get(right.id)) in ((">", math.inf), ("<", -math.inf)):
                return Number(0.0)
            one, other = _compared(left, infinite), _compared(right, infinite)
            return _joined(x, one, other) if operator in ("and", "or") else Binary(operator, one, other)
        case Floor(operand=operand):
            return Floor(_compared(operand, infinite))
        case Cast(operand=operand, precision=precision):
            return Cast(_compared(operand, infinite), precision)
    return x


def _joined(x: Binary, left: Expr, right: Expr) -> Expr:
    """Return a condition of two of which one may be known not to hold."""
    for one, other in ((left, right), (right, left)):
        if isinstance(one, Number):
            return other if x.operator == "or" else one
    return Binary(x.operator, left, right)


def with_tiny(program: Program) -> Program:
    """Return a program in which a coefficient stands for 1e-300: MATIEC, of which OpenPLC is made, cannot read the number.

    Parameters
    ----------
    program : Program
        The program; the result has the same bits.
    """
    body = tuple(replace(a, value=_named(a.value)) for a in program.body)
    if program.body == body:
        return program
    tiny = Quantity(TINY, "1.0E-300, which not every compiler reads", "-")
    return replace(program, body=body, coefficients=(*program.coefficients, tiny), values=(*program.values, _TINY))


def _named(x: Expr) -> Expr:
    match x:
        case Number(value=value) if abs(value) == _TINY:
            return Name(TINY) if value > 0 else Binary("-", Number(0.0), Name(TINY))
        case Select(condition=condition, yes=yes, no=no):
            return Select(_named(condition), _named(yes), _named(no))
        case Binary(operator=operator, left=left, right=right):
            return Binary(operator, _named(left), _named(right))
    return x
