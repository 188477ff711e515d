"""A whole run: the corpora first, then inputs of every kind until the time is up or all have run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any, Final

from tools.fuzz.case import CORPUS, Case, Kind, Ticket, case_of
from tools.fuzz.failures import Failure
from tools.fuzz.workers import Chunk, Tally, Worker, corpus_chunks

PATIENCE: Final = 30.0
"""Seconds without a word after which a process counts as hung; an input may take two, on a machine that may be busy."""
_SECONDS_PER_CHUNK: Final = 1.0
_MOST: Final = 2000


@dataclass
class Group:
    """Inputs that fail for the same reason: the first, how many, and the smallest input found.

    Attributes
    ----------
    kind : Kind
        Their kind.
    ticket : Ticket
        The first input.
    failure : Failure
        What is wrong with it.
    count : int
        How many there are.
    smallest : Case
        An input that fails in the same way, made small.
    """

    kind: Kind
    ticket: Ticket
    failure: Failure
    count: int
    smallest: Case


@dataclass
class Result:
    """What came of a run.

    Attributes
    ----------
    seed : int
        Its seed.
    tallies : dict of str to Tally
        What came of every kind, by name.
    groups : list of Group
        What failed, the most frequent first.
    """

    seed: int
    tallies: dict[str, Tally] = field(default_factory=dict)
    groups: list[Group] = field(default_factory=list)


def fuzz(
    kinds: Sequence[Kind],
    seed: int = 0,
    *,
    minutes: float | None = None,
    count: int | None = None,
    jobs: int = 1,
    patience: float = PATIENCE,
    effort: float = 10.0,
    progress: Callable[[str], None] = lambda _text: None,
) -> Result:
    """Run inputs and return what failed.

    Parameters
    ----------
    kinds : sequence of Kind
        What to run.
    seed : int
        Which inputs: number `i` of a kind depends on the kind, the seed and `i` alone.
    minutes : float, optional
        How long, shared evenly between the kinds.
    count : int, optional
        How many inputs of each kind; with `minutes` as well, whichever ends first.
    jobs : int
        Processes.
    patience : float
        Seconds without a word after which a process counts as hung [s].
    effort : float
        Seconds for making the first input of each group small [s].
    progress : callable
        Called with a line of text now and then.
    """
    result = Result(seed, {kind.name: Tally() for kind in kinds})
    plan = _Plan(kinds, seed, minutes, count)
    workers = [Worker(patience) for _ in range(jobs)]
    try:
        for kind, found in _all(workers, plan, result, progress):
            _merge(result.tallies[kind.name], found)
        result.groups = _grouped(kinds, result)
        _make_small(workers, result.groups, effort)
    finally:
        for worker in workers:
            worker.end()
    return result


class _Plan:
    """Which chunk comes next: the corpora, then the kind that has had the least time."""

    def __init__(self, kinds: Sequence[Kind], seed: int, minutes: float | None, count: int | None) -> None:
        self._seed, self._count = str(seed), count
        self._end = None if minutes is None else time.monotonic() + 60 * minutes
        self._corpora = [chunk for kind in kinds for chunk in corpus_chunks(kind, 10)]
        self._next = dict.fromkeys((k.name for k in kinds), 0)
        self._kinds = {k.name: k for k in kinds}
        self.again: list[Chunk] = []

    def chunk(self, tallies: dict[str, Tally]) -> Chunk | None:
        """Return what is to be run next; ``None`` where nothing is left."""
        if self.again:
            return self.again.pop()
        if self._corpora:
            return self._corpora.pop(0)
        if self._end is not None and time.monotonic() > self._end:
            return None
        open_ = [name for name, at in self._next.items() if self._count is None or at < self._count]
        if not open_:
            return None
        name = min(open_, key=lambda n: (tallies[n].seconds, self._next[n]))
        tally, begin = tallies[name], self._next[name]
        each = tally.seconds / tally.count if tally.count else 0.1
        size = max(5, min(_MOST, int(_SECONDS_PER_CHUNK / max(each, 1e-4))))
        end = begin + size if self._count is None else min(begin + size, self._count)
        self._next[name] = end
        return Chunk(self._kinds[name], self._seed, tuple(map(str, range(begin, end))))


def _all(workers: list[Worker], plan: _Plan, result: Result, progress: Callable[[str], None]) -> Iterator[tuple[Kind, Tally]]:
    """Let the workers run everything that is planned; yield what came of it."""
    said = time.monotonic()
    while True:
        for worker in workers:
            if worker.is_idle and (chunk := plan.chunk(result.tallies)) is not None:
                worker.ask(chunk)
        busy = [w for w in workers if not w.is_idle]
        if not busy:
            return
        wait([w.connection for w in busy], timeout=0.5)
        for worker in busy:
            chunk = worker.asked
            found = worker.answer()
            if isinstance(found, Tally):
                yield chunk.kind, found
            elif found is not None:
                yield chunk.kind, _after_a_loss(chunk, found, plan)
        if time.monotonic() - said > 10:
            said = time.monotonic()
            progress(", ".join(f"{name} {t.count:,} ({len(t.failures):,} failed)" for name, t in result.tallies.items()))


def _after_a_loss(chunk: Chunk, lost: tuple[list[str], Failure], plan: _Plan) -> Tally:
    """Return the failure of the input at which a process was lost; the others of the chunk are run again."""
    begun, failure = lost
    if not begun:  # before the first: not an input's fault, but nothing to go on with either
        raise RuntimeError(f"a process was lost before its first input: {failure.detail}\n{failure.trace}")
    bad = begun[-1]
    others = tuple(number for number in chunk.numbers if number != bad)
    if others:
        plan.again.append(chunk._replace(numbers=others))
    tally = Tally()
    tally.add(Ticket(chunk.kind.name, chunk.seed, bad), failure, 0.0)
    return tally


def _merge(total: Tally, found: Tally) -> None:
    total.count += found.count
    total.seconds += found.seconds
    total.slowest = max(total.slowest, found.slowest)
    total.failures += found.failures


def _grouped(kinds: Sequence[Kind], result: Result) -> list[Group]:
    """Return one group for every kind, reason and place; its first input is the one of the corpus, or the lowest number."""
    by_name = {kind.name: kind for kind in kinds}
    found: dict[Any, Group] = {}
    failures = [failure for tally in result.tallies.values() for failure in tally.failures]
    for ticket, failure in sorted(failures, key=lambda f: _order(f[0])):
        key = (ticket.kind, *failure.group)
        if key not in found:
            kind = by_name[ticket.kind]
            found[key] = Group(
                kind, ticket, failure, 0, case_of(kind, ticket) if not failure.what.startswith("harness") else Case(())
            )
        found[key].count += 1
    return sorted(found.values(), key=lambda g: -g.count)


def _order(ticket: Ticket) -> tuple[bool, int, str]:
    return ticket.number.isdigit(), int(ticket.number) if ticket.number.isdigit() else 0, ticket.number


def _can_be_made_small(group: Group) -> bool:
    """Whether it is worth trying: the corpus is small already, and what takes seconds takes minutes to make small."""
    slow = ("died", "hangs", "over", "harness")
    return group.ticket.seed != CORPUS and not group.failure.what.startswith(slow)


def _make_small(workers: list[Worker], groups: list[Group], effort: float) -> None:
    """Make the first input of every group small, where a process survives it."""
    waiting = [g for g in groups if _can_be_made_small(g)]
    at_work: dict[int, Group] = {}
    while waiting or at_work:
        for i, worker in enumerate(workers):
            if worker.is_idle and waiting:
                at_work[i] = group = waiting.pop(0)
                worker.ask((group.kind, group.ticket, group.failure, effort))
        wait([workers[i].connection for i in at_work], timeout=0.5)
        for i in list(at_work):
            found = workers[i].answer()
            if found is not None:
                group = at_work.pop(i)
                group.smallest = found if isinstance(found, Case) else group.smallest
