"""The command line of the harness."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import click

from tools.fuzz.case import Ticket, case_of, write_files
from tools.fuzz.kinds import KINDS
from tools.fuzz.report import described, summary
from tools.fuzz.run import fuzz
from tools.fuzz.workers import run_one


@click.command(name="python -m tools.fuzz")
@click.option("--minutes", type=float, help="How long; by default one minute, where --count is not given either.")
@click.option("--count", type=click.IntRange(min=0), help="How many inputs of each kind.")
@click.option("--seed", type=int, default=0, show_default=True, help="Which inputs.")
@click.option("--kinds", "names", metavar="KIND,...", help=f"Only these kinds; by default all: {', '.join(KINDS)}.")
@click.option("--jobs", type=click.IntRange(min=1), default=os.cpu_count() or 1, show_default=True, help="Processes.")
@click.option("--again", metavar="KIND:SEED:NUMBER", help="Run one input again, and show what happens.")
@click.option(
    "--keep", metavar="FOLDER", help="Where the files of failures are written; by default a folder among the temporary ones."
)
def command(
    minutes: float | None, count: int | None, seed: int, names: str | None, jobs: int, again: str | None, keep: str | None
) -> None:
    """Run damaged and hostile inputs; print what fails, each with a command that shows it. Exit status 1 if something does.

    Every run begins with the inputs that were faults once (tools/fuzz/corpus). Number I of a kind and a seed is always the same
    input, whatever the number of processes.
    """
    folder = Path(keep or Path(tempfile.gettempdir()) / "pidemu-fuzz")
    _prepare()
    if again is not None:
        raise SystemExit(_again(again, folder))
    chosen = list(KINDS) if names is None else names.split(",")
    unknown = [name for name in chosen if name not in KINDS]
    if unknown:
        raise click.UsageError(f"no kind '{unknown[0]}'; kinds: {', '.join(KINDS)}")
    result = fuzz(
        [KINDS[name] for name in chosen],
        seed,
        minutes=1.0 if minutes is None and count is None else minutes,
        count=count,
        jobs=jobs,
        progress=lambda text: click.echo(text, err=True),
    )
    for group in result.groups:
        click.echo("\n".join(described(group, folder)) + "\n")
    click.echo("\n".join(summary(result)))
    raise SystemExit(1 if result.groups else 0)


def _prepare() -> None:
    """Let nothing of this machine count: no cards of the user's, and generated code in a folder of its own."""
    os.environ.pop("PIDEMU_VENDORS", None)
    os.environ["TERM"] = "dumb"
    os.environ.setdefault("PIDEMU_CACHE", str(Path(tempfile.gettempdir()) / "pidemu-fuzz-code"))


def _again(text: str, folder: Path) -> int:
    """Run one input again; return the exit status."""
    parts = text.split(":", 2)
    if len(parts) != 3 or parts[0] not in KINDS:
        raise click.UsageError(f"'{text}' is not an input; write KIND:SEED:NUMBER, such as records:0:17")
    ticket = Ticket(*parts)
    kind = KINDS[ticket.kind]
    try:
        case = case_of(kind, ticket)
    except KeyError:
        raise click.UsageError(f"the corpus of {ticket.kind} has no '{ticket.number}'") from None
    place = folder / ticket.folder
    if case.files or case.links:
        with tempfile.TemporaryDirectory() as name:
            write_files(case, Path(name))
            place.mkdir(parents=True, exist_ok=True)
            write_files(case, place) if not case.links else None
        click.echo(f"cd {place}")
    click.echo(case.command)
    with tempfile.TemporaryDirectory() as name:
        failure, seconds = run_one(kind, ticket, Path(name))
    if failure is None:
        click.echo(f"nothing is wrong with it ({seconds:.2f} s)")
        return 0
    click.echo(f"{failure.trace}\n{failure.what} at {failure.place}: {failure.detail}")
    return 1
