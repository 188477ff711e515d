"""A fleet on a Dask cluster: chunks of loops as tasks, each of some seconds (extra ``cluster``)."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from pidemu.errors import FleetError
from pidemu.fleet.blocks import Outcome
from pidemu.fleet.local import outcomes
from pidemu.fleet.loops import Loop, Plan
from pidemu.fleet.prepare import Failed

_FIRST: Final = 64
"""Loops in the first chunks; how long they take decides about the size of the next."""
_SECONDS: Final = 3.0
"""How long a chunk should take: much longer than Dask needs for a task, short enough to be done again where a worker is lost."""
_MOST: Final = 4096
_AHEAD: Final = 3
"""Chunks per worker that are under way."""

Numbered = tuple[int, Loop]


def outcomes_on(cluster: Any, loops: Iterable[Numbered], plan: Plan) -> Generator[Outcome | Failed]:
    """Run loops on a cluster, and yield what comes of them as it is done.

    The numbers are those of one machine: a loop's do not depend on the loops beside it. Chunks of a worker that is lost are run
    again by Dask on another one.

    Parameters
    ----------
    cluster : str or distributed.Client or distributed cluster
        Where to run: the scheduler's address, a client, or a cluster such as ``distributed.LocalCluster``.
    loops : iterable of (int, Loop)
        Loops with their places in the fleet.
    plan : Plan
        What is done to them.

    Raises
    ------
    FleetError
        Dask is not installed, or there is no scheduler at the address.
    """
    distributed = _distributed()
    with _client(distributed, cluster) as client:
        source, size = iter(loops), _FIRST
        chunks: dict[Any, list[Numbered]] = {}

        def submitted(count: int) -> Iterator[Any]:
            for _ in range(count):
                chunk = list(itertools.islice(source, size))
                if chunk:
                    future = client.submit(run_chunk, chunk, plan, pure=False, retries=2)
                    chunks[future] = chunk
                    yield future

        done = distributed.as_completed(submitted(_AHEAD * _workers(client)))
        try:
            for future in done:
                chunk = chunks.pop(future)
                found, seconds = _result(future, chunk)
                yield from found
                size = _next_size(size, len(chunk), seconds)
                for new in submitted(1):
                    done.add(new)
        finally:
            client.cancel(list(chunks))


def run_chunk(chunk: Sequence[Numbered], plan: Plan) -> tuple[list[Outcome | Failed], float]:
    """Run loops on a worker; return what came of them, and how long it took [s].

    Parameters
    ----------
    chunk : sequence of (int, Loop)
        Loops with their places in the fleet.
    plan : Plan
        What is done to them.
    """
    start = time.perf_counter()
    found = [_light(one) for one in outcomes(chunk, plan, cores=1, room=np.empty if plan.keep else None)]
    return found, time.perf_counter() - start


def _light(one: Outcome | Failed) -> Outcome | Failed:
    """Return what is sent back: the trials and what came of them, without the programs' numbers."""
    if isinstance(one, Failed):
        return one
    return replace(one, members=tuple(replace(m, structure=None, values=(), initial=()) for m in one.members))  # type: ignore[arg-type]


def _result(future: Any, chunk: Sequence[Numbered]) -> tuple[list[Outcome | Failed], float]:
    """Return what a chunk gave; where it could not be run at all, why, for each of its loops."""
    error = future.exception()
    if error is None:
        found: tuple[list[Outcome | Failed], float] = future.result()
        return found
    return [Failed(place, f"the cluster could not run it: {error}") for place, _ in chunk], _SECONDS


def _next_size(size: int, loops: int, seconds: float) -> int:
    wanted = int(loops * _SECONDS / max(seconds, 1e-3))
    return max(1, min(wanted, 4 * size, _MOST))


def _workers(client: Any) -> int:
    return max(1, len(client.scheduler_info()["workers"]))


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
        client = distributed.Client(cluster, timeout=10)
    except (OSError, TimeoutError, ValueError) as error:
        raise FleetError(
            f"no scheduler answers at {cluster}: {error}; start one with 'dask scheduler', and give its address"
        ) from None
    try:
        yield client
    finally:
        client.close()
