"""The function of C for a block of loops side by side: arrays of numbers by loop, which a compiler computes several at once."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from typing import Final

from pidemu.backends.c_unit import CUnit, assignments, function, read_first, signature, variable
from pidemu.program.ir import Program

WIDTH: Final = 64
"""Loops in a block: a constant of the text, so that the compiler knows how far rows are apart and needs no rest of a loop."""

_ROW: Final = f"[{{}} * {WIDTH} + block_i]"
_LANES: Final = f"for (block_i = 0; block_i < {WIDTH}; block_i++)"


def block_function(unit: CUnit) -> str:
    """Return ``NAME_block(at, scans, values, states, inputs..., rings..., rows..., lengths..., outputs...)``.

    All arrays are flat, their last dimension `WIDTH` loops long; a signal, a ring and an output are arguments of their own, so that
    the compiler sees that they do not overlap. What leaves the delay lines is looked up for all loops first, and conditions have no
    branches, so that it can do the rest for several loops at once.

    Parameters
    ----------
    unit : CUnit
        The unit.
    """
    program, lines = unit.program, range(len(unit.program.lines))
    arguments = ["size_t block_at", "size_t block_scans", "const double *restrict block_values", "double *restrict block_states"]
    arguments += [f"const double *restrict block_in{k}" for k in range(len(program.inputs))]
    arguments += [f"double *restrict block_ring{k}" for k in lines]
    arguments += [f"size_t block_rows{k}" for k in lines]
    arguments += [f"const long long *restrict block_length{k}" for k in lines]
    arguments += [f"double *restrict block_out{k}" for k in range(len(program.recorded))]
    body = [
        "    size_t block_n, block_i;",
        *(f"    double block_left{k}[{WIDTH}];" for k in lines),
        "    for (block_n = 0; block_n < block_scans; block_n++) {",
        *(part for k in lines for part in _look_up(k)),
        f"        {_LANES} {{",
        *(textwrap.indent(line, "        ") for line in _lane(unit, program)),
        "        }",
        "    }",
    ]
    return function(signature(f"void {unit.name}_block", arguments), body)


def _look_up(k: int) -> list[str]:
    row, length = f"block_row{k}", f"(size_t)block_length{k}[block_i]"
    late = f"({row} < {length} ? {row} + block_rows{k} : {row}) - {length}"
    return [
        f"        const size_t {row} = (block_at + block_n) % block_rows{k};",
        f"        {_LANES}",
        f"            block_left{k}[block_i] = block_ring{k}[({late}) * {WIDTH} + block_i];",
    ]


def _lane(unit: CUnit, program: Program) -> list[str]:
    """Return one scan of one loop."""
    places = {q.name: f"block_values{_ROW.format(k)}" for k, q in enumerate(program.coefficients)}
    places |= {q.name: f"block_states{_ROW.format(k)}" for k, q in enumerate(program.states)}
    places |= {q.name: f"block_in{k}{_ROW.format('block_n')}" for k, q in enumerate(program.inputs)}
    places |= {line.name: f"block_left{k}[block_i]" for k, line in enumerate(program.lines)}
    assigned, wanted = {a.name for a in program.body}, read_first(program)
    there = {name: place for name, place in places.items() if name in wanted}
    text = [variable(unit, n, n in assigned, f"({unit.type(n)}){place}") for n, place in there.items()]
    plain = replace(program, body=tuple(replace(a, text="", unit="") for a in program.body))
    text += [line.partition(" /* ")[0].rstrip() for line in assignments(unit, plain, set(there), branchless=True)]
    text += [
        f"    block_states{_ROW.format(k)} = {unit.names[q.name]};" for k, q in enumerate(program.states) if q.name in assigned
    ]
    rows = [f"block_ring{k}{_ROW.format(f'block_row{k}')}" for k in range(len(program.lines))]
    text += [f"    {row} = {unit.names[line.source]};" for row, line in zip(rows, program.lines, strict=True)]
    return [*text, *(f"    block_out{k}{_ROW.format('block_n')} = {unit.names[n]};" for k, n in enumerate(program.recorded))]
