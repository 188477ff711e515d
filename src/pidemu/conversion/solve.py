"""Solving for a target's settings: the match that is asked for, made up for the scans; and what is offered where there is none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule, Status
from pidemu.certificate.linear import bands, certify, compare_paths, deviation
from pidemu.certificate.models import Certificate, Kick, ScanCost
from pidemu.certificate.noise import MORE, noise_gain
from pidemu.certificate.scan_cost import scan_cost
from pidemu.conversion import match as closed
from pidemu.conversion.closed_forms import ClosedForms
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.match import NoMatchError
from pidemu.conversion.match_method import Aim, Match
from pidemu.conversion.modes import Mode, Modes, law_in, looked_at
from pidemu.conversion.moments import MomentProblem as Problem
from pidemu.conversion.moments import Way, at_frequency, in_loop, meet
from pidemu.conversion.nearest import USELESS, nearest
from pidemu.conversion.target import Numbers, Target
from pidemu.errors import ScanError, SettingError
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.process.process import Process

_FILTER_ROUNDS = 12
_LEAST = {Rule.TRAPEZOIDAL: 0.5, Rule.FORWARD: 1.0, Rule.LAGGED_DIFFERENCE: 0.5}
"""Filter time in scan intervals below which a rule rings, or hardly leaves a derivative."""
_CLEARLY = 1e-6
"""Relative amount by which a deviation must be smaller to count."""
_NEAR, _NEAR_ENOUGH = 0.01, 0.02
"""Deviation in the loop band below which the source's own numbers are kept; the second where its filter is only assumed."""
_FAR = 0.05
"""Deviation in the loop band from which the same moments are no longer near."""


class Solver:
    """One conversion under way: one choice of the target's options.

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
    mode : {"auto", "cascade", "both"}
        The modes in which the setpoint path counts; where it is another one in each, weights are matched in automatic.
    """

    def __init__(
        self,
        source: Settings,
        target: Target,
        factor: float,
        scans: tuple[float, float] | None,
        process: Process | None = None,
        *,
        compensate: bool = False,
        mode: Modes = "both",
    ) -> None:
        self.source = source
        self.target = target
        self.factor = factor
        self.scans = scans
        self.process = process
        self.mode = mode
        self.first_mode: Mode = "cascade" if mode == "cascade" else "auto"
        self.forms = ClosedForms(source, target, factor, self.first_mode)
        self.law = self.forms.law
        self.at_source_scan = law_in(source, self.first_mode, scans[0]) if scans else None
        self.filter_is_free = target.filter.free
        self.compensates = compensate and scans is not None
        """Whether targets are matched as a process sees them, sampled and held."""
        self.is_bent = False
        """Whether the settings found make up for the scans: where there is nothing to make up for, they are the plain ones."""

    def settings(self, aim: Aim) -> tuple[Settings, Match]:
        """Return the target's settings and how they were found.

        Raises
        ------
        NoMatchError, SettingError
            The target has no such settings.
        """
        self.target.filter = self.forms.original_filter  # a match fixes it
        self.is_bent = False
        closed.check_terms(self.forms.scaled.algorithm, self.target)
        return self._by(aim)

    def refused(self, why: Exception) -> tuple[Settings | None, str]:
        """Return the nearest settings, where any come near, and the reason why the target refuses."""
        reason = f"{self.target.card.id} cannot do what {self.source.card.id} does: {why}"
        with suppress(SettingError):
            return self._nearest(), reason
        return None, f"{reason}; no settings of it come near"

    def _by(self, aim: Aim) -> tuple[Settings, Match]:
        match aim.match:
            case None:
                return self._default()
            case "textbook":
                return self.forms.textbook(), "textbook"
            case "same-numbers":
                return self.forms.own_numbers(), "same-numbers"
            case "constrained":
                return self._nearest(), "constrained"
            case "frequency":
                return self._through(lambda p, m: at_frequency(p, m, self._frequency(aim))), "frequency"
            case "loop":
                assert self.process is not None
                process = self.process
                return self._through(lambda p, m: in_loop(p, m, process)), "loop"
        return self._compensated(*self.forms.solve(aim.match), aim.match)

    def _default(self) -> tuple[Settings, Match]:
        """Return the settings where no match is asked for (specs/equations.md, section 9, match).

        The same law where the target has it; else the source's own numbers where they are nearly that; else the same moments while
        these are near, and beyond that the least largest deviation.
        """
        why: NoMatchError | SettingError
        try:
            return self._compensated(self.forms.exact(), "exact", None)
        except (NoMatchError, SettingError) as error:
            why = error
        own = self._own_numbers()
        if own is not None:
            return self._compensated(own, "same-numbers", None)
        self.target.filter = self.forms.original_filter
        try:
            settings = self.forms.low_frequency()
        except (NoMatchError, SettingError) as error:
            raise (why if isinstance(why, NoMatchError) and why.fundamental else error) from None
        if self.forms.certify(settings).feedback.is_exact:
            return self._compensated(settings, "exact", None)
        return self._compensated(*self._nearer(settings), None)

    def _own_numbers(self) -> Settings | None:
        """Return the source's own numbers where they are good enough: near in the loop band, and alike for noise."""
        self.target.filter = self.forms.original_filter
        try:
            own = self.forms.own_numbers()
        except (NoMatchError, SettingError):
            return None
        least = _NEAR if filter_status(self.source) is not Status.ASSUMED else _NEAR_ENOUGH
        near = self.continuous_deviation(own) < least
        alike = noise_gain(own) <= MORE * (1 + _CLEARLY) * noise_gain(self.source) * abs(self.factor)
        return own if near and alike else None

    def certify(self, settings: Settings) -> Certificate:
        """Return the linear figures of settings of the target."""
        at_scan = None
        if self.scans and self.at_source_scan:
            at_scan = (self.at_source_scan, law_in(settings, self.first_mode, self.scans[1]))
        found = certify(self.law, law_in(settings, self.first_mode), at_scan, self.factor, self.process)
        others = looked_at(self.mode, self.source, settings)[1:]
        if others:
            limits = bands(self.law, max(self.scans) if self.scans else None, self.process)
            laws = {mode: (law_in(self.source, mode), law_in(settings, mode)) for mode in others}
            found = replace(
                found,
                setpoint_in_cascade=compare_paths(*laws["cascade"], "setpoint", limits, self.factor),
                kick_in_cascade=Kick(self.factor * laws["cascade"][0].kick(), laws["cascade"][1].kick()),
            )
        return found

    def deviation(self, settings: Settings) -> float:
        """Return the largest deviation of the feedback path in the loop band; at the scans, where these are compensated for."""
        if self.compensates and self.scans and self.at_source_scan:
            band = bands(self.law, max(self.scans), self.process)[0]
            return deviation(self.at_source_scan, settings.law(self.scans[1]), band, self.factor)
        return self.continuous_deviation(settings)

    def continuous_deviation(self, settings: Settings) -> float:
        """Return the largest deviation of the continuous feedback paths in the loop band, wherever a scan interval would end it."""
        band = bands(self.law, None, self.process)[0]  # plain settings do not depend on the scan intervals
        return deviation(self.law, settings.law(), band, self.factor)

    def distance(self, settings: Settings) -> float:
        """Return by what settings are judged: the change of Ms with a process, else the deviation in the loop band."""
        if self.process is None:
            return self.continuous_deviation(settings)
        from pidemu.analysis.figures import loop_figures

        old, new = (loop_figures(law, self.process, f).Ms for law, f in ((self.law, self.factor), (settings.law(), 1.0)))
        if not (math.isfinite(old) and math.isfinite(new)):
            return self.continuous_deviation(settings)
        return abs(new / old - 1)

    def scan_cost(self, settings: Settings) -> ScanCost | None:
        """Return what the scan intervals cost, at the crossover of the loop or where it usually lies."""
        if self.scans is None or self.at_source_scan is None:
            return None
        return scan_cost(self.at_source_scan, settings.law(self.scans[1]), self.factor, self.process)

    def _nearest(self) -> Settings:
        # nothing imitates a missing proportional term
        idle = not self.forms.scaled.algorithm.kp and self.target.has_proportional
        numbers = None if idle else nearest(self.forms.matched, self.target, self.factor, self.process)
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
        from pidemu.analysis.figures import crossover

        wanted = self.at_source_scan or self.law
        found = crossover(lambda w: self.factor * wanted.held(w), self.process, None if self.scans is None else self.scans[0])
        if found is None:
            raise SettingError("the source's loop has no gain crossover with this process; give the frequency")
        if self.scans is not None and found >= math.pi / max(self.scans):
            raise SettingError(f"the source's crossover, {found:g} rad/s, is beyond half the scan rate; match at a lower frequency")
        return found

    def _compensated(self, settings: Settings, how: Match, match: Match | None) -> tuple[Settings, Match]:
        """Return settings that make up for the scans, where that is asked for and brings them nearer; else the given ones."""
        if not self.compensates or self._runs_exactly(settings):
            return settings, how
        bent = self._bent(settings)
        runs_exactly = bent is not None and self._runs_exactly(bent)
        if match == "exact" and not runs_exactly:
            raise NoMatchError("no settings give the same law at these scan intervals and rules")
        if bent is None:
            return settings, how
        self.is_bent = True
        return bent, "exact" if runs_exactly else "low-frequency"

    def _bent(self, settings: Settings) -> Settings | None:
        """Return settings that make up for the scans; ``None`` where there are none that come nearer."""
        with suppress(NoMatchError, SettingError, ScanError):
            bent = self._through(self._met, settings, derivative=bool(self.forms.scaled.algorithm.kd))
            if self.deviation(bent) < self._deviation_if_stable(settings) * (1 - _CLEARLY) and self._keeps_signs(bent):
                return bent
        return None

    def _keeps_signs(self, settings: Settings) -> bool:
        """Whether every term pushes the way the source's does: making up for scans never turns a derivative round."""
        old, new = self.forms.scaled.algorithm, settings.algorithm()
        return all(x * y >= 0 for x, y in ((old.kp, new.kp), (old.ki, new.ki), (old.kd, new.kd)))

    def _runs_exactly(self, settings: Settings) -> bool:
        try:
            at_scan = self.certify(settings).feedback_at_scan
            return at_scan is not None and at_scan.is_exact
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
        a = self.forms.scaled.algorithm
        terms = bool(a.ki), bool(a.kp), bool(a.kd)
        if self.filter_is_free:
            self._start_with_a_usable_filter(problem.numbers(start), problem.scan)
        asked = meet(problem, terms)
        for _ in range(_FILTER_ROUNDS if self.filter_is_free else 0):
            law, kept = problem.law(asked), self.target.filter
            kd, Tf = law.algorithm.kd, law.algorithm.Tf
            if not kd:
                break
            apart = law.held_expansion(4)[3] - problem.wanted.held_expansion(4)[3]
            wanted = self._usable(Tf + apart / kd, law.algorithm, law.scan)  # m3 holds -kd Tf
            try:
                self.target.filter = kept.nearest_to(wanted, self.target.filter_base(problem.numbers(asked)))
                asked = meet(problem, terms)
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
        least = _LEAST.get(a.derivative.rule if a.filter_on == "term" else a.filter_rule, 0.0) * (scan or 0.0)
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

    def _nearer(self, settings: Settings) -> tuple[Settings, Match]:
        """Return settings of the same moments or, where these are far off, what comes nearest.

        Raises
        ------
        NoMatchError
            Everything is as far off as no controller at all.
        """
        found: list[tuple[float, Match, Settings]] = [(self.distance(settings), "low-frequency", settings)]
        off = self.continuous_deviation(settings)
        with suppress(NoMatchError, SettingError):
            book = self.forms.weighted(self.forms.textbook_numbers())
            found.append((self.distance(book), "textbook", book))
        a = self.forms.scaled.algorithm
        unfiltered = bool(a.kd) and not a.Tf
        nearer = found[-1][0] < found[0][0] * (1 - _CLEARLY)
        if off >= USELESS or (off > _FAR and not unfiltered) or nearer:
            with suppress(SettingError):
                near = self._nearest()
                found.append((self.distance(near), "constrained", near))
        _, how, best = min(found, key=lambda f: f[0] if f[1] == "low-frequency" else f[0] * (1 + _CLEARLY))
        notched = not a.kp  # integral and derivative alone cancel at one frequency: no measure there
        if not notched and self.continuous_deviation(best) >= USELESS:
            raise NoMatchError("what comes nearest is as far off in the loop band as no controller at all")
        return best, how
