"""Settings of every card, and a record that drives them to their limits, for all engines and languages."""

from __future__ import annotations

import zlib

import numpy as np
import pytest

import pidemu
from pidemu.arrays import Floats
from pidemu.card.library import card_files
from pidemu.card.load import variants
from pidemu.checks.runs import plausible
from pidemu.errors import PidemuError
from pidemu.program.builder import build
from pidemu.program.ir import Program
from pidemu.settings.ranges import PERCENT
from pidemu.settings.settings import Settings

ALL_SIGNALS = ("cascade", "track", "reset", "feedforward")
CARDS = [pytest.param(card_id, id=card_id) for card_id in card_files()]
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


def programs_of(card_id: str) -> list[Program]:
    """Return the program that reads every signal, for every choice of a card's options that makes one."""
    found = []
    for variant in variants(pidemu.load_card(card_id)):
        try:
            algorithm = plausible(variant).algorithm(own_units=True)
            found.append(build(algorithm, 1.0, signals=ALL_SIGNALS, title=f"{card_id} {variant.choice_text}"))
        except PidemuError:  # options that are not defined together
            continue
    assert found
    return found


def modes(program: Program, seed: int, scans: int = 80) -> list[Floats]:
    """Return signals of a program that come and go at random."""
    chance = np.random.default_rng(seed)
    signals = []
    for q in program.inputs:
        column = chance.integers(0, 2, scans).astype(float) if q.name == "auto" else chance.uniform(0, 100, scans)
        if q.name not in ("sp", "pv", "auto", "feedforward"):
            column[chance.random(scans) < 0.6] = np.nan
        signals.append(column)
    return signals
