"""Solving for a target's settings: which match applies, and what is offered where none does."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

from pidemu.algorithm import Algorithm
from pidemu.card.base import Form
from pidemu.certificate.linear import bands, certify, deviation, scan_phase
from pidemu.certificate.models import EXACT, Certificate, ScanCost
from pidemu.certificate.scanwise import common_interval
from pidemu.conversion import match as closed
from pidemu.conversion.aim import Aim, Match
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.moments import Problem, Way, at_frequency, in_loop, meet, sizes
from pidemu.conversion.nearest import nearest
from pidemu.conversion.target import Numbers, Target, TargetFilter
from pidemu.errors import ScanError, SettingError
from pidemu.law import Law
from pidemu.settings import Settings, limits
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.loop.process import Process

RANK = {"exact": 0, "exact-feedback": 1, "approximate": 2, "refused": 3}
"""Verdicts, the best first."""
_FILTER_ROUNDS = 12
_CLEARLY = 1e-6
"""Relative amount by which a deviation must be smaller to count."""


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
    process : Process or None
        The process, where the user states it.
    compensate : bool
        Whether the settings shall make up for scan intervals and rules that differ.
    """

    def __init__(
        self,
        source: Settings,
        target: Target,
        factor: float,
        scans: tuple[float, float] | None,
        process: Process | None = None,
        *,
        compensate: bool = True,
    ) -> None:
        self.source = source
        self.target = target
        self.factor = factor
        self.scans = scans
        self.process = process
        algorithm = source.algorithm()
        self.law = Law(algorithm)
        self.scaled = Law(_scaled(algorithm, factor))
        self.at_source_scan = source.law(scans[0]) if scans else None
        self.original_filter = target.filter
        self.filter_is_free = target.filter.free
        self.compensates = compensate and scans is not None
        """Whether targets are matched as a process sees them, sampled and held."""
        gain = source.by_role(Role.GAIN)
        if gain is not None and not algorithm.kp:
            target.idle_gain = gain.canonical or 1.0

    def settings(self, aim: Aim) -> tuple[Settings, Match]:
        """Return the target's settings and how they were found.

        Raises
        ------
        NoMatchError, SettingError
            The target has no such settings.
        """
        self.target.filter = self.original_filter  # a match fixes it
        closed.check_terms(self.scaled.algorithm, self.target)
        return self._by(aim)

    def refused(self, why: Exception) -> tuple[Settings | None, str]:
        """Return the nearest settings, where any come near, and the reason why the target refuses."""
        reason = f"{self.target.card.id} cannot do what {self.source.card.id} does: {why}"
        with suppress(SettingError):
            return self._nearest(), reason
        return None, f"{reason}; no settings of it come near"

    def rules_differ(self, settings: Settings) -> bool:
        """Whether nobody gave scan intervals, and equal laws would differ at an equal interval by their scan rules."""
        if self.scans is not None:
            return False
        try:
            h = common_interval(self.source, settings)
        except ScanError:
            return True
        band = bands(self.law, h, self.process)[0]
        return deviation(self.source.law(h), settings.law(h), band, self.factor) > EXACT

    def _by(self, aim: Aim) -> tuple[Settings, Match]:
        match aim.match:
            case "textbook":
                return self.textbook(), "textbook"
            case "constrained":
                return self._nearest(), "constrained"
            case "frequency":
                return self._through(lambda p, m: at_frequency(p, m, self._frequency(aim))), "frequency"
            case "loop":
                return self._through(lambda p, m: in_loop(p, m, self._given_process("loop"))), "loop"
        return self.closed(aim.match)

    def certify(self, settings: Settings) -> Certificate:
        """Return the linear figures of settings of the target."""
        at_scan = None
        if self.scans and self.at_source_scan:
            at_scan = (self.at_source_scan, settings.law(self.scans[1]))
        return certify(self.law, settings.law(), at_scan, self.factor, self.process)

    def deviation(self, settings: Settings) -> float:
        """Return the largest deviation of the feedback path in the loop band; at the scans, where these are given."""
        band = bands(self.law, max(self.scans) if self.scans else None, self.process)[0]
        if self.scans and self.at_source_scan:
            return deviation(self.at_source_scan, settings.law(self.scans[1]), band, self.factor)
        return deviation(self.law, settings.law(), band, self.factor)

    def scan_cost(self, settings: Settings) -> ScanCost | None:
        """Return what the scan intervals cost, with the settings of the continuous law and with these."""
        if self.scans is None:
            return None
        end = bands(self.law, max(self.scans), self.process)[0][1]
        plain = settings
        with suppress(NoMatchError, SettingError):
            plain = self._continuous().closed(None)[0]
        return ScanCost(end, scan_phase(end, self.scans), plain != settings, self.deviation(plain))

    def _continuous(self) -> Solver:
        """Return the solver of the same conversion without compensation."""
        target = copy(self.target)
        target.filter = self.original_filter
        return Solver(self.source, target, self.factor, self.scans, self.process, compensate=False)

    def textbook(self) -> Settings:
        """Return what the rule in manuals gives.

        Raises
        ------
        NoMatchError, SettingError
            The rule has no answer, or the target no such settings.
        """
        return self.target.settings(self._textbook_numbers())

    def _textbook_numbers(self) -> Numbers:
        closed.check_terms(self.scaled.algorithm, self.target)
        return closed.textbook(self.scaled.algorithm, self._dial_kd(), self.target)

    def _dial_kd(self) -> float:
        """Return ``K Td`` by the source's dial: its own time, not the strength left by a lead-lag [s]."""
        a, time = self.scaled.algorithm, self.source.by_role(Role.DERIVATIVE)
        return a.kp * time.canonical if a.series and a.kd and time is not None else a.kd

    def _nearest(self) -> Settings:
        idle = not self.scaled.algorithm.kp and self.target.has_proportional
        numbers = None if idle else nearest(self.law, self.target, self.factor)  # nothing imitates a missing proportional term
        if numbers is None:
            raise SettingError("no settings come near")
        return self._weighted(numbers)

    def _given_process(self, match: str) -> Process:
        if self.process is None:
            raise SettingError(f"the match '{match}' needs the process; give process=, or --process gain=...,lag=...,delay=...")
        return self.process

    def _frequency(self, aim: Aim) -> float:
        """Return the frequency to match at: the one given, or the crossover of the source's loop [rad/s]."""
        if aim.frequency is not None:
            w = aim.frequency
            if self.scans is not None and w >= math.pi / max(self.scans):
                raise SettingError(f"{w:g} rad/s is beyond half the scan rate; match at a lower frequency")
            return w
        if self.process is None:
            raise SettingError(
                "the match 'frequency' needs a frequency, frequency:0.02rad/s, or the process, to take the crossover of the loop"
            )
        from pidemu.loop.figures import crossover

        wanted = self.at_source_scan or self.law
        found = crossover(lambda w: self.factor * wanted.held(w), self.process, None if self.scans is None else self.scans[0])
        if found is None:
            raise SettingError("the source's loop has no gain crossover with this process; give the frequency")
        return found

    def closed(self, match: Match | None) -> tuple[Settings, Match]:
        """Return the target's settings by a closed form, or by one that is bent to the scans, and which.

        Raises
        ------
        NoMatchError, SettingError
            There is none, or it leaves the target's ranges.
        """
        settings, how = self._closed(match)
        if self.compensates and self.certify(settings).verdict != "exact":
            settings, how = self._at_scans(settings, match)
        if how != "low-frequency" or match is not None:
            return settings, how
        return self._not_behind_the_textbook(settings)

    def _at_scans(self, settings: Settings, match: Match | None) -> tuple[Settings, Match]:
        """Return settings whose sampled, held law has the source's moments; where these are not nearer, the given ones."""
        with suppress(NoMatchError, SettingError, ScanError):
            bent = self._through(self._met, settings, derivative=bool(self.scaled.algorithm.kd))
            if self.deviation(bent) < self.deviation(settings) * (1 - _CLEARLY):
                settings = bent
        if self.certify(settings).headline.is_exact:
            return settings, "exact"
        if match == "exact":
            raise NoMatchError("no settings give the same law at these scan intervals and rules")
        return settings, "low-frequency"

    def _met(self, problem: Problem, _start: Sequence[float]) -> Sequence[float]:
        """Return moments that `meet` the source's, with a free filter set so that the next moment agrees too, as far as it can."""
        asked = meet(problem)
        for _ in range(_FILTER_ROUNDS if self.filter_is_free else 0):
            law = problem.law(asked)
            kd, Tf = law.algorithm.kd, law.algorithm.Tf
            if not kd:
                break
            apart = law.held_expansion(4)[3] - problem.wanted.held_expansion(4)[3]
            least = 0.5 * (problem.scan or 0.0) if self.target.filter.needed else 0.0  # below it hardly anything is left
            wanted = max(least, Tf + apart / kd)  # m3 holds -kd Tf
            self.target.filter = self.target.filter.nearest_to(wanted, self._derivative_time(problem.numbers(asked)))
            asked = meet(problem)
            if abs(wanted - Tf) <= _CLEARLY * wanted:
                break
        return asked

    def _derivative_time(self, numbers: Numbers) -> float:
        """Return the time that a filter ratio or gain of the target refers to [s]."""
        f = self.target.filter
        if f.kind == "time":
            return 0.0
        unit = replace(f, kind="ratio", value=1.0)
        kept, self.target.filter = f, unit
        time = float(self.target.algorithm_of(replace(numbers, Tf=None)).Tf)
        self.target.filter = kept
        return time

    def _not_behind_the_textbook(self, settings: Settings) -> tuple[Settings, Match]:
        """Return low-frequency settings, or in the rare case that the textbook rule is nearer in the loop band, what is nearest."""
        own = self.deviation(settings)
        with suppress(NoMatchError, SettingError):
            book = self._weighted(self._textbook_numbers())
            if self.deviation(book) < own * (1 - _CLEARLY):
                found: list[tuple[float, Match, Settings]] = [(self.deviation(book), "textbook", book)]
                with suppress(SettingError):
                    near = self._nearest()
                    found.append((self.deviation(near), "constrained", near))
                _, how, best = min(found, key=lambda f: f[0])
                return best, how
        return settings, "low-frequency"

    def _closed(self, match: Match | None) -> tuple[Settings, Match]:
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
            verdict = self._continuous_verdict(settings)
            return None if verdict == "approximate" else (verdict, settings)
        return None

    def _continuous_verdict(self, settings: Settings) -> str:
        return certify(self.law, settings.law(), None, self.factor).verdict

    def _matches(self, match: Match | None) -> tuple[Settings, Match]:
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
        how: Match = "exact" if certify(self.law, settings.law(), None, self.factor).feedback.is_exact else "low-frequency"
        if match == "exact" and how != "exact":
            raise NoMatchError("its filter is fixed, and no settings give the same law")
        return settings, how

    def _low_frequency(self) -> Settings:
        """Match the moments, with a free filter set as near as its range allows to the source's, or left as delivered."""
        delivered = replace(self.target.filter, free=False)
        if self.target.filter.free:
            self.target.filter = self.target.filter.nearest_to(*self._wanted_filter())
            with suppress(NoMatchError, SettingError):
                return self._best(self._matched(self.scaled.moments(), self.target.filter))
        self.target.filter = delivered
        found = self._best(self._matched(self.scaled.moments(), delivered))
        if self._has_the_moments(found):
            return found
        return self._through(lambda problem, _: meet(problem), found, sampled=False)  # a filter that no closed form knows

    def _has_the_moments(self, settings: Settings) -> bool:
        wanted, found = self.scaled.moments(), settings.law().moments()
        return all(abs(x - y) <= EXACT * size for x, y, size in zip(wanted, found, sizes(wanted), strict=True))

    def _matched(self, moments: Sequence[float], filt: TargetFilter) -> Iterable[Numbers]:
        """Return the solutions of the low-frequency match, with a filter that was free set to the value it was fixed at."""
        for numbers in closed.low_frequency(moments, self.target, filt):
            chosen = filt.setting is not None and filt.setting not in self.target.given
            yield replace(numbers, Tf=self._time_of(numbers)) if chosen else numbers

    def _through(self, solve: Way, start: Settings | None = None, *, sampled: bool = True, derivative: bool = True) -> Settings:
        """Return settings found by way of their moments, with the filter that the closed form would have.

        Without `derivative` there is none, whatever the second moment asks for.

        Raises
        ------
        NoMatchError, SettingError
            There are none, or they leave the target's ranges.
        """
        start = start or self._closed(None)[0]
        filt = self.target.filter
        if filt.setting is not None:
            filt = replace(filt, free=False, value=start[filt.setting].canonical)
        self.target.filter = filt

        def numbers(moments: Sequence[float]) -> Numbers:
            if derivative:
                return next(iter(self._matched(moments, self.target.filter)))
            return replace(next(iter(self._matched((*moments[:2], 0.0), self.target.filter))), kd=0.0)

        scans = self.scans if self.compensates and sampled else None
        wanted = self.at_source_scan if scans and self.at_source_scan else self.law
        problem = Problem(Law(_scaled(wanted.algorithm, self.factor), wanted.scan), self.target, numbers, scans and scans[1])
        return self._weighted(numbers(solve(problem, self.scaled.moments())), problem)

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
            rank = RANK[self._continuous_verdict(settings)]
            if i == 0 or rank < RANK["approximate"]:
                found.append((rank, settings))
        if not found:
            raise refused or NoMatchError("the numbers leave the range of floating point")
        return min(found, key=lambda pair: pair[0])[1]

    def _time_of(self, numbers: Numbers) -> float:
        """Return the filter time that goes with the numbers when the filter is fixed [s]."""
        return float(self.target.algorithm_of(replace(numbers, Tf=None)).Tf)

    def _wanted_filter(self) -> tuple[float, float]:
        """Return the filter time that the next moment asks for, and the derivative time it goes with [s]."""
        _, m1, m2, m3 = self.scaled.expansion(4)
        if m2 == 0:
            return 0.0, 0.0
        plain = self.target.form is Form.PARALLEL and self.target.filter.kind != "time"
        per = 1.0 if plain else m1 or self.target.idle_gain
        return max(0.0, -m3 / m2), m2 / per

    def _weighted(self, numbers: Numbers, problem: Problem | None = None) -> Settings:
        """Return settings with the setpoint weights that keep the setpoint path, as far as their ranges allow."""
        settings = self.target.settings(numbers)
        scan = problem.scan if problem is not None else None
        wanted = self.scaled if problem is None else problem.wanted
        b, c = closed.weights(wanted, self.target, settings.algorithm(scan=scan), scan)
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
