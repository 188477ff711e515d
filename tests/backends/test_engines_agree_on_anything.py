"""Bit agreement as a property: random modes, faults, jitter and changes of settings, for every card, in every engine.

``PIDEMU_EXAMPLES`` sets how many random runs each card and engine get; the ordinary number is small.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Controller
from pidemu.backends import native
from pidemu.backends.choice import has_numba
from pidemu.backends.engine_names import ENGINES, Engine
from pidemu.card.library import card_files
from pidemu.errors import PidemuError, ScanError
from pidemu.settings.settings import Settings
from tests.helpers import dials_of, scans_of
from tests.histories import History, history

CARDS = list(card_files())
COMPILER = pytest.mark.skipif(not native.available(), reason="no C compiler on this machine")
NUMBA = pytest.mark.skipif(not has_numba(), reason="there is no Numba for this machine")
OTHERS = [pytest.param(e, marks={"c": COMPILER, "numba": NUMBA}.get(e, ())) for e in ENGINES if e != "python"]
EXAMPLES = int(os.environ.get("PIDEMU_EXAMPLES", "25"))
ODD = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e31, 3.5e38, 1e-310, -0.0, 0.0]
"""What a signal may be beside a percentage."""


@dataclass(frozen=True)
class Plan:
    """Spells of a run, each begun with new settings where there are any."""

    scan: float
    parts: tuple[tuple[dict[str, object] | None, History], ...]


def damaged(record: History, seed: int, *, measured: bool) -> History:
    """The record with odd values on setpoint, measurement and remote setpoint, and with uneven intervals where they count."""
    rng = np.random.default_rng(seed)
    columns = {name: column.copy() for name, column in record.columns.items()}
    for name in ("sp", "pv", "cascade"):
        hit = rng.integers(0, columns[name].size, rng.integers(0, 5))
        columns[name][hit] = rng.choice(ODD, hit.size)
    if measured:
        jitter = rng.choice([1.0, 1.0, 0.5, 1.5, 0.0, 2.0], columns["sp"].size)
        columns["interval"] = jitter
    return History(columns)


@st.composite
def plans(draw: st.DrawFn, card_id: str, first: Settings) -> Plan:
    """A scan interval, and one to three spells."""
    scan = draw(scans_of(first.algorithm()))
    measured = first.equation.scan.interval == "measured"
    parts = []
    for place in range(draw(st.integers(1, 3))):
        seed = draw(st.integers(0, 2**32 - 1))
        changed = draw(dials_of(card_id)) if place and draw(st.booleans()) else None
        record = damaged(history(seed, first.algorithm(scan=scan), 60), seed, measured=measured)
        if measured:
            record = record.moved(interval=record.columns["interval"] * scan)
        parts.append((changed, record))
    return Plan(scan, tuple(parts))


def played(plan: Plan, start: Settings, engine: Engine) -> list[Any]:
    """Everything that a run gives, in words, so that NaN equals NaN and zero differs from minus zero."""
    try:
        controller = Controller(start, plan.scan, initial_output=20.0, engine=engine)
    except ScanError as error:  # the settings cannot be run at the interval
        return [str(error)]
    found: list[Any] = []
    for changed, record in plan.parts:
        try:
            if changed is not None:
                controller.change(changed)
            found.append([x.hex() for x in record.run(controller).tolist()])
            assert controller.engine.engine == engine
        except PidemuError as error:  # a filter that is unstable at an interval, a signal that the new settings have no use for
            found.append(str(error))
        found.append({name: x.hex() for name, x in controller.state.items()})
    return [*found, repr(controller.events)]


@pytest.mark.parametrize("engine", OTHERS)
@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_any_run_of_any_card_gives_the_same_bits_and_events_in_every_engine(engine: Engine, data: st.DataObject) -> None:
    card = pidemu.load_card(data.draw(st.sampled_from(CARDS)))
    start = card.settings(data.draw(dials_of(card.id)))
    plan = data.draw(plans(card.id, start))
    assert played(plan, start, engine) == played(plan, start, "python")
