"""Other options of a target, where they would do better than the ones taken by default."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Final

from pidemu.card.load import Card
from pidemu.conversion import match as closed
from pidemu.conversion.certificate import Certificate
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.solve import Solver
from pidemu.errors import CardError, SettingError

_MOST: Final = 40
"""Combinations looked at."""

_RANK: Final = {"exact": 0, "exact-feedback": 1, "approximate": 2}
_MUCH: Final = 0.5
"""An approximate setpoint path must come at least this much nearer to be worth a word."""


def better_options(
    card: Card, taken: Mapping[str, object], present: Certificate | None, solver: Callable[[Mapping[str, object]], Solver]
) -> str | None:
    """Return what to set for a better verdict, in words, or ``None``.

    Parameters
    ----------
    card : Card
        The target.
    taken : mapping
        Options that the user has chosen; these are kept.
    present : Certificate or None
        What the present options give; ``None``: a refusal.
    solver : callable
        From options to the solver of the conversion.
    """
    if present is not None and present.verdict == "exact":
        return None
    kept = {name.casefold() for name in taken}
    free = [name for name in card.options if name.casefold() not in kept]
    defaults = tuple(card.options[name][0] for name in free)
    combinations = itertools.product(*(card.options[name] for name in free))
    changes = [{n: c for n, c, d in zip(free, chosen, defaults, strict=True) if c != d} for chosen in combinations]
    best: tuple[tuple[int, float], Mapping[str, str], Certificate] | None = None
    for changed in sorted(changes, key=len)[1 : _MOST + 1]:  # the fewest changes first, without none at all
        found = _attempt(solver, {**taken, **changed})
        if found is not None and (present is None or _improves(present, found)):
            key = (_RANK[found.verdict], found.setpoint.loop_band.max_deviation)
            if best is None or key < best[0]:
                best = (key, changed, found)
            if found.verdict == "exact":
                break
    if best is None:
        return None
    words = " ".join(f'--set "{n}={c}"' if " " in c else f"--set {n}={c}" for n, c in best[1].items())
    figures = f"deviation of the setpoint path {best[2].setpoint.loop_band.max_deviation:.2g} in the loop band"
    return f"{words}: {best[2].verdict}" + (f", {figures}" if best[2].verdict == "approximate" else "")


def _attempt(solver: Callable[[Mapping[str, object]], Solver], options: Mapping[str, object]) -> Certificate | None:
    try:
        work = solver(options)
        closed.check_terms(work.scaled.algorithm, work.target)
        return work.certify(work.closed(None)[0])
    except (NoMatchError, SettingError, CardError):
        return None


def _improves(present: Certificate, found: Certificate) -> bool:
    if _RANK[found.verdict] != _RANK[present.verdict]:
        return _RANK[found.verdict] < _RANK[present.verdict]
    nearer = found.setpoint.loop_band.max_deviation < _MUCH * present.setpoint.loop_band.max_deviation
    as_near = found.feedback.loop_band.max_deviation <= 1.01 * present.feedback.loop_band.max_deviation
    return found.verdict == "approximate" and nearer and as_near
