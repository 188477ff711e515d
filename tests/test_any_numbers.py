"""Settings, processes and intervals from one end of what is plausible to the other: an answer, or an error of pidemu's.

``PIDEMU_EXAMPLES`` sets how many random cases there are for each command; pytest turns every warning of NumPy into a failure.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
from collections.abc import Callable

import numpy as np
import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.errors import PidemuError
from pidemu.explanation.explain import explain
from pidemu.process.process import parse_process
from pidemu.settings.settings import Settings
from pidemu.simulation.outcome import margins_of
from pidemu.simulation.simulate import run_trial
from pidemu.simulation.trial import trial

CARDS = list(card_files())
EXAMPLES = int(os.environ.get("PIDEMU_EXAMPLES", "25"))
EDGES = [
    0, 1, -1, 1e-30, 1e-15, 1e15, 1e-12, 1e12, 1e-9, 1e9, 1e-6, 1e6, 1e-3, 1e3, 0.5, 2, 5e-324, 1e-308, 1e308, 1e38, 10**5000,
    math.nan, math.inf, -math.inf,
]  # fmt: skip
PROCESSES = [
    "gain=1,lag=20", "gain=1,lag=20,delay=3", "gain=-1,lag=1,lag=1", "gain=1,integrators=1", "gain=1,pole=0", "gain=1,pole=1",
    "gain=1,pole=1,pole=1", "gain=1,integrators=2", "gain=1,integrators=4", "gain=2,pole=-0.1+1j", "gain=1,pole=1j",
    "gain=1,delay=5", "gain=1", "gain=1,lag=1,lead=1", "gain=1,pole=-1,zero=1", "gain=1,lag=10,zero=0", "gain=1e-12,lag=1e-9",
    "gain=1e12,lag=1e9",
    "gain=1,lag=1e9,delay=1e9", "gain=1,lag=1,delay=1e-9", "gain=1,lag=1e-9", "gain=1,lag=3,lag=3,lag=3,lag=3,lag=3,lag=3,lag=3",
]  # fmt: skip
INTERVALS = [None, None, None, 1.0, 0.1, 1e-3, 1e3, 1e-6, 1e-9, 1e9]


def any_number(rng: random.Random) -> float:
    """An edge, a usual number, or one of any size."""
    kind = rng.random()
    if kind < 0.4:
        return rng.choice(EDGES)
    reach = 3 if kind < 0.7 else 15
    return float(f"{10 ** rng.uniform(-reach, reach):.3g}") * rng.choice([1, 1, 1, -1])


def any_settings(rng: random.Random) -> Settings:
    """Settings of any card under any options, usual but for one to three dials."""
    card = pidemu.load_card(rng.choice(CARDS))
    given: dict[str, object] = {name: rng.choice(choices) for name, choices in card.options.items() if rng.random() < 0.3}
    dials = card.variant(given).equation.settings
    strange = rng.sample(list(dials), min(len(dials), rng.randint(1, 3)))
    for name, setting in dials.items():
        if name in strange:
            given[name] = any_number(rng)
        elif setting.default is None or rng.random() < 0.4:
            given[name] = float(f"{10 ** rng.uniform(-1.5, 1.5):.3g}")
    return card.settings(given)


def any_interval(rng: random.Random) -> float | None:
    return rng.choice(INTERVALS)


def converts(rng: random.Random, settings: Settings) -> None:
    process = parse_process(rng.choice(PROCESSES)) if rng.random() < 0.6 else None
    scan = any_interval(rng)
    both = (scan, any_interval(rng) or 1.0) if scan is not None and rng.random() < 0.3 else scan
    conversion = pidemu.convert(
        settings, rng.choice(CARDS), process=process, scan=both, assume=True, allow_approximate=True, digits=rng.choice([None, 5])
    )
    assert json.dumps(conversion.to_dict(), allow_nan=False)
    assert conversion.sentence


def explains(rng: random.Random, settings: Settings) -> None:
    assert json.dumps(explain(settings, scan=any_interval(rng)).to_dict(), allow_nan=False)


def simulates(rng: random.Random, settings: Settings) -> None:
    made = trial(settings, parse_process(rng.choice(PROCESSES)), any_interval(rng))
    margins_of(made)
    if made.scans < 3000:
        run = run_trial(made, "python")
        assert run.measurement.size == run.output.size == made.scans


def runs(rng: random.Random, settings: Settings) -> None:
    controller = pidemu.Controller(settings, any_interval(rng), engine="python")
    pv = np.array([50.0, 40.0, rng.choice([1e300, math.nan, 1e30]), 50.0, -1e29, 50.0])
    assert controller.run(np.full(6, 50.0), pv).size == 6


@pytest.mark.parametrize("seed", range(EXAMPLES))
@pytest.mark.parametrize("command", [converts, explains, simulates, runs])
def test_any_number_gives_an_answer_or_an_error_that_names_it(
    command: Callable[[random.Random, Settings], None], seed: int
) -> None:
    rng = random.Random(seed)
    with contextlib.suppress(PidemuError):
        command(rng, any_settings(rng))
