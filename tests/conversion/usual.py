"""Every card that has PID settings, with usual numbers."""

from __future__ import annotations

from contextlib import suppress

import pidemu
from pidemu.card.load import variants
from pidemu.card.references import is_active
from pidemu.checks.runs import working
from pidemu.errors import UndefinedError
from pidemu.settings.settings import Settings, limits
from tests.conversion.support import HUNDRED, needed


def usual(card_id: str) -> list[Settings]:
    """Settings of every variant of a card, with usual numbers: gain 2, 90 s, 10 s."""
    found = []
    card = pidemu.load_card(card_id)
    for variant in variants(card):
        given: dict[str, object] = {**variant.chosen, **HUNDRED, **needed(card, dict(variant.chosen))}
        parallel = variant.equation.form == "parallel"
        texts = {"gain": 2.0, "integral": "0.02 1/s" if parallel else "90 s/repeat", "derivative": "20 s" if parallel else "10 s"}
        for name, s in variant.equation.settings.items():
            if s.sets in texts and is_active(variant.equation, name, s):
                given[name] = "200 %" if s.sets == "gain" and s.unit == "%" else texts[s.sets]
        for name, s in variant.equation.settings.items():
            if s.default is None and is_active(variant.equation, name, s):
                given.setdefault(name, working(*limits(s)))
        with suppress(UndefinedError):
            chosen = card.settings(given)
            chosen.algorithm()
            found.append(chosen)
    return found


CARDS = [c for c in pidemu.cards() if pidemu.load_card(c).data.form != "dahlin"]  # a recursion has no PID settings
SOURCES = [(c, usual(c)[0]) for c in CARDS]
