"""Printed Structured Text, read by an evaluator of its own, gives the numbers of plain Python."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends.python import compiled, starting
from pidemu.backends.structured_text import source
from pidemu.backends.structured_text_block import PrintedDial
from pidemu.backends.structured_text_expressions import DIALECTS
from pidemu.program.builder import build
from pidemu.program.ir import Program
from tests.backends.records import CARDS, record, settings_of
from tests.backends.structured_text import Instance, is_there, read, read_rockwell
from tests.helpers import Floats


def outputs_of(block: Instance, program: Program, signals: list[Floats]) -> list[float]:
    """Call a block once per sample; a signal that is NaN is not given."""
    inputs = block.unit.sections
    found = []
    for sample in zip(*(s.tolist() for s in signals), strict=True):
        now: dict[str, Any] = {}
        for q, x in zip(program.inputs, sample, strict=True):
            name = q.name.upper()
            now[name] = x > 0 if name == "AUTO" else x
            if f"{name}_given".casefold() in inputs:
                now[f"{name}_GIVEN"], now[name] = is_there(x), x if is_there(x) else 0.0
        block(**now)
        found.append(float(block["OP"]))
    return found


def in_python(program: Program, signals: list[Floats]) -> list[float]:
    with np.errstate(all="ignore"):
        return [float(x) for x in compiled(program).run(list(starting(program)), *(s.tolist() for s in signals))]


def block_of(program: Program, dialect: Any) -> Instance:
    text = source(
        program, "control", [PrintedDial("Kp", 1.0, "-"), PrintedDial("INT", 2.0, "s"), PrintedDial("N", 3.0, "-")], dialect=dialect
    )
    return read_rockwell(text) if dialect == "rockwell" else read(text)["control"]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("card_id", CARDS)
def test_every_card_gives_the_numbers_of_python(card_id: str, dialect: str) -> None:
    chosen = settings_of(card_id)
    program = pidemu.Controller(chosen).program
    if dialect == "rockwell" and program.wide_literals:
        pytest.skip("refused: REAL and LREAL in one expression")
    columns = {name: column[:300] for name, column in record(chosen, 1, bad=False).items()}
    signals = [np.asarray(columns[q.name], dtype=float) for q in program.inputs]
    expected = in_python(program, signals)
    assert len(set(expected)) > 10
    assert outputs_of(block_of(program, dialect), program, signals) == expected


@pytest.mark.parametrize("card_id", CARDS)
def test_every_card_with_all_signals_gives_the_numbers_of_python(card_id: str) -> None:
    chosen = settings_of(card_id)
    program = build(chosen.algorithm(own_units=True), 1.0, signals=("cascade", "track", "reset", "feedforward"), title=card_id)
    chance = np.random.default_rng(7)
    signals = []
    for q in program.inputs:
        column = chance.integers(0, 2, 200).astype(float) if q.name == "auto" else chance.uniform(0, 100, 200)
        if q.name not in ("sp", "pv", "auto", "feedforward"):
            column[chance.random(200) < 0.6] = math.nan
        signals.append(column)
    assert outputs_of(block_of(program, "iec"), program, signals) == in_python(program, signals)
