"""Solving for a target's settings: the match that is asked for, made up for the scans; and what is offered where there is none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from typing import TYPE_CHECKING

from pidemu.algorithm import Algorithm
from pidemu.card.base import Rule
from pidemu.certificate.linear import bands, certify, deviation, scan_phase
from pidemu.certificate.models import EXACT, Certificate, ScanCost
from pidemu.certificate.scanwise import common_interval
from pidemu.conversion import match as closed
from pidemu.conversion.aim import Aim, Match
from pidemu.conversion.closed_forms import ClosedForms
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.moments import Problem, Way, at_frequency, in_loop, meet
from pidemu.conversion.nearest import USELESS, nearest
from pidemu.conversion.target import Numbers, Target
from pidemu.errors import ScanError, SettingError
from pidemu.settings import Settings

if TYPE_CHECKING:
    from pidemu.loop.process import Process

_FILTER_ROUNDS = 12
_WHOLE = 0.99
"""Share of the loop band above which nothing of it counts as lost."""
_LEAST = {Rule.TRAPEZOIDAL: 0.5, Rule.FORWARD: 1.0, Rule.LAGGED_DIFFERENCE: 0.5}
"""Filter time in scan intervals below which a rule rings, or hardly leaves a derivative."""
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
        self.forms = ClosedForms(source, target, factor)
        self.law = self.forms.law
        self.at_source_scan = source.law(scans[0]) if scans else None
        self.filter_is_free = target.filter.free
        self.compensates = compensate and scans is not None
        """Whether targets are matched as a process sees them, sampled and held."""

    def settings(self, aim: Aim) -> tuple[Settings, Match]:
        """Return the target's settings and how they were found.

        Raises
        ------
        NoMatchError, SettingError
            The target has no such settings.
        """
        self.target.filter = self.forms.original_filter  # a match fixes it
        closed.check_terms(self.forms.scaled.algorithm, self.target)
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
                return self.forms.textbook(), "textbook"
            case "constrained":
                return self._nearest(), "constrained"
            case "frequency":
                return self._through(lambda p, m: at_frequency(p, m, self._frequency(aim))), "frequency"
            case "loop":
                assert self.process is not None
                process = self.process
                return self._through(lambda p, m: in_loop(p, m, process)), "loop"
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

    def scan_cost(self, settings: Settings, how: Match) -> ScanCost | None:
        """Return what the scan intervals cost, with the settings of the continuous law and with these, that were found so."""
        if self.scans is None:
            return None
        end, whole = (bands(self.law, h, self.process)[0][1] for h in (max(self.scans), None))
        plain = settings
        if how not in ("textbook", "constrained"):  # these know nothing of scans
            with suppress(NoMatchError, SettingError):
                plain = self._continuous().closed(None)[0]
        cost = self._deviation_if_stable(plain)
        return ScanCost(end, scan_phase(end, self.scans), plain != settings, cost, cut=end < _WHOLE * whole)

    def _continuous(self) -> Solver:
        """Return the solver of the same conversion without compensation."""
        target = copy(self.target)
        target.filter = self.forms.original_filter
        return Solver(self.source, target, self.factor, self.scans, self.process, compensate=False)

    def _nearest(self) -> Settings:
        # nothing imitates a missing proportional term
        idle = not self.forms.scaled.algorithm.kp and self.target.has_proportional
        numbers = None if idle else nearest(self.law, self.target, self.factor, self.process)
        if numbers is None:
            raise SettingError("no settings come near")
        return self.forms.weighted(numbers)

    def _frequency(self, aim: Aim) -> float:
        """Return the frequency to match at: the one given, or the crossover of the source's loop [rad/s]."""
        if aim.frequency is not None:
            w = aim.frequency
            if self.scans is not None and w >= math.pi / max(self.scans):
                raise SettingError(f"{w:g} rad/s is beyond half the scan rate; match at a lower frequency")
            return w
        assert self.process is not None
        from pidemu.loop.figures import crossover

        wanted = self.at_source_scan or self.law
        found = crossover(lambda w: self.factor * wanted.held(w), self.process, None if self.scans is None else self.scans[0])
        if found is None:
            raise SettingError("the source's loop has no gain crossover with this process; give the frequency")
        if self.scans is not None and found >= math.pi / max(self.scans):
            raise SettingError(f"the source's crossover, {found:g} rad/s, is beyond half the scan rate; match at a lower frequency")
        return found

    def closed(self, match: Match | None) -> tuple[Settings, Match]:
        """Return the target's settings by a closed form, or by one that is bent to the scans, and which.

        Raises
        ------
        NoMatchError, SettingError
            There is none, or it leaves the target's ranges.
        """
        settings, how = self.forms.solve(match)
        if self.compensates and not self._runs_exactly(settings):
            settings, how = self._at_scans(settings, match)
        if how != "low-frequency" or match is not None:
            return settings, how
        settings, how = self._not_behind_the_textbook(settings)
        notched = not self.forms.scaled.algorithm.kp  # integral and derivative alone cancel at one frequency: no measure there
        if self.scans is None and not notched and self.deviation(settings) >= USELESS:
            raise NoMatchError("what comes nearest is as far off in the loop band as no controller at all")
        return settings, how

    def _at_scans(self, settings: Settings, match: Match | None) -> tuple[Settings, Match]:
        """Return settings whose sampled, held law has the source's moments; where these are not nearer, the given ones."""
        with suppress(NoMatchError, SettingError, ScanError):
            bent = self._through(self._met, settings, derivative=bool(self.forms.scaled.algorithm.kd))
            if self.deviation(bent) < self._deviation_if_stable(settings) * (1 - _CLEARLY):
                settings = bent
        if self.certify(settings).headline.is_exact:
            return settings, "exact"
        if match == "exact":
            raise NoMatchError("no settings give the same law at these scan intervals and rules")
        return settings, "low-frequency"

    def _runs_exactly(self, settings: Settings) -> bool:
        try:
            return self.certify(settings).verdict == "exact"
        except ScanError:
            return False

    def _deviation_if_stable(self, settings: Settings) -> float:
        """Return the deviation; infinite where a filter is unstable at the scan interval."""
        try:
            return self.deviation(settings)
        except ScanError:
            return math.inf

    def _met(self, problem: Problem, start: Sequence[float]) -> Sequence[float]:
        """Return moments that `meet` the source's, with a free filter set so that the next moment agrees too, as far as it can."""
        if self.filter_is_free:
            self._start_with_a_usable_filter(problem.numbers(start), problem.scan)
        asked = meet(problem)
        for _ in range(_FILTER_ROUNDS if self.filter_is_free else 0):
            law, kept = problem.law(asked), self.target.filter
            kd, Tf = law.algorithm.kd, law.algorithm.Tf
            if not kd:
                break
            apart = law.held_expansion(4)[3] - problem.wanted.held_expansion(4)[3]
            wanted = self._usable(Tf + apart / kd, law.algorithm, law.scan)  # m3 holds -kd Tf
            try:
                self.target.filter = kept.nearest_to(wanted, self.target.filter_base(problem.numbers(asked)))
                asked = meet(problem)
            except NoMatchError:
                self.target.filter = kept
                break
            if abs(wanted - Tf) <= _CLEARLY * wanted:
                break
        return asked

    def _start_with_a_usable_filter(self, numbers: Numbers, scan: float | None) -> None:
        a = self.target.algorithm_of(numbers)
        if a.kd:
            usable = self._usable(a.Tf, a, scan)
            self.target.filter = self.target.filter.nearest_to(usable, self.target.filter_base(numbers))

    def _usable(self, Tf: float, a: Algorithm, scan: float | None) -> float:
        """Return a filter time [s] or, where its rule would ring or leave hardly a derivative, the nearest at which it does not."""
        least = _LEAST.get(a.derivative_rule if a.filter_on == "term" else a.filter_rule, 0.0) * (scan or 0.0)
        if Tf >= least:
            return max(Tf, 0.0)
        f = self.target.filter
        can_be_off = not f.needed and f.kind != "gain" and f.low <= 0
        return 0.0 if can_be_off and Tf < least / 2 else least

    def _through(self, solve: Way, start: Settings | None = None, *, derivative: bool = True) -> Settings:
        """Return settings found by way of their moments; as a process sees them, where scans count."""
        at_scan = None
        if self.compensates and self.scans and self.at_source_scan:
            at_scan = (self.at_source_scan, self.scans[1])
        return self.forms.through(solve, start or self.forms.solve(None)[0], at_scan, derivative=derivative)

    def _not_behind_the_textbook(self, settings: Settings) -> tuple[Settings, Match]:
        """Return these or, where the textbook rule is nearer in the loop band or they are useless, what is nearest there."""
        found: list[tuple[float, Match, Settings]] = [(self.deviation(settings), "low-frequency", settings)]
        own = found[0][0] * (1 - _CLEARLY)
        with suppress(NoMatchError, SettingError):
            book = self.forms.weighted(self.forms.textbook_numbers())
            found += [(self._deviation_if_stable(book), "textbook", book)]
        if own >= USELESS or found[-1][0] < own:
            with suppress(SettingError):
                near = self._nearest()
                found += [(self._deviation_if_stable(near), "constrained", near)]
        _, how, best = min(found, key=lambda f: f[0] if f[1] == "low-frequency" else f[0] * (1 + _CLEARLY))
        return best, how
