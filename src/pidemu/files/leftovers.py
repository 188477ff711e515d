"""Files that a killed process left half written: each is locked as long as whoever writes it lives, however that ends.

Where the system or the file system has no such locks, as Windows, nothing is known of who writes a file, and none is removed.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from pathlib import Path
from typing import Final

UNFINISHED: Final = ".unfinished"
"""Ending of a file that is being written beside another."""


def is_own(number: int) -> bool:
    """Lock a new file until it is closed, and all its duplicates are; tell whether it is still there to be written."""
    if os.name != "posix":
        return True
    import fcntl

    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:  # it was taken for a leftover, between its making and its lock
        return False
    except OSError:  # no locks here, for others neither
        return True
    return os.fstat(number).st_nlink > 0


def remove_leftovers(folder: Path, short: str) -> None:
    """Remove files that were being written beside another, and whose writer is gone.

    Parameters
    ----------
    folder : Path
        Where they are.
    short : str
        What their names begin with, behind the point.
    """
    if os.name != "posix":
        return
    name = re.compile(rf"\.{re.escape(short)}\.[0-9a-f]{{8}}{re.escape(UNFINISHED)}")
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for path in [entry.path for entry in entries if name.fullmatch(entry.name)]:
            with contextlib.suppress(OSError):
                _remove(path)


def _remove(path: str) -> None:
    import fcntl

    number = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        if stat.S_ISREG(os.fstat(number).st_mode):
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.unlink(path)
    finally:
        os.close(number)
