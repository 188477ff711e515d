"""Solving for a target's settings: which match applies, and what is offered where none does."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Literal

from pidemu.algorithm import Algorithm
from pidemu.card.base import Form
from pidemu.conversion import match as closed
from pidemu.conversion.certificate import Certificate
from pidemu.conversion.linear import certify
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.nearest import nearest
from pidemu.conversion.target import Numbers, Target, TargetFilter
from pidemu.errors import SettingError
from pidemu.law import Law
from pidemu.settings import Settings, limits
from pidemu.units import Role

Match = Literal["exact", "low-frequency", "textbook", "constrained"]
_RANK = {"exact": 0, "exact-feedback": 1, "approximate": 2}


class Solver:
    """One conversion under way.

    Parameters
    ----------
    source : Settings
        What to convert.
    target : Target
        What to convert to.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    scans : tuple of float or None
        Scan intervals of source and target [s].
    """

    def __init__(self, source: Settings, target: Target, factor: float, scans: tuple[float, float] | None) -> None:
        self.source = source
        self.target = target
        self.factor = factor
        self.scans = scans
        algorithm = source.algorithm()
        self.law = Law(algorithm)
        self.scaled = Law(_scaled(algorithm, factor))
        self.at_source_scan = Law(algorithm, scans[0]) if scans else None
        gain = source.by_role(Role.GAIN)
        if gain is not None and not algorithm.kp:
            target.idle_gain = gain.canonical or 1.0

    def solve(self, match: str | None) -> tuple[Settings | None, Match, str]:
        """Return the target's settings, how they were found and, where the target refuses, why these are only the nearest.

        Parameters
        ----------
        match : str or None
            What the user asks for; ``None``: exact where possible, else low-frequency.
        """
        try:
            closed.check_terms(self.scaled.algorithm, self.target)
            if match == "textbook":
                return self.textbook(), "textbook", ""
            return (*self.closed(match), "")
        except (NoMatchError, SettingError) as error:
            reason = f"{self.target.card.id} cannot do what {self.source.card.id} does: {error}"
        a = self.scaled.algorithm
        idle = not a.kp and self.target.has_proportional  # nothing practicable imitates a missing proportional term
        with suppress(SettingError):
            numbers = None if idle else nearest(self.law, self.target, self.factor)
            if numbers is not None:
                return self._weighted(numbers), "constrained", reason
        return None, "constrained", f"{reason}; no settings of it come near"

    def certify(self, settings: Settings) -> Certificate:
        """Return the certificate of settings of the target."""
        at_scan = None
        if self.scans and self.at_source_scan:
            at_scan = (self.at_source_scan, settings.law(self.scans[1]))
        return certify(self.law, settings.law(), at_scan, self.factor)

    def textbook(self) -> Settings:
        """Return what the rule in manuals gives.

        Raises
        ------
        NoMatchError, SettingError
            The rule has no answer, or the target no such settings.
        """
        closed.check_terms(self.scaled.algorithm, self.target)
        return self.target.settings(closed.textbook(self.scaled.algorithm, self._dial_kd(), self.target))

    def _dial_kd(self) -> float:
        """Return ``K Td`` by the source's dial: its own time, not the strength left by a lead-lag [s]."""
        a, time = self.scaled.algorithm, self.source.by_role(Role.DERIVATIVE)
        return a.kp * time.canonical if a.series and a.kd and time is not None else a.kd

    def closed(self, match: str | None) -> tuple[Settings, Match]:
        """Return the target's settings by a closed form, and which.

        Raises
        ------
        NoMatchError, SettingError
            There is none, or it leaves the target's ranges.
        """
        own = self._own()
        if own is not None and (own[0] == "exact" and match != "low-frequency"):
            return own[1], "exact"
        try:
            return self._matches(match)
        except (NoMatchError, SettingError):
            if own is None:
                raise
            return own[1], "exact"

    def _own(self) -> tuple[str, Settings] | None:
        """Return verdict and settings for the source's own numbers, where these are an exact match of a target of its form."""
        equation, a = self.source.equation, self.scaled.algorithm
        gain = self.source.by_role(Role.GAIN)
        if equation.form is not self.target.form:
            return None
        K = a.kp or (gain.canonical if gain is not None else 0.0)
        with suppress(SettingError):
            settings = self._weighted(Numbers(K, a.ki, self._dial_kd(), a.Tf if self.target.filter.free else None))
            verdict = self.certify(settings).verdict
            return None if verdict == "approximate" else (verdict, settings)
        return None

    def _matches(self, match: str | None) -> tuple[Settings, Match]:
        why: NoMatchError | SettingError | None = None
        if match != "low-frequency":
            try:
                return self._best(closed.exact(self.scaled, self.target)), "exact"
            except (NoMatchError, SettingError) as error:
                why = error
                if match == "exact" and self.target.filter.free:
                    raise
        try:
            settings = self._low_frequency()
        except (NoMatchError, SettingError) as error:
            raise (why if isinstance(why, NoMatchError) and why.fundamental else error) from None
        how: Match = "exact" if self.certify(settings).feedback.is_exact else "low-frequency"
        if match == "exact" and how != "exact":
            raise NoMatchError("its filter is fixed, and no settings give the same law")
        return settings, how

    def _low_frequency(self) -> Settings:
        """Match the moments, with a free filter set as near as its range allows to the source's, or left as delivered."""
        delivered = replace(self.target.filter, free=False)
        if self.target.filter.free:
            self.target.filter = self.target.filter.nearest_to(*self._wanted_filter())
            with suppress(NoMatchError, SettingError):
                return self._best(self._matched(self.target.filter))
        self.target.filter = delivered
        return self._best(self._matched(delivered))

    def _matched(self, filt: TargetFilter) -> Iterable[Numbers]:
        """Return the solutions of the low-frequency match, with a filter that was free set to the value it was fixed at."""
        for numbers in closed.low_frequency(self.scaled, self.target, filt):
            chosen = filt.setting is not None and filt.setting not in self.target.given
            yield replace(numbers, Tf=self._time_of(filt, numbers)) if chosen else numbers

    def _best(self, solutions: Iterable[Numbers]) -> Settings:
        """Return the settings of the first solution, or of a later one whose law is exactly the source's.

        Raises
        ------
        SettingError
            None of these lies within the target's ranges; the first one's reason.
        """
        solutions = tuple(solutions)
        if len(solutions) == 1:
            return self._weighted(solutions[0])
        found: list[tuple[int, Settings]] = []
        refused: SettingError | None = None
        for i, numbers in enumerate(solutions):
            try:
                settings = self._weighted(numbers)
            except SettingError as error:
                refused = refused or error
                continue
            rank = _RANK[self.certify(settings).verdict]
            if i == 0 or rank < _RANK["approximate"]:
                found.append((rank, settings))
        if not found:
            raise refused or NoMatchError("the numbers leave the range of floating point")
        return min(found, key=lambda pair: pair[0])[1]

    def _time_of(self, filt: TargetFilter, numbers: Numbers) -> float:
        """Return the filter time that goes with the numbers when the filter is fixed [s]."""
        if filt.kind == "time":
            return filt.value
        Td = numbers.kd / (1.0 if self.target.form is Form.PARALLEL or not numbers.K else numbers.K)
        return filt.ratio * (Td / (1 + Td * numbers.ki / numbers.K) if filt.effective and numbers.K else Td)

    def _wanted_filter(self) -> tuple[float, float]:
        """Return the filter time that the next moment asks for, and the derivative time it goes with [s]."""
        _, m1, m2, m3 = self.scaled.expansion(4)
        if m2 == 0:
            return 0.0, 0.0
        per = 1.0 if self.target.form is Form.PARALLEL else m1 or self.target.idle_gain
        return max(0.0, -m3 / m2), m2 / per

    def _weighted(self, numbers: Numbers) -> Settings:
        """Return settings with the setpoint weights that keep the setpoint path, as far as their ranges allow."""
        settings = self.target.settings(numbers)
        b, c = closed.weights(self.scaled, self.target, settings.algorithm())
        if b is None and c is None:
            return settings
        b, c = self._in_range(Role.PROPORTIONAL_WEIGHT, b), self._in_range(Role.DERIVATIVE_WEIGHT, c)
        return self.target.settings(replace(numbers, b=b, c=c))

    def _in_range(self, role: Role, weight: float | None) -> float | None:
        dial = self.target.dial(role)
        if dial is None or weight is None:
            return None
        low, high = limits(dial[1])
        return min(max(weight, low), high)


def _scaled(a: Algorithm, factor: float) -> Algorithm:
    return a if factor == 1 else replace(a, kp=a.kp * factor, ki=a.ki * factor, kd=a.kd * factor)
