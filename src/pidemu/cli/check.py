"""``pidemu check``."""

from __future__ import annotations

import os
from pathlib import Path

import click

from pidemu.card.library import card_files, unusable, unusable_files
from pidemu.checks import check_file
from pidemu.cli.common import echo, json_option, print_json, vendors_option
from pidemu.errors import CardNotFoundError, Problem


@click.command("check", short_help="Check cards, the built-in ones or those given.")
@click.argument("paths", nargs=-1, metavar="[PATH]...")
@vendors_option
@json_option
def command(paths: tuple[str, ...], vendors: tuple[str, ...], as_json: bool) -> None:
    """Check card files, or all cards below a folder; without PATH the built-in cards and those of --vendors.

    Every fault is printed with its file, line and column. Exit status 1 if there is one.
    """
    files = [f for p in paths for f in _files(Path(p))] if paths else list(card_files(vendors).values())
    unread = [] if paths else unusable_files(vendors)
    problems = [*unread, *(problem for file in files for problem in _checked(file))]
    if as_json:
        print_json([{"path": p.path, "line": p.line, "column": p.column, "message": p.message} for p in problems])
    else:
        for problem in problems:
            echo(problem.render(), err=True)
        cards, count = len(files) + len(unread), sum(problem.stands_for for problem in problems)
        echo(f"{cards} card{'' if cards == 1 else 's'}, {count} problem{'' if count == 1 else 's'}")
    if problems:
        raise SystemExit(1)


def _checked(file: Path) -> list[Problem]:
    reason = unusable(file)
    return check_file(file, shown=_shown(file)) if reason is None else [Problem(_shown(file), 1, 1, reason)]


def _files(path: Path) -> list[Path]:
    if not os.path.isdir(path):  # pathlib's raises where the path cannot be looked at
        if not os.path.lexists(path):
            raise CardNotFoundError(f"no file or folder '{path}'")
        return [path]
    closed: list[Path] = []
    walked = os.walk(path, onerror=lambda error: closed.append(Path(error.filename)))
    found = [Path(folder) / name for folder, folders, files in walked for name in (*folders, *files) if name.endswith(".yaml")]
    if not found and not closed:
        raise CardNotFoundError(f"no .yaml file below '{path}'")
    return sorted([*found, *closed])


def _shown(file: Path) -> str:
    try:
        return file.absolute().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return str(file)
