"""The page that says how each card's emulation was verified."""

from __future__ import annotations

from pathlib import Path

import pytest

import pidemu
from pidemu.card.load import EMULATION
from tools.regenerate import RENEW, emulation

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_what_the_cards_say_today() -> None:
    assert (ROOT / "docs" / "emulation.md").read_text(encoding="utf-8") == emulation.text(), RENEW


@pytest.mark.parametrize("name", pidemu.cards())
def test_every_card_says_how_its_emulation_was_verified_and_names_a_test_that_exists(name: str) -> None:
    evidence = pidemu.load_card(name).data.evidence[EMULATION]
    if evidence.status in ("measured", "documented"):
        assert evidence.note is not None
        test = evidence.note.split(":")[0].split(";")[0]
        assert (ROOT / test).exists(), test
