"""A fleet on one machine: blocks of loops inside, cores outside."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, Final

from pidemu.engines import block, for_loops
from pidemu.fleet.blocks import Outcome, Room, run_block
from pidemu.fleet.loops import Loop, Plan
from pidemu.fleet.prepare import Failed, Group, Prepared, grouped, prepared
from pidemu.targets.runner import Block

_ONE_AT_A_TIME: Final = ("python", "numpy")
"""Engines that threads hold up more than they help: each keeps the interpreter's lock most of the time."""
_TURN: Final = threading.Lock()
_AT_ONCE: Final = 8192
"""Loops that are prepared, and then run, at a time: what is in memory does not grow with the fleet."""


def cores_here() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def outcomes(
    loops: Iterable[tuple[int, Loop]], plan: Plan, *, cores: int | None = None, room: Room | None = None
) -> Generator[Outcome | Failed]:
    """Run loops, and yield what comes of them, block by block, as it is done.

    While threads run blocks, the next loops are prepared. Where the iterator is closed or interrupted, blocks under way stop.

    Parameters
    ----------
    loops : iterable of (int, Loop)
        Loops with their places in the fleet.
    plan : Plan
        What is done to them.
    cores : int, optional
        Threads; by default all cores.
    room : callable, optional
        From a shape to the array that takes a block's signals; by default they are not kept.
    """
    stop = threading.Event()
    count = cores or cores_here()
    pool = ThreadPoolExecutor(count, thread_name_prefix="fleet")
    under_way: set[Future[Outcome]] = set()
    try:
        source = iter(loops)
        while some := list(itertools.islice(source, _AT_ONCE)):
            ready: list[Prepared] = []
            for found in prepared(some, plan):
                if isinstance(found, Failed):
                    yield found
                else:
                    ready.append(found)
            for group in grouped(ready):
                under_way |= _started(pool, group, plan, room, stop)
            while len(under_way) > 2 * count:
                yield from _done(under_way)
        while under_way:
            yield from _done(under_way)
    finally:
        stop.set()
        pool.shutdown(cancel_futures=True)


def _started(pool: ThreadPoolExecutor, group: Group, plan: Plan, room: Room | None, stop: threading.Event) -> set[Future[Outcome]]:
    choice = for_loops(group.structure, group.scans, len(group.members), plan.engine)
    function, most = block(group.structure, choice.engine)
    if choice.engine in _ONE_AT_A_TIME:
        function = _in_turn(function)
    width = most if choice.engine == "numba" else min(most, len(group.members))
    parts = (group.members[start : start + width] for start in range(0, len(group.members), width))
    return {pool.submit(run_block, group, part, choice, function, width, room, stop.is_set) for part in parts}


def _in_turn(function: Block) -> Block:
    def run(*arguments: Any, **named: Any) -> None:
        with _TURN:
            function(*arguments, **named)

    return run


def _done(under_way: set[Future[Outcome]]) -> Iterator[Outcome]:
    """Yield what is done, and wait for the first where nothing is."""
    done, _ = wait(under_way, return_when=FIRST_COMPLETED)
    for future in done:
        under_way.discard(future)
        yield future.result()
