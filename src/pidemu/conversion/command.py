"""The command that makes a conversion again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping

from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.conversion.request import Request
from pidemu.errors import PidemuError
from pidemu.formatting import exactly
from pidemu.settings.ranges import RANGES, option_of
from pidemu.settings.settings import Settings


def set_words(options: Mapping[str, str]) -> str:
    """Return the words that state options of the target, as one types them: ``--set FORM=Series``."""
    return " ".join(f'--set "{n}={x}"' if " " in x else f"--set {n}={x}" for n, x in options.items())


def words_for(source: Settings, target: Card, request: Request) -> str:
    """Return the ``pidemu convert`` command for a source, a target and what is asked for, for a shell."""
    return shlex.join(_words(source, target, request))


def _words(source: Settings, target: Card, request: Request) -> Iterator[str]:
    yield from ("pidemu", "convert", name_of(source.card))
    for n, v in source.items():
        if v.given:
            yield f"{n}={v.typed if isinstance(v.typed, str) else exactly(v.value)}"
    yield from (f"{n}={x}" for n, x in source.options.items() if n not in source.defaulted)
    for name, given in zip(RANGES, (source.pv_range, source.op_range), strict=True):
        if given is not None:
            yield f"{option_of(name)}={given.argument}"
    yield from ("--to", name_of(target), *request.words())


def name_of(card: Card) -> str:
    """Return what a command calls a card: its id, or its file where another card, or none, has this id."""
    try:
        found = load_card(card.id)
    except PidemuError:
        return card.document.path
    return card.id if found.document.value == card.document.value else card.document.path
