"""``pidemu code``."""

from __future__ import annotations

from pathlib import Path

import click

from pidemu.backends.structured_text_expressions import DIALECTS
from pidemu.card.library import load_card
from pidemu.cli.common import OutputArgument, action_option, assignments, echo, limits_option, vendors_option
from pidemu.cli.inputs import inputs
from pidemu.controller.signals import SIGNALS
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.exports.code import code
from pidemu.exports.languages import LANGUAGES, Language
from pidemu.files.reading import reason
from pidemu.files.writing import beside
from pidemu.settings.action import Action


@click.command("code", short_help="Print the scan program of a card with its settings.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--lang", type=click.Choice(LANGUAGES), default="python", show_default=True, help="Language; st is Structured Text.")
@click.option("--dialect", type=click.Choice(DIALECTS), help="Of Structured Text; by default iec, IEC 61131-3.")
@click.option("--self-test", is_flag=True, help="With st and plcopen: a program too that tests the block in the controller.")
@click.option("--name", metavar="NAME", help="The name of files, types, functions and blocks; by default the card's.")
@click.option("--out", type=OutputArgument("folder"), metavar="FOLDER", help="Write NAME.h and NAME.c, or NAME.py, .js, .st there.")
@click.option(
    "--signal",
    "signals",
    multiple=True,
    type=click.Choice(list(SIGNALS)),
    help="A signal that the program reads besides setpoint, measurement, mode and operator's output. Repeatable.",
)
@click.option("--scan", type=float, metavar="H", help="Scan interval [s]; by default the card's.")
@action_option
@limits_option
@vendors_option
def command(
    card: str,
    values: tuple[str, ...],
    lang: Language,
    dialect: str | None,
    self_test: bool,
    name: str | None,
    out: str | None,
    signals: tuple[str, ...],
    scan: float | None,
    action: str,
    limits: tuple[float, float] | None,
    vendors: tuple[str, ...],
) -> None:
    """Print what CARD with the settings NAME=VALUE does in one scan, as a module that runs on its own.

    Its head names what the program rests on and no source of the card states: rules, windup, transfer, limits.
    """
    if name is not None and lang == "python" and out is None:
        raise click.UsageError("--name names the file of a Python module; give --out as well")
    if lang != "st" and dialect is not None:
        raise click.UsageError("--dialect is one of Structured Text; give --lang st as well")
    if lang not in ("st", "plcopen") and self_test:
        raise click.UsageError("--self-test prints a program for a PLC; give --lang st or plcopen as well")
    settings = load_card(card, vendors).settings(assignments(values))
    kind: Action = "direct" if action == "direct" else "reverse"
    found = code(
        settings,
        lang,
        name=name,
        scan=scan,
        action=kind,
        output_limits=limits,
        signals=signals,
        dialect=next((d for d in DIALECTS if d == dialect), "iec"),
        self_test=self_test,
    )
    if out is None:
        click.echo(found.text, nl=False)
        return
    for file, text in found.files.items():
        _write(Path(out) / file, text)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise PidemuError(f"{visible(str(path))}: cannot be written: {reason(error)}") from None
    with beside(path, PidemuError, inputs()) as stream:
        stream.write(text)
    echo(str(path))
