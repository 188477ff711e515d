"""``pidemu vectors``."""

from __future__ import annotations

import click

from pidemu.card.library import load_card
from pidemu.cli.common import (
    OutputArgument,
    action_option,
    assignments,
    echo,
    json_option,
    limits_option,
    number,
    print_json,
    table,
    vendors_option,
)
from pidemu.cli.inputs import inputs
from pidemu.settings.action import Action


@click.command("vectors", short_help="Test vectors of a card, for code in any language.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--scan", type=float, metavar="H", help="Scan interval [s]; by default the card's.")
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of the noise.")
@click.option(
    "--out", type=OutputArgument("folder"), metavar="FOLDER", help="Write vectors.json there, and a CSV file for each case."
)
@action_option
@limits_option
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    scan: float | None,
    seed: int,
    out: str | None,
    action: str,
    limits: tuple[float, float] | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Play the standard cases to CARD with the settings NAME=VALUE: inputs, outputs, states and events, to test other code with.

    Without settings they are those of the card's first example. The hash is that of settings, inputs and outputs: code that gives
    these outputs equals the vectors of that hash. --json prints what vectors.json would hold (specs/vectors.schema.json).
    """
    from pidemu.vector_sets.vector_set import VERSION
    from pidemu.vector_sets.vectors import vectors

    loaded = load_card(card, vendors)
    settings = loaded.settings(assignments(values) if values else loaded.data.examples[0].given)
    kind: Action = "direct" if action == "direct" else "reverse"
    found = vectors(settings, scan, action=kind, output_limits=limits, seed=seed)
    written = found.write(out, inputs()) if out is not None else []
    for path in written:
        echo(str(path), err=as_json)
    if as_json:
        print_json(found.to_dict())
        return
    if written:
        echo()
    echo(settings.summary)
    echo(f"scan {number(found.scan)} s, {action} acting, {found.precision}")
    echo(f"pidemu vectors v{VERSION}, sha256 {found.hash}")
    echo()
    table(
        ["case", "scans", "events", "what happens"],
        [[c.name, str(len(c.outputs)), str(len(c.events)), c.about] for c in found.cases],
        right=(1, 2),
    )
    for name, why in found.left_out.items():
        echo(f"note: no case '{name}': {why}", err=True)
