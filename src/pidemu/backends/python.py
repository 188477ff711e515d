"""A scan program as Python source: the reference that every other back end must equal bit by bit."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.backends.comments import comment_text, python_head
from pidemu.backends.expressions import literal, render
from pidemu.backends.runner import Run, Runner
from pidemu.columns.functions import is_traced, plain, single
from pidemu.program.ir import Program, Quantity, Structure, names_in
from pidemu.program.precision import explicit
from pidemu.program.specialise import specialise


def _number(program: Program, name: str, value: float) -> str:
    """Return a coefficient or an initial value, in its name's precision."""
    return literal(value) if program.precision == "float64" else f"{_precision(program, name)}({literal(value)})"


def _precision(program: Program, name: str) -> str:
    return "float64" if program.is_wide(name) else "float32"


def _said(code: str, text: str, column: int = 64) -> str:
    return f"{code:<{column}}  # {comment_text(text)}"


def _with_unit(quantity: Quantity) -> str:
    return f"{quantity.text} [{quantity.unit}]"


def _body(program: Program, indent: str) -> list[str]:
    lines = []
    for assign in explicit(program):
        code = f"{indent}{assign.name} = {render(assign.value)}"
        lines.append(_said(code, assign.text))
    return lines


def _rounded_inputs(program: Program, indent: str) -> list[str]:
    if program.precision == "float64" or not program.inputs:
        return []
    names = [q.name for q in program.inputs]
    return [f"{indent}{', '.join(names)} = {', '.join(f'{_precision(program, name)}({name})' for name in names)}"]


def _states(program: Program) -> str:
    names = [q.name for q in program.states] + [f"{line.name}_line" for line in program.lines]
    return ", ".join(names) if len(names) > 1 else f"({names[0]},)"


def _delayed(program: Program, indent: str) -> list[str]:
    return [_said(f"{indent}{line.name} = {line.name}_line.popleft()", line.text) for line in program.lines]


def _waiting(program: Program, indent: str) -> list[str]:
    return [f"{indent}{line.name}_line.append({line.source})" for line in program.lines]


def _scan(program: Program) -> list[str]:
    states = _states(program)
    return [
        f"def scan({', '.join(['state', *(q.name for q in program.inputs)])}):",
        '    """Do one scan; change `state` and return the output."""',
        f"    {states} = state",
        *_rounded_inputs(program, "    "),
        *_delayed(program, "    "),
        *_body(program, "    "),
        *_waiting(program, "    "),
        f"    state[:] = {states}",
        f"    return {program.output}",
    ]


def _run(program: Program, name: str, *, fast: bool = False) -> list[str]:
    """Return the function for many scans; `fast`: with the coefficients as local names, which are quicker to reach."""
    states = _states(program)
    signals = ", ".join(f"{q.name}_n" for q in program.inputs) or "scans"
    arguments = ", ".join(q.name for q in program.inputs)
    used = {n for assign in program.body for n in names_in(assign.value)}
    local = "".join(f", {q.name}={q.name}" for q in program.coefficients if q.name in used)
    loop = f"for {arguments} in zip({signals}, strict=True):" if len(program.inputs) > 1 else f"for {arguments} in {signals}:"
    loop = loop if program.inputs else "for _ in range(scans):"
    several = len(program.recorded) > 1
    lists = [f"outputs_{n}" if several else "outputs" for n in program.recorded]
    return [
        f"def {name}(state, {signals}{local if fast else ''}):",
        '    """Do one scan per sample of the signals; change `state` and return the outputs."""',
        f"    {states} = state",
        *(f"    {held} = []" for held in lists),
        f"    {loop}",
        *_rounded_inputs(program, "        "),
        *_delayed(program, "        "),
        *_body(program, "        "),
        *_waiting(program, "        "),
        *(f"        {held}.append({recorded})" for held, recorded in zip(lists, program.recorded, strict=True)),
        f"    state[:] = {states}",
        f"    return {', '.join(lists)}",
    ]


def _imports(program: Program) -> list[str]:
    lines = ["from collections import deque"] if program.lines else []
    if program.precision == "float32":
        wide = program.wide_literals or program.wide
        lines.append("from numpy import float32, float64" if wide else "from numpy import float32")
    return [*lines, ""] if lines else []


def _initial(program: Program) -> list[str]:
    numbers = [_number(program, q.name, v) for q, v in zip(program.states, program.initial, strict=True)]
    return [*numbers, *(f"deque([0.0] * {length})" for length in program.lengths)]


def source(program: Program, notes: Sequence[str] = ()) -> str:
    """Return a module that runs the program: its coefficients, `scan` for one scan and `run` for many.

    Parameters
    ----------
    program : Program
        What to print.
    notes : sequence of str
        What stands in the docstring, below the title, a line each.
    """
    lines = [*python_head(program.title, notes), ""]
    lines += _imports(program)
    for quantity, value in zip(program.coefficients, program.values, strict=True):
        lines.append(_said(f"{quantity.name} = {_number(program, quantity.name, value)}", _with_unit(quantity), 32))
    lines += ["", "# kept from scan to scan"]
    for quantity in program.states:
        lines.append(f"#   {quantity.name:<12} {comment_text(_with_unit(quantity))}")
    lines += [
        f"INITIAL = [{', '.join(_initial(program))}]",
        "",
        "",
        *_scan(program),
        "",
        "",
        *_run(program, "run"),
    ]
    return "\n".join(lines) + "\n"


_AT_ONCE: Final = 2048
"""Scans whose numbers are Python's at a time: more of them would not stay in a processor's cache."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """A program as Python functions.

    Attributes
    ----------
    scan : callable
        ``scan(state, *inputs) -> u``, with one number per input of the program.
    run : callable
        ``run(state, *signals) -> list of u``, with one sequence per input; one list per name where more than one is recorded.
    run_automatic : callable
        ``run_automatic(state, sp, pv, ...)``: the same for scans after the first automatic one, without mode, operator's output and
        output to follow.
    initial : tuple of float
        The states before the first scan, in the program's precision.
    read_in_automatic : tuple of str
        Inputs that `run_automatic` reads, in its order.
    """

    scan: Callable[..., float]
    run: Callable[..., Any]
    run_automatic: Callable[..., Any]
    initial: tuple[float, ...]
    read_in_automatic: tuple[str, ...]


def compiled(program: Program) -> Compiled:
    """Return the program as Python functions.

    The functions' text does not hold the coefficients, so loops that share a structure share the compiled code.

    Parameters
    ----------
    program : Program
        The program.
    """
    bind, read = _bound(program.structure, is_traced(*program.values, *program.initial))
    coefficients = (q.name for q in program.coefficients)
    values = [in_precision(program, name, x) for name, x in zip(coefficients, program.values, strict=True)]
    scan, run, run_automatic = bind(*values)
    return Compiled(scan, run, run_automatic, starting(program), read)


@lru_cache(maxsize=512)
def _bound(structure: Structure, traced: bool = False) -> tuple[Callable[..., Any], tuple[str, ...]]:
    """Return what makes functions of the coefficients' values, and what the one for automatic scans reads."""
    program = structure.bare()
    automatic = specialise(program)
    names: dict[str, Any] = {}
    if program.precision == "float32":
        names = {"float32": single, "float64": plain} if traced else {"float32": np.float32, "float64": np.float64}
    exec(_text(program, automatic), names)  # our own text: nothing of the user's goes into it
    return names["bind"], tuple(q.name for q in automatic.inputs)


def _text(program: Program, automatic: Program) -> str:
    lines = [*_scan(program), *_run(program, "run", fast=True), *_run(automatic, "run_automatic", fast=True)]
    return "\n".join(
        [
            f"def bind({', '.join(q.name for q in program.coefficients)}):",
            *("    " + re.sub(r"  +# .*", "", line) for line in lines),
            "    return scan, run, run_automatic",
        ]
    )


def starting(program: Program) -> tuple[float, ...]:
    """Return the states before the first scan, in their precision; a program's delay lines are further states, empty."""
    return tuple(in_precision(program, q.name, x) for q, x in zip(program.states, program.initial, strict=True))


def in_precision(program: Program, name: str, value: float) -> float:
    """Return a value in the precision of a name of the program."""
    if program.precision == "float64":
        return value
    if is_traced(value):
        return plain(value) if program.is_wide(name) else single(value)  # type: ignore[no-any-return]
    with np.errstate(over="ignore"):
        return np.float64(value) if program.is_wide(name) else np.float32(value)  # type: ignore[return-value]  # stands in


def runner(program: Program) -> Runner:
    """Return the program as functions over records, in plain Python.

    Parameters
    ----------
    program : Program
        The program.
    """
    functions = compiled(program)

    def over(run: Callable[..., Any]) -> Run:
        def record(state: list[Any], signals: Sequence[Floats], scans: int) -> Floats:
            records = np.empty((len(program.recorded), scans))
            for at in range(0, scans, _AT_ONCE):
                part = slice(at, min(at + _AT_ONCE, scans))
                found = run(state, *(s[part].tolist() for s in signals)) if signals else run(state, part.stop - at)
                for row, values in zip(records, found if program.also else [found], strict=True):
                    row[part] = np.fromiter(values, np.float64, len(values))
            return records

        return record

    return Runner(over(functions.run), over(functions.run_automatic), functions.read_in_automatic)
