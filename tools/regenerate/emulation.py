"""How each card's emulation was verified: ``docs/emulation.md``, made from the cards."""

from __future__ import annotations

from collections import Counter
from typing import Final

from pidemu.card.library import cards, load_card
from pidemu.card.load import Card, variants
from pidemu.card.model.base import Evidence
from pidemu.card.model.verification import MEANING

_HEAD: Final = """\
# How the emulations were verified

Generated from the cards by `python -m tools.regenerate`; do not edit. `pidemu cards` shows the class of every card,
`pidemu show` what was compared, and every certificate what its two emulations rest on.

- **V1, against the real program**: a test compares the card's outputs, scan by scan, with outputs of the real thing: the
  program runs in the test, or a trace of it was recorded (`tests/data`).
- **V2, against the printed equations**: a test compares them with a computation of its own, written from the scan equation, the
  program text or the differential equations that the maker publishes.
- **V3, by its law alone**: no scan equation was found. The program's linear response equals the law that the maker states;
  rules, windup and transfers are what the card says of them.

In every case property tests hold for the card: the program's impulse response is that of its discrete law, the output stays inside
its limits, and a transfer that is called bumpless is.
"""


def text() -> str:
    """Return the page: one row per card, and what each card assumes of its scan-by-scan behaviour."""
    found = [load_card(name) for name in cards()]
    count = Counter(card.verification.class_ for card in found)
    lines = ["", f"Of {len(found)} cards {count['V1']} are V1, {count['V2']} are V2 and {count['V3']} are V3."]
    for name, meaning in MEANING.items():
        lines += ["", f"## {name}: {meaning}", "", "| card | what | by |", "| --- | --- | --- |"]
        lines += [f"| {' | '.join(_row(card))} |" for card in found if card.verification.class_ == name]
    lines += ["", "## What is assumed of the scan", ""]
    lines += [
        "Rules, windup, transfers, faults and arithmetic that no source states; `pidemu show CARD` lists all that a card assumes.",
        "",
    ]
    for card in found:
        assumed = _assumed(card)
        lines.append(f"- **{card.id}**: {'; '.join(assumed) if assumed else 'nothing'}")
    return "\n".join([_HEAD, *lines]) + "\n"


def _row(card: Card) -> tuple[str, str, str]:
    v = card.verification
    records = ", ".join(trace.file for trace in v.records)
    by = "; ".join(filter(None, (v.package, records, v.test, v.note)))
    return card.id, v.at or "", by


def _assumed(card: Card) -> list[str]:
    """Return the assumed fields that the law does not depend on, one per evidence entry, over all choices of options."""
    entries: dict[str, Evidence] = {}
    for variant in variants(card):
        for statement in variant.assumptions(()):
            if not statement.makes_the_law and statement.evidence is not None:
                entries.setdefault(statement.key, statement.evidence)
    return [f"`{key}`" for key in entries]
