"""A progress bar on standard error for long work."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any, Final

_LARGE: Final = 1000
"""Loops from which on a bar is shown on a terminal."""


class Progress:
    """How many loops are done.

    Parameters
    ----------
    total : int
        Loops in all.
    shown : bool or None
        Whether to show a bar; by default where standard error is a terminal and the fleet is large.
    """

    def __init__(self, total: int, shown: bool | None) -> None:
        self._total = total
        self._shown = bool(sys.stderr and sys.stderr.isatty() and total >= _LARGE) if shown is None else shown
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        if self._shown:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Bar(*columns, console=Console(stderr=True))
            self._bar.start()
            self._task = self._bar.add_task("loops", total=self._total)
        return self

    def advance(self, loops: int) -> None:
        """Say that so many more are done."""
        if self._bar is not None:
            self._bar.advance(self._task, loops)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()
