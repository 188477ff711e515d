"""A scan program as source for Numba: one loop over a record, and a block of loops side by side."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from pidemu.backends.expressions import NUMBA, NUMBA_BLOCK, Dialect, render
from pidemu.program.ir import Program, names_in
from pidemu.program.precision import explicit

WIDTH: Final = 64
"""Loops in a block: a constant of the text, so that the compiler knows that rows are apart and computes several loops at once."""

_HEAD: Final = """from math import inf, nan

from numba import njit
from numpy import float32, float64

jit = njit(nogil=True, error_model="numpy")
"""
_STEP: Final = " " * 8
_LOOP: Final = " " * 12


def module_text(*functions: str) -> str:
    """Return a module of functions."""
    return "\n\n".join([_HEAD, *functions]) + "\n"


def record_text(program: Program, name: str) -> str:
    """Return a function for one loop over a record: ``name(values, states, *signals, *lines, *outputs)``, all one-dimensional.

    A delay line is a ring of as many values as it delays by scans; the oldest is at ``scans % length`` in the end.
    """
    inputs, states, lines = _names(program)
    arguments = [f"{n}_n" for n in inputs] + [f"{n}_line" for n in lines] + [f"{n}_out" for n in program.recorded]
    text = [
        f"@jit\ndef {name}(values, states, {', '.join(arguments)}):",
        *_coefficients(program, "values[{}]", "    "),
        *(_load(program, n, f"states[{k}]", "    ") for k, n in enumerate(states)),
        *(f"    {n}_at = 0" for n in lines),
        f"    for n in range({program.output}_out.size):",
        *(_load(program, n, f"{n}_n[n]", _STEP) for n in inputs),
        *(_load(program, n, f"{n}_line[{n}_at]", _STEP) for n in lines),
        *_body(program, NUMBA, _STEP),
    ]
    for line in program.lines:
        at = f"{line.name}_at"
        text += [
            f"{_STEP}{line.name}_line[{at}] = {line.source}",
            f"{_STEP}{at} = {at} + 1 if {at} + 1 < {line.name}_line.size else 0",
        ]
    text += [f"{_STEP}{n}_out[n] = {n}" for n in program.recorded]
    return "\n".join([*text, *(f"    states[{k}] = {n}" for k, n in enumerate(states)), "    return"])


def block_text(program: Program) -> str:
    """Return a function for a block of loops: ``block(values, states, at, *signals, *rings, *lengths, *left, *outputs)``.

    All arrays are flat, their last dimension `WIDTH` loops long: `values` and `states` hold a row per name; a signal, a ring and an
    output are arrays of their own, so that the compiler sees that they do not overlap. What leaves the delay lines is looked up for
    all loops first, so that it can do the rest for several loops at once.
    """
    inputs, states, lines = _names(program)
    arguments = [f"{n}_n" for n in inputs]
    arguments += [f"{n}_{what}" for what in ("ring", "length", "left") for n in lines]
    arguments += [f"{n}_out" for n in program.recorded]
    row = "[{} * " + f"{WIDTH} + i]"
    text = [
        f"@jit\ndef block(values, states, at, {', '.join(arguments)}):",
        f"    scans = {program.output}_out.size // {WIDTH}",
        *(f"    {n}_rows = {n}_ring.size // {WIDTH}" for n in lines),
        "    for n in range(scans):",
        *(part for n in lines for part in _look_up(n)),
        f"{_STEP}for i in range({WIDTH}):",
        *_coefficients(program, "values" + row, _LOOP),
        *(_load(program, n, "states" + row.format(k), _LOOP) for k, n in enumerate(states)),
        *(_load(program, n, f"{n}_n" + row.format("n"), _LOOP) for n in inputs),
        *(_load(program, n, f"{n}_left[i]", _LOOP) for n in lines),
        *_body(program, NUMBA_BLOCK, _LOOP),
        *(f"{_LOOP}states{row.format(k)} = {n}" for k, n in enumerate(states)),
        *(f"{_LOOP}{line.name}_ring{row.format(f'{line.name}_row')} = {line.source}" for line in program.lines),
        *(f"{_LOOP}{n}_out{row.format('n')} = {n}" for n in program.recorded),
    ]
    return "\n".join(text)


def _look_up(line: str) -> list[str]:
    return [
        f"{_STEP}{line}_row = (at + n) % {line}_rows",
        f"{_STEP}for i in range({WIDTH}):",
        f"{_LOOP}r = {line}_row - {line}_length[i]",
        f"{_LOOP}r = r + {line}_rows if r < 0 else r",
        f"{_LOOP}{line}_left[i] = {line}_ring[r * {WIDTH} + i]",
    ]


def _names(program: Program) -> tuple[list[str], list[str], list[str]]:
    return [q.name for q in program.inputs], [q.name for q in program.states], [line.name for line in program.lines]


def _load(program: Program, name: str, place: str, indent: str) -> str:
    return f"{indent}{name} = {place if program.is_wide(name) else f'float32({place})'}"


def _coefficients(program: Program, place: str, indent: str) -> Iterable[str]:
    read = {n for assign in program.body for n in names_in(assign.value)} | set(program.recorded)
    for k, q in enumerate(program.coefficients):
        if q.name in read:
            yield _load(program, q.name, place.format(k), indent)


def _body(program: Program, dialect: Dialect, indent: str) -> Iterable[str]:
    return (f"{indent}{assign.name} = {render(assign.value, dialect)}" for assign in explicit(program))
