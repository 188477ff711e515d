"""``pidemu check``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import click

from pidemu.card.library import card_files
from pidemu.checks import check_file
from pidemu.cli.common import json_option, print_json, vendors_option
from pidemu.errors import CardNotFoundError, Problem
from pidemu.files.reading import is_file, is_folder
from pidemu.printable import printable

_SHOWN: Final = 200
"""Problems that are printed."""


@click.command("check", short_help="Check cards, the built-in ones or those given.")
@click.argument("paths", nargs=-1, metavar="[PATH]...")
@vendors_option
@json_option
def command(paths: tuple[str, ...], vendors: tuple[str, ...], as_json: bool) -> None:
    """Check card files, or all cards below a folder; without PATH the built-in cards and those of --vendors.

    Every fault is printed with its file, line and column. Exit status 1 if there is one.
    """
    files = [f for p in paths for f in _files(Path(p))] if paths else list(card_files(vendors).values())
    problems: list[Problem] = []
    for file in files:
        problems += check_file(file, shown=_shown(file))
    if as_json:
        print_json([{"path": p.path, "line": p.line, "column": p.column, "message": p.message} for p in problems])
    else:
        for problem in problems[:_SHOWN]:
            click.echo(problem.render(), err=True)
        if len(problems) > _SHOWN:
            click.echo(f"and {len(problems) - _SHOWN:,} more problems; --json lists all", err=True)
        count = len(problems)
        click.echo(f"{len(files)} card{'' if len(files) == 1 else 's'}, {count} problem{'' if count == 1 else 's'}")
    if problems:
        raise SystemExit(1)


def _files(path: Path) -> list[Path]:
    shown = printable(str(path))
    if is_folder(path):
        found = sorted(path.rglob("*.yaml"))
        if not found:
            raise CardNotFoundError(f"no .yaml file below '{shown}'")
        return found
    if not is_file(path):
        raise CardNotFoundError(f"no file or folder '{shown}'")
    return [path]


def _shown(file: Path) -> str:
    try:
        return Path(os.path.realpath(file)).relative_to(Path.cwd()).as_posix()  # unlike Path.resolve, it bears a loop of links
    except (ValueError, OSError):
        return str(file)
