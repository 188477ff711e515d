"""A scan program as Structured Text of IEC 61131-3, and in the dialects of Siemens SCL and Rockwell.

A choice is an ``IF``; a signal that is not there is said by a flag, since no dialect promises what ``x <> x`` does with NaN.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final

from pidemu.backends.comments import comment_text
from pidemu.backends.structured_text_block import GROUPS, FunctionBlock, Group, PrintedDial, Variable, block_of
from pidemu.backends.structured_text_expressions import Dialect
from pidemu.backends.structured_text_names import check_name
from pidemu.backends.structured_text_self_test import SelfTest, self_test_block
from pidemu.program.ir import Program

_SECTIONS: Final[dict[Group, str]] = {
    "input": "VAR_INPUT",
    "output": "VAR_OUTPUT",
    "setting": "VAR CONSTANT",
    "coefficient": "VAR CONSTANT",
    "state": "VAR",
    "value": "VAR",
}
_SCL_SECTIONS: Final[dict[Group, str]] = {**_SECTIONS, "value": "VAR_TEMP"}
_USAGE: Final[dict[Group, str]] = {"input": "Input", "output": "Output"}
_ABOUT: Final = """\
Not run on a controller. One call is one scan: call it at the scan interval named above. The outputs are pidemu's bit by bit
where {kind} is that of IEEE 754 and expressions are evaluated as written.
SP and PV are numbers: a NaN that enters stays in what is kept, so look at signals before the call. A signal that may be absent
has a flag, such as MANUAL_GIVEN; NaN is not asked for. Where there is no limit, nothing is compared.
Sections are those of pidemu's specs/equations.md."""
_ROCKWELL: Final = """\
Make an Add-On Instruction {name} with these parameters and local tags; what follows is its Logic routine."""
_COMMENT: Final = 56
_WIDTH: Final = 120


def source(
    program: Program,
    name: str,
    dials: Sequence[PrintedDial] = (),
    notes: Sequence[str] = (),
    *,
    dialect: Dialect = "iec",
    test: SelfTest | None = None,
) -> str:
    """Return a function block that runs the program.

    Parameters
    ----------
    program : Program
        What to print.
    name : str
        The block's name.
    dials : sequence of PrintedDial
        The vendor's settings, which stand in the block for reading.
    notes : sequence of str
        What stands in the comment at the top, below the title, a line each.
    dialect : {"iec", "scl", "rockwell"}
        IEC 61131-3; Siemens SCL, as an external source; the logic of a Rockwell Add-On Instruction with a table of its tags.
    test : SelfTest, optional
        A record whose outputs are known: a program that plays it in the controller is printed behind the block.

    Raises
    ------
    EngineError
        The name cannot be a block's, or the program or the test cannot be said in the dialect.
    """
    check_name(name)
    block = block_of(program, name, dials, dialect)
    head = _comment(about(block, notes))
    if dialect == "rockwell":
        parts = [
            _comment([*about(block, notes), "", *_ROCKWELL.format(name=name).splitlines(), "", *_tags(block)]),
            *block.statements,
        ]
    elif dialect == "scl":
        parts = [head, *_scl(name, block.variables, block.statements)]
    else:
        parts = [head, *_iec("FUNCTION_BLOCK", name, block.variables, block.statements)]
    if test is not None:
        other = self_test_block(block, test, dialect)
        told = _comment(other.about)
        text = (
            _scl(other.name, other.variables, other.statements)
            if dialect == "scl"
            else _iec("PROGRAM", other.name, other.variables, other.statements)
        )
        parts += ["", told, *text]
    return "\n".join(parts) + "\n"


def about(block: FunctionBlock, notes: Sequence[str]) -> list[str]:
    """Return what stands at the top of a block, a line each.

    Parameters
    ----------
    block : FunctionBlock
        The block.
    notes : sequence of str
        Any texts.
    """
    kind = "REAL" if block.program.precision == "float32" else "LREAL"
    title = textwrap.wrap(comment_text(block.program.title), 116, break_long_words=False)
    renamed = [f"The setting {comment_text(old)} is called {new}: the language has no such name." for old, new in block.renamed]
    told = [*map(comment_text, notes), ""] if notes else []
    first = "A PID controller, scan by scan; printed by pidemu."
    return [first, *title, "", *told, *renamed, *_ABOUT.format(kind=kind).splitlines()]


def _comment(lines: Sequence[str]) -> str:
    return "\n".join(["(*", *(f"  {line}".rstrip() for line in lines), "*)"])


def _iec(kind: str, name: str, variables: Sequence[Variable], statements: Sequence[str]) -> list[str]:
    declared = [line for part in _sections(variables, _SECTIONS) for line in part]
    return [f"{kind} {name}", *declared, *statements, f"END_{kind}"]


def _scl(name: str, variables: Sequence[Variable], statements: Sequence[str]) -> list[str]:
    declared = [line for part in _sections(variables, _SCL_SECTIONS) for line in part]
    head = [f'FUNCTION_BLOCK "{name}"', "VERSION : 0.1"]
    return [*head, *declared, "BEGIN", *(f"    {line}" for line in statements), "END_FUNCTION_BLOCK"]


def _sections(variables: Sequence[Variable], sections: Mapping[Group, str]) -> list[list[str]]:
    """Return the declarations; groups that are declared alike share a section."""
    found = []
    for word, groups in groupby(dict.fromkeys(v.group for v in variables), sections.__getitem__):
        lines = [word]
        for group in groups:
            lines += [f"    (* {GROUPS[group]} *)"] if GROUPS[group] else []
            lines += [_declared(v) for v in variables if v.group == group]
        found.append([*lines, "END_VAR"])
    return found


def _declared(v: Variable) -> str:
    kind = f"ARRAY[0..{v.length - 1}] OF {v.type}" if v.length else v.type
    initial = f" := {v.initial}" if v.initial and not (v.length and not v.initial.startswith("[")) else ""
    code = f"    {v.name} : {kind}{initial};"
    if len(code) > _WIDTH:
        return textwrap.fill(code, _WIDTH, initial_indent="", subsequent_indent=" " * 8, break_long_words=False)
    return f"{code:<{_COMMENT}}(* {comment_text(v.text)} *)" if v.text else code


def _tags(block: FunctionBlock) -> list[str]:
    """Return the tags of an instruction as a table."""
    rows = [("Name", "Usage", "Type", "Default", "Description")]
    for v in block.variables:
        kind = f"{v.type}[{v.length}]" if v.length else v.type
        initial = {"TRUE": "1", "FALSE": "0"}.get(v.initial, v.initial)
        rows.append((v.name, _USAGE.get(v.group, "Local"), kind, initial or "0", comment_text(v.text)))
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    return ["  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]) for row in rows]
