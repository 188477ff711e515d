"""Conversions of any card to any other, with everything stated that could be asked."""

from __future__ import annotations

import itertools
from typing import Any

from hypothesis import assume
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings
from tests.conversion.support import needed, settings_that_act
from tests.conversion.usual import CARDS

PAIRS = list(itertools.product(CARDS, CARDS))
RANGES: dict[str, object] = {"pv_range": (0, 100), "op_range": (0, 100)}
TWO_SCANS = st.tuples(st.floats(0.1, 3), st.floats(0.1, 3))


def held(source: Settings, target: str) -> dict[str, object]:
    """What the target needs beside what is computed."""
    return {} if source.card.id == target else needed(pidemu.load_card(target))


def convert(source: Settings, target: str, **how: Any) -> pidemu.Conversion:
    return pidemu.convert(source, target, **{"given": held(source, target), "emulate": False, "assume": True, **how})


def converted(source: Settings, target: str, **how: Any) -> pidemu.Conversion:
    """Convert; what the target refuses is not an example."""
    try:
        return convert(source, target, **how)
    except (ConversionRefusedError, ScanError):
        assume(False)
        raise


def drawn(data: st.DataObject, pairs: list[tuple[str, str]] = PAIRS) -> tuple[Settings, str]:
    source, target = data.draw(st.sampled_from(pairs))
    return settings_that_act(data, pidemu.load_card(source)).changed(RANGES), target


def numbers(s: Settings) -> dict[str, float]:
    return {name: v.value for name, v in s.items() if v.active}


def stated(s: Settings) -> dict[str, object]:
    """All options, and every dial as a number."""
    return {**s.options, **{n: v.value for n, v in s.items() if v.active}}
