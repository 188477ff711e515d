"""Random but sensible settings of any card, scan intervals for them, and a card made up on the spot."""

from __future__ import annotations

import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from pidemu.algorithm.model import Algorithm
from pidemu.arrays import Floats as Floats  # noqa: PLC0414  # the tests take it from here
from pidemu.backends.python import compiled
from pidemu.card.library import load_card
from pidemu.card.load import Card, card_from
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import Setting
from pidemu.card.reading import parse
from pidemu.card.references import is_active
from pidemu.errors import SettingError
from pidemu.program.ir import Program
from pidemu.settings.settings import Settings, limits, off_values
from pidemu.units import Role, Spans, from_canonical, parse_unit

WIDE = (-1e12, 1e12)
"""Output limits that no test signal reaches."""

_SENSIBLE: dict[Role, st.SearchStrategy[float]] = {
    Role.GAIN: st.floats(0.05, 50),
    Role.MULTIPLIER: st.floats(0.1, 10),
    Role.INTEGRAL: st.floats(1, 3000).map(lambda seconds: 1 / seconds),
    Role.DERIVATIVE: st.just(0.0) | st.floats(0.1, 600),
    Role.FILTER_TIME: st.just(0.0) | st.floats(0.1, 100),
    Role.FILTER_RATIO: st.floats(0.01, 1),
    Role.FILTER_GAIN: st.floats(1, 30),
    Role.PROPORTIONAL_WEIGHT: st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1),
    Role.DERIVATIVE_WEIGHT: st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1),
    Role.TRACKING_TIME: st.floats(1, 3000),
    Role.FILTER_FACTOR: st.just(1.0) | st.floats(0.1, 1),
    Role.INTEGRAL_LIMIT: st.floats(5, 500),
    Role.WINDUP_LIMIT: st.floats(60, 120),
    Role.DEADBAND: st.just(0.0) | st.floats(0.1, 10),
    Role.GAP_GAIN: st.floats(0, 1),
    Role.LINEARITY: st.just(1.0) | st.floats(0.1, 1),
    Role.FEEDFORWARD_GAIN: st.floats(0, 2),
    Role.BIAS: st.floats(0, 100),
    Role.OUTPUT_RATE: st.floats(0.1, 100),
    Role.SETPOINT_RATE: st.floats(0.1, 100),
    Role.RESOLUTION: st.floats(0.01, 1),
    Role.PROCESS_GAIN: st.floats(0.1, 10),
    Role.PROCESS_TIME: st.floats(1, 600),
    Role.PROCESS_DELAY: st.floats(0, 60),
    Role.CLOSED_LOOP_TIME: st.floats(1, 600),
}
"""Canonical values by role (specs/equations.md, section 1)."""


def copied(file: Path) -> str:
    """Return a built-in card's text as a user may copy it: without saying how it was verified, which only pidemu's tests show."""
    return re.sub(r"^verification:\n(?:  .*\n)+", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE)


def option_combinations(card: Card) -> list[dict[str, str]]:
    """Every way to choose the card's options."""
    names = list(card.options)
    return [dict(zip(names, choices, strict=True)) for choices in itertools.product(*card.options.values())]


@st.composite
def dial_values(draw: st.DrawFn, setting: Setting) -> float:
    """A value for one dial, in its unit: an off value now and then, otherwise a sensible one inside its range."""
    off = off_values(setting)
    if off and draw(st.integers(0, 7)) == 0:
        return draw(st.sampled_from(off))
    role = Role(setting.sets)
    sensible = draw(_SENSIBLE[role])
    sensible = 0.0 if abs(sensible) < 1e-9 else sensible  # no controller has a gain or a time of 1e-200
    value = from_canonical(role, sensible, parse_unit(setting.unit), Spans(scan=0.5))
    low, high = limits(setting)
    value = min(max(value, low), high)
    if setting.resolution is not None:
        value = min(max(round(value / setting.resolution) * setting.resolution, low), high)
    if math.isinf(value) and value not in off:  # a derivative of zero has no value on a dial that cannot show it
        value = from_canonical(role, 1.0, parse_unit(setting.unit), Spans(scan=0.5))
    return value


@st.composite
def dials_of(draw: st.DrawFn, card_id: str) -> dict[str, object]:
    """Valid settings of the card of this id, by name, under any choice of its options; choices that it refuses are left out."""
    card = load_card(card_id)
    options = draw(st.sampled_from(option_combinations(card)))
    equation = card.variant(options).equation
    given: dict[str, object] = dict(options)
    for name, setting in equation.settings.items():
        if not is_active(equation, name, setting) or (setting.default is not None and draw(st.integers(0, 4)) == 0):
            continue
        given[name] = draw(dial_values(setting))
    refused = False
    try:
        card.settings(given).algorithm()
    except SettingError as error:
        refused = "not defined" in str(error)
        if not refused:
            raise
    assume(not refused)
    return given


def settings_of(data: st.DataObject, card: Card) -> Settings:
    """Draw valid settings of a card; a failure prints the dials, not the whole card."""
    return card.settings(data.draw(dials_of(card.id)))


@st.composite
def scans_of(draw: st.DrawFn, algorithm: Algorithm) -> float:
    """A scan interval [s]; with a rule that rings or is unstable where the filter is faster than the scan, one below its time."""
    rules = (algorithm.derivative.rule, algorithm.filter_rule)
    rings = algorithm.Tf and any(rule in (Rule.FORWARD, Rule.TRAPEZOIDAL) for rule in rules)
    highest = min(10.0, algorithm.Tf) if rings else 10.0
    if algorithm.arithmetic.type == "integer":
        return draw(st.integers(1, 100)) / 10
    if algorithm.dahlin is not None:
        return draw(st.floats(max(0.05, algorithm.dahlin.delay / 30), 10))
    return draw(st.floats(min(0.05, highest / 2), highest))


def made_up_card(**fields: Any) -> Card:
    """Return a card with the given fields over those of a plain parallel PID (JSON is YAML)."""
    plain: dict[str, Any] = {
        "card": 1,
        "vendor": "Nobody",
        "product": "test bench",
        "algorithm": "PID",
        "sources": {"own": {"title": "made up", "read": "2026-01-01"}},
        "form": "parallel",
        "implementation": "positional",
        "proportional": {"on": "error"},
        "integral": {"rule": "backward", "windup": {"scheme": "none"}},
        "derivative": {"on": "error"},
        "transfer": {"start": "bumpless"},
        "settings": {
            "kp": {"sets": "gain", "unit": "%/%"},
            "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0},
            "kd": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
        },
        "action": {
            "names": {"reverse": "Reverse", "direct": "Direct"},
            "example": {"name": "Reverse", "sp": 50, "pv": 51, "output": "falls"},
        },
        "scan": {"default": "1 s"},
        "output": {"limits": [0, 100]},
        "evidence": {"form": {"status": "assumed", "note": "made up"}},
        "examples": [{"given": {"kp": 1}, "canonical": {"kp": 1, "ki": 0, "kd": 0}}],
    }
    return card_from(parse(json.dumps(plain | fields), "made-up.yaml"), "nobody/bench")


def outputs(program: Program, sp: Floats, pv: Floats, auto: Floats | None = None, manual: Floats | None = None) -> Floats:
    """Run a program from its initial state."""
    functions = compiled(program)
    state = list(functions.initial)
    modes = np.ones_like(sp) if auto is None else auto
    held = np.full_like(sp, math.nan) if manual is None else manual
    return np.array(functions.run(state, sp.tolist(), pv.tolist(), modes.tolist(), held.tolist()))
