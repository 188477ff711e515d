"""A scan program as a function block: its variables in groups and its statements, before a dialect prints them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

from pidemu.backends.comments import comment_text
from pidemu.backends.structured_text_expressions import TYPES, Dialect, StatementWriter, is_given, literal
from pidemu.backends.structured_text_names import given_flag, identifiers
from pidemu.backends.structured_text_numbers import TINY, with_tiny, without_infinity
from pidemu.errors import EngineError
from pidemu.program.ir import Assign, Binary, Cast, Expr, Floor, Line, Name, Precision, Program, Quantity, Select
from pidemu.program.precision import explicit
from pidemu.settings.settings import Settings

Group = Literal["input", "output", "setting", "coefficient", "state", "value"]
GROUPS: Final[Mapping[Group, str]] = {
    "input": "",
    "output": "",
    "setting": "the settings that the numbers below were computed from: for reading, they change nothing",
    "coefficient": "numbers computed from settings and scan interval",
    "state": "kept from scan to scan",
    "value": "computed in every scan",
}
"""What a group of variables is, in words."""
_WHOLE: Final[Mapping[Precision, str]] = {"float64": "4503599627370496.0", "float32": "8388608.0"}
"""From here on every number is whole."""


@dataclass(frozen=True, slots=True)
class PrintedDial:
    """A vendor's setting as it is printed.

    Attributes
    ----------
    name : str
        The vendor's name.
    value : float
        Its value.
    unit : str
        The vendor's unit.
    """

    name: str
    value: float
    unit: str


def dials(settings: Settings) -> list[PrintedDial]:
    """Return the settings at work as they are printed."""
    return [PrintedDial(name, x.value, x.unit) for name, x in settings.items() if x.active]


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the block.

    Attributes
    ----------
    group : str
        What it is for, a key of `GROUPS`.
    name : str
        Its name in Structured Text.
    type : str
        ``REAL``, ``LREAL``, ``BOOL``, ``INT`` or ``LINT``.
    initial : str
        Its value before the first scan; empty for what is computed in every scan.
    text : str
        What it is, with its unit.
    length : int
        How many of them an array holds; 0 for a single one.
    """

    group: Group
    name: str
    type: str
    initial: str
    text: str
    length: int = 0


@dataclass(frozen=True)
class FunctionBlock:
    """A function block.

    Attributes
    ----------
    name : str
        Its name.
    program : Program
        What it does.
    names : mapping
        Name in Structured Text by name of the program, and of what tells that an input is there.
    variables : tuple of Variable
        In groups, in the order of `GROUPS`.
    statements : tuple of str
        What a scan does.
    renamed : tuple of (str, str)
        The vendor's names that the language does not allow, and what stands for them.
    """

    name: str
    program: Program
    names: Mapping[str, str]
    variables: tuple[Variable, ...]
    statements: tuple[str, ...]
    renamed: tuple[tuple[str, str], ...]

    def flagged(self, name: str) -> bool:
        """Tell whether a flag says that an input is there."""
        return any(v.group == "input" and v.name == self.names[given_flag(name)] for v in self.variables)


def block_of(program: Program, name: str, settings: Sequence[PrintedDial], dialect: Dialect) -> FunctionBlock:
    """Return a program as a function block.

    Parameters
    ----------
    program : Program
        The program.
    name : str
        The block's name.
    settings : sequence of PrintedDial
        The vendor's settings.
    dialect : {"iec", "scl", "rockwell"}
        For whom.

    Raises
    ------
    EngineError
        The program cannot be said in the dialect.
    """
    if dialect == "rockwell" and program.wide_literals:
        raise EngineError(
            "this program computes partly in LREAL, partly in REAL, which Rockwell cannot mix; use --dialect iec or scl"
        )
    program = without_infinity(program)
    program = with_tiny(program) if dialect == "iec" else program
    settings = [d for d in settings if math.isfinite(d.value)]
    names, vendor = identifiers(program, name, (d.name for d in settings))
    return _Maker(program, names, dialect).block(name, settings, vendor)


class _Maker:
    """Collects what a block is made of."""

    def __init__(self, program: Program, names: Mapping[str, str], dialect: Dialect) -> None:
        self._program = program
        self._names = dict(names)
        self._dialect = dialect
        self._writer = StatementWriter(program, self._names, dialect)
        self._body = explicit(program)
        self._wholes: list[tuple[str, Precision]] = []

    def block(self, name: str, settings: Sequence[PrintedDial], vendor: Mapping[str, str]) -> FunctionBlock:
        """Return the block."""
        statements = tuple(self._statements())
        kind = self._program.precision
        variables = (
            *self._inputs(),
            *self._output(),
            *(Variable("setting", vendor[d.name], TYPES[kind], literal(d.value, kind), f"[{d.unit}]") for d in settings),
            *self._coefficients(),
            *self._kept(),
            *self._values(),
        )
        renamed = tuple((old, new) for old, new in vendor.items() if old != new)
        return FunctionBlock(name, self._program, self._names, variables, statements, renamed)

    def _type(self, name: str) -> str:
        return TYPES[self._precision(name)]

    def _precision(self, name: str) -> Precision:
        return "float64" if self._program.is_wide(name) else "float32"

    def _inputs(self) -> Iterator[Variable]:
        asked = {name for a in self._body for name in _asked_for(a.value, self._program)}
        for q in self._program.inputs:
            name = self._names[q.name]
            text = q.text.partition("; NaN")[0]
            if q.name == "auto":
                yield Variable("input", name, "BOOL", "TRUE", "automatic; otherwise manual")
                continue
            yield Variable("input", name, self._type(q.name), "0.0", f"{text} [{q.unit}]")
            if q.name in asked:
                yield Variable("input", self._names[given_flag(q.name)], "BOOL", "FALSE", f"{name} counts; otherwise there is none")

    def _output(self) -> Iterator[Variable]:
        name = self._program.output
        starts = dict(zip((q.name for q in self._program.states), self._program.initial, strict=True))
        texts = {q.name: f"{q.text} [{q.unit}]" for q in self._program.states}
        initial = literal(starts.get(name, 0.0), self._precision(name))
        yield Variable(
            "output", self._names[name], self._type(name), initial, texts.get(name, "output").replace("last output", "output")
        )

    def _quantities(self, group: Group, quantities: Sequence[Quantity], values: Sequence[float]) -> Iterator[Variable]:
        for q, value in zip(quantities, values, strict=True):
            initial = literal(value, self._precision(q.name))
            yield Variable(group, self._names[q.name], self._type(q.name), initial, f"{q.text} [{q.unit}]")

    def _coefficients(self) -> Iterator[Variable]:
        pairs = [(q, x) for q, x in zip(self._program.coefficients, self._program.values, strict=True) if q.name != TINY]
        yield from self._quantities("coefficient", [q for q, _ in pairs], [x for _, x in pairs])

    def _kept(self) -> Iterator[Variable]:
        kept = [(q, x) for q, x in zip(self._program.states, self._program.initial, strict=True) if q.name != self._program.output]
        yield from self._quantities("state", [q for q, _ in kept], [x for _, x in kept])
        for q in self._program.coefficients:
            if q.name == TINY:
                yield Variable("state", self._names[TINY], "LREAL", "0.0", q.text)
        for line, length in zip(self._program.lines, self._program.lengths, strict=True):
            text = f"{line.text} [{line.unit}]"
            yield Variable("state", self._line(line), self._type(line.source), "0.0", text, length)
            yield Variable("state", f"{self._line(line)}_at", "INT", "0", "where in it the oldest value is")

    def _line(self, line: Line) -> str:
        return f"{self._names[line.name]}_line"

    def _values(self) -> Iterator[Variable]:
        there = {q.name for q in (*self._program.inputs, *self._program.coefficients, *self._program.states)}
        local: dict[str, str] = {line.name: f"{line.text} [{line.unit}]" for line in self._program.lines}
        for a in self._program.body:
            if a.name not in there and a.name != self._program.output:
                local.setdefault(a.name, f"{a.text} [{a.unit}]")
        for name, text in local.items():
            yield Variable("value", self._names[name], self._type(name), "", text)
        for name, precision in self._wholes:
            yield Variable("value", self._names[name], TYPES[precision], "", "a whole number, rounded down")
        if self._wholes:
            yield Variable("value", "whole_number", "LINT", "", "for rounding down")

    def _statements(self) -> Iterator[str]:
        if any(q.name == TINY for q in self._program.coefficients):
            tiny = self._names[TINY]
            yield from (f"IF {tiny} = 0.0 THEN", f"    {tiny} := EXPT(10.0, -300.0);", "END_IF;")
        for line in self._program.lines:
            place = f"{self._local(self._line(line))}[{self._local(self._line(line))}_at]"
            yield f"{self._writer.name(line.name)} := {place};"
        for a in self._body:
            value, floors = self._without_floors(a.value)
            for name, operand in floors:
                yield from self._rounded_down(name, operand)
            yield from self._writer.statements(replace(a, value=value), comment_text(f"{a.text} [{a.unit}]") if a.text else "")
        for line, length in zip(self._program.lines, self._program.lengths, strict=True):
            held = self._local(self._line(line))
            yield f"{held}[{held}_at] := {self._writer.name(line.source)};"
            yield f"{held}_at := {held}_at + 1;"
            yield f"IF {held}_at = {length} THEN"
            yield f"    {held}_at := 0;"
            yield "END_IF;"

    def _local(self, name: str) -> str:
        return f"#{name}" if self._dialect == "scl" else name

    def _without_floors(self, x: Expr) -> tuple[Expr, list[tuple[str, Expr]]]:
        """Return an expression with names in place of what is rounded down, and what these stand for, each once."""
        found: dict[Expr, str] = {}

        def replaced(part: Expr) -> Expr:
            match part:
                case Floor(operand=operand):
                    inner = Floor(replaced(operand))
                    if inner not in found:
                        found[inner] = f"whole_{len(self._wholes) + 1}"
                        self._names[found[inner]] = found[inner]
                        self._wholes.append((found[inner], self._program.precision))
                    return Name(found[inner])
                case Select(condition=condition, yes=yes, no=no):
                    return Select(replaced(condition), replaced(yes), replaced(no))
                case Binary(operator=operator, left=left, right=right):
                    return Binary(operator, replaced(left), replaced(right))
                case Cast(operand=operand, precision=precision):
                    return Cast(replaced(operand), precision)
            return part

        value = replaced(x)
        return value, [(name, floor.operand) for floor, name in found.items() if isinstance(floor, Floor)]

    def _rounded_down(self, name: str, operand: Expr) -> Iterator[str]:
        kind = TYPES[self._program.precision]
        x, n = self._writer.name(name), self._local("whole_number")
        to, back = (f"{kind}_TO_LINT({x})", f"LINT_TO_{kind}({n})") if self._dialect != "rockwell" else (x, n)
        yield from self._writer.statements(Assign(name, operand, ""), "rounded down in the next lines")
        yield f"IF ABS({x}) < {_WHOLE[self._program.precision]} THEN"
        yield f"    {n} := {to};"
        yield f"    IF {back} > {x} THEN"
        yield f"        {n} := {n} - 1;"
        yield "    END_IF;"
        yield f"    {x} := {back};"
        yield "ELSE"
        yield f"    {x} := {x} + ({x} - {x}); (* whole already; NaN of an infinity *)"
        yield "END_IF;"


def _asked_for(x: Expr, program: Program) -> set[str]:
    asked = is_given(x, program)
    if asked is not None:
        return {asked[0]}
    return {name for part in _parts(x) for name in _asked_for(part, program)}


def _parts(x: Expr) -> tuple[Expr, ...]:
    match x:
        case Select(condition=condition, yes=yes, no=no):
            return condition, yes, no
        case Binary(left=left, right=right):
            return left, right
        case Floor(operand=operand) | Cast(operand=operand):
            return (operand,)
    return ()
