"""Rules that a card must obey beyond its shape. What is missing fails; nothing is skipped."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pidemu.card import store
from pidemu.card.library import is_known_good
from pidemu.errors import CardError, Problem, capped

if TYPE_CHECKING:
    from pidemu.card.load import Card


def check(card: Card) -> list[Problem]:
    """Return every breach of the rules, in the order of the file.

    Parameters
    ----------
    card : Card
        The card.
    """
    from pidemu.card.load import variants
    from pidemu.checks import equations, runs, statements, traces  # with NumPy and all that runs a card

    try:
        found = {p for rule in statements.RULES for p in rule(card)}
        found |= {p for variant in variants(card) for rule in equations.RULES for p in rule(variant)}
        if not found:  # what is wrong in itself is not computed with
            found |= {p for run in (*runs.RULES, traces.reject_unreproduced_traces) for p in run(card)}
    except CardError as error:  # two choices, each fine by itself, do not go together
        found = set(error.problems)
    return capped(found)


def remembered_check(card: Card) -> list[Problem]:
    """Return every breach of the rules; a card that had none is not checked again as long as neither it nor pidemu has changed.

    Parameters
    ----------
    card : Card
        The card.
    """
    if store.is_checked(card.digest, card.id):
        return []
    from pidemu.card.load import keep

    found = check(card)
    if not found and not card.verification.records:  # files that may change: they are run each time
        store.keep_checked(card.digest, card.id)
        keep(card)
    return found


def check_file(file: Path, card_id: str | None = None, shown: str | None = None) -> list[Problem]:
    """Return everything wrong with a card file: its text, its shape and the rules.

    Parameters
    ----------
    file : Path
        The file.
    card_id : str, optional
        Its id; by default from its path.
    shown : str, optional
        Its name in messages.
    """
    try:
        if is_known_good(file, card_id, shown):
            return []
        from pidemu.card.load import load_file

        return remembered_check(load_file(file, card_id, shown))
    except CardError as error:
        return list(error.problems)
