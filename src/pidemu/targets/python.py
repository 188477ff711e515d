"""A scan program as Python source: the reference that every other back end must equal bit by bit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType
from typing import Any, Final

from pidemu.scan.program import Binary, Expr, Floor, Name, Number, Program, Select, has_literal, names_in
from pidemu.scan.specialise import specialise

_PRECEDENCE: Final = {
    "or": 1, "and": 2, "<": 4, ">": 4, "<=": 4, ">=": 4, "==": 4, "!=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
}  # fmt: skip
_SELECT: Final = 0
_ATOM: Final = 9


def render(x: Expr) -> str:
    """Return an expression as Python."""
    return _render(x)[0]


def _literal(value: float) -> str:
    return repr(value) if math.isfinite(value) else f'float("{value!r}")'


def _number(program: Program, value: float) -> str:
    """Return a coefficient or an initial value, in the program's precision."""
    return _literal(value) if program.precision == "float64" else f"float32({_literal(value)})"


def _assigned(program: Program, x: Expr) -> str:
    """Return the right side of an assignment.

    A float32 program runs on float32 numbers, and plain numbers in its text give way to them, so every operation is rounded. Wide
    literals are float64 numbers, which do not give way: what is computed with them is rounded when it is assigned.
    """
    if program.precision == "float64":
        return render(x)
    if program.wide_literals and has_literal(x):
        return f"float32({render(_widened(x))})"
    return f"float32({render(x)})" if isinstance(x, Number) else render(x)


def _widened(x: Expr) -> Expr:
    """Return the expression with ``float64(...)`` around the numbers that it computes with."""
    match x:
        case Number(value=value):
            return Name(f"float64({_literal(value)})")
        case Select(condition=condition, yes=yes, no=no):
            return Select(_widened(condition), _widened(yes), _widened(no))
        case Binary(operator=operator, left=left, right=right):
            return Binary(operator, _widened(left), _widened(right))
        case Floor(operand=operand):
            return Floor(_widened(operand))
    return x


def _render(x: Expr) -> tuple[str, int]:
    match x:
        case Number(value=value):
            return _literal(value), _ATOM if value >= 0 else 7
        case Name(id=name):
            return name, _ATOM
        case Select(condition=condition, yes=yes, no=no):
            test, then = (_wrapped(part, 1) for part in (condition, yes))
            return f"{then} if {test} else {_wrapped(no, _SELECT)}", _SELECT
        case Binary(operator=operator, left=left, right=right):
            level = _PRECEDENCE[operator]
            compares = level == _PRECEDENCE["<"]  # Python chains comparisons: a < b < c is not (a < b) < c
            before, after = level + compares, level + (level > _PRECEDENCE["and"])
            return f"{_wrapped(left, before)} {operator} {_wrapped(right, after)}", level
        case Floor(operand=operand):
            return f"{_wrapped(operand, _PRECEDENCE['*'])} // 1.0", _PRECEDENCE["/"]
    raise TypeError(f"no Python for {type(x).__name__}")


def _wrapped(x: Expr, least: int) -> str:
    text, level = _render(x)
    return text if level >= least else f"({text})"


def _body(program: Program, indent: str) -> list[str]:
    lines = []
    for assign in program.body:
        code = f"{indent}{assign.name} = {_assigned(program, assign.value)}"
        lines.append(f"{code:<64}  # {assign.text}")
    return lines


def _rounded_inputs(program: Program, indent: str) -> list[str]:
    if program.precision == "float64":
        return []
    names = ", ".join(q.name for q in program.inputs)
    return [f"{indent}{names} = {', '.join(f'float32({q.name})' for q in program.inputs)}"]


def _states(program: Program) -> str:
    names = ", ".join(q.name for q in program.states)
    return names if len(program.states) > 1 else f"({names},)"


def _scan(program: Program) -> list[str]:
    states = _states(program)
    return [
        f"def scan(state, {', '.join(q.name for q in program.inputs)}):",
        '    """Do one scan; change `state` and return the output."""',
        f"    {states} = state",
        *_rounded_inputs(program, "    "),
        *_body(program, "    "),
        f"    state[:] = {states}",
        f"    return {program.output}",
    ]


def _run(program: Program, name: str, *, fast: bool = False) -> list[str]:
    """Return the function for many scans; `fast`: with the coefficients as local names, which are quicker to reach."""
    states = _states(program)
    signals = ", ".join(f"{q.name}_n" for q in program.inputs)
    arguments = ", ".join(q.name for q in program.inputs)
    used = {n for assign in program.body for n in names_in(assign.value)}
    local = "".join(f", {q.name}={q.name}" for q in program.coefficients if q.name in used)
    loop = f"for {arguments} in zip({signals}, strict=True):" if len(program.inputs) > 1 else f"for {arguments} in {signals}:"
    return [
        f"def {name}(state, {signals}{local if fast else ''}):",
        '    """Do one scan per sample of the signals; change `state` and return the outputs."""',
        f"    {states} = state",
        "    outputs = []",
        f"    {loop}",
        *_rounded_inputs(program, "        "),
        *_body(program, "        "),
        f"        outputs.append({program.output})",
        f"    state[:] = {states}",
        "    return outputs",
    ]


def source(program: Program) -> str:
    """Return a module that runs the program: its coefficients, `scan` for one scan and `run` for many.

    Parameters
    ----------
    program : Program
        What to print.
    """
    lines = [f"# {' '.join(program.title.split())}", ""]
    if program.precision == "float32":
        lines += ["from numpy import float32, float64" if program.wide_literals else "from numpy import float32", ""]
    for quantity, value in zip(program.coefficients, program.values, strict=True):
        lines.append(f"{f'{quantity.name} = {_number(program, value)}':<32}  # {quantity.text} [{quantity.unit}]")
    lines += ["", "# kept from scan to scan"]
    for quantity in program.states:
        lines.append(f"#   {quantity.name:<12} {quantity.text} [{quantity.unit}]")
    lines += [
        f"INITIAL = [{', '.join(_number(program, v) for v in program.initial)}]",
        "",
        "",
        *_scan(program),
        "",
        "",
        *_run(program, "run"),
    ]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Compiled:
    """A program as Python functions.

    Attributes
    ----------
    scan : callable
        ``scan(state, *inputs) -> u``, with one number per input of the program.
    run : callable
        ``run(state, *signals) -> list of u``, with one sequence per input.
    run_automatic : callable
        ``run_automatic(state, sp, pv, ...) -> list of u``: the same for scans after the first automatic one, without mode,
        operator's output and output to follow.
    initial : tuple of float
        The states before the first scan, in the program's precision.
    read_in_automatic : frozenset of str
        Inputs that `run_automatic` reads.
    bind : callable
        From the coefficients' values to the three functions.
    """

    scan: Callable[..., float]
    run: Callable[..., list[float]]
    run_automatic: Callable[..., list[float]]
    initial: tuple[float, ...]
    read_in_automatic: frozenset[str]
    bind: Callable[..., Any]


@lru_cache(maxsize=256)
def _code(text: str) -> CodeType:
    return compile(text, "<scan program>", "exec")


def _text(program: Program) -> str:
    lines = [*_scan(program), *_run(program, "run", fast=True), *_run(specialise(program), "run_automatic", fast=True)]
    return "\n".join(
        [
            f"def bind({', '.join(q.name for q in program.coefficients)}):",
            *("    " + re.sub(r"  +# .*", "", line) for line in lines),
            "    return scan, run, run_automatic",
        ]
    )


def compiled(program: Program, like: tuple[Program, Compiled] | None = None) -> Compiled:
    """Return the program as Python functions.

    The functions' text does not hold the coefficients, so loops that share a structure share the compiled code.

    Parameters
    ----------
    program : Program
        The program.
    like : tuple of Program and Compiled, optional
        A program of which this one is known to differ in its coefficients' values only, and its functions.
    """
    if like is not None and [q.name for q in like[0].coefficients] == [q.name for q in program.coefficients]:
        bind = like[1].bind
    else:
        names: dict[str, Any] = {}
        if program.precision == "float32":
            import numpy as np

            names = {"float32": np.float32, "float64": np.float64}
        exec(_code(_text(program)), names)  # our own text: nothing of the user's goes into it
        bind = names["bind"]
    values, initial = program.values, program.initial
    if program.precision == "float32":
        values, initial = _narrow(values), _narrow(initial)
    scan, run, run_automatic = bind(*values)
    read = like[1].read_in_automatic if like is not None else frozenset(q.name for q in specialise(program).inputs)
    return Compiled(scan, run, run_automatic, initial, read, bind)


def _narrow(values: Sequence[float]) -> tuple[float, ...]:
    import numpy as np

    with np.errstate(over="ignore"):
        return tuple(np.float32(v) for v in values)  # type: ignore[misc]  # they stand in for floats
