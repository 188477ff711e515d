"""``pidemu code``."""

from __future__ import annotations

import re
from pathlib import Path

import click

from pidemu.backends.structured_text_expressions import DIALECTS, Dialect
from pidemu.card.library import load_card
from pidemu.certificate.unverified import facts, unverified_program
from pidemu.cli.code_text import LANGUAGES, Printing, check_name, files, printed
from pidemu.cli.common import OutputArgument, action_option, assignments, echo, limits_option, vendors_option
from pidemu.cli.outputs import inputs
from pidemu.controller.controller import Controller
from pidemu.controller.signals import SIGNALS
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.reading import reason
from pidemu.files.writing import beside
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings


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
    lang: str,
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
    if name is not None:
        check_name(name, lang)
    loaded = load_card(card, vendors)
    settings = loaded.settings(assignments(values))
    kind: Action = "direct" if action == "direct" else "reverse"
    controller = Controller(settings, scan, kind, limits)
    controller.listen(*signals)
    program = controller.program
    notes = _notes(settings, scan=scan is not None, limits=limits is not None)
    test = None
    if self_test:
        from pidemu.vector_sets.block_test import block_test
        from pidemu.vector_sets.vectors import vectors

        test = block_test(program, vectors(settings, scan, action=kind, output_limits=limits))
    chosen: Dialect = next((d for d in DIALECTS if d == dialect), "iec")
    what = Printing(program, settings, name or _name(loaded.id), notes, chosen, test)
    if out is None:
        click.echo(printed(what, lang), nl=False)
        return
    for file, text in files(what, lang).items():
        _write(Path(out) / file, text)


def _notes(settings: Settings, *, scan: bool, limits: bool) -> list[str]:
    """Return what the head says of the card's evidence."""
    found = facts(unverified_program(settings, scan=scan, limits=limits))
    if not found:
        return [f"Every field of the card {settings.card.id} that makes this program is documented or measured."]
    return [f"Assumed or inferred in the card {settings.card.id}, and at work here:", *(f"- {fact}" for fact in found)]


def _name(card_id: str) -> str:
    """Return a name in C after a card: its letters and digits, one underscore for anything else."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", card_id).strip("_")
    return name if name[:1].isalpha() else f"pid_{name}".rstrip("_")


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise PidemuError(f"{visible(str(path))}: cannot be written: {reason(error)}") from None
    with beside(path, PidemuError, inputs()) as stream:
        stream.write(text)
    echo(str(path))
