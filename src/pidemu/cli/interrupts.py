"""Ctrl-C and SIGTERM: either ends a command, which writes what is complete; the exit status says which it was, 130 or 143."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Final

_TERMINATED: Final = threading.Event()


def status() -> int:
    """Return the exit status of a command that was interrupted."""
    return 128 + (signal.SIGTERM if _TERMINATED.is_set() else signal.SIGINT)


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Take SIGTERM for Ctrl-C as long as a command runs; only the first one, so that what is complete can be written."""
    _TERMINATED.clear()
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield  # whoever calls us sees to it
        return
    signal.signal(signal.SIGTERM, _terminated)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _terminated(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 (the signature of a handler)
    if not _TERMINATED.is_set():
        _TERMINATED.set()
        raise KeyboardInterrupt
