"""A target's options, where nobody chose them: every choice tried, the best first (specs/equations.md, section 9)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

from pidemu.card.load import Card
from pidemu.card.models import Equation
from pidemu.card.references import is_active
from pidemu.certificate.models import RANK, Certificate, Verdict
from pidemu.conversion.aim import Aim, Match
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.solve import Solver
from pidemu.conversion.target import is_computed
from pidemu.errors import PidemuError
from pidemu.settings import Settings
from pidemu.units import Role

_SMALL: Final = 1e-3
"""Deviation below which two choices are as good as each other; above it one must halve it to be better."""


@dataclass(frozen=True)
class Attempt:
    """One choice of the options, and what a conversion gives with it.

    Attributes
    ----------
    changed : dict of str to str
        The options that are not as the card delivers them.
    solver : Solver or None
        What solved it; ``None`` where the given dials do not go with these options.
    settings : Settings or None
        The target's settings; ``None`` where it refuses.
    match : str
        How they were found.
    certificate : Certificate or None
        The linear figures.
    rules_differ : bool
        Whether nobody gave scan intervals and the two would differ at an equal one, by their scan rules.
    nonlinear_differs : bool
        Whether what is not linear, such as a squared error, differs from the source's.
    unused : int
        How many dials that the user gave are not in use with these options.
    error : PidemuError, NoMatchError or None
        Why it refuses.
    """

    changed: Mapping[str, str]
    solver: Solver | None
    settings: Settings | None
    match: Match
    certificate: Certificate | None
    rules_differ: bool = False
    nonlinear_differs: bool = False
    unused: int = 0
    error: Exception | None = None

    @property
    def verdict(self) -> Verdict:
        """The verdict by the linear figures; ``refused`` where there are none."""
        return "refused" if self.certificate is None else self.certificate.verdict

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON."""
        c = self.certificate
        paths = {} if c is None else {"feedback": c.headline, "setpoint": c.setpoint_at_scan or c.setpoint}
        return {
            "changed": dict(self.changed),
            "verdict": self.verdict,
            "rules_differ": self.rules_differ,
            **{name: path.loop_band.max_deviation for name, path in paths.items()},
        }

    @cached_property
    def rank(self) -> tuple[Any, ...]:
        """What the choices are ordered by: given dials in use, verdict, scan rules, nonlinear options, both paths, changes."""
        c = self.certificate
        if c is None:
            return (True, self.unused, RANK["refused"], False, False, 0, 0, len(self.changed))
        setpoint = c.setpoint_at_scan or c.setpoint
        paths = (c.headline.loop_band.max_deviation, setpoint.loop_band.max_deviation)
        return (
            False,
            self.unused,
            RANK[c.verdict],
            self.rules_differ,
            self.nonlinear_differs,
            *(_coarse(d) for d in paths),
            len(self.changed),
        )


def _coarse(deviation: float) -> int:
    """Return a deviation in doublings of what is small."""
    if not math.isfinite(deviation):
        return 1000
    return 0 if deviation <= _SMALL else math.ceil(math.log2(deviation / _SMALL))


def attempts(
    card: Card,
    taken: Mapping[str, object],
    solver: Callable[[Mapping[str, object]], Solver],
    aim: Aim,
    *,
    wanted: Mapping[str, object],
    every: bool,
) -> tuple[Attempt, ...]:
    """Return the attempts with every choice of the options that nobody chose, the best first.

    Parameters
    ----------
    card : Card
        The target.
    taken : mapping
        Options that the user has chosen; these are kept.
    solver : callable
        From options to the solver of the conversion.
    aim : Aim
        What to aim at.
    wanted : mapping
        Dials that the user has given: options with which these are in use come first.
    every : bool
        Whether to go on where the card's defaults are exact already.
    """
    found: list[Attempt] = []
    seen: list[tuple[object, ...]] = []
    for changed in _choices(card, taken):
        options = {**_defaults(card), **taken, **changed}
        if not every:
            matters = _what_matters(card.variant(options).equation)
            if matters in seen:
                continue
            seen.append(matters)
        unused = _unused(card.variant(options).equation, wanted)
        found.append(replace(_attempt(options, changed, solver, aim), unused=unused))
        first = found[0]
        if not every and first.verdict == "exact" and not (first.rules_differ or first.nonlinear_differs or first.unused):
            break
    return tuple(sorted(found, key=lambda a: a.rank))


def _choices(card: Card, taken: Mapping[str, object]) -> Iterator[dict[str, str]]:
    """Yield what differs from the card's defaults, the fewest differences first."""
    kept = {name.casefold() for name in taken}
    free = [name for name in card.options if name.casefold() not in kept]
    defaults = _defaults(card)
    combinations = itertools.product(*(card.options[name] for name in free))
    changes = [{n: c for n, c in zip(free, chosen, strict=True) if c != defaults[n]} for chosen in combinations]
    yield from sorted(changes, key=len)


def _unused(e: Equation, wanted: Mapping[str, object]) -> int:
    names = {n.casefold(): n for n in e.settings}
    found = [names.get(n.casefold()) for n in wanted]
    return sum(n is None or not is_active(e, n, e.settings[n]) for n in found)


def _defaults(card: Card) -> dict[str, str]:
    return dict(card.variant({}).chosen)


def _what_matters(e: Equation) -> tuple[object, ...]:
    """Return what a conversion sees of an equation: two choices that agree in it are one here."""
    signals = (e.proportional, e.derivative, e.error, e.setpoint, e.measurement, e.signals)
    dials = {n: (s.sets, s.unit, s.range, s.off, s.default) for n, s in e.settings.items() if is_computed(e, n, Role(s.sets))}
    return e.form, e.integral.on, e.integral.rule, signals, dials


def _attempt(
    options: Mapping[str, object], changed: Mapping[str, str], solver: Callable[[Mapping[str, object]], Solver], aim: Aim
) -> Attempt:
    work = None
    try:
        work = solver(options)
        settings, how = work.settings(aim)
        others = [s.algorithm().beyond_the_law for s in (work.source, settings)]
        return Attempt(changed, work, settings, how, work.certify(settings), work.rules_differ(settings), others[0] != others[1])
    except (NoMatchError, PidemuError) as error:
        return Attempt(changed, work, None, "constrained", None, error=error)
