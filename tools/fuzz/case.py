"""An input: a command line and the files it reads."""

from __future__ import annotations

import functools
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

OLD = "old"
"""Names that begin so are results of an earlier run, which a command may replace as a whole; other files are only read."""


FORCED_NUMPY: Final = 10.0
"""What a loop may take besides where NumPy is asked for [s]: made for many loops side by side, it needs 40 to 80 us for a scan of
one, and a run whose interval nobody gave has up to 100,000 scans."""


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes
    ----------
    words : tuple of str
        What follows ``pidemu`` on the command line.
    files : mapping of str to bytes
        Files of the folder in which it runs, by name.
    links : mapping of str to str
        Symbolic links of the folder, and where they lead.
    direct : bool
        The kind calls the functions behind the command, for speed or as a Python program would.
    terminal : bool
        Both streams are a terminal.
    limit : float
        CPU time that it may take [s].
    """

    words: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    direct: bool = False
    terminal: bool = False
    limit: float = 2.0

    @property
    def text(self) -> str:
        """Everything that was given, for checks that depend on it."""
        given = [*self.words, *(content.decode("utf-8", "replace") for content in self.files.values())]
        return "\n".join(given).casefold()

    @property
    def command(self) -> str:
        """The command, as one types it."""
        return shlex.join(["pidemu", *(printable(word) for word in self.words)])


class Said(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


def _nothing(case: Case, said: Said) -> None:
    """Check nothing beyond what every command owes."""


def command(case: Case) -> int:
    """Run the command line in this process; return its exit status."""
    from pidemu.cli import main

    try:
        main(list(case.words))
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    return 0


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes
    ----------
    name : str
        What it is called.
    make : callable
        Return an input, which depends on the random numbers alone.
    corpus : callable
        Return inputs that were faults once, by name.
    run : callable
        Run an input in the current folder; return the exit status. `PidemuError` is an answer, everything else raised is a fault.
    check : callable
        Raise `Breach` where the outcome is wrong.
    """

    name: str
    make: Callable[[Random], Case]
    corpus: Callable[[], Mapping[str, Case]] = dict
    run: Callable[[Case], int] = command
    check: Callable[[Case, Said], None] = _nothing


class Ticket(NamedTuple):
    """Which input: a kind's name, a seed or ``corpus``, and a number or a name of the corpus."""

    kind: str
    seed: str
    number: str

    def __str__(self) -> str:
        return ":".join(self)

    @property
    def folder(self) -> str:
        """A name for its files."""
        return "-".join(self)


CORPUS = "corpus"
"""Seed of the inputs of the corpus."""


@functools.cache
def corpus_of(kind: Kind) -> Mapping[str, Case]:
    """Return the corpus of a kind; some of it takes time to make."""
    return kind.corpus()


def case_of(kind: Kind, ticket: Ticket) -> Case:
    """Return the input of a ticket.

    Raises
    ------
    KeyError
        The corpus has no such input.
    """
    if ticket.seed == CORPUS:
        return corpus_of(kind)[ticket.number]
    return kind.make(Random(str(ticket)))


def write_files(case: Case, folder: Path) -> None:
    """Write the files of an input to a folder."""
    for name, content in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    for name, target in case.links.items():
        (folder / name).symlink_to(target)


def printable(text: str) -> str:
    """Return a text in which nothing but printable characters is left, for reports."""
    return "".join(c if c.isprintable() or c == "\n" else f"\\x{ord(c):02x}" if ord(c) < 256 else f"\\u{ord(c):04x}" for c in text)
