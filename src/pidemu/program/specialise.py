"""A program with some names known beforehand: what needs no deciding is decided once, not every scan.

In a long spell in automatic the mode and the start flags never change. The specialised program does the same arithmetic in the same
order, so its bits are the same; only selects on what is known, copies and unused assignments go.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from pidemu.program.ir import Assign, Binary, Expr, Floor, Name, Number, Program, Select, names_in

IN_AUTOMATIC: Final[Mapping[str, float]] = {"auto": 1.0, "track": math.nan, "on": 1.0, "begun": 1.0}
"""What holds from the second automatic scan on."""

_COMPARE: Final[dict[str, Callable[[float, float], bool]]] = {
    "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip


def specialise(program: Program, known: Mapping[str, float] = IN_AUTOMATIC) -> Program:
    """Return the program for scans in which inputs and states have known values that they keep.

    Parameters
    ----------
    program : Program
        The program.
    known : mapping
        Value by name of input or state.
    """
    environment: dict[str, Expr] = {name: Number(value) for name, value in known.items()}
    kept: list[Assign] = []
    for assign in program.body:
        value = _fold(assign.value, environment)
        for name in [n for n, e in environment.items() if isinstance(e, Name) and e.id == assign.name]:
            del environment[name]  # what it stood for changes
        if isinstance(value, Name) and value.id == assign.name:
            continue
        if isinstance(value, Number | Name):
            environment[assign.name] = value
        else:
            environment.pop(assign.name, None)
        if not (isinstance(value, Number) and known.get(assign.name) == value.value):
            kept.append(replace(assign, value=value))
    live = {q.name for q in program.states} | set(program.recorded) | {line.source for line in program.lines}
    body: list[Assign] = []
    for assign in reversed(kept):
        if assign.name in live:
            live.discard(assign.name)
            live.update(names_in(assign.value))
            body.append(assign)
    body = _named_once(body[::-1], program.output)
    inputs = tuple(q for q in program.inputs if q.name not in known and q.name != "manual")
    return replace(program, inputs=inputs, body=tuple(body))


def _named_once(body: list[Assign], output: str) -> list[Assign]:
    """Compute the output under its own name where the last assignment only copies it from a name set once."""
    copied = next((a for a in reversed(body) if a.name == output), None)
    if copied is None or not isinstance(copied.value, Name):
        return body
    old = copied.value.id
    sets = [i for i, a in enumerate(body) if a.name == old]
    end = body.index(copied)
    if len(sets) != 1 or any(output in names_in(a.value) for a in body[sets[0] + 1 : end]):
        return body
    renamed = {old: Name(output)}
    rest = [replace(a, value=_fold(a.value, renamed)) for a in body[sets[0] + 1 :] if a is not copied]
    return [*body[: sets[0]], replace(body[sets[0]], name=output), *rest]


def _fold(x: Expr, environment: Mapping[str, Expr]) -> Expr:
    match x:
        case Name(id=name):
            return environment.get(name, x)
        case Select(condition=condition, yes=yes, no=no):
            test = _fold(condition, environment)
            if isinstance(test, Number):
                return _fold(yes if test.value else no, environment)
            return Select(test, _fold(yes, environment), _fold(no, environment))
        case Binary(operator=op, left=left, right=right):
            a, b = _fold(left, environment), _fold(right, environment)
            if op in _COMPARE and isinstance(a, Number) and isinstance(b, Number):
                return Number(float(_COMPARE[op](a.value, b.value)))
            if op in ("and", "or"):
                return _logical(op == "and", a, b)
            return Binary(op, a, b)
        case Floor(operand=operand):
            return Floor(_fold(operand, environment))
    return x


def _logical(is_and: bool, a: Expr, b: Expr) -> Expr:
    for one, other in ((a, b), (b, a)):
        if isinstance(one, Number):
            return other if bool(one.value) == is_and else one
    return Binary("and" if is_and else "or", a, b)
