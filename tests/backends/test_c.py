"""C printed of every card, compiled without a warning, gives the bits of plain Python."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends import python
from pidemu.backends.c import header, single, source
from pidemu.card.library import card_files
from pidemu.errors import EngineError
from pidemu.program.builder import build
from pidemu.program.ir import Assign, Binary, Expr, Floor, Line, Name, Number, Operator, Program, Quantity, Select, select
from tests.algorithms import EXTERNAL_RESET, algorithm
from tests.backends.c_compiler import CPP, FLAGS, WARNINGS, Loop, compiled, needs_compiler, needs_cpp, refused
from tests.helpers import Floats

pytestmark = needs_compiler
_EXAMPLES = [(i, e.given) for i in card_files() for e in pidemu.load_card(i).data.examples]
_SCANS = 240


def program_of(card_id: str, given: Mapping[str, str | float]) -> Program:
    return pidemu.Controller(pidemu.load_card(card_id).settings(given)).program


@dataclass(frozen=True)
class Record:
    """Signals for any program: a rough general part, and a part in automatic."""

    general: dict[str, Floats]
    automatic: dict[str, Floats]


def record(seed: int, rough: bool = True) -> Record:
    """Setpoint steps, saturation, manual with and without an output set, other modes, and signals that are no numbers."""
    rng = np.random.default_rng(seed)

    def spells(low: float, high: float) -> Floats:
        return np.repeat(rng.uniform(low, high, _SCANS // 20), 20)

    def sometimes(x: Floats) -> Floats:
        return np.where(rng.random(_SCANS) < 0.5, x, math.nan)

    general = {
        "sp": spells(-40, 140),
        "pv": 50 + rng.normal(0, 40, _SCANS),
        "auto": np.repeat(rng.integers(0, 2, _SCANS // 10), 10).astype(float),
        "manual": sometimes(spells(-20, 120)),
        "cascade": sometimes(spells(0, 100)),
        "track": np.where(np.arange(_SCANS) // 15 % 4 == 3, spells(0, 100), math.nan),
        "reset": sometimes(spells(0, 100)),
        "feedforward": spells(-5, 5),
    }
    if rough:
        general["pv"][rng.integers(_SCANS // 2, _SCANS, 3)] = math.nan, math.inf, -math.inf
        general["sp"][rng.integers(_SCANS // 2, _SCANS, 2)] = math.nan, 1e308
    return Record(general, {**general, "sp": spells(-40, 140), "pv": 50 + rng.normal(0, 40, _SCANS), "reset": spells(0, 100)})


def same(expected: Floats, found: Floats) -> bool:
    return np.array_equal(expected, found, equal_nan=True)


def beginning(program: Program) -> list[Any]:
    return [*python.starting(program), *(deque([0.0] * length) for length in program.lengths)]


def by_python(program: Program, signals: Mapping[str, Floats]) -> Floats:
    run = python.runner(program).run
    with np.errstate(all="ignore"):
        return run(beginning(program), [signals[q.name] for q in program.inputs], len(next(iter(signals.values()))))


def check(program: Program, loop: Loop, seed: int) -> None:
    """Compare with Python: a rough record, then from the start one scan in automatic, then the function for automatic scans."""
    made, reference = record(seed), python.runner(program)
    general = [made.general[q.name] for q in program.inputs]
    assert same(by_python(program, made.general), loop.run(general))
    general_run, automatic_run = reference.run, reference.run_automatic
    state, again = beginning(program), Loop(loop._library, loop._name, program)
    first = [np.array([1.0]) if q.name == "auto" else made.automatic[q.name][:1] for q in program.inputs]
    rest = [made.automatic[name] for name in reference.read_in_automatic]
    with np.errstate(all="ignore"):
        expected = [general_run(state, first, 1), automatic_run(state, rest, _SCANS)]
    found = [again.run(first), again.run(rest, "run_automatic", reference.read_in_automatic)]
    assert all(same(x, y) for x, y in zip(expected, found, strict=True))
    assert np.isfinite(expected[1]).all()


def printed(programs: Mapping[str, Program]) -> str:
    return "\n".join(single(program, name) for name, program in programs.items())


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """All examples of all cards in one library."""
    programs = {f"c{k}": program_of(*example) for k, example in enumerate(_EXAMPLES)}
    return compiled(tmp_path_factory.mktemp("c"), printed(programs), "-O2")


@pytest.mark.parametrize("k", range(len(_EXAMPLES)), ids=lambda k: f"{_EXAMPLES[k][0]}-{k}")
def test_printed_c_gives_the_outputs_of_python(library: ctypes.CDLL, k: int) -> None:
    program = program_of(*_EXAMPLES[k])
    check(program, Loop(library, f"c{k}", program), k)


def test_so_it_does_with_every_optimisation(tmp_path: Path) -> None:
    programs = {f"c{k}": program_of(*_EXAMPLES[k]) for k in range(0, len(_EXAMPLES), 9)}
    optimised = compiled(tmp_path, printed(programs), "-O3")
    for k, (name, program) in enumerate(programs.items()):
        check(program, Loop(optimised, name, program), k)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_all_signals_that_a_program_can_read_are_arguments(tmp_path: Path, precision: Any) -> None:
    a = algorithm(kp=2.0, ki=0.1, kd=1.0, Tf=0.5, windup=EXTERNAL_RESET, arithmetic__type=precision)
    program = build(a, 0.5, signals=("cascade", "track", "reset", "feedforward"))
    assert len(program.inputs) == 8
    check(program, Loop(compiled(tmp_path, single(program, "pid")), "pid", program), 1)


def test_float64_programs_have_no_conversions_to_warn_of(tmp_path: Path) -> None:
    programs = [program_of(*example) for example in _EXAMPLES[::4]]
    text = printed({f"c{k}": p for k, p in enumerate(programs) if p.precision == "float64"})
    compiled(tmp_path, text, "-O0", "-Wconversion", "-Wdouble-promotion", "-Wshadow")


@needs_cpp
def test_printed_c_is_cpp_as_well(tmp_path: Path) -> None:
    (tmp_path / "all.cpp").write_text(printed({f"c{k}": program_of(*x) for k, x in enumerate(_EXAMPLES)}), encoding="utf-8")
    assert refused("-std=c++11", "-fsyntax-only", *WARNINGS, str(tmp_path / "all.cpp"), compiler=CPP) == ""


# --- programs made up: delay lines, names of C, precedence, numbers ----------------------------------------------------------


def quantities(*names: str) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, f"what {name} is", "%") for name in names)


def delaying() -> Program:
    """Two delay lines, and all values recorded: an input, the output, a local name, a state and what leaves a line."""
    u, late, later, total = (Name(n) for n in ("u", "late", "later", "total"))
    return Program(
        "two lines", quantities("x"), quantities("k"), (0.5,), quantities("total"), (1.0,),
        (Assign("u", Name("x") * Name("k") + late, "sum"), Assign("total", total + u + later, "total")),
        lines=(Line("late", "one scan ago", "%", "u"), Line("later", "three scans ago", "%", "x")), lengths=(1, 3),
        also=("x", "total", "later"),
    )  # fmt: skip


def test_delay_lines_and_all_recorded_names_are_in_the_printed_c(tmp_path: Path) -> None:
    program = delaying()
    library = compiled(tmp_path, single(program, "pid"))
    x = np.arange(1.0, 9.0)
    later = np.array([0, 0, 0, 1, 2, 3, 4, 5.0])
    u = np.cumsum(x) / 2
    expected = np.array([u, x, 1 + np.cumsum(u + later), later])
    assert same(expected, Loop(library, "pid", program).run([x]))
    step = Loop(library, "pid", program)
    assert expected.T.tolist() == [list(step.step(value)) for value in x.tolist()]
    parts = Loop(library, "pid", program)
    assert same(expected, np.hstack([parts.run([x[:2]]), parts.run([x[2:]])]))


def test_words_of_c_and_cpp_are_spelt_otherwise(tmp_path: Path) -> None:
    names = ("auto", "double", "class", "n", "n_", "state", "settings", "now", "fixed", "i", "not", "NAN", "automatic")
    body = [Assign(n, Name("register") + Name(n), "") for n in names] + [Assign("u", Name("volatile") - Name("n_"), "")]
    program = Program(
        "words", quantities(*names), quantities("register"), (0.25,), quantities("volatile"), (3.0,),
        (*body, Assign("volatile", Name("auto") + Name("automatic") + Name("not"), "")), also=("n", "i"),
    )  # fmt: skip
    text = single(program, "pid")
    x = {name: np.arange(4.0) + 10 * k for k, name in enumerate(names)}
    kept = np.concatenate([[3.0], (x["auto"] + x["automatic"] + x["not"] + 0.75)[:-1]])
    expected = np.array([kept - (x["n_"] + 0.25), x["n"] + 0.25, x["i"] + 0.25])
    assert same(expected, Loop(compiled(tmp_path, text), "pid", program).run(list(x.values())))
    if CPP is not None:
        (tmp_path / "words.cpp").write_text(text, encoding="utf-8")
        assert refused("-std=c++17", "-fsyntax-only", *WARNINGS, str(tmp_path / "words.cpp"), compiler=CPP) == ""


def expression(rng: np.random.Generator, depth: int) -> Expr:
    """A random expression of a, b and c that divides by nothing that is zero."""
    if depth == 0:
        return Name("abc"[rng.integers(3)]) if rng.random() < 0.7 else Number(float(rng.choice([0.1, -0.3, 2.0, -1e-300, 1e30])))
    one, other = (expression(rng, depth - 1) for _ in range(2))
    kind = rng.integers(8)
    if kind < 3:
        return (one + other, one - other, one * other)[kind]
    if kind == 3:
        return one / (other * other + 1.0)
    if kind == 4:
        return Floor(one)
    return select(condition(rng, depth), one, select(condition(rng, 1), other, expression(rng, 1)))


def condition(rng: np.random.Generator, depth: int) -> Expr:
    """A random condition; see `opposites` for why it does not ask for ``<`` and ``>=`` both."""
    orders: tuple[Operator, Operator] = ("<", ">") if rng.random() < 0.5 else ("<=", ">=")

    def comparison() -> Expr:
        operators: tuple[Operator, ...] = (*orders, "==", "!=")
        return Binary(operators[rng.integers(4)], expression(rng, depth - 1), expression(rng, 0))

    p, q, r = comparison(), comparison(), comparison()
    return (p, p & q, p | q & r, (p | q) & r, p & (q & r), p | (q | r))[rng.integers(6)]


@pytest.mark.parametrize(("precision", "wide_literals"), [("float64", False), ("float32", False), ("float32", True)])
def test_any_expression_means_in_c_what_it_means_in_python(tmp_path: Path, precision: Any, wide_literals: bool) -> None:
    rng = np.random.default_rng(8)
    names = tuple(f"v{k}" for k in range(72))
    program = Program(
        "expressions", quantities("a", "b", "c"), quantities("k"), (1.0,), quantities(*names), (0.0,) * len(names),
        tuple(Assign(name, expression(rng, 1 + k % 3), "") for k, name in enumerate(names)),
        output="v0", also=names[1:], precision=precision, wide_literals=wide_literals,
        wide=frozenset(names[1::3]) if precision == "float32" else frozenset(),
    )  # fmt: skip
    odd = [0.0, -0.0, 1.5, -1.5, math.nan, math.inf, -math.inf, 1e300, 5e-324, 1e-40, 16777217.0]
    signals = {name: np.array([odd[k] for k in rng.integers(len(odd), size=300)]) for name in "abc"}
    for name in "abc":
        signals[name][::2] = rng.normal(0, 3, 150)
    expected = by_python(program, signals)
    assert same(expected, Loop(compiled(tmp_path, single(program, "pid")), "pid", program).run(list(signals.values())))
    assert 0.1 < np.isfinite(expected).mean() < 0.95


def opposites(x: Expr) -> bool:
    """Tell whether a condition asks for a comparison and its opposite.

    gcc 12 takes ``a >= b || (c && a < b)`` for ``a >= b || c``, as if there were no NaN.
    """
    against = {"<": ">=", ">=": "<", ">": "<=", "<=": ">"}
    swapped = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}

    def orders(x: Expr) -> set[tuple[str, Expr, Expr]]:
        match x:
            case Binary(operator="and" | "or", left=left, right=right):
                return orders(left) | orders(right)
            case Binary(operator=operator, left=left, right=right) if operator in against:
                return {(operator, left, right), (swapped[operator], right, left)}
        return set()

    found = orders(x)
    return any((against[operator], left, right) in found for operator, left, right in found)


def conditions(x: Expr) -> Iterator[Expr]:
    match x:
        case Select(condition=condition, yes=yes, no=no):
            yield condition
            for part in (condition, yes, no):
                yield from conditions(part)
        case Binary(left=left, right=right):
            yield from conditions(left)
            yield from conditions(right)
        case Floor(operand=operand):
            yield from conditions(operand)


def test_no_program_has_a_condition_that_a_compiler_is_known_to_get_wrong() -> None:
    a, b, c = (Name(n) for n in "abc")
    assert opposites((a >= b) | (c > b) & (b > a))
    assert not opposites((a > b) & (c > 0.0) | (a < b) & (c < 0.0))
    asked = [x for example in _EXAMPLES for assign in program_of(*example).body for x in conditions(assign.value)]
    assert len(asked) > len(_EXAMPLES)
    assert not any(map(opposites, asked))


@pytest.mark.parametrize(("precision", "kind"), [("float64", ctypes.c_double), ("float32", ctypes.c_float)])
def test_numbers_are_read_back_exactly(tmp_path: Path, precision: Any, kind: type[Any]) -> None:
    values = (0.1, -1 / 3, 1e-300, -1e300, 5e-324, 1e-45, 3.4e38, 1e16, 7.0, -0.0, math.inf, -math.inf, math.nan)
    names = tuple(f"k{i}" for i in range(len(values)))
    program = Program(
        "numbers", quantities("x"), quantities(*names), values, (), (), (Assign("u", Name("x"), ""),), precision=precision
    )
    library = compiled(tmp_path, single(program, "pid"))
    with np.errstate(over="ignore"):
        expected = np.array(values).astype(precision)
    found = np.array(list((kind * len(values)).in_dll(library, "pid_default")), dtype=precision)
    assert expected.tobytes()[: -expected.itemsize] == found.tobytes()[: -found.itemsize]
    assert np.isnan(found[-1])


# --- what the text says ---------------------------------------------------------------------------------------------------------


def test_every_assignment_and_quantity_is_explained() -> None:
    program = program_of("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.5})
    lines = source(program, "pid").splitlines()
    for assign in program.body:
        assert any(f" {assign.name} = " in line and line.endswith(f"/* {assign.text} [{assign.unit}] */") for line in lines)
    for q in (*program.coefficients, *program.states):
        assert any(
            line.split() == f"double {q.name}; /* {q.text} [{q.unit}] */".split() for line in header(program, "pid").splitlines()
        )


def test_the_top_names_the_controller_and_says_how_to_build_it() -> None:
    program = program_of("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.5})
    for text in (header(program, "pid"), source(program, "pid"), single(program, "pid")):
        top = text[: text.index("*/")]
        assert program.title in " ".join(top.replace("*", " ").split())
        assert "-ffp-contract=off" in top
        assert "manual" in top


def test_no_title_ends_the_comment_it_is_in(tmp_path: Path) -> None:
    program = replace(delaying(), title="K*/ int x; /* K")
    compiled(tmp_path, single(program, "pid"), "-O0")


@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only"])
def test_a_build_that_would_take_nan_for_a_number_stops(tmp_path: Path, flag: str) -> None:
    (tmp_path / "pid.c").write_text(single(delaying(), "pid"), encoding="utf-8")
    assert "NaN means that a signal is not there" in refused(*FLAGS, flag, "-fsyntax-only", str(tmp_path / "pid.c"))


@pytest.mark.parametrize("name", ["2nd", "a b", "a-b", "a__b", "_a", "a_", "", "größe", "int", "class", "auto"])
def test_a_name_that_is_none_in_c_is_refused(name: str) -> None:
    for printer in (header, source, single):
        with pytest.raises(EngineError, match=f"^'{name}' is "):
            printer(delaying(), name)
