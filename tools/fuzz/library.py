"""The built-in cards: their texts, and settings to begin with."""

from __future__ import annotations

import functools
from random import Random

from pidemu import load_card
from pidemu.card.library import card_files
from pidemu.formatting import exactly
from tools.fuzz.vocabulary import misspelt, quantity, text

_ASSIGNMENTS = ("GAIN", "K", "Ti", "TI", "Td", "RESET", "pv_range", "op_range", "=", "", "x=y")


@functools.cache
def texts() -> dict[str, str]:
    """Return the text of every built-in card, by id."""
    return {card_id: file.read_text(encoding="utf-8") for card_id, file in card_files().items()}


@functools.cache
def examples() -> dict[str, tuple[tuple[str, ...], ...]]:
    """Return the settings of every card's examples, as words."""
    found = {}
    for card_id in card_files():
        given = [e.given for e in load_card(card_id).data.examples]
        found[card_id] = tuple(tuple(f"{n}={v if isinstance(v, str) else exactly(v)}" for n, v in g.items()) for g in given)
    return found


def a_card(rng: Random) -> tuple[str, list[str]]:
    """Return a card with settings of one of its examples."""
    card = rng.choice(list(examples()))
    return card, list(rng.choice(examples()[card]) if examples()[card] else ())


def changed_settings(rng: Random, words: list[str], hostile: float) -> list[str]:
    """Return settings with other values, and some with other names; `hostile` is the share of what nobody expects."""
    found = []
    for word in words:
        name, _, value = word.partition("=")
        if rng.random() < 0.6 and not value[:1].isalpha():
            value = quantity(rng, hostile)
        if rng.random() < hostile / 4:
            name = misspelt(rng, name)
        if rng.random() > hostile / 6:
            found.append(f"{name}={value}")
    if rng.random() < hostile / 3:
        found.append(rng.choice((f"{rng.choice(_ASSIGNMENTS)}={quantity(rng, 0.5)}", *found, text(rng))))
    return found
