"""What a scan program in C declares: types and functions, each with what it means."""

from __future__ import annotations

from typing import Final

from pidemu.backends.c_unit import CUnit, said, signature
from pidemu.backends.comments import comment_text
from pidemu.program.ir import Line, Program, Quantity

MEMBER: Final = 36
"""Column of the comments beside members."""


def types(unit: CUnit) -> str:
    """Return the types of settings and state."""
    program = unit.program
    lengths = [f"#define {unit.length(x)} {n}u" for x, n in zip(program.lines, program.lengths, strict=True)]
    lines = [text for line in program.lines for text in _line_members(unit, line)]
    return "\n".join(
        [
            *(lengths if unit.own_lines else []),
            "typedef struct {",
            *([_member(unit, q) for q in program.coefficients] or ["    double none;"]),
            f"}} {unit.name}_settings;",
            "",
            "typedef struct {",
            *([*(_member(unit, q) for q in program.states), *lines] or ["    double none;"]),
            f"}} {unit.name}_state;",
        ]
    )


def _member(unit: CUnit, q: Quantity) -> str:
    return said(f"    {unit.type(q.name)} {unit.names[q.name]};", _with_unit(q), MEMBER)


def _line_members(unit: CUnit, line: Line) -> list[str]:
    kind, name = unit.type(line.source), unit.line(line)
    if unit.own_lines:
        return [said(f"    {kind} {name}[{unit.length(line)}];", _with_unit(line), MEMBER), f"    size_t {name}_at;"]
    return [f"    {kind} *{name};", f"    size_t {name}_length;", f"    size_t {name}_at;"]


def _with_unit(q: Quantity | Line) -> str:
    return f"{q.text} [{q.unit}]" if q.text else ""


def prototypes(unit: CUnit) -> str:
    """Return what the header declares, with what it means."""
    meant = [f" *   {unit.names[q.name]:<12}{comment_text(_with_unit(q))}" for q in unit.program.inputs]
    shorter = "/* The same with fewer inputs and decisions: for scans after one in automatic, while automatic lasts. */"
    automatic = ["", shorter, f"{run_head(unit, unit.automatic, 'run_automatic')};"] if unit.automatic else []
    return "\n".join(
        [
            said(f"extern const {unit.name}_settings {unit.name}_default;", "the settings named above"),
            said(f"void {unit.name}_init({unit.name}_state *state);", "the state before the first scan"),
            "",
            "/* One scan; returns the output.",
            *meant,
            " */",
            f"{step_head(unit)};",
            "",
            "/* n scans, a sample of every input and of the output each; the output may take the place of an input. */",
            f"{run_head(unit, unit.program, 'run')};",
            *automatic,
        ]
    )


def step_head(unit: CUnit) -> str:
    """Return the head of the function for one scan."""
    result = f"{unit.type(unit.program.output)} {unit.name}_step"
    return signature(result, [*unit.pointers, *unit.arguments(unit.program, "{} {}"), *unit.also])


def run_head(unit: CUnit, program: Program, name: str) -> str:
    """Return the head of a function for many scans of the program, or of that for automatic scans."""
    output = f"{unit.type(program.output)} *{unit.names[program.output]}"
    samples = unit.arguments(program, "const {} *{}")
    return signature(f"void {unit.name}_{name}", [*unit.pointers, "size_t n", *samples, output, *unit.also])
