"""A scan program as C99 without dependencies: settings, state, one scan, and many scans.

The text is C++ too, is free of warnings (``-Wall -Wextra -Wpedantic``), and gives the bits of `pidemu.backends.python` where a
compiler keeps to IEEE 754: no contraction of ``a * b + c`` to one operation, no fast math, no wider intermediate results.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import Final

from pidemu.backends.c_block import block_function
from pidemu.backends.c_expressions import RESERVED
from pidemu.backends.c_header import MEMBER, prototypes, run_head, step_head, types
from pidemu.backends.c_unit import CUnit, function, said, scan
from pidemu.backends.comments import comment_text
from pidemu.errors import EngineError
from pidemu.program.ir import Binary, Cast, Expr, Floor, Program, Select
from pidemu.program.precision import explicit

_ABSENT: Final = ("manual", "cascade", "track", "reset")

_BUILD: Final = """\
The outputs are pidemu's bit by bit where operations are those of IEEE 754: build with -ffp-contract=off (no a * b + c
in one operation) and without -ffast-math. NaN means that a signal is not there ({absent}), so
-ffinite-math-only changes more than bits. Sections are those of pidemu's specs/equations.md."""

_GUARDS: Final = """\
#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "NaN means that a signal is not there: build without -ffast-math and -ffinite-math-only"
#endif
#if !defined(PIDEMU_OTHER_BITS) && ({digits} || (defined(FLT_EVAL_METHOD) && {wider}))
#error "no IEEE 754 arithmetic (x86 of 32 bits: build with -msse2 -mfpmath=sse); -DPIDEMU_OTHER_BITS builds all the same"
#endif"""

_INLINE: Final = """\
#if defined(__GNUC__)
#define {name}_INLINE static inline __attribute__((always_inline))
#else
#define {name}_INLINE static inline
#endif"""

_FLOOR: Final = """\
/* the largest whole number that is not above x; NaN of an infinity */
static inline {kind} {name}({kind} x)
{{
    return isfinite(x) ? {floor}(x) : x - x;
}}"""

_CPP: Final = ('#ifdef __cplusplus\nextern "C" {\n#endif', "#ifdef __cplusplus\n}\n#endif")


def header(program: Program, name: str, notes: Sequence[str] = ()) -> str:
    """Return the header ``NAME.h``: types, the settings of this program, and the functions.

    Parameters
    ----------
    program : Program
        What to print.
    name : str
        What types and functions begin with: a C identifier.
    notes : sequence of str
        What stands in the comment at the top, below the title, a line each.

    Raises
    ------
    EngineError
        The name is not a C identifier.
    """
    unit = _unit(program, name)
    guard = f"{name.upper()}_H"
    before = [_about(unit, notes), f"#ifndef {guard}\n#define {guard}", "#include <stddef.h>", _CPP[0]]
    return _joined([*before, types(unit), prototypes(unit), _CPP[1], f"#endif /* {guard} */"])


def source(program: Program, name: str, notes: Sequence[str] = ()) -> str:
    """Return the source ``NAME.c``, which includes the header.

    Parameters
    ----------
    program, name, notes
        As in `header`.

    Raises
    ------
    EngineError
        The name is not a C identifier.
    """
    unit = _unit(program, name)
    return _joined([_about(unit, notes), f'#include "{name}.h"', *_preamble(unit), *_functions(unit)])


def single(program: Program, name: str, notes: Sequence[str] = ()) -> str:
    """Return header and source as one text that compiles on its own.

    Parameters
    ----------
    program, name, notes
        As in `header`.

    Raises
    ------
    EngineError
        The name is not a C identifier.
    """
    unit = _unit(program, name)
    return _joined([_about(unit, notes), "#include <stddef.h>", *_preamble(unit), types(unit), prototypes(unit), *_functions(unit)])


def library(program: Program, name: str) -> str:
    """Return types and the functions for many scans, for loops that differ in numbers: delay lines are memory of the caller's.

    A delay line has three members of the state: ``LINE_line`` points to it, ``LINE_line_length`` says how many scans it delays by,
    ``LINE_line_at`` where in it the oldest value is.

    Parameters
    ----------
    program, name
        As in `header`.
    """
    unit = CUnit.of(program, name, own_lines=False)
    general = [scan(unit, unit.program, "scan"), _run(unit, unit.program, "run", "scan")]
    return _joined(["#include <stddef.h>", *_preamble(unit), types(unit), *general, *_automatic(unit)])


def block_library(program: Program, name: str) -> str:
    """Return the function for blocks of loops side by side (`pidemu.backends.c_block`).

    Parameters
    ----------
    program, name
        As in `header`.
    """
    unit = CUnit.of(program, name, own_lines=False)
    return _joined(["#include <stddef.h>", *_preamble(unit), block_function(unit)])


def check_name(name: str) -> None:
    """Check that a name can begin the names of types and functions.

    Raises
    ------
    EngineError
        It is not a C identifier, or one that C or C++ keeps for itself.
    """
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
        raise EngineError(f"'{name}' is not a name in C; give letters, digits and single underscores, a letter first")
    if name in RESERVED:
        raise EngineError(f"'{name}' is a word of C or C++; give another name, such as {name}_control")


def _unit(program: Program, name: str) -> CUnit:
    check_name(name)
    return CUnit.of(program, name)


def _joined(parts: list[str]) -> str:
    return "\n\n".join(parts) + "\n"


def _about(unit: CUnit, notes: Sequence[str]) -> str:
    """Return the comment at the top: which controller, and how to build it."""
    absent = ", ".join(unit.names[q.name] for q in unit.program.inputs if q.name in _ABSENT)
    title = textwrap.wrap(comment_text(unit.program.title), 116, break_long_words=False)
    told = [*map(comment_text, notes), ""] if notes else []
    text = "\n".join([*title, "", *told, _BUILD.format(absent=absent)])
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in text.splitlines()), " */"])


def _preamble(unit: CUnit) -> list[str]:
    parts = ["#include <float.h>\n#include <math.h>", _guards(unit.program), _INLINE.format(name=unit.name.upper())]
    floats = {unit.writer.is_float(x) for assign in explicit(unit.program) for x in _floors(assign.value)}
    for suffix, kind in (("", "double"), ("f", "float")):
        if (kind == "float") in floats:
            parts.append(_FLOOR.format(kind=kind, name=unit.floor + suffix, floor=f"floor{suffix}"))
    return parts


def _guards(program: Program) -> str:
    """Return what stops a build whose outputs would differ."""
    narrow = program.precision == "float32"
    digits = "FLT_MANT_DIG != 24" if narrow and not (program.wide or program.wide_literals) else "DBL_MANT_DIG != 53"
    return _GUARDS.format(digits=digits, wider="FLT_EVAL_METHOD != 0" + ("" if narrow else " && FLT_EVAL_METHOD != 1"))


def _floors(x: Expr) -> Iterator[Expr]:
    match x:
        case Floor(operand=operand):
            yield x
            yield from _floors(operand)
        case Cast(operand=operand):
            yield from _floors(operand)
        case Select(condition=condition, yes=yes, no=no):
            for part in (condition, yes, no):
                yield from _floors(part)
        case Binary(left=left, right=right):
            yield from _floors(left)
            yield from _floors(right)


def _functions(unit: CUnit) -> list[str]:
    general = [scan(unit, unit.program, "scan"), _step(unit), _run(unit, unit.program, "run", "scan")]
    return [_default(unit), _init(unit), *general, *_automatic(unit)]


def _default(unit: CUnit) -> str:
    coefficients = zip(unit.program.coefficients, unit.program.values, strict=True)
    values = [said(f"    {unit.number(q.name, x)},", unit.names[q.name], MEMBER) for q, x in coefficients]
    return "\n".join([f"const {unit.name}_settings {unit.name}_default = {{", *(values or ["    0.0"]), "};"])


def _init(unit: CUnit) -> str:
    program = unit.program
    starting = zip(program.states, program.initial, strict=True)
    body = ["    size_t i;"] if program.lines else []
    body += [f"    state->{unit.names[q.name]} = {unit.number(q.name, x)};" for q, x in starting]
    for line in program.lines:
        place = f"state->{unit.line(line)}"
        body += [f"    for (i = 0; i < {unit.length(line)}; i++)", f"        {place}[i] = {unit.number(line.source, 0.0)};"]
        body.append(f"    {place}_at = 0;")
    return function(f"void {unit.name}_init({unit.name}_state *state)", body or ["    (void)state;"])


def _step(unit: CUnit) -> str:
    arguments = ["settings", "state", *unit.arguments(unit.program, "{1}"), *(f"{unit.names[n]}_out" for n in unit.program.also)]
    return function(step_head(unit), [f"    return {unit.name}_scan({', '.join(arguments)});"])


def _automatic(unit: CUnit) -> list[str]:
    if unit.automatic is None:
        return []
    return [scan(unit, unit.automatic, "scan_automatic"), _run(unit, unit.automatic, "run_automatic", "scan_automatic")]


def _run(unit: CUnit, program: Program, name: str, each: str) -> str:
    samples = unit.arguments(program, "{1}[i]")
    arguments = ["&fixed", "&now", *samples, *(f"&{unit.names[n]}_out[i]" for n in program.also)]
    body = [
        f"    const {unit.name}_settings fixed = *settings; /* copies: the compiler keeps them in registers */",
        f"    {unit.name}_state now = *state;",
        "    size_t i;",
        "    for (i = 0; i < n; i++)",
        f"        {unit.names[program.output]}[i] = {unit.name}_{each}({', '.join(arguments)});",
        "    *state = now;",
    ]
    return function(run_head(unit, program, name), body)
