"""``pidemu code``."""

from __future__ import annotations

import click

from pidemu.card.library import load_card
from pidemu.cli.common import action_option, assignments, limits_option, vendors_option
from pidemu.emulator import Controller


@click.command("code", short_help="Print the scan program of a card with its settings.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--lang", type=click.Choice(["python"]), default="python", show_default=True, help="Language.")
@click.option("--scan", type=float, metavar="H", help="Scan interval [s]; by default the card's.")
@action_option
@limits_option
@vendors_option
def command(
    card: str,
    values: tuple[str, ...],
    lang: str,  # noqa: ARG001 (one language so far; the choice is checked)
    scan: float | None,
    action: str,
    limits: tuple[float, float] | None,
    vendors: tuple[str, ...],
) -> None:
    """Print what CARD with the settings NAME=VALUE does in one scan, as a module that runs on its own."""
    from pidemu.targets.python import source

    settings = load_card(card, vendors).settings(assignments(values))
    controller = Controller(settings, scan, "direct" if action == "direct" else "reverse", limits)
    click.echo(source(controller.program), nl=False)
