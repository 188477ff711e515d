"""A card made up on the spot, and what the tests share of `pidemu.testing`."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from pidemu.arrays import Floats as Floats  # noqa: PLC0414  # the tests take it from here
from pidemu.backends.python import compiled
from pidemu.card.library import load_card
from pidemu.card.load import Card, card_from
from pidemu.card.reading import parse
from pidemu.program.ir import Program
from pidemu.settings.settings import Settings
from pidemu.testing.strategies import dial_values as dial_values  # noqa: PLC0414
from pidemu.testing.strategies import dials_of as any_dials
from pidemu.testing.strategies import option_combinations as option_combinations  # noqa: PLC0414
from pidemu.testing.strategies import scans_of as scans_of  # noqa: PLC0414

WIDE = (-1e12, 1e12)
"""Output limits that no test signal reaches."""


def copied(file: Path) -> str:
    """Return a built-in card's text as a user may copy it: without saying how it was verified, which only pidemu's tests show."""
    return re.sub(r"^verification:\n(?:  .*\n)+", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE)


def dials_of(card_id: str) -> st.SearchStrategy[dict[str, object]]:
    """Valid settings of the card of this id, by name."""
    return any_dials(load_card(card_id))


def settings_of(data: st.DataObject, card: Card) -> Settings:
    """Draw valid settings of a card; a failure prints the dials, not the whole card."""
    return card.settings(data.draw(dials_of(card.id)))


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
