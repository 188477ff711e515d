"""Solving for a target's settings: the match that is asked for, made up for the scans; and what is offered where there is none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from pidemu.card.model.base import Status
from pidemu.certificate.noise import MORE, noise_gain
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.match.moments import Asked, MomentProblem, Way, at_frequency, in_loop
from pidemu.conversion.match.nearest import USELESS, nearest
from pidemu.conversion.match.no_match import REFUSALS, NoMatchError
from pidemu.conversion.match.terms import check_terms
from pidemu.conversion.match_method import Aim, Match
from pidemu.conversion.modes import Modes, law_in
from pidemu.conversion.solver.closed_forms import by_closed_form, exact, low_frequency_because, textbook, textbook_numbers
from pidemu.conversion.solver.compensation import CLEARLY, Compensation
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.own_numbers import own_numbers
from pidemu.conversion.solver.pair import Pair, make_pair
from pidemu.conversion.solver.yardstick import Yardstick, first_of
from pidemu.conversion.target.target import Target
from pidemu.errors import SettingError
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.process.process import Process

_NEAR: Final = 0.01
_NEAR_ENOUGH: Final = 0.02
"""Deviation in the loop band below which the source's own numbers are kept; the second where its filter is only assumed."""
_FAR: Final = 0.05
"""Deviation in the loop band from which the same moments are no longer near."""


@dataclass(frozen=True)
class Solver:
    """One conversion under way: one choice of the target's options. It holds nothing that a match decides.

    Attributes
    ----------
    pair : Pair
        Source and target, matched by their continuous laws.
    yardstick : Yardstick
        What settings are held against.
    """

    pair: Pair
    yardstick: Yardstick

    def settings(self, aim: Aim) -> Found:
        """Return the target's settings and how they were found.

        Raises
        ------
        NoMatchError, SettingError
            The target has no such settings.
        """
        check_terms(self.pair.wanted, self.pair.target.variant)
        match aim.match:
            case None:
                return self._default()
            case "textbook":
                return textbook(self.pair)
            case "same-numbers":
                return own_numbers(self.pair)
            case "constrained":
                return self._nearest()
            case "frequency":
                return self._by_moments(lambda p, m: (p, at_frequency(p, m, self._frequency(aim))), "frequency")
            case "loop":
                return self._by_moments(self._in_loop, "loop")
        return self._compensation.compensated(by_closed_form(self.pair, aim.match), aim.match)

    def refused(self, why: Exception) -> tuple[Found | None, str]:
        """Return the nearest settings, where any come near, and the reason why the target refuses."""
        reason = f"{self.pair.target.card.id} cannot do what {self.pair.source.card.id} does: {why}"
        with suppress(SettingError):
            found = self._nearest()
            if self._comes_near(found):
                return found, reason
        return None, f"{reason}; no settings of it come near"

    @property
    def _compensation(self) -> Compensation:
        return Compensation(self.pair, self.yardstick)

    def _default(self) -> Found:
        """Return the settings where no match is asked for (specs/equations.md, section 9, match).

        The same law where the target has it; else the source's own numbers where they are nearly that; else the same moments while
        these are near, and beyond that the least largest deviation.
        """
        compensated = self._compensation.compensated
        try:
            return compensated(exact(self.pair), None)
        except REFUSALS as refusal:
            why = refusal
        own = self._own_numbers()
        if own is not None:
            return compensated(replace(own, why=str(why)), None)
        found = low_frequency_because(self.pair, why)
        return compensated(found if found.match == "exact" else self._nearer(found), None)

    def _own_numbers(self) -> Found | None:
        """Return the source's own numbers where they are good enough: near in the loop band, and alike for noise."""
        try:
            own = own_numbers(self.pair)
        except REFUSALS:
            return None
        source = self.pair.source
        least = _NEAR if filter_status(source) is not Status.ASSUMED else _NEAR_ENOUGH
        near = self.yardstick.continuous_deviation(own.settings) < least
        alike = noise_gain(own.settings) <= MORE * (1 + CLEARLY) * noise_gain(source) * abs(self.pair.factor)
        return own if near and alike else None

    def _nearest(self) -> Found:
        """Return the nearest settings, with the filter that the target delivers.

        Raises
        ------
        SettingError
            None come near.
        """
        target = self.pair.target
        # nothing imitates a missing proportional term
        idle = not self.pair.wanted.kp and target.has_proportional
        numbers = None if idle else nearest(self.pair.matched, target, self.pair.factor, self.yardstick.process)
        if numbers is None:
            raise SettingError("no settings come near")
        return self.pair.settle(numbers, "constrained")

    def _nearer(self, found: Found) -> Found:
        """Return settings of the same moments or, where these are far off, what comes nearest.

        Raises
        ------
        NoMatchError
            Everything is as far off as no controller at all.
        """
        judge = self.yardstick
        choices = [(judge.distance(found.settings), found)]
        off = judge.continuous_deviation(found.settings)
        with suppress(*REFUSALS):
            book = self.pair.settle(textbook_numbers(self.pair), "textbook")
            choices.append((judge.distance(book.settings), book))
        a = self.pair.wanted
        unfiltered = bool(a.kd) and not a.Tf
        nearer = choices[-1][0] < choices[0][0] * (1 - CLEARLY)
        if off >= USELESS or (off > _FAR and not unfiltered) or nearer:
            with suppress(SettingError):
                near = self._nearest()
                choices.append((judge.distance(near.settings), near))
        _, best = min(choices, key=lambda c: c[0] if c[1].match == "low-frequency" else c[0] * (1 + CLEARLY))
        if not self._comes_near(best):
            raise NoMatchError("what comes nearest is as far off in the loop band as no controller at all")
        return replace(best, why=found.why)

    def _comes_near(self, found: Found) -> bool:
        """Tell whether settings are nearer than no controller at all."""
        notched = not self.pair.wanted.kp  # integral and derivative alone cancel at one frequency: no measure there
        return notched or self.yardstick.continuous_deviation(found.settings) < USELESS

    def _by_moments(self, solve: Way, match: Match) -> Found:
        """Return settings found by way of their moments, from those of the closed forms."""
        start = by_closed_form(self.pair, None)
        return replace(self._compensation.through_moments(solve, start), match=match)

    def _in_loop(self, problem: MomentProblem, moments: Sequence[float]) -> Asked:
        assert self.yardstick.process is not None
        return problem, in_loop(problem, moments, self.yardstick.process)

    def _frequency(self, aim: Aim) -> float:
        """Return the frequency to match at: the one given, or the crossover of the source's loop [rad/s]."""
        judge = self.yardstick
        if aim.frequency is not None:
            w = aim.frequency
            if judge.scans is not None and w >= math.pi / max(judge.scans):
                raise SettingError(f"{w:g} rad/s is beyond half the scan rate; match at a lower frequency")
            return w
        assert judge.process is not None
        from pidemu.analysis.figures import crossover

        wanted = judge.at_source_scan or judge.law
        found = crossover(lambda w: judge.factor * wanted.held(w), judge.process, None if judge.scans is None else judge.scans[0])
        if found is None:
            raise SettingError("the source's loop has no gain crossover with this process; give the frequency")
        if judge.scans is not None and found >= math.pi / max(judge.scans):
            raise SettingError(f"the source's crossover, {found:g} rad/s, is beyond half the scan rate; match at a lower frequency")
        return found


def make_solver(
    source: Settings,
    target: Target,
    factor: float,
    scans: tuple[float, float] | None,
    process: Process | None = None,
    *,
    compensate: bool = False,
    mode: Modes = "both",
) -> Solver:
    """Return what solves for the settings of a target.

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
    process : Process, optional
        The process, where the user states it.
    compensate : bool
        Whether the settings shall make up for scan intervals and rules that differ.
    mode : {"auto", "cascade", "both"}
        The modes in which the setpoint path counts.
    """
    first = first_of(mode)
    pair = make_pair(source, target, factor, first)
    at_source_scan = law_in(source, first, scans[0]) if scans else None
    compensates = compensate and scans is not None
    return Solver(pair, Yardstick(source, factor, scans, process, mode, compensates, pair.law, at_source_scan))
