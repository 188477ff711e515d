"""A short run of the fuzz harness, the same inputs every time: all that was found once, and some new ones of each kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.fuzz.case import corpus_of
from tools.fuzz.kinds import KINDS
from tools.fuzz.report import described
from tools.fuzz.run import fuzz

COUNTS = {
    "records": 2000,
    "tables": 500,
    "commands": 500,
    "cards": 60,
    "loop-files": 60,
    "conversions": 30,
    "signals": 200,
    "certificates": 40,
    "plants": 60,
}
SEED = 2026


def test_every_kind_is_run() -> None:
    assert list(KINDS) == list(COUNTS)


@pytest.mark.parametrize("name", COUNTS)
def test_no_input_breaks_anything(name: str, tmp_path: Path) -> None:
    found = fuzz([KINDS[name]], SEED, count=COUNTS[name], effort=3)
    assert [] == ["\n".join(described(group, tmp_path)) for group in found.groups]
    assert len(corpus_of(KINDS[name])) + COUNTS[name] == found.tallies[name].count
