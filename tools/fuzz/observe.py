"""Running one input in this process, and judging the outcome."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import shutil
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pidemu.errors import PidemuError
from tools.fuzz import checks
from tools.fuzz.case import Case, Kind, Said, write_files
from tools.fuzz.failures import Breach, Failure, TooLong, failure_of

_clock = itertools.count(1_600_000_000_000_000_000, 1_000_000_000)
"""When files were changed [ns]: each later than the one before, so that nothing is taken for what stood there last."""


class Outcome(NamedTuple):
    """What came of an input."""

    failure: Failure | None
    seconds: float


def observe(kind: Kind, case: Case, folder: Path) -> Outcome:
    """Run an input in a folder and say what is wrong with the outcome; the folder is emptied afterwards.

    An input that takes too long is run again, since the first run may have had to import what it needs.
    """
    found = _observe_once(kind, case, folder)
    if found.seconds > case.limit / 2:
        again = _observe_once(kind, case, folder)
        return again if again.seconds < found.seconds or found.failure is None else found
    return found


def _observe_once(kind: Kind, case: Case, folder: Path) -> Outcome:
    _stage(case, folder)
    failure, started = None, time.process_time()
    seconds = 0.0
    with contextlib.chdir(folder), _captured(case.terminal) as streams:
        try:
            with warnings.catch_warnings(), _time_limit(case.limit):
                warnings.simplefilter("error")
                status = _status(kind, case)
            seconds = time.process_time() - started
            said = Said(status, *streams())
            for rule in (*checks.RULES, kind.check):
                rule(case, said)
            checks.files_are_whole(case, said, folder)
        except TooLong as error:
            place = failure_of(error)
            failure = Failure(f"over {case.limit:g} s", _label(case), f"at {place.place}", place.trace)
        except (Exception, SystemExit) as error:
            failure = failure_of(error)
    seconds = seconds or time.process_time() - started
    if failure is None and seconds > case.limit:  # where the clock could not interrupt
        failure = Failure(f"over {case.limit:g} s", _label(case), f"{seconds:.1f} s")
    _empty(folder)
    return Outcome(failure, seconds)


def _status(kind: Kind, case: Case) -> int:
    """Run the input; errors of pidemu are answers where no command prints them."""
    try:
        return kind.run(case)
    except PidemuError as error:
        if not case.direct:
            raise
        if not str(error).strip():
            raise Breach("says no cause", type(error).__name__) from None
        return 2


def _label(case: Case) -> str:
    return "pidemu " + (case.words[0] if case.words else "")


def _stage(case: Case, folder: Path) -> None:
    """Write the files of an input."""
    write_files(case, folder)
    for name in case.files:
        now = next(_clock)
        os.utime(folder / name, ns=(now, now))


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


class _Terminal(io.TextIOWrapper):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@contextlib.contextmanager
def _captured(terminal: bool) -> Iterator[Any]:
    """Take what is printed; give a function that returns what was printed on both streams."""
    buffers = io.BytesIO(), io.BytesIO()
    made = [(_Terminal if terminal else io.TextIOWrapper)(b, encoding="utf-8", write_through=True) for b in buffers]
    kept = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = made
    try:
        yield lambda: tuple(b.getvalue().decode("utf-8") for b in buffers)
    finally:
        sys.stdout, sys.stderr = kept


@contextlib.contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise `TooLong` after so much CPU time, where the system has such a clock; elsewhere the time is compared afterwards."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGPROF, _time_is_up)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.5)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _time_is_up(_signal: int, _frame: object) -> None:
    raise TooLong
