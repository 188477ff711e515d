"""Settings found by way of their moments: what is wanted chooses these, a closed form turns them into numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from pidemu.card.model.base import Form
from pidemu.conversion.match.low_frequency import low_frequency
from pidemu.conversion.match.moments import MomentProblem, Way
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.pair import Pair
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.law.law import Law


def through_moments(
    pair: Pair, solve: Way, start: Found, at_scan: tuple[Law, float] | None = None, *, derivative: bool = True
) -> Found:
    """Return settings found by way of their moments.

    Parameters
    ----------
    pair : Pair
        Source and target.
    solve : callable
        What finds the moments.
    start : Found
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
    target = pair.target

    def closed_form(moments: Sequence[float], filt: TargetFilter) -> Numbers:
        if not derivative:
            return replace(next(solutions(pair, (*moments[:2], 0.0), filt)), kd=0.0)
        found = next(solutions(pair, moments, filt))
        if target.form is Form.SERIES and found.kd and not (found.K and target.has_proportional):
            raise NoMatchError("a series form has no derivative without proportional action")
        return found

    law, scan = at_scan or (pair.law, None)
    problem = MomentProblem(pair.as_matched(law, pair.factor), target, start.filter, closed_form, scan)
    problem, moments = solve(problem, pair.scaled.moments())
    return pair.settle(problem.numbers(moments), start.match, problem.wanted, problem.scan)


def solutions(pair: Pair, moments: Sequence[float], filt: TargetFilter) -> Iterator[Numbers]:
    """Yield the solutions of the low-frequency match, with a filter that was free set to the value it was fixed at."""
    chosen = filt.setting is not None and filt.setting not in pair.target.given
    for numbers in low_frequency(moments, pair.target, filt):
        yield replace(numbers, Tf=_time_of(pair, numbers, filt)) if chosen else numbers


def _time_of(pair: Pair, numbers: Numbers, filt: TargetFilter) -> float:
    """Return the filter time that goes with the numbers when the filter is fixed [s]."""
    return float(pair.target.algorithm_of(replace(numbers, Tf=None), filt).Tf)
