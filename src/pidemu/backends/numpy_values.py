"""A scan program as values: what a scan computes, every value once, so that buffers can be given out to them (`numpy_text`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np

from pidemu.program.ir import Binary, Cast, Expr, Floor, Name, Number, Precision, Program, Select
from pidemu.program.precision import explicit

Kind = Literal["float64", "float32", "bool"]
GIVEN: Final = ("number", "input", "coefficient", "start", "late")
"""Values that are there when a scan begins; all others are computed."""
_ARITHMETIC: Final = {"+": "add", "-": "subtract", "*": "multiply", "/": "divide"}
_COMPARISONS: Final = {
    "<": "less", ">": "greater", "<=": "less_equal", ">=": "greater_equal", "==": "equal", "!=": "not_equal",
}  # fmt: skip
_LOGICAL: Final = {"and": "logical_and", "or": "logical_or"}


class ScanValue(NamedTuple):
    """A value of one scan.

    Attributes
    ----------
    what : str
        One of `GIVEN`, a ufunc, ``"select"`` (of condition, yes, no), or ``"copy"``: into a buffer of its own, rounded to its kind.
    of : tuple of int
        The values it is computed from.
    kind : {"float64", "float32", "bool"}
        Its numbers.
    label : str
        Which number, input, coefficient, state or delay line.
    """

    what: str
    of: tuple[int, ...]
    kind: Kind
    label: str = ""


@dataclass(frozen=True, slots=True)
class ScanGraph:
    """What a scan computes.

    Attributes
    ----------
    values : list of ScanValue
        All values; what one is computed from comes before it.
    starts, finals : list of int
        The states' values before and after the scan.
    recorded : list of int
        What is recorded.
    entering : list of int
        What enters the delay lines.
    """

    values: list[ScanValue]
    starts: list[int]
    finals: list[int]
    recorded: list[int]
    entering: list[int]

    def computed(self, value: int) -> bool:
        """Tell whether a value is computed in the scan."""
        return self.values[value].what not in GIVEN


def scan_of(program: Program) -> ScanGraph:
    """Return what one scan of a program computes.

    Parameters
    ----------
    program : Program
        The program.
    """
    v = _Values()
    held: dict[str, int] = {}
    starts = [v.given("start", i, _kind(program, q.name)) for i, q in enumerate(program.states)]
    held.update(zip((q.name for q in program.states), starts, strict=True))
    for i, q in enumerate(program.coefficients):
        held[q.name] = v.given("coefficient", i, _kind(program, q.name))
    for i, q in enumerate(program.inputs):
        held[q.name] = v.cast(v.given("input", i, "float64"), _kind(program, q.name))
    for i, line in enumerate(program.lines):
        held[line.name] = v.cast(v.given("late", i, "float64"), _kind(program, line.name))
    for assign in explicit(program):
        held[assign.name] = v.expression(assign.value, held)
    finals = [v.cast(held[q.name], _kind(program, q.name)) for q in program.states]
    recorded = [v.numeric(held[name]) for name in program.recorded]
    return ScanGraph(v.all, starts, finals, recorded, [v.numeric(held[line.source]) for line in program.lines])


def _kind(program: Program, name: str) -> Precision:
    return "float64" if program.is_wide(name) else "float32"


class _Values:
    """Collects values; one that is there already is not computed again."""

    def __init__(self) -> None:
        self.all: list[ScanValue] = []
        self._place: dict[ScanValue, int] = {}

    def _add(self, what: str, *of: int, kind: Kind, label: str = "") -> int:
        value = ScanValue(what, of, kind, label)
        if value not in self._place:
            self._place[value] = len(self.all)
            self.all.append(value)
        return self._place[value]

    def given(self, what: str, index: int, kind: Kind) -> int:
        return self._add(what, kind=kind, label=str(index))

    def number(self, x: float, kind: Kind) -> int:
        with np.errstate(over="ignore"):
            return self._add("number", kind=kind, label=repr(float(np.float32(x) if kind == "float32" else x)))

    def cast(self, value: int, kind: Precision) -> int:
        """Return a value as one of a kind of numbers; true is 1."""
        old = self.all[value]
        if old.kind == kind:
            return value
        return self.number(float(old.label), kind) if old.what == "number" else self._add("copy", value, kind=kind)

    def numeric(self, value: int) -> int:
        return self.cast(value, "float64") if self.all[value].kind == "bool" else value

    def _truth(self, value: int) -> int:
        kind = self.all[value].kind
        return value if kind == "bool" else self._add("not_equal", value, self.number(0.0, kind), kind="bool")

    def _alike(self, left: int, right: int) -> tuple[int, int, Kind]:
        """Return two numbers in the precision of an operation on them."""
        kinds = {self.all[left].kind, self.all[right].kind}
        if len(kinds) == 1:
            return left, right, kinds.pop()
        return self.cast(left, "float64"), self.cast(right, "float64"), "float64"

    def expression(self, x: Expr, held: dict[str, int]) -> int:
        """Return the value of an expression.

        Parameters
        ----------
        x : Expr
            The expression.
        held : dict
            What its names hold.
        """
        match x:
            case Number(value=number):
                return self.number(number, "float64")
            case Name(id=name):
                return held[name]
            case Cast(operand=Number(value=number), precision=precision):
                return self.number(number, precision)
            case Cast(operand=operand, precision=precision):
                return self.cast(self.expression(operand, held), precision)
            case Floor(operand=operand):
                return self._floor(self.numeric(self.expression(operand, held)))
            case Select(condition=condition, yes=yes, no=no):
                test = self._truth(self.expression(condition, held))
                return self._select(test, self.expression(yes, held), self.expression(no, held))
            case Binary(operator=operator, left=left, right=right):
                return self._binary(operator, self.expression(left, held), self.expression(right, held))
        raise TypeError(f"no NumPy for {type(x).__name__}")

    def _binary(self, operator: str, left: int, right: int) -> int:
        if operator in _LOGICAL:
            return self._logical(_LOGICAL[operator], self._truth(left), self._truth(right))
        one, other, kind = self._alike(self.numeric(left), self.numeric(right))
        if operator in _ARITHMETIC:
            return self._add(_ARITHMETIC[operator], one, other, kind=kind)
        return self._add(_COMPARISONS[operator], one, other, kind="bool")

    def _logical(self, what: str, left: int, right: int) -> int:
        """Return a conjunction or disjunction; ``x > -c and x < c`` is ``|x| < c``, for NaN too, and one operation less."""
        above, below = self.all[left], self.all[right]
        if (what, above.what, below.what) == ("logical_and", "greater", "less") and above.of[0] == below.of[0]:
            low, high = self.all[above.of[1]], self.all[below.of[1]]
            if low.what == high.what == "number" and float(low.label) == -float(high.label):
                size = self._add("absolute", above.of[0], kind=high.kind)
                return self._add("less", size, below.of[1], kind="bool")
        return self._add(what, left, right, kind="bool")

    def _select(self, test: int, yes: int, no: int) -> int:
        one, other, kind = self._alike(self.numeric(yes), self.numeric(no))
        if one == other:
            return one
        assert kind != "bool"
        if (one, other) == (self.number(1.0, kind), self.number(0.0, kind)):
            return self.cast(test, kind)
        return self._add("select", test, one, other, kind=kind)

    def _floor(self, x: int) -> int:
        """Return the floor; ``x - x`` is 0, but NaN where Python's ``x // 1.0`` is NaN, and floor_divide is 20 times slower."""
        kind = self.all[x].kind
        return self._add("subtract", self._add("floor", x, kind=kind), self._add("subtract", x, x, kind=kind), kind=kind)
