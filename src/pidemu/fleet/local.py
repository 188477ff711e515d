"""A fleet on one machine: blocks of loops inside, cores outside."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final

from pidemu.backends.choice import Choice, block, for_loops, give_up, instead, one_by_one
from pidemu.backends.engine_names import Engine
from pidemu.backends.runner import Block
from pidemu.errors import FleetError
from pidemu.fleet.blocks import BlockOutcome, Room, Stopped, run_block
from pidemu.fleet.group import Group, grouped
from pidemu.fleet.lists import PlacedLoops
from pidemu.fleet.loops import FleetPlan, Loop
from pidemu.fleet.prepare import Failed, Preparation, reason_of
from pidemu.processes import processors

_ONE_AT_A_TIME: Final = ("python", "numpy")
"""Engines that threads hold up more than they help: each keeps the interpreter's lock most of the time."""
_SIDE_BY_SIDE: Final = ("numpy", "numba", "c")
"""Engines that take about as long for a block as for its longest loop; the others run one loop after the other."""
_FIXED: Final = ("numba", "c")
"""Engines whose blocks have one width: it is a constant of what they compile."""
_TURN: Final = threading.Lock()
_AT_ONCE: Final = 8192
"""Loops that are prepared, and then run, at a time: what is in memory does not grow with the fleet."""
_AT_ONCE_KEPT: Final = 2048
"""The same where signals are kept: preparing them takes 2 to 10 s, and until it is over nothing is complete."""
_WORK: Final = 2**22
"""Loops times scans of a block whose signals are kept: some 3 s in plain Python. A run that is killed loses them."""
_NARROWEST: Final = {"numpy": 1024, "numba": 64, "c": 64}
"""Loops below which a block is not made narrower: half as wide, these engines take longer for the same (1.6 and 2 times)."""
_LOOK: Final = 0.5
"""Seconds after which a wait begins anew: where the system does not interrupt one, Ctrl-C is seen then."""


def outcomes(
    loops: Iterable[tuple[int, Loop]], plan: FleetPlan, *, cores: int | None = None, room: Room | None = None
) -> Generator[BlockOutcome | Failed]:
    """Run loops, and yield what comes of them, block by block, as it is done.

    While threads run blocks, the next loops are prepared. Where the iterator is closed or interrupted, blocks under way stop.

    Parameters
    ----------
    loops : iterable of (int, Loop)
        Loops with their places in the fleet.
    plan : FleetPlan
        What is done to them.
    cores : int, optional
        Threads; by default all cores.
    room : callable, optional
        From a shape to the array that takes a block's signals; by default they are not kept.
    """
    count = cores or processors()
    threads = _Threads(count, plan, room)
    try:
        all_of_them, at_once, preparation = PlacedLoops.of(loops), _AT_ONCE if room is None else _AT_ONCE_KEPT, Preparation(plan)
        for start in range(0, len(all_of_them), at_once):
            ready: list[Group] = []
            for found in preparation.prepared(all_of_them[start : start + at_once]):
                if isinstance(found, Failed):
                    yield found
                else:
                    ready.append(found)
                yield from threads.done()
            yield from threads.done(2 * count)
            for group in grouped(ready):
                threads.start(group)
        yield from threads.done(0)
    finally:
        threads.close()


class _Threads:
    """Threads that run blocks. Where signals are kept, they wait while many blocks are done that nobody has taken yet."""

    def __init__(self, count: int, plan: FleetPlan, room: Room | None) -> None:
        self._plan, self._room = plan, room
        self._stop = threading.Event()
        self._free = None if room is None else threading.Semaphore(2 * count)
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="fleet")
        self._done: queue.SimpleQueue[Future[list[BlockOutcome | Failed]]] = queue.SimpleQueue()
        self._left = 0

    def start(self, group: Group) -> None:
        """Run a group of loops."""
        choice, function, width = self._engine(group)
        if choice.engine in _ONE_AT_A_TIME:
            function = _in_turn(function)
        widest = width if self._room is None else min(width, max(_NARROWEST.get(choice.engine, 1), _WORK // group.mean_scans))
        for part in group.parts(widest, 2 if choice.engine in _SIDE_BY_SIDE else 1):
            lanes = width if choice.engine in _FIXED else len(part)
            self._pool.submit(self._run, part, choice, function, lanes).add_done_callback(self._done.put)
            self._left += 1

    def _engine(self, group: Group) -> tuple[Choice, Block, int]:
        """Return what runs a group; one that cannot even begin is replaced."""
        asked = self._plan.engine
        chosen: Engine = asked or "numba"
        try:
            choice = for_loops(group.structure, group.mean_scans, len(group), asked)
            chosen = choice.engine
            return choice, *block(group.structure, chosen)
        except Exception as error:
            give_up(chosen)
            then = None if asked else for_loops(group.structure, group.mean_scans, len(group))
            choice = instead(chosen, error, then)
            return choice, *block(group.structure, choice.engine)

    def _run(self, part: Group, choice: Choice, function: Block, width: int) -> list[BlockOutcome | Failed]:
        if self._free is not None:
            self._free.acquire()
        try:
            return [run_block(part, choice, function, width, self._room, self._stop.is_set)]
        except (Stopped, FleetError):  # the latter where there is no room for signals: that is nobody's loop
            raise
        except Exception as error:
            if (choice.engine, len(part)) == ("python", 1):
                return [Failed(int(part.places[0]), reason_of(error))]
            return [self._alone(part.chosen([i]), instead(choice.engine, error)) for i in range(len(part))]

    def _alone(self, member: Group, choice: Choice) -> BlockOutcome | Failed:
        """Run a loop of a block that failed, in plain Python: what was wrong with one of them is no matter to the others."""
        function = _in_turn(one_by_one(member.structure, choice.engine))
        try:
            return run_block(member, choice, function, 1, self._room, self._stop.is_set)
        except (Stopped, FleetError):
            raise
        except Exception as error:
            return Failed(int(member.places[0]), reason_of(error))

    def done(self, most: int | None = None) -> Iterator[BlockOutcome | Failed]:
        """Yield what is done; wait until at most so many blocks are left, or not at all."""
        while self._left:
            waits = most is not None and self._left > most
            try:
                future = self._done.get(block=waits, timeout=_LOOK)
            except queue.Empty:
                if waits:
                    continue
                return
            self._left -= 1
            yield from future.result()
            if self._free is not None:
                self._free.release()

    def close(self) -> None:
        """End the threads; blocks under way stop."""
        self._stop.set()
        if self._free is not None:
            self._free.release(self._left + 1)
        self._pool.shutdown(cancel_futures=True)


def _in_turn(function: Block) -> Block:
    def run(*arguments: Any, **named: Any) -> None:
        with _TURN:
            function(*arguments, **named)

    return run
