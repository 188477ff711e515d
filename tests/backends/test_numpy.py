"""Loops run side by side with NumPy give the bits that each gives alone in plain Python."""

from __future__ import annotations

import math
import tracemalloc
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends import numpy as target
from pidemu.backends import python
from pidemu.checks.runs import plausible
from pidemu.program.blocks import flushed, limited
from pidemu.program.builder import build
from pidemu.program.ir import Assign, Binary, Expr, Floor, Line, Name, Number, Program, Quantity, select
from pidemu.program.specialise import specialise
from pidemu.simulation.closed import closed_loop
from tests.algorithms import EXTERNAL_RESET, algorithm
from tests.helpers import Floats

_LOOPS = 7
_SCANS = 90


def same(expected: Floats, found: Floats) -> bool:
    """Tell whether all numbers are equal, zeros with their sign; NaN is equal to NaN."""
    signs = np.signbit(expected) == np.signbit(found)
    return np.array_equal(expected, found, equal_nan=True) and bool((signs | np.isnan(expected)).all())


def programs_like(program: Program, loops: int = _LOOPS) -> list[Program]:
    """Programs of the same structure with other coefficients; one of them, the last, they all have in common."""
    return [
        replace(program, values=(*(x * (1 + 0.01 * i) for x in program.values[:-1]), *program.values[-1:])) for i in range(loops)
    ]


def record(program: Program, seed: int) -> Floats:
    """Setpoint steps into saturation, manual with and without an output set, other modes, and signals that are no numbers."""
    rng = np.random.default_rng(seed)

    def steps(low: float, high: float) -> Floats:
        return np.repeat(rng.uniform(low, high, _SCANS // 10), 10)

    def sometimes(x: Floats) -> Floats:
        return np.where(rng.random(_SCANS) < 0.5, x, math.nan)

    signals = {
        "sp": steps(-40, 140),
        "pv": 50 + np.cumsum(rng.normal(0, 8, _SCANS)),
        "auto": np.repeat(rng.integers(0, 3, _SCANS // 5) > 0, 5).astype(float),
        "manual": sometimes(steps(-20, 120)),
        "cascade": sometimes(steps(0, 100)),
        "track": np.where(np.arange(_SCANS) // 10 % 4 == 3, steps(0, 100), math.nan),
        "reset": sometimes(steps(0, 100)),
        "feedforward": steps(-5, 5),
        "load": steps(-5, 5),
    }
    if seed % 3 == 1:
        signals["pv"][[60, 70, 80]] = math.nan, math.inf, -math.inf
    if seed % 3 == 2:
        signals["sp"][75:77] = 1e308, -1e308
    return np.array([signals[q.name] for q in program.inputs])


def one_by_one(programs: Sequence[Program], signals: Floats, starts: Sequence[Floats] | None = None) -> tuple[Floats, Floats]:
    """Run loop after loop in plain Python; return records of shape (recorded names, scans, loops), and states."""
    records, states = [], []
    for i, program in enumerate(programs):
        begun = python.starting(program) if starts is None else starts[i].tolist()
        state = [python.in_precision(program, q.name, x) for q, x in zip(program.states, begun, strict=True)]
        empty = [python.in_precision(program, line.name, 0.0) for line in program.lines]
        state += [deque([zero] * length) for zero, length in zip(empty, program.lengths, strict=True)]  # type: ignore[misc]  # as in Python
        with np.errstate(all="ignore"):
            found = python.compiled(program).run(state, *signals[:, :, i].tolist())
        records.append(found if program.also else [found])
        states.append(state[: len(program.states)])
    return np.moveaxis(np.array(records, dtype=float), 0, 2), np.array(states, dtype=float).T


class Together:
    """A block of loops, at its start."""

    def __init__(self, programs: Sequence[Program], states: Floats | None = None) -> None:
        self.structure = programs[0].structure
        self.values = np.array([p.values for p in programs]).T
        self.states = np.array([p.initial for p in programs]).T if states is None else states.copy()
        self.lengths = np.array([p.lengths for p in programs], dtype=np.int64).T
        self.rings = np.zeros((len(self.lengths), 1 + self.lengths.max(initial=0), len(programs)))
        self.at = 0

    def run(self, signals: Floats) -> Floats:
        scans = signals.shape[1]
        records = np.full((len(self.structure.recorded), scans, signals.shape[2]), math.pi)
        run = target.block(self.structure)
        run(self.values, self.states, signals, self.rings, self.lengths, self.at, records)
        self.at += scans
        return records


def check(programs: Sequence[Program], signals: Floats, starts: Floats | None = None) -> Floats:
    """Compare a block, in one run and in two, with loop after loop in Python; return the states."""
    records, states = one_by_one(programs, signals, None if starts is None else list(starts.T))
    whole, halves = Together(programs, starts), Together(programs, starts)
    assert same(records, whole.run(signals))
    assert same(states, whole.states)
    split = 2 * signals.shape[1] // 5
    assert same(records, np.concatenate([halves.run(signals[:, :split]), halves.run(signals[:, split:])], axis=1))
    assert same(states, halves.states)
    return states


def check_both(program: Program, loops: int = _LOOPS) -> None:
    """Compare the program; then, from one scan in automatic on, the one for scans in automatic."""
    programs = programs_like(program, loops)
    signals = np.stack([record(program, seed) for seed in range(loops)], axis=2)
    check(programs, signals)
    names = [q.name for q in program.inputs]
    first = signals[:, :1].copy()
    first[names.index("auto")] = 1.0
    if "track" in names:
        first[names.index("track")] = math.nan
    _, begun = one_by_one(programs, first)
    automatic = [specialise(p) for p in programs]
    check(automatic, np.stack([record(automatic[0], seed) for seed in range(loops)], axis=2), begun)


@pytest.mark.parametrize("card_id", pidemu.cards())
def test_every_card_gives_the_bits_of_plain_python(card_id: str) -> None:
    check_both(pidemu.Controller(plausible(pidemu.load_card(card_id).variant({}))).program)


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_cascade_tracking_external_reset_and_feedforward_give_the_bits_of_plain_python(precision: Any) -> None:
    a = algorithm(kp=1.3, ki=0.2, kd=0.5, b=0.4, Tf=0.3, windup=EXTERNAL_RESET, arithmetic__type=precision)
    check_both(build(a, 0.1, signals=("cascade", "track", "reset", "feedforward")))


@pytest.mark.parametrize("loops", [1, 2, 64])
def test_any_number_of_loops_makes_a_block(loops: int) -> None:
    check_both(pidemu.Controller(pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=1, Tf=0.2)).program, loops)


@pytest.mark.parametrize("card_id", ["generic/standard", "arduino/pid"])
@pytest.mark.parametrize("delay", [0.0, 1.03])
def test_closed_loops_with_different_dead_times_give_the_bits_of_plain_python(card_id: str, delay: float) -> None:
    controller = specialise(pidemu.Controller(plausible(pidemu.load_card(card_id).variant({})), scan=0.1).program)
    programs = []
    for i in range(_LOOPS):
        process = pidemu.Process.from_lags(1.0 + i / 10, lags=[1.0, 0.3], delay=delay * (1 + i))
        programs.append(closed_loop(controller, process.sampled(0.1), (50.0, 40.0 + i)))
    names = [q.name for q in controller.states]
    starts = np.array([p.initial for p in programs]).T
    starts[[names.index(n) for n in ("u", "I") if n in names]] = 45.0
    sp, load = np.random.default_rng(1).uniform((40, -5), (60, 5), (_SCANS, _LOOPS, 2)).transpose(2, 0, 1)
    check(programs, np.array([sp, load]), starts)


def made_by_hand(
    body: Sequence[tuple[str, Expr]],
    states: str = "",
    lines: Sequence[tuple[str, str, int]] = (),
    also: tuple[str, ...] = (),
    initial: float = 0.0,
) -> Program:
    """A program that reads sp, pv and has the coefficients k and low."""
    return Program(
        title="made by hand",
        inputs=(Quantity("sp", "", "%"), Quantity("pv", "", "%")),
        coefficients=(Quantity("k", "", "-"), Quantity("low", "", "%")),
        values=(0.7, -20.0),
        states=tuple(Quantity(name, "", "%") for name in states.split()),
        initial=(initial,) * len(states.split()),
        body=tuple(Assign(name, value, "") for name, value in body),
        lines=tuple(Line(name, "", "%", source) for name, source, _ in lines),
        lengths=tuple(length for *_, length in lines),
        also=also,
    )


sp, pv, k, low, r, s, t, u, late = (Name(name) for name in ("sp", "pv", "k", "low", "r", "s", "t", "u", "late"))
_HAZARDS = {
    "states are shifted": made_by_hand([("r", t), ("t", s), ("s", pv), ("u", r + s)], "r s t"),
    "states are exchanged": made_by_hand([("a", s), ("s", t), ("t", Name("a")), ("s", s + k), ("u", s - t)], "s t"),
    "states only change places": made_by_hand([("a", s), ("s", t), ("t", Name("a")), ("u", s * pv)], "s t", initial=0.25),
    "one value ends in three states": made_by_hand([("u", sp * k), ("s", u + s), ("t", s), ("r", s)], "r s t u"),
    "one old value ends in two states": made_by_hand([("r", s), ("t", s), ("s", s + pv), ("u", r - k)], "r s t u"),
    "a state is the condition of its own select": made_by_hand([("s", select(s > pv, pv, s)), ("u", s + 0.0)], "s u"),
    "a state is kept where a condition holds": made_by_hand([("s", select(pv > 40.0, s, sp)), ("u", s * k)], "s"),
    "both sides of a select are the state": made_by_hand([("s", select(pv > sp, s + k, s - k)), ("u", limited(s, low, k))], "s"),
    "an input is recorded": made_by_hand([("u", select(sp > pv, k, low))], "u", also=("sp", "k", "pv")),
    "a value is recorded twice": made_by_hand([("u", flushed(sp * k)), ("v", u)], "u", also=("v",)),
    "a truth value is recorded, kept and used": made_by_hand(
        [("b", (sp > pv) & (pv > low)), ("s", Name("b")), ("u", select(Name("b"), 1.0, select(s, sp, pv)) * k)], "s", also=("b",)
    ),
    "truth values are added": made_by_hand(
        [("s", select((sp > pv) | (s > 3.0), 1.0, 0.0) + select(sp > pv, 0.0, 1.0)), ("u", s)], "s"
    ),
    "zeros have signs": made_by_hand([("s", select(pv > sp, -0.0, 0.0)), ("u", limited(s, low * 0.0, k * 0.0))], "s"),
    "a state never changes": made_by_hand([("u", s + k)], "s t", initial=2.0),
    "what leaves a line is kept for two scans": made_by_hand(
        [("u", sp + k * t), ("t", s), ("s", late)], "s t u", [("late", "u", 3)], ("late",)
    ),
    "what leaves a line enters another": made_by_hand(
        [("u", pv + k * late), ("s", late)], "s u", [("late", "u", 2), ("later", "late", 4)], ("later", "late")
    ),
    "what leaves a line is kept, and what enters it is not recorded": made_by_hand(
        [("v", sp + k * s), ("s", late), ("u", pv - late)], "s u", [("late", "v", 2)]
    ),
    "what enters a line is computed from what leaves it": made_by_hand(
        [("v", select(sp > pv, late * k, sp)), ("u", pv - late)], "u", [("late", "v", 1)]
    ),
    "what enters a line is kept for longer than it is in there": made_by_hand(
        [("u", pv - r + late), ("r", t), ("t", s), ("s", Name("v")), ("v", sp * k)], "r s t v u", [("late", "v", 1)]
    ),
    "the source of a line is an input": made_by_hand([("u", late + s), ("s", late)], "s", [("late", "pv", 1)]),
    "the source of a line is an old state": made_by_hand(
        [("a", s), ("s", late), ("u", pv)], "s", [("late", "u", 1), ("b", "a", 1)]
    ),
}  # fmt: skip


@pytest.mark.parametrize("lengths", ["alike", "different"])
@pytest.mark.parametrize("name", _HAZARDS)
def test_values_are_not_overwritten_while_they_are_needed(name: str, lengths: str) -> None:
    programs = programs_like(_HAZARDS[name])
    if lengths == "different":
        programs = [replace(p, lengths=tuple(n + i for n in p.lengths)) for i, p in enumerate(programs)]
    signals = np.stack([record(programs[0], seed) for seed in range(_LOOPS)], axis=2)
    signals[:, 30:40] = 0.0
    check(programs, signals, np.array([p.initial for p in programs]).T + np.arange(_LOOPS))


def test_a_line_gives_back_what_entered_it_as_many_scans_ago_as_each_loop_has() -> None:
    lengths = (1, 2, 3, 5, 8, 13, 2)
    program = made_by_hand([("u", sp + pv)], lines=[("late", "u", 1)], also=("late",))
    signals = np.random.default_rng(3).uniform(0, 100, (2, 60, len(lengths)))
    loops = Together([replace(program, lengths=(n,)) for n in lengths])
    records = np.concatenate([loops.run(signals[:, :17]), loops.run(signals[:, 17:])], axis=1)
    for i, n in enumerate(lengths):
        total = (signals[0] + signals[1])[:, i]
        assert np.array_equal(records[1, :, i], [*[0.0] * n, *total[:-n]])


def test_the_floor_is_that_of_python_also_of_what_has_none() -> None:
    numbers = [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 2.5, -1e-320, 1e300, -(2.0**52) - 0.5, math.inf, -math.inf, math.nan]
    program = made_by_hand([("u", Floor(sp))])
    found = Together([program] * len(numbers)).run(np.array([[numbers], [numbers]]))
    assert same(np.array([x // 1.0 for x in numbers]), found[0, 0])


def test_a_denormal_number_is_flushed_and_not_a_number_is_not() -> None:
    numbers = [1e-301, -1e-301, 1e-300, -1e-300, 5e-324, -0.0, 1.0, math.inf, math.nan]
    found = Together([made_by_hand([("u", flushed(sp))])] * len(numbers)).run(np.array([[numbers], [numbers]]))
    assert same(np.array([0.0, 0.0, 1e-300, -1e-300, 0.0, 0.0, 1.0, math.inf, math.nan]), found[0, 0])


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 1.0])
def test_a_select_is_right_however_often_its_condition_holds(share: float) -> None:
    rng = np.random.default_rng(2)
    signals = rng.uniform(0, 1, (2, 3, 500))
    condition = Binary("<", pv, Number(share))
    found = Together([made_by_hand([("u", select(condition, sp * k, 0.0 - sp))])] * 500).run(signals)
    assert same(np.where(signals[1] < share, signals[0] * 0.7, 0.0 - signals[0]), found[0])


@pytest.mark.parametrize("wide_literals", [False, True])
def test_every_operation_has_the_precision_of_the_program(wide_literals: bool) -> None:
    body = [
        ("e", (sp - pv) * 0.1), ("s", s + k * Name("e") / 3.0), ("t", select(s > 0.3, s * t, 0.1)),
        ("tenth", Number(0.1)), ("w", (Name("w") - Name("tenth")) + s * 1.1 + late),
        ("u", limited(select(Name("w") > s, Floor(s), t), low, Number(40.0))),
    ]  # fmt: skip
    program = made_by_hand(body, "s t w", [("late", "w", 2)], ("s", "t", "w"))
    narrow = replace(program, precision="float32", wide_literals=wide_literals, wide=frozenset({"w", "late"}))
    programs = programs_like(narrow)
    signals = np.stack([record(narrow, seed) for seed in range(_LOOPS)], axis=2)
    check(programs, signals, np.zeros((3, _LOOPS)))
    records, _ = one_by_one(programs, signals)
    wide, _ = one_by_one([replace(p, precision="float64") for p in programs], signals)
    assert not same(records, wide)


def test_one_loop_over_a_record_gives_the_bits_of_plain_python_and_leaves_its_state() -> None:
    program = made_by_hand([("s", s + k * (sp - late)), ("u", s + pv)], "s", [("late", "u", 4)], ("late",))
    signals = list(record(program, 0))
    states = [[0.5, deque([1.0, 2.0, 3.0, 4.0])] for _ in range(2)]
    runs = [made.runner(program).run for made in (python, target)]
    for part in ([x[:3] for x in signals], [x[3:] for x in signals]):
        expected, found = (run(state, part, part[0].size) for run, state in zip(runs, states, strict=True))
        assert same(expected, found)
        assert states[0] == states[1]


def test_one_loop_in_single_precision_leaves_numbers_of_single_precision() -> None:
    program = build(algorithm(kp=1.3, ki=0.2, kd=0.5, Tf=0.3, arithmetic__type="float32"), 0.1)
    signals = list(record(program, 0))
    ends: list[list[Any]] = []
    for made in (python.runner(program), target.runner(program)):
        state: list[Any] = list(python.starting(program))
        with np.errstate(all="ignore"):
            found = [made.run(state, signals, _SCANS), made.run_automatic(state, signals[:2], _SCANS)]
        assert made.read_in_automatic == ("sp", "pv")
        ends.append([*np.concatenate(found).ravel().tolist(), *state])
    assert ends[0] == ends[1]
    assert {type(x) for x in ends[1][-len(program.states) :]} == {np.float32}


def test_a_program_without_inputs_does_as_many_scans_as_there_are_records() -> None:
    program = replace(made_by_hand([("s", s + k), ("u", s)], "s"), inputs=())
    state: list[float] = [1.0]
    assert same(np.array([[1.0 + 0.7, 1.0 + 0.7 + 0.7]]), target.runner(program).run(state, [], 2))


def test_what_a_run_allocates_does_not_grow_with_its_scans() -> None:
    program = pidemu.Controller(pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=1, Tf=0.2), scan=0.1).program
    closed = closed_loop(specialise(program), pidemu.Process.from_lags(1.0, lags=[2.0], delay=1.0).sampled(0.1), (50.0, 50.0))
    loops = Together([replace(closed, lengths=(5 + i % 6,)) for i in range(100)])
    rng = np.random.default_rng(0)
    peaks = []
    for scans in (20, 20, 2000):
        signals, records = rng.uniform(0, 100, (2, scans, 100)), np.empty((2, scans, 100))
        tracemalloc.start()
        target.block(loops.structure)(loops.values, loops.states, signals, loops.rings, loops.lengths, 0, records)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < peaks[1] + 400  # one row of the loops would be 800 bytes
