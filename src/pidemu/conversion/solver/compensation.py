"""Settings that make up for scan intervals and rules that differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.conversion.match.moments import Asked, MomentProblem, Way, meet
from pidemu.conversion.match.no_match import REFUSALS, NoMatchError
from pidemu.conversion.match_method import Match
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.pair import Pair
from pidemu.conversion.solver.through_moments import through_moments
from pidemu.conversion.solver.yardstick import Yardstick
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings

_FILTER_ROUNDS: Final = 12
_LEAST: Final = {Rule.TRAPEZOIDAL: 0.5, Rule.FORWARD: 1.0, Rule.LAGGED_DIFFERENCE: 0.5}
"""Filter time in scan intervals below which a rule rings, or hardly leaves a derivative."""
CLEARLY: Final = 1e-6
"""Relative amount by which a deviation must be smaller to count."""


@dataclass(frozen=True)
class Compensation:
    """What makes up for the scans, where that is asked for.

    Attributes
    ----------
    pair : Pair
        Source and target.
    yardstick : Yardstick
        What settings are held against.
    """

    pair: Pair
    yardstick: Yardstick

    def compensated(self, found: Found, match: Match | None) -> Found:
        """Return settings that make up for the scans, where that is asked for and brings them nearer; else the given ones.

        Parameters
        ----------
        found : Found
            What matches without regard to the scans.
        match : str or None
            The match that was asked for.

        Raises
        ------
        NoMatchError
            The exact match was asked for, and no settings give the same law at the scans.
        """
        if not self.yardstick.compensates or self._runs_exactly(found.settings):
            return found
        bent = self._bent(found)
        runs_exactly = bent is not None and self._runs_exactly(bent.settings)
        if match == "exact" and not runs_exactly:
            raise NoMatchError("no settings give the same law at these scan intervals and rules")
        if bent is None:
            return found
        how: Match = "exact" if runs_exactly else "low-frequency"
        return replace(bent, match=how, why="" if runs_exactly else found.why, compensated=True)

    def through_moments(self, solve: Way, start: Found, *, derivative: bool = True) -> Found:
        """Return settings found by way of their moments; as a process sees them, where scans count."""
        at_scan, y = None, self.yardstick
        if y.compensates and y.scans and y.at_source_scan:
            at_scan = (y.at_source_scan, y.scans[1])
        return through_moments(self.pair, solve, start, at_scan, derivative=derivative)

    def _bent(self, found: Found) -> Found | None:
        """Return settings that make up for the scans; ``None`` where there are none that come nearer."""
        with suppress(*REFUSALS, ScanError):
            bent = self.through_moments(self._met, found, derivative=bool(self.pair.wanted.kd))
            nearer = self.yardstick.deviation(bent.settings) < self._deviation_if_stable(found.settings) * (1 - CLEARLY)
            if nearer and self._keeps_signs(bent.settings):
                return bent
        return None

    def _keeps_signs(self, settings: Settings) -> bool:
        """Whether every term pushes the way the source's does: making up for scans never turns a derivative round."""
        old, new = self.pair.wanted, settings.algorithm()
        return all(x * y >= 0 for x, y in ((old.kp, new.kp), (old.ki, new.ki), (old.kd, new.kd)))

    def _runs_exactly(self, settings: Settings) -> bool:
        try:
            at_scan = self.yardstick.certify(settings).feedback_at_scan
            return at_scan is not None and at_scan.is_exact
        except ScanError:
            return False

    def _deviation_if_stable(self, settings: Settings) -> float:
        """Return the deviation; infinite where a filter is unstable at the scan interval."""
        try:
            return self.yardstick.deviation(settings)
        except ScanError:
            return math.inf

    def _met(self, problem: MomentProblem, start: Sequence[float]) -> Asked:
        """Return moments that `meet` the source's, with a free filter set so that the next moment agrees too, as far as it can."""
        a = self.pair.wanted
        terms = bool(a.ki), bool(a.kp), bool(a.kd)
        free = self.pair.target.filter.free
        if free:
            problem = _with_a_usable_filter(problem, start)
        asked = meet(problem, terms)
        for _ in range(_FILTER_ROUNDS if free else 0):
            law = problem.law(asked)
            kd, Tf = law.algorithm.kd, law.algorithm.Tf
            if not kd:
                break
            apart = law.held_expansion(4)[3] - problem.wanted.held_expansion(4)[3]
            wanted = _usable(Tf + apart / kd, law.algorithm, problem)  # m3 holds -kd Tf
            try:
                other = problem.filtered_like(wanted, asked)
                asked = meet(other, terms)
            except NoMatchError:
                break
            problem = other
            if abs(wanted - Tf) <= CLEARLY * wanted:
                break
        return problem, asked


def _with_a_usable_filter(problem: MomentProblem, start: Sequence[float]) -> MomentProblem:
    a = problem.target.algorithm_of(problem.numbers(start), problem.filter)
    return problem.filtered_like(_usable(a.Tf, a, problem), start) if a.kd else problem


def _usable(Tf: float, a: Algorithm, problem: MomentProblem) -> float:
    """Return a filter time [s] or, where its rule would ring or leave hardly a derivative, the nearest at which it does not."""
    least = _LEAST.get(a.derivative.rule if a.filter_on == "term" else a.filter_rule, 0.0) * (problem.scan or 0.0)
    if Tf >= least:
        return max(Tf, 0.0)
    f = problem.filter
    can_be_off = not f.needed and f.kind != "gain" and f.low <= 0
    return 0.0 if can_be_off and Tf < least / 2 else least
