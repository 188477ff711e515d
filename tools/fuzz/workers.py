"""Processes that run inputs. One that dies or hangs is replaced, and its input is the failure."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import re
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final, NamedTuple

from tools.fuzz.case import CORPUS, Case, Kind, Ticket, case_of, corpus_of
from tools.fuzz.failures import Failure
from tools.fuzz.observe import observe
from tools.fuzz.shrink import shrink

MEMORY: Final = 4 * 2**30
"""Memory that a process may take [bytes]."""
_AWAKE: Final = 0.2


class Chunk(NamedTuple):
    """Inputs for one process: numbers of a seed, or the names of a corpus."""

    kind: Kind
    seed: str
    numbers: tuple[str, ...]

    def tickets(self) -> list[Ticket]:
        """Return the inputs."""
        return [Ticket(self.kind.name, self.seed, number) for number in self.numbers]


@dataclass
class Tally:
    """What came of a chunk.

    Attributes
    ----------
    count : int
        Inputs that ran.
    seconds : float
        CPU time that they took [s].
    slowest : tuple of float and str
        The longest time of one input [s], and which.
    failures : list of tuple
        Inputs that failed, with what is wrong.
    """

    count: int = 0
    seconds: float = 0.0
    slowest: tuple[float, str] = (0.0, "")
    failures: list[tuple[Ticket, Failure]] = field(default_factory=list)

    def add(self, ticket: Ticket, failure: Failure | None, seconds: float) -> None:
        """Take what came of one input."""
        self.count, self.seconds = self.count + 1, self.seconds + seconds
        self.slowest = max(self.slowest, (seconds, str(ticket)))
        if failure is not None:
            self.failures.append((ticket, failure))


def run_one(kind: Kind, ticket: Ticket, folder: Path, case: Case | None = None) -> tuple[Failure | None, float]:
    """Run one input in this process; where it cannot even be made, that is the failure."""
    try:
        return observe(kind, case_of(kind, ticket) if case is None else case, folder)
    except Exception as error:  # the harness itself
        from tools.fuzz.failures import failure_of

        found = failure_of(error)
        return replace(found, what=f"harness: {found.what}"), 0.0


def smallest(kind: Kind, ticket: Ticket, failure: Failure, folder: Path, seconds: float) -> Case:
    """Return the smallest input found that fails as this one does."""

    def fails(case: Case) -> bool:
        found, _ = run_one(kind, ticket, folder, case)
        return found is not None and found.group == failure.group

    case = case_of(kind, ticket)
    if not fails(case):
        return case
    return shrink(case, fails, seconds=seconds)


def _work(connection: Connection, crash_file: str) -> None:
    """Run what is asked for until nothing more is; say before each input which one it is."""
    _limit_memory()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with tempfile.TemporaryDirectory(prefix="pidemu-fuzz-") as name, open(crash_file, "w", encoding="utf-8") as crash:
        faulthandler.enable(crash)
        if hasattr(faulthandler, "register"):
            faulthandler.register(signal.SIGUSR1, crash)
        folder = Path(name) / "work"
        folder.mkdir()
        while (asked := connection.recv()) is not None:
            for answer in _answers(asked, folder, connection):
                connection.send(answer)


def _answers(asked: Any, folder: Path, connection: Connection) -> Any:
    if isinstance(asked, Chunk):
        tally = Tally()
        for number in asked.numbers:
            connection.send(number)
            ticket = Ticket(asked.kind.name, asked.seed, number)
            tally.add(ticket, *run_one(asked.kind, ticket, folder))
        yield tally
    else:
        kind, ticket, failure, seconds = asked
        connection.send(ticket.number)
        yield smallest(kind, ticket, failure, folder, seconds)


def _limit_memory() -> None:
    if sys.platform == "win32":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))


class Worker:
    """A process that runs inputs, and what is known of it.

    Parameters
    ----------
    patience : float
        Seconds without a word after which it counts as hung.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._context = multiprocessing.get_context("spawn")
        self._file = tempfile.NamedTemporaryFile("r", prefix="pidemu-fuzz-", suffix=".txt", delete=False)  # noqa: SIM115
        self._begin()

    def _begin(self) -> None:
        self.connection, theirs = self._context.Pipe()
        self._process = self._context.Process(target=_work, args=(theirs, self._file.name), daemon=True)
        self._process.start()
        theirs.close()
        self._asked: Any = None
        self._heard = time.monotonic()
        self._done: list[str] = []

    @property
    def is_idle(self) -> bool:
        """Whether it has nothing to do."""
        return self._asked is None

    @property
    def asked(self) -> Any:
        """What it was asked last."""
        return self._asked

    def ask(self, asked: Any) -> None:
        """Give it something to do."""
        self._asked, self._heard, self._done = asked, time.monotonic(), []
        self.connection.send(asked)

    def answer(self) -> Any:
        """Return what it found, ``None`` while it is at it; where it died or hangs, the inputs it had begun and a `Failure`."""
        try:
            while self.connection.poll():
                found = self.connection.recv()
                self._heard = time.monotonic()
                if not isinstance(found, str):
                    self._asked = None
                    return found
                self._done.append(found)
        except (EOFError, OSError):
            return self._lost("died", f"exit status {self._status()}")
        if time.monotonic() - self._heard > self._patience:
            return self._lost("hangs", f"no answer after {self._patience:g} s")
        return None

    def _status(self) -> int | None:
        self._process.join(5)
        return self._process.exitcode

    def _lost(self, what: str, detail: str) -> tuple[list[str], Failure]:
        """Replace the process; return the inputs it had begun, the last of which is the failure, and why."""
        if self._process.is_alive() and hasattr(signal, "SIGUSR1") and self._process.pid is not None:
            os.kill(self._process.pid, signal.SIGUSR1)
            time.sleep(_AWAKE)
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._file.seek(0)
        trace = self._file.read()
        begun = self._done
        self._begin()
        return begun, Failure(what, _place_in(trace), detail, trace)

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._file.close()
        Path(self._file.name).unlink(missing_ok=True)


def _place_in(trace: str) -> str:
    """Return the innermost place in pidemu of a dumped stack, else the innermost at all."""
    found = re.findall(r'File "([^"]+)", line (\d+)', trace)
    ours = [f for f in found if f"{os.sep}pidemu{os.sep}" in f[0] and "tools" not in Path(f[0]).parts]
    if not found:
        return "?"
    file, line = (ours or found)[0]
    return f"{'/'.join(Path(file).parts[-4:])}:{line}" if ours else f"{Path(file).name}:{line}"


def corpus_chunks(kind: Kind, size: int) -> list[Chunk]:
    """Return the corpus of a kind, in chunks."""
    names = tuple(corpus_of(kind))
    return [Chunk(kind, CORPUS, names[i : i + size]) for i in range(0, len(names), size)]
