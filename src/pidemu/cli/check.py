"""``pidemu check``."""

from __future__ import annotations

from pathlib import Path

import click

from pidemu.card.library import card_files
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
    problems: list[Problem] = []
    for file in files:
        problems += check_file(file, shown=_shown(file))
    if as_json:
        print_json([{"path": p.path, "line": p.line, "column": p.column, "message": p.message} for p in problems])
    else:
        for problem in problems:
            echo(problem.render(), err=True)
        count = len(problems)
        echo(f"{len(files)} card{'' if len(files) == 1 else 's'}, {count} problem{'' if count == 1 else 's'}")
    if problems:
        raise SystemExit(1)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found = sorted(path.rglob("*.yaml"))
        if not found:
            raise CardNotFoundError(f"no .yaml file below '{path}'")
        return found
    if not path.is_file():
        raise CardNotFoundError(f"no file or folder '{path}'")
    return [path]


def _shown(file: Path) -> str:
    try:
        return file.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return str(file)
