"""The standard streams, where they are closed or full: said in one line, without a traceback."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from typing import Any

from pidemu.files.reading import reason


def prepare() -> None:
    """Take the places of closed streams, lest the next file that is opened takes them; what a console lacks is escaped."""
    if sys.stdin is None:
        os.open(os.devnull, os.O_RDONLY)  # the lowest free number
    if sys.stdout is None:
        sys.stdout = open(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")  # noqa: SIM115  # refuses what is written
    if sys.stderr is None:
        sys.stderr = open(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def flush() -> None:
    """Write what is kept back.

    Raises
    ------
    OSError
        There is no room for it, or the stream is closed.
    """
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()


def report(error: OSError) -> int:
    """Say which stream cannot be written, and return the exit status; raise the error where all of them can."""
    broken = next((stream for stream in (sys.stdout, sys.stderr) if stream is not None and not _writes(stream)), None)
    if error.filename is not None or broken is None:
        raise error
    with contextlib.suppress(OSError, ValueError):  # what is kept back goes nowhere, and is no error at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), broken.fileno())
    if broken is sys.stdout:
        why = "it is closed" if error.errno == errno.EBADF else reason(error)
        with contextlib.suppress(OSError):
            sys.stderr.write(f"error: the standard output cannot be written: {why}\n")
            sys.stderr.flush()
    return 1


def _writes(stream: Any) -> bool:
    try:
        stream.write("\n")  # what failed before may be dropped already
        stream.flush()
    except (OSError, ValueError):
        return False
    return True
