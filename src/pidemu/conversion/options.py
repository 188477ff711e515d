"""A target's options, where they were not stated: every choice tried, the best first (specs/equations.md, section 9)."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pidemu.card.load import Card
from pidemu.card.model.card_file import Equation
from pidemu.certificate.models import Certificate, Verdict
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.match_method import Aim
from pidemu.conversion.merit import Merit, merit, unused
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
        return (1,) if self.merit is None else (0, *self.merit.key)

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


def attempts(
    card: Card,
    taken: Mapping[str, object],
    solver: Callable[[Mapping[str, object]], Solver],
    aim: Aim,
    *,
    wanted: Mapping[str, object],
) -> tuple[Attempt, ...]:
    """Return the attempts with every choice of the options that were not stated, the best first.

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
    """
    found: list[Attempt] = []
    seen: list[tuple[object, ...]] = []
    for changed in _choices(card, taken):
        options = {**card.variant({}).chosen, **taken, **changed}
        equation = card.variant(options).equation
        matters = _what_matters(equation)
        if matters not in seen:
            seen.append(matters)
            found.append(_attempt(options, changed, solver, aim, unused(equation, dict(wanted))))
    return tuple(sorted(found, key=lambda a: a.rank))


def _choices(card: Card, taken: Mapping[str, object]) -> Iterator[dict[str, str]]:
    """Yield what differs from the card's defaults, the fewest differences first."""
    kept = {name.casefold() for name in taken}
    free = [name for name in card.options if name.casefold() not in kept]
    defaults = card.variant({}).chosen
    combinations = itertools.product(*(card.options[name] for name in free))
    changes = [{n: c for n, c in zip(free, chosen, strict=True) if c != defaults[n]} for chosen in combinations]
    yield from sorted(changes, key=len)


def _what_matters(e: Equation) -> tuple[object, ...]:
    """Return what a conversion sees of an equation: two choices that agree in it are one here."""
    signals = (e.proportional, e.integral, e.derivative, e.error, e.setpoint, e.measurement, e.signals, e.transfer)
    dials = {n: (s.sets, s.unit, s.range, s.off, s.default) for n, s in e.settings.items() if is_computed(e, n, Role(s.sets))}
    return e.form, signals, dials


def _attempt(
    options: Mapping[str, object],
    changed: Mapping[str, str],
    solver: Callable[[Mapping[str, object]], Solver],
    aim: Aim,
    idle: int,
) -> Attempt:
    work = None
    try:
        work = solver(options)
        found = work.settings(aim)
        certificate = work.yardstick.certify(found.settings)
        judged = merit(work.yardstick, found.settings, certificate, len(changed), idle)
        return Attempt(changed, work, found, certificate, judged)
    except (NoMatchError, PidemuError) as error:
        return Attempt(changed, work, None, None, error=error)
