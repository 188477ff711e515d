"""One program as a unit of C: how its names are spelt and typed, and the function that does one scan."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pidemu.backends.c_expressions import Writer, identifiers, literal
from pidemu.backends.comments import comment_text
from pidemu.program.ir import Line, Precision, Program, names_in
from pidemu.program.precision import explicit
from pidemu.program.specialise import specialise

_COMMENT: Final = 72
_WIDTH: Final = 120


@dataclass(frozen=True)
class CUnit:
    """A program under a name.

    Attributes
    ----------
    program : Program
        The program.
    automatic : Program or None
        The program for scans after the first automatic one; none for a program that knows no modes.
    name : str
        What types and functions begin with.
    names : mapping
        C name by name of the program.
    own_lines : bool
        The state holds the memory of the delay lines; otherwise it points to memory of the caller's.
    """

    program: Program
    automatic: Program | None
    name: str
    names: Mapping[str, str]
    own_lines: bool

    @classmethod
    def of(cls, program: Program, name: str, *, own_lines: bool = True) -> CUnit:
        """Return the unit of a program."""
        modes = any(q.name == "auto" for q in program.inputs)
        return cls(program, specialise(program) if modes else None, name, identifiers(program), own_lines)

    def precision(self, name: str) -> Precision:
        """Return the precision of a name of the program."""
        return "float64" if self.program.is_wide(name) else "float32"

    def type(self, name: str) -> str:
        """Return the C type of a name of the program."""
        return "double" if self.program.is_wide(name) else "float"

    def number(self, name: str, value: float) -> str:
        """Return a value of a name of the program."""
        return literal(value, self.precision(name))

    @property
    def floor(self) -> str:
        """The function for whole numbers; that for float has an ``f`` at the end."""
        return f"{self.name}_floor"

    @property
    def writer(self) -> Writer:
        """What prints expressions."""
        return Writer(self.program, self.names, self.floor)

    def line(self, line: Line) -> str:
        """Return the member of the state that holds, or points to, a delay line."""
        return f"{self.names[line.name]}_line"

    def length(self, line: Line) -> str:
        """Return the constant that says how many scans a delay line delays by."""
        return f"{self.name}_{self.names[line.name]}_length".upper()

    def arguments(self, program: Program, form: str) -> list[str]:
        """Return one argument per input; `form` has places for its type and its name."""
        return [form.format(self.type(q.name), self.names[q.name]) for q in program.inputs]

    @property
    def also(self) -> list[str]:
        """One argument per name that is recorded besides the output."""
        return [f"{self.type(n)} *{self.names[n]}_out" for n in self.program.also]

    @property
    def pointers(self) -> list[str]:
        """The arguments that every scan has."""
        return [f"const {self.name}_settings *settings", f"{self.name}_state *state"]


def said(code: str, text: str, column: int = _COMMENT) -> str:
    """Return a line of code with a comment in a column, where there is one."""
    text = comment_text(text)
    return f"{code:<{column - 1}} /* {text} */" if text else code


def signature(what: str, arguments: Sequence[str]) -> str:
    """Return the head of a function, its arguments in lines of readable length."""
    lines, indent = [f"{what}("], " " * 4
    for k, argument in enumerate(arguments):
        word = argument + (")" if k == len(arguments) - 1 else ",")
        if len(lines[-1]) + len(word) >= _WIDTH:
            lines.append(indent + word)
        else:
            lines[-1] += word if k == 0 else f" {word}"
    return "\n".join(lines)


def function(head: str, body: Iterable[str]) -> str:
    """Return a function."""
    return "\n".join([head, "{", *body, "}"])


def scan(unit: CUnit, program: Program, name: str) -> str:
    """Return the function that does one scan: settings and states into variables, the assignments, the states back.

    Parameters
    ----------
    unit : CUnit
        The unit.
    program : Program
        Its program, or that for automatic scans.
    name : str
        The function's name, without that of the unit.
    """
    result = f"{unit.name.upper()}_INLINE {unit.type(program.output)} {unit.name}_{name}"
    head = signature(result, [*unit.pointers, *unit.arguments(program, "{} {}"), *unit.also])
    wanted = read_first(program)
    assigned = {a.name for a in program.body}
    coefficients = [q.name for q in program.coefficients if q.name in wanted]
    kept = [q.name for q in program.states if q.name in wanted]
    stored = [q.name for q in program.states if q.name in assigned]
    body = [f"    (void){unit.names[q.name]};" for q in program.inputs if q.name not in wanted]
    body += ["    (void)settings;"] if not coefficients else []
    body += ["    (void)state;"] if not (kept or stored or program.lines) else []
    body += [variable(unit, n, n in assigned, f"settings->{unit.names[n]}") for n in coefficients]
    body += [variable(unit, n, n in assigned, f"state->{unit.names[n]}") for n in kept]
    delayed = [line for line in program.lines if line.name in wanted]
    for line in delayed:
        place = f"state->{unit.line(line)}"
        body.append(said(variable(unit, line.name, False, f"{place}[{place}_at]"), line.text))
    there = {*coefficients, *kept, *(line.name for line in delayed), *(q.name for q in program.inputs)}
    body += assignments(unit, program, there)
    body += [f"    state->{unit.names[n]} = {unit.names[n]};" for n in stored]
    body += [text for line in program.lines for text in _entering(unit, line)]
    body += [f"    *{unit.names[n]}_out = {unit.names[n]};" for n in program.also]
    return function(head, [*body, f"    return {unit.names[program.output]};"])


def read_first(program: Program) -> set[str]:
    """Return what a scan reads before it assigns it."""
    wanted: set[str] = set()
    assigned: set[str] = set()
    for assign in program.body:
        wanted |= set(names_in(assign.value)) - assigned
        assigned.add(assign.name)
    return wanted | ({*program.recorded, *(line.source for line in program.lines)} - assigned)


def variable(unit: CUnit, name: str, changes: bool, value: str) -> str:
    """Return the declaration of a variable; one that does not change is a constant."""
    return f"    {'' if changes else 'const '}{unit.type(name)} {unit.names[name]} = {value};"


def assignments(unit: CUnit, program: Program, there: set[str], *, branchless: bool = False) -> Iterable[str]:
    """Yield the assignments of a scan; names that are not there yet are declared. See `Writer` for `branchless`."""
    writer = Writer(unit.program, unit.names, unit.floor, branchless=branchless)
    times = [a.name for a in program.body]
    for assign in explicit(program):
        value = writer.text(assign.value)
        if assign.name in there:
            code = f"    {unit.names[assign.name]} = {value};"
        else:
            code = variable(unit, assign.name, times.count(assign.name) > 1, value)
            there = there | {assign.name}
        yield said(code, f"{assign.text} [{assign.unit}]")


def _entering(unit: CUnit, line: Line) -> list[str]:
    """Return how the newest value takes the place of the oldest in a delay line."""
    place = f"state->{unit.line(line)}"
    length = unit.length(line) if unit.own_lines else f"{place}_length"
    return [
        f"    {place}[{place}_at] = {unit.names[line.source]};",
        f"    {place}_at = {place}_at + 1 < {length} ? {place}_at + 1 : 0;",
    ]
