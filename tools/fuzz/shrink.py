"""Making a failing input small, as long as it fails in the same way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final, TypeVar

from tools.fuzz.case import Case

T = TypeVar("T")
_LETTERS: Final = 3000
"""Characters of a file that are taken away one by one; of a longer one, lines are enough."""


class _Budget:
    """Attempts and seconds that are left."""

    def __init__(self, attempts: int, seconds: float) -> None:
        self._left, self._end = attempts, time.monotonic() + seconds

    def spend(self) -> bool:
        """Return whether one more attempt may be made."""
        self._left -= 1
        return self._left >= 0 and time.monotonic() < self._end


def shrink(case: Case, fails: Callable[[Case], bool], attempts: int = 3000, seconds: float = 20.0) -> Case:
    """Return a smaller input that fails too.

    Parameters
    ----------
    case : Case
        An input that fails.
    fails : callable
        Whether an input fails in the same way.
    attempts : int
        How many inputs may be tried.
    seconds : float
        How long it may take [s].
    """
    budget = _Budget(attempts, seconds)

    def still(candidate: Case) -> bool:
        return budget.spend() and fails(candidate)

    while (smaller := _pass(case, still)) != case:
        case = smaller
    return case


def _pass(case: Case, still: Callable[[Case], bool]) -> Case:
    """Take away files, words, lines and characters once."""
    for name in list(case.files):
        without = replace(case, files={n: c for n, c in case.files.items() if n != name})
        if still(without):
            case = without
    words = reduce(case.words[1:], lambda rest: still(replace(case, words=(*case.words[:1], *rest))))
    case = replace(case, words=(*case.words[:1], *words))
    for name in case.files:
        case = _with_smaller_file(case, name, still)
    for at in range(len(case.words)):
        case = _with_smaller_word(case, at, still)
    return case


def _with_smaller_file(case: Case, name: str, still: Callable[[Case], bool]) -> Case:
    def kept(content: bytes) -> bool:
        return still(replace(case, files={**case.files, name: content}))

    content = b"".join(reduce(case.files[name].splitlines(keepends=True), lambda lines: kept(b"".join(lines))))
    pieces = [content[i : i + 1] for i in range(len(content))] if len(content) < _LETTERS else _chunks(content)
    content = b"".join(reduce(pieces, lambda left: kept(b"".join(left))))
    return replace(case, files={**case.files, name: content})


def _chunks(content: bytes) -> list[bytes]:
    size = len(content) // 500 + 1
    return [content[i : i + size] for i in range(0, len(content), size)]


def _with_smaller_word(case: Case, at: int, still: Callable[[Case], bool]) -> Case:
    """Take characters from a word; not from one that may lead to another folder when it is shorter."""
    word = case.words[at]
    if at == 0 or any(c in word for c in "/~\\") or ".." in word or case.words[at - 1] in ("-o", "--output", "--table", "--out"):
        return case

    def kept(letters: Sequence[str]) -> bool:
        return still(replace(case, words=(*case.words[:at], "".join(letters), *case.words[at + 1 :])))

    return replace(case, words=(*case.words[:at], "".join(reduce(word, kept)), *case.words[at + 1 :]))


def reduce(items: Sequence[T], still: Callable[[Sequence[T]], bool]) -> Sequence[T]:
    """Return as few of the items as still do; halves are tried first, then quarters, down to one by one (delta debugging)."""
    items, size = list(items), len(items)
    while size:
        size = (size + 1) // 2
        for start in _starts(items, size):
            without = items[:start] + items[start + size :]
            if len(without) < len(items) and still(without):
                items = without
        if size == 1:
            break
    return items


def _starts(items: Sequence[T], size: int) -> Iterator[int]:
    """Yield where pieces begin, the last first, so that taking one away moves none that is still to come."""
    yield from range(((len(items) - 1) // size) * size if items else -1, -1, -size)
