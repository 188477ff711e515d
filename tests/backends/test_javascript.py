"""Printed JavaScript gives the bits of plain Python, and stands in a page whatever a card calls things."""

from __future__ import annotations

import math
import re
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.backends.javascript import source
from pidemu.backends.python import compiled, starting
from pidemu.errors import EngineError
from pidemu.program.ir import Assign, Line, Name, Number, Program, Quantity, Select
from tests.backends.node import evaluated, needs_node, play
from tests.backends.records import CARDS, modes, programs_of, record, settings_of
from tests.backends.texts import programs, retold
from tests.helpers import Floats
from tests.hostile import hostile_text

_ODD = [math.nan, math.inf, -math.inf, 1e300, -1e300, 3.5e38, 1e-310, 1e-40, -0.0, 0.5, -0.5, 2.0**53]


def bits(values: object) -> list[str]:
    """Numbers with the sign of zero, and one NaN."""
    return [float(x).hex() for x in np.ravel(np.asarray(values, dtype=float))]


def in_python(program: Program, signals: list[Floats]) -> tuple[list[str], list[str]]:
    state: list[Any] = [*starting(program), *(deque([0.0] * length) for length in program.lengths)]
    with np.errstate(all="ignore"):
        outputs = compiled(program).run(state, *(s.tolist() for s in signals))
    return bits(outputs), bits(state[: len(program.states)])


def in_node(folder: Path, program: Program, signals: list[Floats]) -> tuple[list[str], list[str]]:
    outputs, state = play(folder, source(program, "control"), program, signals)
    return bits(outputs), bits(state)


@needs_node
@pytest.mark.parametrize("card_id", CARDS)
def test_every_card_gives_the_bits_of_python(card_id: str, tmp_path: Path) -> None:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    columns = record(chosen, 1)
    signals = [np.asarray(columns[q.name], dtype=float) for q in program.inputs]
    expected = in_python(program, signals)
    assert len(set(expected[0])) > 10
    assert in_node(tmp_path, program, signals) == expected


@needs_node
@pytest.mark.parametrize("card_id", CARDS)
def test_every_choice_of_options_gives_the_bits_of_python_on_odd_numbers(card_id: str, tmp_path: Path) -> None:
    for seed, program in enumerate(programs_of(card_id)):
        chance = np.random.default_rng(seed)
        signals = modes(program, seed)
        for q, column in zip(program.inputs, signals, strict=True):
            if q.name != "auto":  # what is odd may stay in the states, so the first scans are without
                hit = np.flatnonzero(chance.random(20) < 0.3) + 60
                column[hit] = chance.choice(_ODD, hit.size)
        assert in_node(tmp_path, program, signals) == in_python(program, signals), program.title


@needs_node
def test_a_delay_line_gives_the_bits_of_python(tmp_path: Path) -> None:
    given_ = {"Kp": -1.2, "tau": 30, "theta": 7, "lambda": 20}
    program = pidemu.Controller(pidemu.load_card("generic/dahlin").settings(given_)).program
    chance = np.random.default_rng(3)
    signals = [chance.uniform(30, 70, 200), chance.uniform(30, 70, 200), np.ones(200), np.full(200, math.nan)]
    assert in_node(tmp_path, program, signals) == in_python(program, signals)


def closed_loop() -> Program:
    """A loop with a delay, two names recorded, and a name that is a word of the language."""
    sp, y, u, kp = (Quantity(name, name, "%") for name in ("sp", "y", "u", "kp"))
    body = (
        Assign("function", Select(Name("sp") > 3.0, Number(-0.0), Name("late")), "delayed"),
        Assign("u", Name("kp") * (Name("sp") - Name("function")), "controller"),
        Assign("y", Name("y") + (Name("u") - Name("y")) * 0.1, "process"),
    )
    late = Line("late", "delayed", "%", "y")
    return Program("loop", (sp,), (kp,), (2.0,), (y, u), (0.0, 0.0), body, lines=(late,), lengths=(3,), also=("y",))


@needs_node
def test_a_closed_loop_that_records_several_names_gives_the_bits_of_python(tmp_path: Path) -> None:
    program = closed_loop()
    assert "const function_2 = sp > 3.0 ? -0.0 : late;" in source(program, "control")
    signals = [np.linspace(0, 5, 50)]
    assert in_node(tmp_path, program, signals) == in_python(program, signals)


@needs_node
def test_two_programs_stand_in_one_page_and_read_settings_of_their_own(tmp_path: Path) -> None:
    text = "".join(source(p, f"loop{k}") for k, p in enumerate(programs()))
    page = (
        "let module;"
        + text
        + """
        const one = loop0.initial(), other = loop0.initial();
        const slow = { ...loop0.settings, kp: 0.5 };
        loop0.scan(one, 50, 50); loop0.scan(other, 50, 50, 1, NaN, slow);
        console.log(loop0.scan(one, 60, 50) > loop0.scan(other, 60, 50, 1, NaN, slow), typeof loop1.run, typeof globalThis.loop2);
    """
    )
    assert evaluated(page, tmp_path) == "true function object\n"


@needs_node
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(which=st.integers(0, 2), text=hostile_text, notes=st.lists(hostile_text, max_size=2))
@example(which=0, text="</script><script>", notes=["<!-- */ \u2028 x = 1"])
def test_whatever_the_texts_the_code_is_the_same(tmp_path: Path, which: int, text: str, notes: list[str]) -> None:
    program = programs()[which]
    plain, printed = source(program, "control"), source(retold(program, text), "control", notes)
    printed.encode()
    assert without_comments(printed) == without_comments(plain)
    assert re.search("</|<!", printed) is None
    assert evaluated(f"{printed}; console.log(typeof module.exports.run)", tmp_path) == "function\n"


def without_comments(text: str) -> list[str]:
    """Lines of JavaScript, ended by all that ends one there, without comments and empty lines."""
    lines = (line.partition("//")[0].rstrip() for line in re.split("\r\n|[\n\r\u2028\u2029]", text))
    return [line for line in lines if line]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("2nd", "'2nd' is not a name in JavaScript; give letters, digits and underscores, a letter first"),
        ("a-b", "'a-b' is not a name in JavaScript; give letters, digits and underscores, a letter first"),
        ("class", "'class' is a word of JavaScript or of what is printed; give another name, such as class_control"),
        ("scan", "'scan' is a word of JavaScript or of what is printed; give another name, such as scan_control"),
    ],
)
def test_a_name_that_is_none_in_javascript_is_refused(name: str, message: str) -> None:
    with pytest.raises(EngineError) as refused:
        source(closed_loop(), name)
    assert str(refused.value) == message
