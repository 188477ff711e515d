"""Work that is shared among processes, and what becomes of it where one of them dies."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeVar

S = TypeVar("S")
R = TypeVar("R")


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def shared(function: Callable[[S], R], shares: Sequence[S], jobs: int) -> Iterator[tuple[S, R | BaseException]]:
    """Yield each share of some work with its result, as it gets done; with the error where its process died.

    A process that dies takes with it what the others were doing; each such share gets another try alone. With one job the work is
    done here. After Ctrl-C what has begun ends, and the rest is dropped.

    Parameters
    ----------
    function : callable
        From a share to its result; a function of a module, as other processes have to find it.
    shares : sequence
        What is shared out, such as can be sent to another process.
    jobs : int
        Processes.
    """
    if jobs <= 1:
        yield from ((share, function(share)) for share in shares)
        return
    unlucky = []
    for share, found in _run(function, shares, min(jobs, len(shares))):
        if isinstance(found, BrokenProcessPool):  # this one ended it, or was under way beside the one that did
            unlucky.append(share)
        else:
            yield share, found
    for share in unlucky:
        yield from _run(function, [share], 1)


def _run(function: Callable[[S], R], shares: Sequence[S], jobs: int) -> Iterator[tuple[S, R | BaseException]]:
    # "spawn" everywhere: the same on every system, and safe beside threads
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_leave_interrupts_to_the_parent)
    try:
        running: dict[Future[R], S] = {pool.submit(function, share): share for share in shares}
        for done in as_completed(running):
            error = done.exception()
            yield running[done], done.result() if error is None else error
    finally:
        pool.shutdown(cancel_futures=True)


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
