"""``pidemu code``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import click

from pidemu.card.library import load_card
from pidemu.certificate.unverified import facts, unverified_program
from pidemu.cli.common import OutputArgument, action_option, assignments, echo, limits_option, vendors_option
from pidemu.cli.outputs import inputs
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.reading import reason
from pidemu.files.writing import beside
from pidemu.program.ir import Program
from pidemu.settings.settings import Settings

_ENDINGS: Final = {"python": "py", "js": "js"}


@click.command("code", short_help="Print the scan program of a card with its settings.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--lang", type=click.Choice(["python", "c", "js"]), default="python", show_default=True, help="Language.")
@click.option("--name", metavar="NAME", help="The name of files, types and functions; by default the card's.")
@click.option("--out", type=OutputArgument("folder"), metavar="FOLDER", help="Write NAME.h and NAME.c, NAME.py or NAME.js there.")
@click.option("--scan", type=float, metavar="H", help="Scan interval [s]; by default the card's.")
@action_option
@limits_option
@vendors_option
def command(
    card: str,
    values: tuple[str, ...],
    lang: str,
    name: str | None,
    out: str | None,
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
    if name is not None:
        _check_name(name, lang)
    loaded = load_card(card, vendors)
    settings = loaded.settings(assignments(values))
    program = Controller(settings, scan, "direct" if action == "direct" else "reverse", limits).program
    notes = _notes(settings, scan=scan is not None, limits=limits is not None)
    name = name or _name(loaded.id)
    if out is None:
        click.echo(_printed(program, lang, name, notes), nl=False)
        return
    for file, text in _files(program, lang, name, notes).items():
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


def _check_name(name: str, lang: str) -> None:
    """Refuse a name that is none in the language; the file of a Python module is named as one of C."""
    if lang == "js":
        from pidemu.backends.javascript import check_name
    else:
        from pidemu.backends.c import check_name
    check_name(name)


def _printed(program: Program, lang: str, name: str, notes: Sequence[str]) -> str:
    if lang == "c":
        from pidemu.backends.c import single

        return single(program, name, notes)
    if lang == "js":
        from pidemu.backends.javascript import source as script

        return script(program, name, notes)
    from pidemu.backends.python import source

    return source(program, notes)


def _files(program: Program, lang: str, name: str, notes: Sequence[str]) -> dict[str, str]:
    if lang == "c":
        from pidemu.backends.c import header, source

        return {f"{name}.h": header(program, name, notes), f"{name}.c": source(program, name, notes)}
    return {f"{name}.{_ENDINGS[lang]}": _printed(program, lang, name, notes)}


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise PidemuError(f"{visible(str(path))}: cannot be written: {reason(error)}") from None
    with beside(path, PidemuError, inputs()) as stream:
        stream.write(text)
    echo(str(path))
