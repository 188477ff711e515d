"""``pidemu matrix``."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import click

from pidemu.card.library import card_files
from pidemu.cli.common import OutputArgument, echo, heading, json_option, print_json, table, vendors_option, wrapped
from pidemu.errors import PidemuError
from pidemu.files.outputs import check_outputs
from pidemu.files.writing import beside
from pidemu.matrix.cell import OUTCOMES, Cell
from pidemu.matrix.matrix import Matrix, counts, matrix

_PIPED: Final = 110
"""Columns of text that go into a pipe."""
_LEGEND: Final = (
    "From the card of the row to the card of the column; a number is the largest deviation of the feedback path in the loop band, "
    "in %. '=' the same law; '~' the same law, but not all else (a deadband, a limit, arithmetic, coarse dials); '?' something has "
    "to be answered first; 'x' refused; '!' failed; '*' the setpoint path deviates more than the feedback path."
)
_ALONE: Final = " Verdicts rest on the continuous laws alone."


@click.command("matrix", short_help="Convert typical settings of every card to every card.")
@click.argument("cards", nargs=-1, metavar="[CARD]...")
@click.option(
    "--csv",
    "text",
    type=OutputArgument(),
    metavar="FILE.csv",
    help="Write one line per conversion, with settings, figures and sentence.",
)
@click.option("--html", "page", type=OutputArgument(), metavar="FILE.html", help="Write a heat map with all details; needs jinja2.")
@click.option("--no-derivative", "plain", is_flag=True, help="Typical settings without derivative.")
@click.option("--no-emulation", "laws", is_flag=True, help="Compare the continuous laws alone, in less time.")
@click.option("--jobs", type=click.IntRange(min=1), help="Processes that share the work; by default one per processor.")
@vendors_option
@json_option
def command(
    cards: tuple[str, ...],
    text: str | None,
    page: str | None,
    plain: bool,
    laws: bool,
    jobs: int | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Convert typical settings of every CARD to every CARD, by default of all cards, and print verdicts and deviations.

    Typical settings are a gain of 2, 90 s of integral time and 10 s of derivative time; other dials are at the card's defaults, and
    all options are stated. All cards take some minutes. Exit status 1 if a conversion ends in an error that is not a refusal.
    """
    if page is not None:
        from pidemu.report.matrix_page import check_page

        check_page()
    read = card_files(vendors).values()
    check_outputs({"--csv": text, "--html": page}, PidemuError, read)  # now, and not after the work
    with _shown_progress() as progress:
        found = matrix(
            cards or None, derivative=not plain, emulate=not laws, jobs=jobs, vendors=vendors, progress=progress
        )  # fmt: skip
    if text is not None:
        with beside(text, PidemuError, read) as stream:
            stream.write(found.to_csv())
    if page is not None:
        from pidemu.report.matrix_page import write_page

        write_page(page, found)
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found)
    for card, why in found.left_out.items():
        echo(f"note: {card} is left out: {why}", err=True)
    for cell in found.failed:
        echo(f"error: {cell.source} to {cell.target}: {cell.sentence}", err=True)
    if found.failed:
        raise SystemExit(1)


@contextmanager
def _shown_progress() -> Iterator[Callable[[int, int], None] | None]:
    """Show a bar on stderr while this is open, if that is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("conversions", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _print(m: Matrix) -> None:
    """Print the table, in blocks of columns where it is too wide, and what the conversions came to."""
    width = min(shutil.get_terminal_size().columns, 400) if sys.stdout.isatty() else _PIPED
    marks = [[_mark(cell) for cell in row] for _, row in m.rows()]
    heads, rows = list(m.cards), list(m.cards)
    room = width - max(map(len, rows)) - 2
    if sum(len(h) + 2 for h in heads) > room:
        heads = [str(i + 1) for i in range(len(heads))]
        rows = [f"{h:>{len(heads[-1])}} {card}" for h, card in zip(heads, rows, strict=True)]
        room -= len(heads[-1]) + 1
    per_block = max(1, room // (2 + max(len(x) for x in (*heads, *(mark for row in marks for mark in row)))))
    for start in range(0, len(heads), per_block):
        columns = slice(start, start + per_block)
        shown = heads[columns]
        table(["", *shown], [[r, *row[columns]] for r, row in zip(rows, marks, strict=True)], right=range(1, len(shown) + 1))
        echo()
    heading(_summary(m))
    wrapped(_LEGEND + ("" if m.emulated else _ALONE))


def _mark(cell: Cell) -> str:
    return cell.mark + ("*" if cell.setpoint_stands_out else "")


def _summary(m: Matrix) -> str:
    found = counts(m.cells)
    parts = ", ".join(f"{found[outcome]} {outcome}" for outcome in OUTCOMES if found[outcome])
    return f"{len(m.cells)} conversion{'s' if len(m.cells) != 1 else ''}: {parts}"
