"""A target's options, where they were not stated: every choice tried, the best first (specs/equations.md, section 9)."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, overload

from pidemu.card.load import Card, Variant
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import Equation
from pidemu.card.model.marks import beyond_scans
from pidemu.certificate.models import Certificate, Verdict
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.match.terms import missing_term
from pidemu.conversion.match_method import Aim
from pidemu.conversion.merit import Merit, floor, merit, unused, with_same_law
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.solver import Solver
from pidemu.conversion.target.computed import is_computed
from pidemu.errors import PidemuError
from pidemu.settings.settings import Settings
from pidemu.units import Role


@dataclass(frozen=True)
class Attempt:
    """One choice of the options, and what a conversion gives with it.

    Attributes
    ----------
    changed : dict of str to str
        The options that are not as the card delivers them.
    solver : Solver or None
        What solved it; ``None`` where the given dials do not go with these options.
    found : Found or None
        The target's settings and how they were found; ``None`` where it refuses.
    certificate : Certificate or None
        The linear figures.
    merit : Merit or None
        What it is judged by.
    error : PidemuError, NoMatchError or None
        Why it refuses.
    """

    changed: Mapping[str, str]
    solver: Solver | None
    found: Found | None
    certificate: Certificate | None
    merit: Merit | None = None
    error: Exception | None = None

    @property
    def settings(self) -> Settings | None:
        """The target's settings; ``None`` where it refuses."""
        return None if self.found is None else self.found.settings

    @property
    def verdict(self) -> Verdict:
        """The verdict by the linear figures; ``refused`` where there are none."""
        return "refused" if self.certificate is None else self.certificate.verdict

    @property
    def rank(self) -> tuple[float, ...]:
        """What to sort by: refusals last."""
        return _REFUSED if self.merit is None else _rank(self.merit)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        c, s = self.certificate, self.settings
        paths = {} if c is None else {"feedback": c.headline, "setpoint": c.setpoint_headline}
        return {
            "changed": dict(self.changed),
            "verdict": self.verdict,
            **({} if s is None else {"settings": s.to_dict()["settings"]}),
            **{name: path.loop_band.max_deviation for name, path in paths.items()},
        }


_REFUSED: Final = (1.0,)


def _rank(merit: Merit) -> tuple[float, ...]:
    return (0, *merit.key)


@dataclass(frozen=True)
class OptionChoice:
    """One choice of the options.

    Attributes
    ----------
    variant : Variant
        The target with these options.
    options : dict of str to str
        All options, as they were stated.
    changed : dict of str to str
        Those that are not as the card delivers them.
    floor : Merit
        No merit is less.
    is_hopeless : bool
        Whether the target refuses, as it lacks a term.
    """

    variant: Variant
    options: Mapping[str, object]
    changed: Mapping[str, str]
    floor: Merit
    is_hopeless: bool


class Ranking(Sequence[Attempt]):
    """The attempts with every choice of the options that were not stated, the best first.

    A choice is tried when its turn may have come: what its equation says of it bounds its merit, and more closely so once another
    choice with the same law was tried. Those that cannot be the next best are not tried before somebody asks for them.

    Parameters
    ----------
    choices : iterable of OptionChoice
        The choices that a conversion can tell apart, in the order in which equally good ones come.
    attempt : callable
        From a choice to what it gives.
    rules_matter : bool
        Whether dials depend on scan rules, so that choices with the same continuous law do not have the same dials.
    """

    def __init__(self, choices: Iterable[OptionChoice], attempt: Callable[[OptionChoice], Attempt], *, rules_matter: bool) -> None:
        self._attempt = attempt
        self._rules_matter = rules_matter
        self._ranked: list[Attempt] = []
        self._by_law: dict[str, Merit] = {}
        self._left: list[tuple[tuple[float, ...], int, OptionChoice, Attempt | None]] = [
            (self._bound(choice), place, choice, None) for place, choice in enumerate(choices)
        ]
        heapq.heapify(self._left)
        self._size = len(self._left)

    def __len__(self) -> int:
        return self._size

    @overload
    def __getitem__(self, index: int) -> Attempt: ...

    @overload
    def __getitem__(self, index: slice) -> list[Attempt]: ...

    def __getitem__(self, index: int | slice) -> Attempt | list[Attempt]:
        wanted = range(self._size)[index]
        last = wanted if isinstance(wanted, int) else max(wanted, default=-1)
        while len(self._ranked) <= last:
            self._rank_next()
        return self._ranked[index]

    def _rank_next(self) -> None:
        """Find the best of the choices that are left."""
        while True:
            bound, place, choice, attempt = heapq.heappop(self._left)
            if attempt is not None:
                self._ranked.append(attempt)
                return
            least = self._bound(choice)
            if least <= bound:
                attempt = self._try(choice)
                least = attempt.rank
            heapq.heappush(self._left, (least, place, choice, attempt))

    def _bound(self, choice: OptionChoice) -> tuple[float, ...]:
        """Return what a choice ranks by at best, by all that is known of it."""
        if choice.is_hopeless:
            return _REFUSED
        like = None if self._rules_matter else self._by_law.get(law_text(choice.variant))
        return _rank(choice.floor if like is None else with_same_law(choice.floor, like))

    def _try(self, choice: OptionChoice) -> Attempt:
        attempt = self._attempt(choice)
        if attempt.merit is not None and not self._rules_matter:
            self._by_law.setdefault(law_text(choice.variant), attempt.merit)
        return attempt


def ranking(
    card: Card,
    taken: Mapping[str, object],
    source: Settings,
    solver: Callable[[Mapping[str, object]], Solver],
    aim: Aim,
    *,
    wanted: Mapping[str, object],
    rules_matter: bool,
) -> Ranking:
    """Return the choices of the options that were not stated, the best first.

    Parameters
    ----------
    card : Card
        The target.
    taken : mapping
        Options that the user has chosen; these are kept.
    source : Settings
        What is converted.
    solver : callable
        From options to the solver of the conversion.
    aim : Aim
        What to aim at.
    wanted : mapping
        Dials that the user has given: options with which these are in use come first.
    rules_matter : bool
        Whether dials depend on scan rules.
    """
    choices: list[OptionChoice] = []
    seen: list[tuple[object, ...]] = []
    for changed in _choices(card, taken):
        options = {**card.variant({}).chosen, **taken, **changed}
        variant = card.variant(options)
        matters = _what_matters(variant)
        if matters not in seen:
            seen.append(matters)
            least = floor(source, variant, len(changed), unused(variant, wanted))
            choices.append(OptionChoice(variant, options, changed, least, bool(missing_term(source.algorithm(), variant))))
    return Ranking(choices, lambda choice: _attempt(choice, solver, aim), rules_matter=rules_matter)


def _choices(card: Card, taken: Mapping[str, object]) -> Iterator[dict[str, str]]:
    """Yield what differs from the card's defaults, the fewest differences first."""
    kept = {name.casefold() for name in taken}
    free = [name for name in card.options if name.casefold() not in kept]
    defaults = card.variant({}).chosen
    combinations = itertools.product(*(card.options[name] for name in free))
    changes = [{n: c for n, c in zip(free, chosen, strict=True) if c != defaults[n]} for chosen in combinations]
    yield from sorted(changes, key=len)


@lru_cache(maxsize=1024)
def _what_matters(variant: Variant) -> tuple[object, ...]:
    """Return what a conversion sees of an equation: two choices that agree in it are one here."""
    e = variant.equation
    signals = (e.proportional, e.integral, e.derivative, e.error, e.setpoint, e.measurement, e.signals, e.transfer)
    return e.form, signals, _dials(e)


@lru_cache(maxsize=1024)
def law_text(variant: Variant) -> str:
    """Return what the continuous law of an equation depends on, in both modes: two choices that agree in it have the same dials."""
    e = variant.equation
    parts = (e.proportional, e.integral, e.derivative, e.error, e.setpoint, e.measurement)
    needs_a_filter = e.derivative.rule is Rule.LAGGED_DIFFERENCE
    return repr((e.form, e.signals, e.cascade, needs_a_filter, [beyond_scans(part) for part in parts], _dials(e)))


def _dials(e: Equation) -> dict[str, tuple[object, ...]]:
    return {n: (s.sets, s.unit, s.range, s.off, s.default) for n, s in e.settings.items() if is_computed(e, n, Role(s.sets))}


def _attempt(choice: OptionChoice, solver: Callable[[Mapping[str, object]], Solver], aim: Aim) -> Attempt:
    work = None
    try:
        work = solver(choice.options)
        found = work.settings(aim)
        certificate = work.yardstick.certify(found.settings)
        judged = merit(work.yardstick, found.settings, certificate, choice.floor.changed, choice.floor.unused)
        return Attempt(choice.changed, work, found, certificate, judged)
    except (NoMatchError, PidemuError) as error:
        return Attempt(choice.changed, work, None, None, error=error)
