"""All engines give the bits of plain Python, for every built-in card, on records with saturation, manual and bad signals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends import native
from pidemu.backends.choice import block, has_numba
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.backends.python import compiled, starting
from tests.backends.records import CARDS, SCANS, record, settings_of

COMPILER = pytest.mark.skipif(not native.available(), reason="no C compiler on this machine")
NUMBA = pytest.mark.skipif(not has_numba(), reason="there is no Numba for this machine")
OTHERS = [pytest.param(e, marks={"c": COMPILER, "numba": NUMBA}.get(e, ())) for e in ENGINES if e != "python"]


def same(one: Any, other: Any) -> bool:
    return bool(np.array_equal(np.asarray(one, dtype=float), np.asarray(other, dtype=float), equal_nan=True))


@pytest.mark.parametrize("engine", OTHERS)
@pytest.mark.parametrize("card_id", CARDS)
def test_a_controller_gives_the_same_bits_in_every_engine(card_id: str, engine: Engine) -> None:
    settings = settings_of(card_id)
    signals = record(settings, 1)
    reference, other = pidemu.Controller(settings, engine="python"), pidemu.Controller(settings, engine=engine)
    expected, found = reference.run(**signals), other.run(**signals)
    assert other.engine.engine == engine
    assert len(set(expected.tolist())) > SCANS / 10  # the record moves the output
    assert same(found, expected)
    assert same(list(other.state.values()), list(reference.state.values()))
    assert [type(x) for x in other._running.state] == [type(x) for x in reference._running.state]
    assert repr(other.events) == repr(reference.events)  # a bump may be NaN


@pytest.mark.parametrize("engine", OTHERS)
@pytest.mark.parametrize("card_id", CARDS)
def test_loops_side_by_side_give_the_bits_of_loops_alone(card_id: str, engine: Engine) -> None:
    settings = settings_of(card_id)
    program = pidemu.Controller(settings).program
    function, width = block(program.structure, engine)
    width = 5 if engine == "numpy" else width
    records = [record(settings, seed) for seed in range(5)]  # bad samples go straight into the arithmetic
    signals = np.array([[records[i % 5][q.name] for i in range(width)] for q in program.inputs]).transpose(0, 2, 1).copy()
    values, states = (np.repeat(np.array(x)[:, None], width, axis=1) for x in (program.values, program.initial))
    found = np.empty((1, SCANS, width))
    function(values, states, signals, np.zeros((0, 1, width)), np.zeros((0, width), dtype=np.int64), 0, found)
    run = compiled(program).run
    for i in range(5):
        state = list(starting(program))
        with np.errstate(all="ignore"):
            expected = run(state, *(records[i][q.name].tolist() for q in program.inputs))
        assert same(found[0, :, i], expected)
        assert same(states[:, i], state)
