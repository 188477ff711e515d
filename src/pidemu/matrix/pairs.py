"""Many conversions, shared among processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from pidemu.matrix.cell import Cell, Work, cell, failed
from pidemu.processes import processors, shared

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
        jobs = 1 if len(pairs) < _FEW else processors()
    found: dict[tuple[str, str], Cell] = {}
    for share, done in shared(partial(_share, work), shares, jobs):
        cells = [failed(*pair, done) for pair in share] if isinstance(done, BaseException) else done
        found.update({(c.source, c.target): c for c in cells})
        if progress is not None:
            progress(len(found), len(pairs))
    return found


def _share(work: Work, pairs: Pairs) -> list[Cell]:
    return [cell(work, *pair) for pair in pairs]
