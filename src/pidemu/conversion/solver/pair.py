"""A source and a target, matched by their continuous laws."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

from pidemu.algorithm.model import Algorithm
from pidemu.certificate.linear import Limits, bands, deviation, sameness
from pidemu.certificate.models import EXACT, RANK, Verdict
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.match.weights import weights
from pidemu.conversion.match_method import Match
from pidemu.conversion.modes import Mode, in_mode, law_in
from pidemu.conversion.solver.found import Found
from pidemu.conversion.target.dials import settings_with
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target
from pidemu.errors import SettingError
from pidemu.law.law import Law
from pidemu.settings.settings import Settings, limits
from pidemu.units import Role


@dataclass(frozen=True)
class Pair:
    """A source and a target, matched by their continuous laws.

    Attributes
    ----------
    source : Settings
        What to convert.
    target : Target
        What to convert to.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    mode : {"auto", "cascade"}
        The mode in which the setpoint weights are matched.
    law : Law
        The source's law.
    matched : Law
        What is matched: the law without a filter of the measurement that both have alike.
    scaled : Law
        The same with the gains for the new signal ranges.
    """

    source: Settings
    target: Target
    factor: float
    mode: Mode
    law: Law
    matched: Law
    scaled: Law

    @property
    def wanted(self) -> Algorithm:
        """The algorithm that the target is to have."""
        return self.scaled.algorithm

    @property
    def dial_kd(self) -> float:
        """``K Td`` by the source's dial: its own time, not the strength left by a lead-lag [s]."""
        a, time = self.wanted, self.source.by_role(Role.DERIVATIVE)
        return a.kp * time.canonical if a.series and a.kd and time is not None else a.kd

    def as_matched(self, law: Law, factor: float = 1.0) -> Law:
        """Return a law of source or target as it is matched, its gains multiplied."""
        return Law(_scaled(_as_matched(law.algorithm, self.target), factor), law.scan)

    def moments(self, settings: Settings) -> tuple[float, float, float]:
        """Return the moments of the feedback path, which no mode changes."""
        return self.as_matched(Law(settings.algorithm())).moments()

    def sameness(self, settings: Settings) -> tuple[float, float]:
        """Return by how much both paths of the continuous laws deviate, in this conversion's mode; see `linear.sameness`."""
        return sameness(self.law, law_in(settings, self.mode), self._bands, self.factor)

    def verdict(self, settings: Settings) -> Verdict:
        """Return the verdict by the continuous laws, in this conversion's mode."""
        feedback, setpoint = self.sameness(settings)
        return "approximate" if feedback >= EXACT else "exact" if setpoint < EXACT else "exact-feedback"

    def off(self, found: Found) -> float:
        """Return the largest deviation of the continuous feedback paths in the loop band."""
        return deviation(self.law, law_in(found.settings, self.mode), self._bands[0], self.factor)

    @cached_property
    def _bands(self) -> Limits:
        return bands(self.law, None)

    def settle(self, numbers: Numbers, match: Match, law: Law | None = None, scan: float | None = None) -> Found:
        """Return settings of the target, with the setpoint weights that keep the setpoint path, as far as their ranges allow.

        Parameters
        ----------
        numbers : Numbers
            The numbers, without weights.
        match : str
            The match that found them.
        law : Law, optional
            What the setpoint path is matched with; by default the continuous law.
        scan : float, optional
            The target's scan interval [s], where `law` is discrete.

        Raises
        ------
        SettingError
            The target cannot be set so.
        """
        plain = self.unweighted(numbers, match)
        b, c = weights(law or self.scaled, self.target, plain.settings.algorithm(scan=scan), scan)
        if b is None and c is None:
            return plain
        b, c = self._in_range(Role.PROPORTIONAL_WEIGHT, b), self._in_range(Role.DERIVATIVE_WEIGHT, c)
        return self.unweighted(replace(numbers, b=b, c=c), match)

    def unweighted(self, numbers: Numbers, match: Match) -> Found:
        """Return settings of the target for numbers as they are; raises as `settle`."""
        settings, own = settings_with(self.target, numbers), self.target.filter
        filt = own if own.setting is None else own.fixed_at(settings[own.setting].canonical)
        return Found(settings, numbers, filt, match)

    def best_of(self, solutions: Iterable[Numbers], match: Match) -> Found:
        """Return the settings of the first solution, or of a later one whose law is exactly the source's.

        Raises
        ------
        SettingError
            None of these lies within the target's ranges; the first one's reason.
        """
        solutions = tuple(solutions)
        if len(solutions) == 1:
            return self.settle(solutions[0], match)
        found: list[tuple[int, Found]] = []
        refused: SettingError | None = None
        for i, numbers in enumerate(solutions):
            try:
                one = self.settle(numbers, match)
            except SettingError as error:
                refused = refused or error
                continue
            rank = RANK[self.verdict(one.settings)]
            if i == 0 or rank < RANK["approximate"]:
                found.append((rank, one))
        if not found:
            raise refused or NoMatchError("the numbers leave the range of floating point")
        return min(found, key=lambda pair: pair[0])[1]

    def _in_range(self, role: Role, weight: float | None) -> float | None:
        dial = self.target.dial(role)
        if dial is None or weight is None:
            return None
        low, high = limits(dial[1])
        return min(max(weight, low), high)


def make_pair(source: Settings, target: Target, factor: float, mode: Mode = "auto") -> Pair:
    """Return a source and a target with what is matched of them; for the arguments see `Pair`."""
    law = Law(in_mode(source.algorithm(), mode))
    matched = Law(_as_matched(law.algorithm, target))
    return Pair(source, target, factor, mode, law, matched, Law(_scaled(matched.algorithm, factor)))


def _as_matched(a: Algorithm, target: Target) -> Algorithm:
    return a.filtered(None) if target.is_paired else a


def _scaled(a: Algorithm, factor: float) -> Algorithm:
    """Return the algorithm with all three gains multiplied."""
    return a if factor == 1 else replace(a, kp=a.kp * factor, ki=a.ki * factor, kd=a.kd * factor)
