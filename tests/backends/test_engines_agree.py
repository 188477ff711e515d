"""All engines give the bits of plain Python, for every built-in card, on records with saturation, manual and bad signals."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.arrays import Floats
from pidemu.backends import native
from pidemu.backends.choice import block, has_numba
from pidemu.backends.names import ENGINES, Engine
from pidemu.backends.python import compiled, starting
from pidemu.card.library import card_files
from pidemu.checks.runs import plausible
from pidemu.settings.ranges import PERCENT
from pidemu.settings.settings import Settings

CARDS = [pytest.param(card_id, id=card_id) for card_id in card_files()]
COMPILER = pytest.mark.skipif(not native.available(), reason="no C compiler on this machine")
NUMBA = pytest.mark.skipif(not has_numba(), reason="there is no Numba for this machine")
OTHERS = [pytest.param(e, marks={"c": COMPILER, "numba": NUMBA}.get(e, ())) for e in ENGINES if e != "python"]
SCANS = 600


def settings_of(card_id: str) -> Settings:
    return plausible(pidemu.load_card(card_id).variant({}))


def record(settings: Settings, seed: int, *, bad: bool = True) -> dict[str, Floats]:
    """Setpoint steps, a measurement that drives the output to both limits and settles, manual and bad samples."""
    chance = np.random.default_rng((zlib.crc32(settings.card.id.encode()), seed))
    low, high = (settings.pv_range or PERCENT).ends
    span = high - low
    n = np.arange(SCANS)
    sp = low + span * chance.random(SCANS // 50).repeat(50)
    swing = 0.6 * np.sin(n / chance.uniform(10, 40)) * (n % 300 < 150)
    pv = np.where(
        n % 300 < 200, low + span * (0.5 + swing + 0.02 * chance.standard_normal(SCANS)), sp + span * 1e-3 * 0.9 ** (n % 100)
    )
    found = {"sp": sp, "pv": pv, "auto": (chance.random(SCANS // 30) > 0.3).repeat(30).astype(float)}
    bottom, top = np.clip(settings.equation.output.limits, -1000, 1000)
    found["manual"] = np.where(chance.random(SCANS) < 0.4, np.nan, chance.uniform(bottom, top, SCANS))
    if bad:
        found["pv"][chance.integers(0, SCANS, 12)] = chance.choice([np.nan, np.inf, -np.inf], 12)
    return found


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


@pytest.mark.parametrize("engine", ["numpy", pytest.param("numba", marks=NUMBA)])
@pytest.mark.parametrize("card_id", CARDS)
def test_loops_side_by_side_give_the_bits_of_loops_alone(card_id: str, engine: Engine) -> None:
    settings = settings_of(card_id)
    program = pidemu.Controller(settings).program
    function, width = block(program.structure, engine)
    width = width if engine == "numba" else 5
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
