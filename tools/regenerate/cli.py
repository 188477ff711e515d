"""The command line: write what is stale, or name it."""

from __future__ import annotations

import os

import click

from pidemu.card.library import ENVIRONMENT
from tools.regenerate.files import Generated, chosen, first_difference
from tools.regenerate.picture import PICTURE, take_picture


@click.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--check", is_flag=True, help="Write nothing; name stale files with their first difference; exit status 1 for any.")
@click.option("--picture", is_flag=True, help=f"Take the picture of a certificate, docs/{PICTURE.name}, too; needs a Chromium.")
def command(names: tuple[str, ...], check: bool, picture: bool) -> None:
    """Write the generated files of the repository as they are today.

    A NAME is a file or a folder, such as docs/emulation.md or specs; by default all. docs/matrix.csv and docs/matrix.md take
    minutes, all others less than one.
    """
    os.environ.pop(ENVIRONMENT, None)  # no cards of the user's own
    if check and picture:
        raise click.UsageError("--check writes nothing; --picture takes a picture: give one of them")
    try:
        files = chosen(names)
    except LookupError as error:
        raise click.UsageError(str(error)) from None
    stale = [file for file in files if _is_stale(file, write=not check)]
    if picture:
        take_picture()
        click.echo(f"docs/{PICTURE.name}: taken")
    click.echo(f"{len(files)} generated files, {len(stale)} {'stale' if check else 'written'}")
    if check and stale:
        raise SystemExit(1)


def _is_stale(file: Generated, *, write: bool) -> bool:
    """Compare a file with what it would be today, say where it differs, and write it where that is asked for."""
    there = file.written()
    today = file.make(there)
    if today == there:
        return False
    click.echo(f"{file.name}: {first_difference(there, today)}")
    if write:
        file.write(today)
    return True
