"""The best settings of a card for a process, by a criterion and within limits, on the exact sampled loop."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

import pidemu
from pidemu.analysis.figures import loop_figures, settling_time
from pidemu.analysis.load_response import load_iae
from pidemu.analysis.loop_figures import LoopFigures
from pidemu.arrays import Floats
from pidemu.card.library import load_card
from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.conversion.rounding import rounded
from pidemu.conversion.target.dials import settings_with
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.prepare import prepare_target
from pidemu.conversion.target.target import Target
from pidemu.errors import PidemuError, ScanError, SettingError, TuningError, UndefinedError
from pidemu.formatting import json_safe
from pidemu.law.law import Law
from pidemu.process.process import Process
from pidemu.process.text import written
from pidemu.settings.action import Action
from pidemu.settings.ranges import RangeGiven
from pidemu.settings.settings import Settings
from pidemu.tuning.compare import tune_all
from pidemu.tuning.criteria import CRITERIA, DISTURBANCES, bounded, criterion_of, is_stable, read_limits
from pidemu.tuning.sampled_loops import SampledLoops
from pidemu.tuning.tune import Tuning, percent_process
from pidemu.units import Role

SCHEMA: Final = "pidemu-optimum-1"
"""Name and version of the form of ``pidemu optimise --json``."""
_MOST_SCANS: Final = 2500
"""Scans of a run; a loop that needs more is searched at a longer interval, and its figures are those at its own."""
_LEAST_SCANS: Final = 200
_LENGTHS: Final = 2.0
"""Length of a run, in times in which the best rule's loop settles."""
_POPULATION: Final = 24
"""Candidates per number that is sought."""
_GENERATIONS: Final = {1: 12, 2: 18, 3: 26}
_REFINED: Final = 8
"""Rounds of a search close to the best."""
_AROUND: Final = 20.0
"""Factor around the rules' numbers within which the best is sought."""
_TERMS: Final = {"P": 1, "PI": 2, "PID": 3}
_REPEATS: Final = 3
"""How often a limit that the exact figure breaks is drawn tighter."""
_IMPOSSIBLE, _BROKEN, _UNSTABLE = 1e30, 1e20, 1e6
"""What stands for no settings, and for settings that break a limit, in place of a criterion; and the excess of an unstable loop."""
_WITHIN: Final = 1e-3
"""Relative excess over a limit that is rounding."""


@dataclass(frozen=True)
class RuleAnswer:
    """What a tuning rule would have given.

    Attributes
    ----------
    rule : str
        The rule.
    settings : Settings
        Its dials.
    criterion : float
        The criterion with these; infinite where the loop is unstable.
    within_limits : bool
        Whether the limits hold.
    """

    rule: str
    settings: Settings
    criterion: float
    within_limits: bool


@dataclass(frozen=True)
class OptimalTuning:
    """The best settings that were found.

    Attributes
    ----------
    settings : Settings
        Card, dials and options.
    criterion_name, disturbance : str
        What they are best by, and after a step of what.
    criterion : float
        Its value, per 1 % of step (see `pidemu.tuning.criteria.CRITERIA`); of a family of processes the worst.
    limits : dict of str to float
        What was bounded.
    bounded : dict of str to float
        What these figures are; of a family the worst.
    process : Process
        The process.
    family : tuple of Process
        Further processes that it had to serve.
    figures : LoopFigures
        The sampled loop with the process, at the scan interval.
    action : {"reverse", "direct"}
        The control action that makes the feedback negative.
    scan : float
        Scan interval [s].
    rules : tuple of RuleAnswer
        What each rule would have given, the best first.
    """

    settings: Settings
    criterion_name: str
    disturbance: str
    criterion: float
    limits: Mapping[str, float]
    bounded: Mapping[str, float]
    process: Process
    family: tuple[Process, ...]
    figures: LoopFigures
    action: Action
    scan: float
    rules: tuple[RuleAnswer, ...]

    @property
    def gains(self) -> dict[str, float]:
        """Gains of the dials: ``kp``, ``ki`` [1/s], ``kd`` [s] and the filter time ``Tf`` [s], in percent."""
        a = self.settings.algorithm()
        return {name: float(getattr(a, name)) for name in ("kp", "ki", "kd", "Tf")}

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``pidemu optimise --json``."""
        plain: dict[str, Any] = json_safe(
            {
                "schema": SCHEMA,
                "pidemu": pidemu.__version__,
                **{k: v for k, v in self.settings.to_dict().items() if k in ("card", "settings", "options")},
                "gains": self.gains,
                "figures": {**dataclasses.asdict(self.figures), **self.bounded, "scan": self.scan},
                "criterion": {"name": self.criterion_name, "disturbance": self.disturbance, "value": self.criterion},
                "limits": dict(self.limits),
                "action": self.action,
                "process": written(self.process),
                "family": [written(p) for p in self.family],
                "rules": [
                    {"rule": r.rule, "criterion": r.criterion, "within_limits": r.within_limits, **r.settings.to_dict()}
                    for r in self.rules
                ],
            }
        )
        return plain


def optimise(
    card: str | Path | Card,
    process: Process,
    criterion: str = "iae",
    disturbance: str = "load",
    limits: Mapping[str, object] | None = None,
    scan: float | None = None,
    *,
    controller: str | None = None,
    options: Mapping[str, object] | None = None,
    given: Mapping[str, object] | None = None,
    family: Sequence[Process] = (),
    pv_range: RangeGiven | None = None,
    op_range: RangeGiven | None = None,
    action: str | None = None,
    digits: int | None = None,
) -> OptimalTuning:
    """Find the settings of a card that are best for a process, on its exact sampled loop in the linear range.

    Parameters
    ----------
    card : str, path or Card
        The card to tune, its id, or its file.
    process : Process
        The process. A gain in other units than %/% needs the range of the measurement.
    criterion : {"iae", "ise", "itae", "ie"}
        What is least: see `pidemu.tuning.criteria.CRITERIA`.
    disturbance : {"load", "setpoint"}
        After a step of what; the load enters at the process input.
    limits : mapping of str to float, optional
        What is bounded from above, ``{"Ms": 1.6}``: see `pidemu.tuning.criteria.LIMITS`.
    scan : float, optional
        Scan interval [s]; by default that of `pidemu.tune` for the best rule.
    controller : {"P", "PI", "PID"}, optional
        Which terms; by default all that the card has.
    options, given : mapping, optional
        Options of the card, and dials that shall have these values. Other options are those of the best rule.
    family : sequence of Process, optional
        Further processes that the same settings have to serve: the criterion is that of the worst, and the limits hold for all.
    pv_range, op_range : tuple or str, optional
        Ranges of measurement and output, as for `pidemu.tune`.
    action : {"reverse", "direct"}, optional
        Control action; by default the one that makes the feedback negative, and no other is taken.
    digits : int, optional
        Round the dials to their resolution or so many digits; the figures are those of the rounded ones.

    Returns
    -------
    OptimalTuning
        Settings and figures, and what every tuning rule that serves would have given.

    Raises
    ------
    TuningError
        Criterion, disturbance or a limit is unknown, or no settings keep the limits.
    PidemuError
        No tuning rule serves the process, so that there is nothing to begin with; or scipy is not installed.

    Examples
    --------
    >>> import pidemu
    >>> process = pidemu.Process.from_lags(1.0, lags=[20], delay=4)
    >>> best = pidemu.optimise("generic/standard", process, limits={"Ms": 1.6}, controller="PI", scan=0.5)
    >>> best.figures.Ms < 1.602, best.criterion <= min(r.criterion for r in best.rules if r.within_limits)
    (True, True)
    """
    _check(criterion, disturbance)
    bounds = read_limits(limits)
    target, served = card if isinstance(card, Card) else load_card(card), percent_process(process, pv_range, op_range)
    others = tuple(percent_process(p, pv_range, op_range) for p in family)
    named: dict[str, Any] = {
        "options": options,
        "given": given,
        "pv_range": pv_range,
        "op_range": op_range,
        "scan": scan,
        "action": action,
    }
    tunings = tune_all(target, served, controller=controller or _controller(target, options), **named).tunings
    first = tunings[0]
    terms = _TERMS[first.rule.controller]
    prepared = prepare_target(
        target,
        first.settings.options,
        dict(given or {}),
        (first.settings.pv_range, first.settings.op_range),
        scan=scan,
    )
    search = _Search(prepared, (served, *others), criterion, disturbance, bounds, first, terms)
    starts = [numbers for t in tunings if (numbers := search.numbers_of(t.settings)) is not None]
    return _concluded(search, search.best(starts), tunings, digits, served, others)


def _check(criterion: str, disturbance: str) -> None:
    if criterion not in CRITERIA:
        raise TuningError(f"the criterion is '{criterion}'; it is one of {', '.join(CRITERIA)}")
    if disturbance not in DISTURBANCES:
        raise TuningError(f"the disturbance is '{disturbance}'; it is one of {', '.join(DISTURBANCES)}")
    if find_spec("scipy") is None:
        raise PidemuError("optimising needs scipy, which is not installed; pip install 'pidemu[loop]'")


def _controller(card: Card, options: Mapping[str, object] | None) -> str:
    """Return which terms a card has with these options, or with any."""
    variants = [card.variant(options)] if options else [card.variant({n: c}) for n in card.options for c in card.options[n]]
    return "PID" if any(v.has_derivative for v in (variants or [card.variant()])) else "PI"


class _Search:
    """One optimisation: what is sought among, and how good each is.

    Parameters
    ----------
    target : Target
        The card with its options.
    processes : tuple of Process
        What has to be served.
    criterion, disturbance : str
        What is least, after a step of what.
    limits : dict of str to float
        What is bounded.
    first : Tuning
        The rule's answer to begin with.
    terms : int
        How many of gain, integral and derivative dial are sought.
    """

    def __init__(
        self,
        target: Target,
        processes: tuple[Process, ...],
        criterion: str,
        disturbance: str,
        limits: dict[str, float],
        first: Tuning,
        terms: int,
    ) -> None:
        self.target, self.processes, self.criterion, self.disturbance = target, processes, criterion, disturbance
        self.limits, self.tight, self.first, self.terms = limits, dict(limits), first, terms
        self.scan = first.scan
        length = _LENGTHS * max(settling_time(first.settings, p, self.scan) for p in processes)
        self.coarse = max(self.scan, length / _MOST_SCANS)
        self.length = length

    def numbers_of(self, settings: Settings) -> Floats | None:
        """Return gain, time per repeat and derivative time of settings, as many as are sought; ``None`` where one is off."""
        a = settings.algorithm()
        if self.target.form is Form.PARALLEL:
            kp, ki, kd = (abs(x) for x in (a.kp, a.ki, a.kd))
        else:
            gain, rate, time = (settings.by_role(r) for r in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE))
            kp = abs(a.kp or (gain.canonical if gain is not None else 0.0))
            ki, kd = kp * (rate.canonical if rate else 0.0), kp * (time.canonical if time else 0.0)
        numbers = np.array([kp, kp / ki if ki else 0.0, kd / kp if kp else 0.0][: self.terms])
        return numbers if bool(np.all(numbers > 0)) else None

    def settings(self, x: Floats) -> Settings:
        """Return the dials for gain, time per repeat and derivative time.

        Raises
        ------
        SettingError
            A dial cannot be set so.
        """
        K = float(x[0]) * (-1.0 if self.first.action == "direct" and self.target.card.data.action.fixed else 1.0)
        Ti, Td = float(x[1]) if self.terms > 1 else math.inf, float(x[2]) if self.terms > 2 else 0.0
        return settings_with(self.target, Numbers(K, K / Ti, K * Td))

    def law(self, settings: Settings) -> Law:
        """Return the law at the scan interval of the search, of a controller that acts so that the feedback is negative.

        Raises
        ------
        ScanError, UndefinedError
            There is none.
        """
        law = settings.law(self.coarse)
        a = law.algorithm
        return Law(dataclasses.replace(a, kp=abs(a.kp), ki=abs(a.ki), kd=abs(a.kd)), law.scan)

    def _law_for(self, x: Floats) -> Law | None:
        """Return the law for numbers; ``None`` where the card cannot be set so, or cannot be run so."""
        try:
            return self._law_or_none(self.settings(x))
        except SettingError:
            return None

    def costs(self, candidates: Floats) -> Floats:
        """Return how bad candidates are, shape (candidates,): the criterion, or far more where a limit is broken.

        Parameters
        ----------
        candidates : ndarray, shape (terms, candidates)
            Logarithms of the numbers.
        """
        laws = [self._law_for(np.exp(x)) for x in candidates.T]
        there = [i for i, law in enumerate(laws) if law is not None]
        found = np.full(len(laws), _IMPOSSIBLE)
        if there:
            found[there] = self._costs([law for law in laws if law is not None])
        return found

    def _costs(self, laws: list[Law]) -> Floats:
        value, excess, _ = self.judged(laws)
        return np.where(excess > 0, _BROKEN * (1 + excess), value)

    def judged(self, laws: list[Law]) -> tuple[Floats, Floats, dict[str, Floats]]:
        """Return the criterion, by how much limits are broken, and what these bound; of all processes the worst."""
        value, excess = np.zeros(len(laws)), np.zeros(len(laws))
        figures = {name: np.full(len(laws), -math.inf) for name in self.limits}
        for process in self.processes:
            loops = SampledLoops(process, self.coarse, max(_LEAST_SCANS, math.ceil(self.length / self.coarse)), laws)
            response = loops.responses(self.disturbance)
            other = (
                response if self.disturbance == "setpoint" else loops.responses("setpoint") if "overshoot" in self.limits else None
            )
            stable = is_stable(response)
            value = np.maximum(value, np.where(stable, criterion_of(self.criterion, response), math.inf))
            excess = excess + np.where(stable, 0.0, _UNSTABLE)
            for name, most in self.tight.items():
                is_ = bounded(name, loops, response, other)
                figures[name] = np.maximum(figures[name], is_)
                over = np.where(np.isfinite(is_), np.maximum(is_ / most - 1, 0.0), _UNSTABLE)
                excess = excess + np.where(stable, over, 0.0)
        return np.where(np.isfinite(value), value, _BROKEN), excess, figures

    def best(self, starts: list[Floats]) -> Floats:
        """Return the best numbers: an evolution from the rules' answers, then a search close to the best."""
        from scipy.optimize import differential_evolution

        if not starts:
            raise TuningError("no tuning rule's answer has all the terms that are sought; give controller='PI' or 'P'")
        points = np.log(np.array(starts))
        low, high = points.min(axis=0) - math.log(_AROUND), points.max(axis=0) + math.log(_AROUND)
        random = np.random.default_rng(0)
        population = np.clip(points[random.integers(len(points), size=_POPULATION * self.terms)], low, high)
        population = np.clip(population + random.normal(0, 0.5, population.shape), low, high)
        population[: len(points)] = points[: len(population)]
        found = differential_evolution(
            lambda x: self.costs(x.reshape(self.terms, -1)),
            list(zip(low, high, strict=True)),
            init=population,
            maxiter=_GENERATIONS[self.terms],
            tol=1e-4,
            polish=False,
            vectorized=True,
            updating="deferred",
            rng=0,
        )
        best, cost = np.asarray(found.x, dtype=float), float(found.fun)
        for i in range(_REFINED):
            near = best[:, None] + random.normal(0, 0.1 * 0.45**i, (self.terms, 2 * _POPULATION))
            costs = self.costs(near)
            if float(costs.min()) < cost:
                best, cost = near[:, int(costs.argmin())], float(costs.min())
        if cost >= _BROKEN:
            raise TuningError(
                f"no settings of {self.target.card.id} were found that keep the limits {_told(self.limits)}; widen them"
            )
        numbers: Floats = np.exp(best)
        return numbers

    def answers(self, tunings: Sequence[Tuning]) -> list[RuleAnswer]:
        """Return what rules give, the best first."""
        laws = [self._law_or_none(t.settings) for t in tunings]
        there = [i for i, law in enumerate(laws) if law is not None]
        value, excess, _ = self.judged([law for law in laws if law is not None])
        known = {i: (float(value[k]), float(excess[k])) for k, i in enumerate(there)}
        found = []
        for i, t in enumerate(tunings):
            criterion, over = known.get(i, (_BROKEN, _UNSTABLE))
            found.append(RuleAnswer(t.rule.name, t.settings, math.inf if criterion >= _BROKEN else criterion, over <= _WITHIN))
        return sorted(found, key=lambda r: (not r.within_limits, r.criterion, r.rule))

    def _law_or_none(self, settings: Settings) -> Law | None:
        try:
            return self.law(settings)
        except (ScanError, UndefinedError):
            return None


def _concluded(
    search: _Search, best: Floats, tunings: tuple[Tuning, ...], digits: int | None, process: Process, family: tuple[Process, ...]
) -> OptimalTuning:
    """Return the optimum with its exact figures; limits that these break are drawn tighter first."""
    for _ in range(_REPEATS):
        settings = search.settings(best)
        if digits is not None:
            settings, _ = rounded(settings, digits, search.target.given)
        exact = [loop_figures(settings.law(search.scan), p) for p in search.processes]
        worst = {"Ms": max(f.Ms for f in exact), "Mt": max(f.Mt for f in exact)}
        broken = {n: x for n, x in search.limits.items() if n in worst and worst[n] > x * (1 + _WITHIN)}
        if all(f.stable for f in exact) and not broken:
            break
        for name, most in broken.items():
            search.tight[name] = 1 + (search.tight[name] - 1) * min(0.98, (most - 1) / (worst[name] - 1))
        best = search.best([best])
    else:
        raise TuningError(f"the settings found do not keep the limits {_told(search.limits)} exactly; widen them")
    search.tight, search.coarse, search.length = dict(search.limits), search.scan, 2 * search.length
    value, _, figures = search.judged([search.law(settings)])
    main = dataclasses.replace(exact[0], iae=load_iae(settings, process, search.scan))
    bounds = {name: worst.get(name, float(x[0])) for name, x in figures.items()}
    return OptimalTuning(
        settings, search.criterion, search.disturbance, float(value[0]), search.limits, bounds, process, family, main,
        search.first.action, search.scan, tuple(search.answers(tunings)),
    )  # fmt: skip


def _told(limits: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {x:g}" for name, x in limits.items()) or "of stability"
