"""How each card's emulation was verified: ``docs/emulation.md``, made from the cards' evidence."""

from __future__ import annotations

from typing import Final

from pidemu.card.library import cards, load_card
from pidemu.card.load import EMULATION, Card, variants
from pidemu.card.model.base import Evidence, Status

_HOW: Final = {
    Status.MEASURED: "against the real implementation",
    Status.DOCUMENTED: "against the published scan equation",
    Status.INFERRED: "against the law alone",
    Status.ASSUMED: "only assumed",
}
_HEAD: Final = """\
# How the emulations were verified

Generated from the cards' evidence by `python -m tools.regenerate`; do not edit. What the words mean:

- **against the real implementation**: a test compares the card's outputs, scan by scan, with outputs of the real thing;
- **against the published scan equation**: a test compares them with a computation of its own, written from the scan equation or the
  program text that the maker publishes;
- **against the law alone**: no scan equation was found. The program's linear response equals the law that the maker states; rules,
  windup and transfers are what the card says of them;
- **only assumed**: not even that.

In every case property tests hold for the card: the program's impulse response is that of its discrete law, the output stays inside
its limits, and a transfer that is called bumpless is.
"""


def text() -> str:
    """Return the page: one row per card, and what each card assumes of its scan-by-scan behaviour."""
    found = [load_card(name) for name in cards()]
    rows = [(card.id, _HOW[e.status], e.at or "", e.note or "") for card in found if (e := card.data.evidence.get(EMULATION))]
    lines = ["", "| card | verified | what | by |", "| --- | --- | --- | --- |"]
    lines += [f"| {' | '.join(row)} |" for row in sorted(rows, key=_order)]
    lines += ["", "## What is assumed of the scan", ""]
    lines += [
        "Rules, windup, transfers, faults and arithmetic that no source states; `pidemu show CARD` lists all that a card assumes.",
        "",
    ]
    for card in found:
        assumed = _assumed(card)
        lines.append(f"- **{card.id}**: {'; '.join(assumed) if assumed else 'nothing'}")
    return "\n".join([_HEAD, *lines]) + "\n"


def _order(row: tuple[str, str, str, str]) -> tuple[int, str]:
    return list(_HOW.values()).index(row[1]), row[0]


def _assumed(card: Card) -> list[str]:
    """Return the assumed fields that the law does not depend on, one per evidence entry, over all choices of options."""
    entries: dict[str, Evidence] = {}
    for variant in variants(card):
        for statement in variant.assumptions(()):
            if not statement.makes_the_law and statement.evidence is not None:
                entries.setdefault(statement.key, statement.evidence)
    return [f"`{key}`" for key in entries]
