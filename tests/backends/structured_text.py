"""A small evaluator of Structured Text, written for the tests: it reads what is printed and nothing else.

Types are held apart: REAL and LREAL do not mix, a number takes the type of what it stands beside, a condition is a BOOL.
Names are case-blind. `implicit` is for Rockwell, where an assignment converts and types mix.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

Value = Any
Scope = dict[str, Value]
Evaluate = Callable[[Scope], Value]
Execute = Callable[[Scope], None]

_TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<token>:=|<>|<=|>=|\.\.|\d+\.\d+(?:E-?\d+)?|\d+|[A-Za-z](?:_?[A-Za-z0-9])*|[-+*/=<>()\[\],;:.#\"])",
    re.DOTALL,
)
_KINDS: dict[str, Callable[[Value], Value]] = {
    "lreal": float, "real": np.float32, "bool": bool, "int": int, "lint": int,
}  # fmt: skip


class Literal(float):
    """A number of the text, which has no type of its own."""


class TextError(Exception):
    """What is read is not Structured Text, or its types do not fit."""


def tokens_of(text: str) -> list[str]:
    """Split a text; comments do not nest."""
    found, at = [], 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise TextError(f"cannot read {text[at : at + 30]!r}")
        if match["token"]:
            found.append(match["token"])
        at = match.end()
    return found


def kind_of(value: Value) -> str:
    if isinstance(value, Literal):
        return "literal"
    return {bool: "bool", int: "int", float: "lreal", np.float32: "real"}[type(value)]


def alike(a: Value, b: Value) -> tuple[Value, Value]:
    """Give a number of the text the type of the other operand; refuse two types."""
    kinds = kind_of(a), kind_of(b)
    if kinds[0] == kinds[1]:
        return a, b
    if "literal" in kinds and "bool" not in kinds:
        return (type(b)(a), b) if kinds[0] == "literal" else (a, type(a)(b))
    raise TextError(f"{kinds[0]} and {kinds[1]} do not mix")


def mixed(a: Value, b: Value) -> tuple[Value, Value]:
    """Rockwell: what is computed with a real number is real."""
    return alike(*((x if isinstance(x, float | np.float32) else float(x)) for x in (a, b))) if kind_of(a) != kind_of(b) else (a, b)


class Instance:
    """A function block or program with its variables."""

    def __init__(self, unit: Unit, units: dict[str, Unit]) -> None:
        self.unit = unit
        self.scope: Scope = {}
        for name, (kind, initial, length) in unit.variables.items():
            if kind in units:
                self.scope[name] = Instance(units[kind], units)
            elif length:
                self.scope[name] = [_KINDS[kind](x) for x in (initial or [0.0] * length)]
            else:
                self.scope[name] = _KINDS[kind](initial)

    def __call__(self, **inputs: Value) -> None:
        """Do one call."""
        for name, value in inputs.items():
            if self.unit.sections[name.casefold()] != "var_input":
                raise TextError(f"{name} is no input")
            self.scope[name.casefold()] = _KINDS[self.unit.variables[name.casefold()][0]](value)
        with np.errstate(all="ignore"):
            for statement in self.unit.statements:
                statement(self.scope)

    def __getitem__(self, name: str) -> Value:
        return self.scope[name.casefold()]


class Unit:
    """A function block or program as it was read."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.variables: dict[str, tuple[str, Any, int]] = {}
        self.sections: dict[str, str] = {}
        self.statements: list[Execute] = []


class Parser:
    """Reads units; recursive descent."""

    def __init__(self, text: str, *, implicit: bool = False) -> None:
        self.tokens = [t for t in tokens_of(text) if t not in ('"', "#")]
        self.at = 0
        self.implicit = implicit
        self.unit = Unit("")

    def peek(self) -> str:
        return self.tokens[self.at].casefold() if self.at < len(self.tokens) else ""

    def take(self, *expected: str) -> str:
        token = self.peek()
        if not token or (expected and token not in expected):
            raise TextError(f"{token!r} instead of {expected} after {' '.join(self.tokens[max(0, self.at - 8) : self.at])}")
        self.at += 1
        return token

    def accept(self, token: str) -> bool:
        self.at += (same := self.peek() == token)
        return same

    def units(self) -> dict[str, Unit]:
        found = {}
        while self.peek():
            kind = self.take("function_block", "program")
            self.unit = Unit(self.take())
            if self.accept("version"):
                self.take(":"), self.take()
            while self.peek().startswith("var"):
                self._section()
            self.accept("begin")
            self.unit.statements = self._statements(f"end_{kind}")
            self.take(f"end_{kind}")
            found[self.unit.name] = self.unit
        return found

    def _section(self) -> None:
        section = self.take("var", "var_input", "var_output", "var_temp")
        section = "constant" if self.accept("constant") else section
        while not self.accept("end_var"):
            name = self.take()
            self.take(":")
            length = 0
            if self.accept("array"):
                self.take("["), self.take("0"), self.take("..")
                length = int(self.take()) + 1
                self.take("]"), self.take("of")
            kind = self.take()
            initial: Any = 0.0
            if self.accept(":="):
                initial = self._initials() if self.accept("[") else self._initial()
            elif length:
                initial = None
            self.take(";")
            self.declare(name, section, kind, initial, length)

    def declare(self, name: str, section: str, kind: str, initial: Any, length: int) -> None:
        if name in self.unit.variables:
            raise TextError(f"{name} is declared twice")
        self.unit.variables[name], self.unit.sections[name] = (kind, initial, length), section

    def _initials(self) -> list[Any]:
        values = [self._initial()]
        while self.accept(","):
            values.append(self._initial())
        self.take("]")
        return values

    def _initial(self) -> Any:
        sign = -1 if self.accept("-") else 1
        token = self.take()
        return token == "true" if token in ("true", "false") else sign * float(token)

    def _statements(self, *ends: str) -> list[Execute]:
        found = []
        while self.peek() not in ends:
            found.append(self._statement())
        return found

    def _statement(self) -> Execute:
        if self.accept("if"):
            return self._if()
        name = self.take()
        if name not in self.unit.variables:
            raise TextError(f"{name} is not declared")
        if self.accept("("):
            return self._call(name)
        index = self._index() if self.accept("[") else None
        self.take(":=")
        value = self._expression()
        self.take(";")
        return self._assign(name, index, value)

    def _assign(self, name: str, index: Evaluate | None, value: Evaluate) -> Execute:
        kind, section = self.unit.variables[name][0], self.unit.sections[name]
        if section in ("constant", "var_input"):
            raise TextError(f"{name} is assigned")
        fits = {"lreal": ("lreal", "literal"), "real": ("real", "literal"), "bool": ("bool",)}.get(kind, ("int",))
        make, implicit = _KINDS[kind], self.implicit

        def execute(scope: Scope) -> None:
            found = value(scope)
            if kind_of(found) not in fits and not implicit:
                raise TextError(f"{name} is {kind}, and {found!r} is {kind_of(found)}")
            found = round(found) if implicit and kind == "lint" and isinstance(found, float) else make(found)
            if index is None:
                scope[name] = found
            else:
                scope[name][index(scope)] = found

        return execute

    def _if(self) -> Execute:
        branches: list[tuple[Evaluate, list[Execute]]] = []
        test = self._expression()
        self.take("then")
        branches.append((test, self._statements("elsif", "else", "end_if")))
        while self.accept("elsif"):
            test = self._expression()
            self.take("then")
            branches.append((test, self._statements("elsif", "else", "end_if")))
        other = self._statements("end_if") if self.accept("else") else []
        self.take("end_if"), self.take(";")

        def execute(scope: Scope) -> None:
            for condition, body in branches:
                if _truth(condition(scope)):
                    chosen = body
                    break
            else:
                chosen = other
            for statement in chosen:
                statement(scope)

        return execute

    def _call(self, name: str) -> Execute:
        arguments: dict[str, Evaluate] = {}
        while not self.accept(")"):
            argument = self.take()
            self.take(":=")
            arguments[argument] = self._expression()
            self.accept(",")
        self.take(";")
        return lambda scope: scope[name](**{a: value(scope) for a, value in arguments.items()})

    def _index(self) -> Evaluate:
        index = self._expression()
        self.take("]")
        return index

    def _expression(self, level: int = 0) -> Evaluate:
        if level == len(_LEVELS):
            return self._unary()
        left = self._expression(level + 1)
        while self.peek() in _LEVELS[level]:
            operation = _LEVELS[level][self.take()]
            left = self._operation(operation, left, self._expression(level + 1), logical=level < 2)
        return left

    def _operation(self, operation: Callable[[Value, Value], Value], left: Evaluate, right: Evaluate, *, logical: bool) -> Evaluate:
        if logical:
            return lambda scope: operation(_truth(left(scope)), _truth(right(scope)))
        fit = mixed if self.implicit else alike

        def evaluate(scope: Scope) -> Value:
            found = operation(*fit(left(scope), right(scope)))
            return bool(found) if isinstance(found, np.bool_) else found

        return evaluate

    def _unary(self) -> Evaluate:
        if self.accept("not"):
            operand = self._unary()
            return lambda scope: not _truth(operand(scope))
        if self.accept("-"):
            operand = self._unary()
            return lambda scope: _negative(operand(scope))
        if self.accept("("):
            inner = self._expression()
            self.take(")")
            return inner
        return self._atom()

    def _atom(self) -> Evaluate:
        token = self.take()
        if token in ("true", "false"):
            return lambda _: token == "true"
        if token[0].isdigit():
            number = Literal(token) if "." in token else int(token)
            return lambda _: number
        if self.accept("("):
            return self._function(token)
        if token not in self.unit.variables:
            raise TextError(f"{token} is not declared")
        if self.accept("["):
            index = self._index()
            return lambda scope: scope[token][index(scope)]
        if self.accept("."):
            member = self.take()
            return lambda scope: scope[token][member]
        return lambda scope: scope[token]

    def _function(self, name: str) -> Evaluate:
        if name == "expt":
            return self._power()
        operand = self._expression()
        self.take(")")
        function, kind = _FUNCTIONS[name]

        def evaluate(scope: Scope) -> Value:
            found = operand(scope)
            if kind and kind_of(found) not in (kind, "literal"):
                raise TextError(f"{name} of {kind_of(found)}")
            return function(found)

        return evaluate

    def _power(self) -> Evaluate:
        base = self._expression()
        self.take(",")
        exponent = self._expression()
        self.take(")")
        return lambda scope: float(base(scope)) ** float(exponent(scope))


def _truth(x: Value) -> bool:
    if not isinstance(x, bool):
        raise TextError(f"{x!r} is not a BOOL")
    return x


def _negative(x: Value) -> Value:
    return Literal(-x) if isinstance(x, Literal) else -x


def _quotient(a: Value, b: Value) -> Value:
    """IEEE 754 division."""
    if isinstance(a, float) and b == 0:
        return float(np.float64(a) / np.float64(b))
    return a / b


_LEVELS: tuple[dict[str, Callable[[Value, Value], Value]], ...] = (
    {"or": lambda a, b: a or b},
    {"and": lambda a, b: a and b},
    {"=": lambda a, b: a == b, "<>": lambda a, b: a != b},
    {"<": lambda a, b: a < b, ">": lambda a, b: a > b, "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b},
    {"+": lambda a, b: a + b, "-": lambda a, b: a - b},
    {"*": lambda a, b: a * b, "/": _quotient},
)
_FUNCTIONS: dict[str, tuple[Callable[[Value], Value], str]] = {
    "abs": (abs, ""),
    "lreal_to_real": (np.float32, "lreal"),
    "real_to_lreal": (float, "real"),
    "lreal_to_lint": (round, "lreal"),
    "lint_to_lreal": (float, "int"),
}


def read(text: str) -> dict[str, Instance]:
    """Return instances of what a text in IEC or SCL declares, by name in small letters."""
    units = Parser(text).units()
    return {name: Instance(unit, units) for name, unit in units.items()}


def read_rockwell(text: str) -> Instance:
    """Return an Add-On Instruction: its tags from the table of the comment, its logic from the rest."""
    parser = Parser(text, implicit=True)
    rows = text[text.index("  Name  ") : text.index("*)")].splitlines()[1:]
    for row in rows:
        name, usage, kind, initial = re.split(r"  +", row.strip())[:4]
        what, _, length = kind.rstrip("]").partition("[")
        section = {"Input": "var_input", "Output": "var_output"}.get(usage, "var")
        value = initial == "1" if kind == "BOOL" else float(initial)
        parser.declare(name.casefold(), section, what.casefold(), None if length else value, int(length or 0))
    parser.unit.statements = parser._statements("")
    return Instance(parser.unit, {})


def is_there(x: float) -> bool:
    """Whether a signal is there."""
    return not math.isnan(x)
