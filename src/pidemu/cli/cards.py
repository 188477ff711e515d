"""``pidemu cards``."""

from __future__ import annotations

import click

from pidemu.card.library import CardEntry, card_entry, card_files, unusable_files
from pidemu.card.model.base import Status
from pidemu.cli.common import echo, json_option, print_json, table, vendors_option
from pidemu.errors import CardError


@click.command("cards", short_help="List the cards, and how sure they are.")
@click.argument("word", required=False)
@vendors_option
@json_option
def command(word: str | None, vendors: tuple[str, ...], as_json: bool) -> None:
    """List the cards whose id or title holds WORD.

    Beside each: how its emulation was verified (V1 against the real program, V2 against the printed equations, V3 by its law
    alone), and how many of its statements are documented, measured, inferred or assumed.
    """
    rows: list[CardEntry] = []
    broken = [problem.headline() for problem in unusable_files(vendors)]
    for card_id, file in card_files(vendors).items():
        try:
            card = card_entry(file, card_id)
        except CardError as error:
            broken.append(f"{card_id}: {error.problems[0].headline()}")
            continue
        if word is None or word.casefold() in f"{card.id} {card.title}".casefold():
            rows.append(card)
    if not rows and not broken:
        raise click.UsageError(f"no card holds '{word}'; 'pidemu cards' lists all")
    if as_json:
        print_json([{"card": c.id, "title": c.title, "verification": c.verification, "status": dict(c.status)} for c in rows])
    else:
        table(
            ["card", "controller", "verified", *(s.value for s in Status)],
            [[c.id, c.title, c.verification, *(str(n) for n in c.status.values())] for c in rows],
            indent=0,
            right=(3, 4, 5, 6),
        )
    for message in broken:
        echo(f"error: {message}", err=True)
    if broken:
        raise SystemExit(1)
