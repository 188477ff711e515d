"""Settings of a target by the closed forms: which of them applies, in what order, with what filter and which setpoint weights."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form, Status
from pidemu.certificate.linear import certify
from pidemu.certificate.models import EXACT, RANK, Certificate
from pidemu.conversion import match as closed
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.match_method import Match
from pidemu.conversion.modes import Mode, in_mode, law_in
from pidemu.conversion.moments import MomentProblem as Problem
from pidemu.conversion.moments import Way, meet, sizes
from pidemu.conversion.target import Numbers, Target, TargetFilter
from pidemu.errors import SettingError
from pidemu.law.law import Law
from pidemu.settings.settings import Settings, limits
from pidemu.units import Role

_DEAR = 0.01
"""Deviation in the loop band from which leaving a filter as delivered costs too much."""
_KEPT = 1e-6
"""By how much moments may be off where they are to be kept: what the ends of a dial's range round."""
_ROUNDING = 1e-6
"""Deviation that rounding may make of an exact match where its numbers nearly cancel."""


class ClosedForms:
    """A source and a target, matched by their continuous laws.

    Parameters
    ----------
    source : Settings
        What to convert.
    target : Target
        What to convert to; a match fixes its filter.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    mode : {"auto", "cascade"}
        The mode in which the setpoint weights are matched.
    """

    def __init__(self, source: Settings, target: Target, factor: float, mode: Mode = "auto") -> None:
        self.source = source
        self.target = target
        self.factor = factor
        self.mode = mode
        algorithm = in_mode(source.algorithm(), mode)
        self.law = Law(algorithm)
        self.matched = Law(self._as_matched(algorithm))
        """What is matched: the law without a filter of the measurement that both have alike."""
        self.scaled = Law(scaled(self.matched.algorithm, factor))
        self.original_filter = target.filter
        gain = source.by_role(Role.GAIN)
        if gain is not None and not algorithm.kp:
            target.idle_gain = gain.canonical or 1.0

    def _as_matched(self, a: Algorithm) -> Algorithm:
        return a.filtered(None) if self.target.is_paired else a

    def textbook(self) -> Settings:
        """Return what the rule in manuals gives.

        Raises
        ------
        NoMatchError, SettingError
            The rule has no answer, or the target no such settings.
        """
        return self.target.settings(self.textbook_numbers())

    def textbook_numbers(self) -> Numbers:
        """Return what the rule in manuals gives, without choice of setpoint weights; raises as `textbook`."""
        closed.check_terms(self.scaled.algorithm, self.target)
        return closed.textbook(self.scaled.algorithm, self._dial_kd(), self.target)

    def _dial_kd(self) -> float:
        """Return ``K Td`` by the source's dial: its own time, not the strength left by a lead-lag [s]."""
        a, time = self.scaled.algorithm, self.source.by_role(Role.DERIVATIVE)
        return a.kp * time.canonical if a.series and a.kd and time is not None else a.kd

    def solve(self, match: Match | None) -> tuple[Settings, Match]:
        """Return the target's settings and how they were found: exactly, or at low frequencies.

        Raises
        ------
        NoMatchError, SettingError
            There are none, or they leave the target's ranges.
        """
        if match == "low-frequency":
            found = self.low_frequency(moments=True)
            if not self._keeps_the_moments(found):
                raise NoMatchError("no settings keep the moments: with these options the target lacks a term")
            return found, match
        why: NoMatchError | SettingError
        try:
            return self.exact(), "exact"
        except (NoMatchError, SettingError) as error:
            why = error
            if match == "exact" and self.target.filter.free:
                raise
        try:
            settings = self.low_frequency()
        except (NoMatchError, SettingError) as error:
            raise (why if isinstance(why, NoMatchError) and why.fundamental else error) from None
        how: Match = "exact" if self.certify(settings).feedback.is_exact else "low-frequency"
        if match == "exact" and how != "exact":
            raise NoMatchError("its filter is fixed, and no settings give the same law")
        return settings, how

    def exact(self) -> Settings:
        """Return settings with the source's law: its own numbers, where these have it, else those of the closed form.

        Raises
        ------
        NoMatchError, SettingError
            There are none.
        """
        own = None
        with suppress(SettingError, NoMatchError):
            own = self.own_numbers(filtered=True)
        verdict = "approximate" if own is None else self.certify(own).verdict
        if own is not None and verdict == "exact":
            return own
        try:
            return self._proven(self._best(closed.exact(self.scaled, self.target)))
        except (NoMatchError, SettingError):
            if own is None or verdict == "approximate":
                raise
            return own

    def own_numbers(self, *, filtered: bool = False) -> Settings:
        """Return the source's own numbers on a target of its form, their units converted.

        Parameters
        ----------
        filtered : bool
            Whether a filter that can be set takes the source's filter time; otherwise it stays as delivered.

        Raises
        ------
        NoMatchError, SettingError
            The target has another form, or does not take them.
        """
        equation, a = self.source.equation, self.scaled.algorithm
        gain = self.source.by_role(Role.GAIN)
        if equation.form is not self.target.form:
            raise NoMatchError(f"the source is of {equation.form.value} form, the target of {self.target.form.value} form")
        K = a.kp or (gain.canonical if gain is not None else 0.0)
        return self.weighted(Numbers(K, a.ki, self._dial_kd(), a.Tf if filtered and self.target.filter.free else None))

    def certify(self, settings: Settings) -> Certificate:
        """Return the figures of both continuous laws, in this conversion's mode."""
        return certify(self.law, law_in(settings, self.mode), None, self.factor)

    def _proven(self, settings: Settings) -> Settings:
        """Refuse an exact match that is none: whatever the card says of its terms, the law decides."""
        if self.certify(settings).feedback.full_band.max_deviation > _ROUNDING:
            raise NoMatchError("no settings give the same law")
        return settings

    def low_frequency(self, *, moments: bool = False) -> Settings:
        """Match the moments, with the filter as the target fixes it or as it is delivered.

        A filter that can be set takes the source's filter time where it costs more than 1 % in the loop band to leave it, and the
        source's filter is documented, measured or inferred: an assumed one is not imitated, and neither is the lack of one. With
        that filter the source's own gain and integral may come nearer than the moments; with `moments` these are kept even so.
        """
        original = self.target.filter
        delivered = replace(original, free=False)
        settings, why = None, None
        try:
            settings = self._with_filter(delivered)
        except (NoMatchError, SettingError) as error:
            why = error
        a = self.scaled.algorithm
        self.target.filter = original
        imitated = original.free and a.kd and a.Tf and filter_status(self.source) is not Status.ASSUMED
        if imitated and (settings is None or self.certify(settings).feedback.loop_band.max_deviation > _DEAR):
            like_the_source = self._with_the_sources_filter(moments=moments)
            if like_the_source is not None:
                return like_the_source
        if settings is None:
            assert why is not None
            raise why
        self.target.filter = delivered
        return settings

    def _with_the_sources_filter(self, *, moments: bool) -> Settings | None:
        """Return what is nearest with the source's filter time: the same moments or, where these may go, its own numbers."""
        found: list[Settings] = []
        if not moments:
            with suppress(NoMatchError, SettingError):
                kept = self._gain_and_integral_kept()
                if self.certify(kept).feedback.loop_band.max_deviation <= _DEAR:
                    return kept
            with suppress(NoMatchError, SettingError):
                found.append(self.own_numbers(filtered=True))
        with suppress(NoMatchError, SettingError):
            found.append(self._with_filter(self.target.filter.nearest_to(*self._wanted_filter())))
        return min(found, key=lambda s: self.certify(s).feedback.loop_band.max_deviation, default=None)

    def _gain_and_integral_kept(self) -> Settings:
        """Return the source's gain and integral with its filter time, and the derivative that keeps the moments.

        Raises
        ------
        NoMatchError, SettingError
            The target has another form or filter, or does not take them.
        """
        a, (_, m1, m2) = self.scaled.algorithm, self.scaled.moments()
        equation, filt = self.source.equation, self.target.filter
        K = a.kp
        if equation.form is not self.target.form or filt.lead_lag or self.target.shape.filter_on != "term" or not (K and a.ki):
            raise NoMatchError("gain and integral cannot be kept")
        kd = K * (m1 - K) / a.ki if self.target.form is Form.SERIES else m2
        if kd * K <= 0:
            raise NoMatchError("the derivative would turn round")
        return self.weighted(Numbers(K, a.ki, kd, a.Tf))

    def _with_filter(self, filt: TargetFilter) -> Settings:
        self.target.filter = filt
        return self._with_the_moments(self._best(self._matched(self.scaled.moments(), filt)))

    def _with_the_moments(self, settings: Settings) -> Settings:
        """Return the settings or, behind a filter that no closed form knows, such that have the moments."""
        wanted, found = self.scaled.moments(), self._moments(settings)
        if all(abs(x - y) <= EXACT * size for x, y, size in zip(wanted, found, sizes(wanted), strict=True)):
            return settings
        return self.through(lambda problem, _: meet(problem), settings)

    def _keeps_the_moments(self, settings: Settings) -> bool:
        wanted, found = self.scaled.moments(), self._moments(settings)
        m0, m1, _ = wanted
        size = [max(x, y) for x, y in zip(sizes(wanted), sizes((m0, m1, 0.0)), strict=True)]  # m2 can be 0 but for rounding
        return all(abs(x - y) <= _KEPT * s for x, y, s in zip(wanted, found, size, strict=True))

    def _moments(self, settings: Settings) -> tuple[float, float, float]:
        """Return the moments of the feedback path, which no mode changes."""
        return Law(self._as_matched(settings.algorithm())).moments()

    def _matched(self, moments: Sequence[float], filt: TargetFilter) -> Iterable[Numbers]:
        """Return the solutions of the low-frequency match, with a filter that was free set to the value it was fixed at."""
        for numbers in closed.low_frequency(moments, self.target, filt):
            chosen = filt.setting is not None and filt.setting not in self.target.given
            yield replace(numbers, Tf=self._time_of(numbers)) if chosen else numbers

    def through(
        self, solve: Way, start: Settings, at_scan: tuple[Law, float] | None = None, *, derivative: bool = True
    ) -> Settings:
        """Return settings found by way of their moments.

        Parameters
        ----------
        solve : callable
            What finds the moments.
        start : Settings
            Settings whose filter is taken.
        at_scan : tuple of Law and float, optional
            The source's law at its scan interval and the target's interval [s], where these count.
        derivative : bool
            Without it the target gets no derivative action, whatever the second moment asks for.

        Raises
        ------
        NoMatchError, SettingError
            There are none, or they leave the target's ranges.
        """
        filt = self.target.filter
        if filt.setting is not None:
            filt = replace(filt, free=False, value=start[filt.setting].canonical)
        self.target.filter = filt

        def numbers(moments: Sequence[float]) -> Numbers:
            if derivative:
                found = next(iter(self._matched(moments, self.target.filter)))
                if self.target.form is Form.SERIES and found.kd and not (found.K and self.target.has_proportional):
                    raise NoMatchError("a series form has no derivative without proportional action")
                return found
            return replace(next(iter(self._matched((*moments[:2], 0.0), self.target.filter))), kd=0.0)

        wanted, scan = at_scan or (self.law, None)
        wanted = Law(self._as_matched(wanted.algorithm), wanted.scan)
        problem = Problem(Law(scaled(wanted.algorithm, self.factor), wanted.scan), self.target, numbers, scan)
        return self.weighted(numbers(solve(problem, self.scaled.moments())), problem)

    def _best(self, solutions: Iterable[Numbers]) -> Settings:
        """Return the settings of the first solution, or of a later one whose law is exactly the source's.

        Raises
        ------
        SettingError
            None of these lies within the target's ranges; the first one's reason.
        """
        solutions = tuple(solutions)
        if len(solutions) == 1:
            return self.weighted(solutions[0])
        found: list[tuple[int, Settings]] = []
        refused: SettingError | None = None
        for i, numbers in enumerate(solutions):
            try:
                settings = self.weighted(numbers)
            except SettingError as error:
                refused = refused or error
                continue
            rank = RANK[self.certify(settings).verdict]
            if i == 0 or rank < RANK["approximate"]:
                found.append((rank, settings))
        if not found:
            raise refused or NoMatchError("the numbers leave the range of floating point")
        return min(found, key=lambda pair: pair[0])[1]

    def _time_of(self, numbers: Numbers) -> float:
        """Return the filter time that goes with the numbers when the filter is fixed [s]."""
        return float(self.target.algorithm_of(replace(numbers, Tf=None)).Tf)

    def _wanted_filter(self) -> tuple[float, float]:
        """Return the source's filter time, and the derivative time on the target that it goes with [s].

        Series forms have their derivative between the lead of the numerator and the filter; the others by the second moment.
        """
        a = self.scaled.algorithm
        _, m1, m2 = closed.without_rounding(self.scaled.moments())
        behind = replace(self.target.filter, kind="time", value=a.Tf, free=False)
        numbers = next(iter(closed.low_frequency(self.scaled.moments(), self.target, behind)), None)
        if numbers is not None and self.target.shape.filter_on == "term":
            return a.Tf, float(self.target.filter_base(numbers))
        filt = self.target.filter
        plain = self.target.form is Form.PARALLEL and filt.kind != "time" and filt.of != "derivative-time"
        return a.Tf, m2 / (1.0 if plain else m1 or self.target.idle_gain)

    def weighted(self, numbers: Numbers, problem: Problem | None = None) -> Settings:
        """Return settings of the target, with the setpoint weights that keep the setpoint path, as far as their ranges allow."""
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


def scaled(a: Algorithm, factor: float) -> Algorithm:
    """Return the algorithm with all three gains multiplied."""
    return a if factor == 1 else replace(a, kp=a.kp * factor, ki=a.ki * factor, kd=a.kd * factor)
