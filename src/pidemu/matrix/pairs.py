"""Many conversions, shared among processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Final

from pidemu.matrix.cell import Cell, Work, cell, failed

_SHARE: Final = 4
"""Conversions that a process does before it reports. Some shares are begun ahead, and after Ctrl-C these still have to end."""
_FEW: Final = 60
"""Conversions below which starting processes takes longer than it saves."""

Pairs = tuple[tuple[str, str], ...]


def computed(
    work: Work, pairs: Sequence[tuple[str, str]], jobs: int | None = None, progress: Callable[[int, int], None] | None = None
) -> dict[tuple[str, str], Cell]:
    """Return the cell of every pair of cards.

    Parameters
    ----------
    work : Work
        What is computed.
    pairs : sequence of pairs of str
        Ids of source and target.
    jobs : int, optional
        Processes; by default as many as there are processors, and none beside this one where there is little to do.
    progress : callable, optional
        Called with the number of pairs done, and of all.
    """
    shares = [tuple(pairs[i : i + _SHARE]) for i in range(0, len(pairs), _SHARE)]
    if jobs is None:
        jobs = 1 if len(pairs) < _FEW else os.cpu_count() or 1
    found: dict[tuple[str, str], Cell] = {}
    for cells in _shared(work, shares, jobs) if jobs > 1 else (_share(work, share) for share in shares):
        found.update({(c.source, c.target): c for c in cells})
        if progress is not None:
            progress(len(found), len(pairs))
    return found


def _shared(work: Work, shares: Sequence[Pairs], jobs: int) -> Iterator[list[Cell]]:
    """Yield the cells of each share as it gets done; what a process that died was doing has failed."""
    # "spawn" everywhere: the same on every system, and safe beside threads
    pool = ProcessPoolExecutor(min(jobs, len(shares)), mp_context=get_context("spawn"), initializer=_leave_interrupts_to_the_parent)
    try:
        running: dict[Future[list[Cell]], Pairs] = {pool.submit(_share, work, share): share for share in shares}
        for done in as_completed(running):
            error = done.exception()
            yield done.result() if error is None else [failed(*pair, error) for pair in running[done]]
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C, what has begun ends and the rest is dropped


def _share(work: Work, pairs: Pairs) -> list[Cell]:
    return [cell(work, *pair) for pair in pairs]


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
