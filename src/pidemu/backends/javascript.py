"""A scan program as JavaScript without imports, for Node and for a page: the bits are those of `pidemu.backends.python`.

The text is one constant, an object that holds the coefficients, the initial state, one scan and many scans. It can stand between
``<script>`` and ``</script>``, several of them in one page, or in a file that Node loads.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

from pidemu.backends.comments import comment_text
from pidemu.backends.javascript_expressions import WORDS, ScriptWriter, literal
from pidemu.backends.names import names_of, respelt
from pidemu.errors import EngineError
from pidemu.program.ir import Binary, Cast, Expr, Floor, Line, Precision, Program, Quantity, Select, names_in
from pidemu.program.precision import explicit

_OWN: Final = frozenset({"settings", "constants", "state", "initial", "scan", "run", "floor", "outputs", "n", "i"})
_COMMENT: Final = 72
_MEMBER: Final = 36
_MARKUP: Final = re.compile(r"<(?=[/!])")
"""What could end a script within a page, or begin a comment of the page."""
_ABSENT: Final = {"auto": "1.0", "manual": "NaN", "cascade": "NaN", "track": "NaN", "reset": "NaN", "feedforward": "0.0"}
_FLOOR: Final = """\
  // the largest whole number that is not above x; NaN of an infinity
  const floor = (x) => Number.isFinite(x) ? Math.floor(x) : x - x;
"""
_ABOUT: Final = """\
Use: state = {name}.initial(); u = {name}.scan(state, {inputs}); scan changes the state.
{name}.run(state, {{{inputs}}}) takes one array per input and returns the outputs.
NaN means that a signal is not there. Sections are those of pidemu's specs/equations.md."""


def check_name(name: str) -> None:
    """Check that a name can be a constant's.

    Raises
    ------
    EngineError
        It is not an identifier of letters, digits and underscores, or a word of JavaScript.
    """
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise EngineError(f"'{name}' is not a name in JavaScript; give letters, digits and underscores, a letter first")
    if name in WORDS | _OWN:
        raise EngineError(f"'{name}' is a word of JavaScript or of what is printed; give another name, such as {name}_control")


def source(program: Program, name: str, notes: Sequence[str] = ()) -> str:
    """Return JavaScript that runs the program.

    Parameters
    ----------
    program : Program
        What to print.
    name : str
        The name of the constant.
    notes : sequence of str
        What stands in the comment at the top, below the title, a line each.

    Raises
    ------
    EngineError
        The name cannot be a constant's.
    """
    check_name(name)
    return _Script(program, name).text(notes)


def _said(code: str, text: str, column: int = _COMMENT) -> str:
    text = _comment(text)
    return f"{code:<{column - 1}} // {text}" if text else code


def _comment(text: str) -> str:
    return _MARKUP.sub("< ", comment_text(text))


def _with_unit(q: Quantity | Line) -> str:
    return f"{q.text} [{q.unit}]"


def _has_floor(x: Expr) -> bool:
    match x:
        case Floor():
            return True
        case Cast(operand=operand):
            return _has_floor(operand)
        case Select(condition=condition, yes=yes, no=no):
            return any(map(_has_floor, (condition, yes, no)))
        case Binary(left=left, right=right):
            return _has_floor(left) or _has_floor(right)
    return False


class _Script:
    """The parts of the text."""

    def __init__(self, program: Program, name: str) -> None:
        self._program = program
        self._name = name
        self._names = respelt(names_of(program), WORDS | _OWN | {name})
        self._body = explicit(program)

    def text(self, notes: Sequence[str]) -> str:
        """Return the whole text."""
        floor = [_FLOOR] if any(_has_floor(a.value) for a in self._body) else []
        parts = [*floor, *("\n".join([*part, ""]) for part in (self._settings(), self._initial(), self._scan(), self._run()))]
        name = self._name
        return "\n".join(
            [
                *self._head(notes),
                "",
                f"const {name} = (() => {{",
                *parts,
                "  return { settings, initial, scan, run };",
                "})();",
                "",
                f'if (typeof module === "object") module.exports = {name};',
                f"else globalThis.{name} = {name};",
                "",
            ]
        )

    def _head(self, notes: Sequence[str]) -> list[str]:
        inputs = ", ".join(self._inputs)
        told = [_comment(x) for x in (self._program.title, "", *notes, *([""] if notes else []))]
        about = _ABOUT.format(name=self._name, inputs=inputs).splitlines()
        return [f"// {line}".rstrip() for line in ("A PID controller, scan by scan; printed by pidemu.", *told, *about)]

    @property
    def _inputs(self) -> list[str]:
        return [self._names[q.name] for q in self._program.inputs]

    def _precision(self, name: str) -> Precision:
        return "float64" if self._program.is_wide(name) else "float32"

    def _settings(self) -> list[str]:
        values = zip(self._program.coefficients, self._program.values, strict=True)
        members = [
            _said(f"    {self._names[q.name]}: {literal(x, self._precision(q.name))},", _with_unit(q), _MEMBER) for q, x in values
        ]
        return ["  const settings = {", *members, "  };"]

    def _initial(self) -> list[str]:
        program = self._program
        values = zip(program.states, program.initial, strict=True)
        members = [
            _said(f"    {self._names[q.name]}: {literal(x, self._precision(q.name))},", _with_unit(q), _MEMBER) for q, x in values
        ]
        for line, length in zip(program.lines, program.lengths, strict=True):
            members.append(_said(f"    {self._line(line)}: new Array({length}).fill(0.0),", _with_unit(line), _MEMBER))
        return ["  // the state before the first scan", "  const initial = () => ({", *members, "  });"]

    def _line(self, line: Line) -> str:
        return f"{self._names[line.name]}_line"

    def _scan(self) -> list[str]:
        program = self._program
        arguments = [
            f"{self._names[q.name]} = {_ABSENT[q.name]}" if q.name in _ABSENT else self._names[q.name] for q in program.inputs
        ]
        inputs = [f"  //   {self._names[q.name]:<12} {_comment(_with_unit(q))}".rstrip() for q in program.inputs]
        head = ", ".join(["state", *arguments, "constants = settings"])
        recorded = [self._names[n] for n in program.recorded]
        return [
            "  // one scan: changes the state, returns the output",
            *inputs,
            f"  function scan({head}) {{",
            *(f"    {line}" for line in self._statements()),
            f"    return {', '.join(recorded)};" if len(recorded) == 1 else f"    return [{', '.join(recorded)}];",
            "  }",
        ]

    def _statements(self) -> Iterator[str]:
        program, names = self._program, self._names
        used = {n for a in program.body for n in names_in(a.value)} | {*program.recorded, *(line.source for line in program.lines)}
        assigned = {a.name for a in program.body}
        for word in ("const", "let"):
            some = [names[q.name] for q in program.coefficients if q.name in used and (q.name in assigned) == (word == "let")]
            if some:
                yield f"{word} {{ {', '.join(some)} }} = constants;"
        if program.states:
            yield f"let {{ {', '.join(names[q.name] for q in program.states)} }} = state;"
        yield from (f"{names[q.name]} = Math.fround({names[q.name]});" for q in program.inputs if not program.is_wide(q.name))
        for line in program.lines:
            yield _said(f"const {names[line.name]} = state.{self._line(line)}.shift();", line.text, _COMMENT - 4)
        yield from self._assignments()
        yield from (f"state.{self._line(line)}.push({names[line.source]});" for line in program.lines)
        yield from (f"state.{names[q.name]} = {names[q.name]};" for q in program.states if q.name in assigned)

    def _assignments(self) -> Iterator[str]:
        writer = ScriptWriter(self._program, self._names)
        times = [a.name for a in self._body]
        there = {q.name for q in (*self._program.states, *self._program.inputs, *self._program.coefficients)}
        for assign in self._body:
            word = "" if assign.name in there else "let " if times.count(assign.name) > 1 else "const "
            there.add(assign.name)
            code = f"{word}{self._names[assign.name]} = {writer.text(assign.value)};"
            yield _said(code, f"{assign.text} [{assign.unit}]", _COMMENT - 4)

    def _run(self) -> list[str]:
        names = [q.name for q in self._program.inputs]
        spelt = self._inputs
        samples = [f"{q}?.[i]" if name in _ABSENT else f"{q}[i]" for name, q in zip(names, spelt, strict=True)]
        arguments = ["state", f"{{ {', '.join(spelt)} }}", f"n = {spelt[0]}.length"] if spelt else ["state", "n"]
        return [
            "  // one scan per sample of the signals: changes the state, returns the outputs",
            f"  function run({', '.join([*arguments, 'constants = settings'])}) {{",
            "    const outputs = [];",
            f"    for (let i = 0; i < n; i++) outputs.push(scan({', '.join(['state', *samples, 'constants'])}));",
            "    return outputs;",
            "  }",
        ]
