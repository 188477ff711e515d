"""A fleet on a Dask cluster: chunks of loops as tasks, each of some seconds (extra ``cluster``)."""

from __future__ import annotations

import contextlib
import importlib
import socket
import time
from collections.abc import Generator, Iterable, Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pidemu.errors import FleetError
from pidemu.files.cache import warn
from pidemu.fleet.blocks import BlockOutcome
from pidemu.fleet.lists import PlacedLoops
from pidemu.fleet.local import outcomes
from pidemu.fleet.loops import FleetPlan, Loop
from pidemu.fleet.prepare import Failed

_FIRST: Final = 64
"""Loops in the first chunks; how long they take decides about the size of the next."""
_SECONDS: Final = 3.0
"""How long a chunk should take: much longer than Dask needs for a task, short enough to be done again where a worker is lost."""
_MOST: Final = 4096
_AHEAD: Final = 3
"""Chunks per thread of a worker that are under way."""
_PATIENCE: Final = 10.0
"""How long a scheduler may take to answer [s]."""
_LOST: Final = "the cluster was lost; run the loop again"
_QUIET: Final = 10.0
"""How long a cluster may have no worker before that is said [s]."""
_LOOK: Final = 1.0
"""Seconds from one look at the workers to the next."""

Numbered = tuple[int, Loop]


def outcomes_on(
    cluster: Any, loops: Iterable[Numbered], plan: FleetPlan, worker_timeout: float
) -> Generator[BlockOutcome | Failed]:
    """Run loops on a cluster, and yield what comes of them as it is done.

    The numbers are those of one machine: a loop's do not depend on the loops beside it. Chunks of a worker that is lost are run
    again by Dask on another one; where the whole cluster is lost, or has no worker for long, the loops that are left fail.

    Parameters
    ----------
    cluster : str or distributed.Client or distributed cluster
        Where to run: the scheduler's address, a client, or a cluster such as ``distributed.LocalCluster``.
    loops : iterable of (int, Loop)
        Loops with their places in the fleet.
    plan : FleetPlan
        What is done to them.
    worker_timeout : float
        How long to wait where there is no worker [s]; 0 for ever.

    Raises
    ------
    FleetError
        Dask is not installed, or there is no scheduler at the address.
    """
    distributed = _distributed()
    with _client(distributed, cluster) as client:
        yield from _Chunks(distributed, client, loops, plan, worker_timeout).outcomes()


class _Chunks:
    """Chunks of loops: as many under way as keep all threads of the cluster busy, each of some seconds."""

    def __init__(self, distributed: Any, client: Any, loops: Iterable[Numbered], plan: FleetPlan, worker_timeout: float) -> None:
        self._distributed, self._client, self._plan = distributed, client, plan
        self._loops, self._size, self._next_one = PlacedLoops.of(loops), _FIRST, 0
        self._under_way: dict[Any, PlacedLoops] = {}
        self._halves: list[PlacedLoops] = []
        self._suspects: list[PlacedLoops] = []
        self._alone: set[int] = set()
        self._workers = _Workers(client, worker_timeout)

    def outcomes(self) -> Iterator[BlockOutcome | Failed]:
        """Yield what comes of the loops."""
        done = self._distributed.as_completed(self._submitted(), loop=self._client.loop)
        try:
            for future in self._workers.waited(done):
                if future.cancelled():
                    break
                chunk = self._under_way.pop(future)
                taken = _taken(future)
                if not (isinstance(taken, self._distributed.KilledWorker) and self._is_tried_again(chunk)):
                    found, seconds = _result(taken, chunk)
                    yield from found
                    self._size = _next_size(self._size, len(chunk), seconds)
                if self._client.status == "running":
                    done.update(self._submitted())
            left = (*self._under_way.values(), *self._halves, *self._suspects, self._loops[self._next_one :])
            yield from (Failed(place, self._workers.fault or _LOST) for chunk in left for place in chunk.places)
        finally:
            if self._client.status == "running":
                self._client.cancel(list(self._under_way))

    def _submitted(self) -> list[Any]:
        """Submit further chunks; workers may have come or gone."""
        threads = max(1, sum(self._client.nthreads().values()))
        new = []
        while len(self._under_way) < _AHEAD * threads and (chunk := self._next()):
            new.append(self._client.submit(run_chunk, chunk, self._plan, pure=False, retries=2))
            self._under_way[new[-1]] = chunk
        return new

    def _next(self) -> PlacedLoops:
        """Return the next chunk: of a table its rows and their numbers, of which a worker makes what it needs."""
        if self._halves:
            return self._halves.pop()
        chunk = self._loops[self._next_one : self._next_one + self._size]
        self._next_one += len(chunk)
        if not chunk and not self._under_way and self._suspects:
            chunk = self._suspects.pop()
            self._alone.add(chunk.places[0])
        return chunk

    def _is_tried_again(self, chunk: PlacedLoops) -> bool:
        """Tell whether loops whose workers were killed get another chance: halves of them, and at the end each with nothing beside.

        One of them may end whatever runs it, and takes with it what the same worker is at; the others are not to fail for it.
        """
        middle = len(chunk) // 2
        if middle:
            self._halves += [chunk[:middle], chunk[middle:]]
        elif chunk.places[0] not in self._alone:
            self._suspects.append(chunk)
        else:
            return False
        return True


class _Workers:
    """Waits for what workers do, and not for ever where there is none."""

    def __init__(self, client: Any, timeout: float) -> None:
        self._client, self._timeout = client, timeout
        self._since: float | None = None
        self._said = False
        self.fault = ""

    def waited(self, done: Any) -> Iterator[Any]:
        """Yield futures as they are done; end where all are, or where there has been no worker for too long."""
        looked = time.monotonic()
        while not done.is_empty():
            if done.has_ready():
                self._since = None
                yield next(done)
                looked = time.monotonic()
                continue
            time.sleep(0.02)
            if time.monotonic() - looked > _LOOK:
                looked = time.monotonic()
                if self._given_up():
                    return

    def _given_up(self) -> bool:
        """Tell whether there has been no worker for too long; say so when it begins to be long."""
        if self._client.status != "running" or self._client.nthreads():
            self._since, self._said = None, False
            return False
        self._since = time.monotonic() if self._since is None else self._since
        waited = time.monotonic() - self._since
        if 0 < self._timeout <= waited:
            self.fault = f"the cluster had no worker for {self._timeout:g} s; start some with 'dask worker', and run the loop again"
            return True
        if waited >= _QUIET and not self._said:
            self._said = True
            end = f"waiting until there have been none for {self._timeout:g} s" if self._timeout > 0 else "waiting for one"
            warn(f"{_address(self._client)} has no workers; {end}; 'dask worker ADDRESS' starts one")
        return False


def _address(client: Any) -> str:
    return str(client.scheduler.address) if client.scheduler is not None else "the cluster"


def run_chunk(chunk: PlacedLoops, plan: FleetPlan) -> tuple[list[BlockOutcome | Failed], float]:
    """Run loops on a worker; return what came of them, and how long it took [s].

    Parameters
    ----------
    chunk : PlacedLoops
        Loops with their places in the fleet.
    plan : FleetPlan
        What is done to them.
    """
    start = time.perf_counter()
    found = [_light(one) for one in outcomes(chunk, plan, cores=1, room=np.empty if plan.keep else None)]
    return found, time.perf_counter() - start


def _light(one: BlockOutcome | Failed) -> BlockOutcome | Failed:
    """Return what is sent back: what came of the loops, without the numbers of their programs."""
    if isinstance(one, Failed):
        return one
    return replace(one, members=one.members.light())


Taken = tuple[list[BlockOutcome | Failed], float]


def _taken(future: Any) -> Taken | Exception:
    """Return what a chunk gave, or why there is nothing: its own error, or that of a worker that was lost with what it had done."""
    try:
        taken: Taken = future.result()
    except Exception as error:
        return error
    return taken


def _result(taken: Taken | Exception, chunk: PlacedLoops) -> Taken:
    """Return what a chunk gave; where it could not be run at all, why, for each of its loops."""
    if isinstance(taken, Exception):
        return [Failed(place, f"the cluster could not run it: {taken}") for place in chunk.places], _SECONDS
    return taken


def _next_size(size: int, loops: int, seconds: float) -> int:
    wanted = int(loops * _SECONDS / max(seconds, 1e-3))
    return max(1, min(wanted, 4 * size, _MOST))


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise FleetError(
            "a cluster needs dask.distributed, which is not installed; pip install 'pidemu[cluster]' brings it"
        ) from None


@contextlib.contextmanager
def _client(distributed: Any, cluster: Any) -> Iterator[Any]:
    if isinstance(cluster, distributed.Client):
        yield cluster
        return
    try:
        if isinstance(cluster, str):
            _wait_for(*distributed.comm.get_address_host_port(cluster))
        client = distributed.Client(cluster, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        raise FleetError(
            f"no scheduler answers at {cluster}: {error}; start one with 'dask scheduler', and give its address"
        ) from None
    try:
        yield client
    finally:
        client.close()


def _wait_for(host: str, port: int) -> None:
    """Wait until something listens; a Dask client that finds nothing leaves threads behind.

    Raises
    ------
    OSError
        Nothing does.
    """
    end = time.monotonic() + _PATIENCE
    while True:
        try:
            socket.create_connection((host, port), timeout=_PATIENCE).close()
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(min(0.2, _PATIENCE))
        else:
            return
