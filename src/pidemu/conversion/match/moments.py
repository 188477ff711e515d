"""Targets solved by way of their moments, where no closed form answers (specs/equations.md, section 3).

The closed forms turn moments ``m0, m1, m2`` into the numbers of any target, whatever its form and filter. Here they are asked with
moments that are not the source's, but chosen so that what is wanted comes true: the moments of the sampled, held law, the response
at one frequency, or the closed loop. ``m0`` stays, and with it the integral of the error after a load step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from pidemu.arrays import Floats
from pidemu.certificate.linear import bands
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target
from pidemu.errors import PidemuError
from pidemu.law.law import Law

if TYPE_CHECKING:
    from pidemu.process.process import Process

_ROUNDS = 60
_CONVERGED = 1e-13
_NEWTON_CONVERGED = 1e-12
_STEP = 1e-6
"""Relative step of a difference quotient: the middle between rounding and curvature."""
_POINTS = 200


@dataclass(frozen=True, slots=True)
class MomentProblem:
    """What is wanted of a target.

    Attributes
    ----------
    wanted : Law
        The source's law, scaled; discrete where the scan intervals count.
    target : Target
        The target.
    filter : TargetFilter
        The target's filter, with the value that it has.
    closed_form : callable
        From moments and filter to the target's numbers; raises `NoMatchError` where there are none.
    scan : float or None
        The target's scan interval [s], where it counts.
    """

    wanted: Law
    target: Target
    filter: TargetFilter
    closed_form: Callable[[Sequence[float], TargetFilter], Numbers]
    scan: float | None

    def numbers(self, moments: Sequence[float]) -> Numbers:
        """Return the target's numbers for these moments."""
        return self.closed_form(moments, self.filter)

    def law(self, moments: Sequence[float]) -> Law:
        """Return the target's law with the numbers of these moments."""
        return Law(self.target.algorithm_of(self.numbers(moments), self.filter), self.scan)

    def filtered_like(self, Tf: float, moments: Sequence[float]) -> MomentProblem:
        """Return the problem with the filter fixed nearest to a time [s], for the numbers of these moments."""
        return replace(self, filter=self.filter.nearest_to(Tf, self.target.filter_base(self.numbers(moments))))


Asked = tuple[MomentProblem, Sequence[float]]
"""Moments to ask the closed form with, and the problem that they solve: its filter may be another one than at first."""
Way = Callable[[MomentProblem, Sequence[float]], Asked]
"""A way to solve: from the problem and the source's moments."""


def meet(problem: MomentProblem, terms: Sequence[bool] = (True, True, True)) -> Sequence[float]:
    """Return moments for which the target's law, sampled and held, has the moments of the source's.

    A scan rule and a hold change ``m1`` by ``h m0`` and ``m2`` by ``h m1``. What makes up for that is found by Newton's method; the
    map is nearly linear. At equal intervals two unfiltered laws then have the same three coefficients of their increments: they
    are equal.

    Parameters
    ----------
    problem : MomentProblem
        What is wanted.
    terms : sequence of bool
        Which of integral, proportional and derivative term are at work. The moment of one that is not is neither met nor changed:
        without a derivative, gain and integral stay the source's but for what the rules do to ``m1``.

    Raises
    ------
    NoMatchError
        There are none: the intervals are too long for the settings.
    """
    wanted = np.array(problem.wanted.held_expansion(3))
    size = np.array(sizes(wanted.tolist()))
    free = np.flatnonzero(terms)

    def missing(x: Floats) -> Floats:
        found: Floats = np.array(problem.law((x * size).tolist()).held_expansion(3))
        apart: Floats = (wanted - found) / size
        return apart

    x = np.where(terms, wanted / size, 0.0)
    for _ in range(_ROUNDS):
        off = missing(x)
        slope = np.stack([(missing(x + _STEP * e) - off) / _STEP for e in np.eye(3)[free]], axis=1)
        if not (np.isfinite(slope).all() and np.isfinite(off).all()):
            break
        step = np.zeros(3)
        step[free] = np.linalg.lstsq(slope[free], -off[free], rcond=1e-9)[0]
        x = x + step
        if float(np.max(np.abs(step))) <= _CONVERGED * max(1.0, float(np.max(np.abs(x)))):
            asked: list[float] = (x * size).tolist()
            return asked
    raise NoMatchError("the scan intervals are too long for these settings")


def sizes(moments: Sequence[float]) -> tuple[float, float, float]:
    """Return what each of three moments is measured by: itself, or what the others make of it over one time."""
    m0, m1, m2 = moments
    time = abs(m1 / m0) if m0 and m1 else abs(m2 / m1) if m1 and m2 else 1.0
    return (
        abs(m0) or abs(m1) / time or abs(m2) / time**2,
        abs(m1) or abs(m0) * time or abs(m2) / time,
        abs(m2) or abs(m1) * time or abs(m0) * time**2,
    )


def at_frequency(problem: MomentProblem, start: Sequence[float], w: float) -> Sequence[float]:
    """Return moments with the source's ``m0`` for which the two responses agree at a frequency.

    Parameters
    ----------
    problem : MomentProblem
        What is wanted.
    start : sequence of float
        The source's moments.
    w : float
        The frequency [rad/s].

    Raises
    ------
    NoMatchError
        There are none.
    """
    goal = complex(problem.wanted.held(w)[()])

    def apart(x: Floats) -> Floats:
        ratio = complex(problem.law((start[0], *x)).held(w)[()]) / goal - 1
        return np.array([ratio.real, ratio.imag])

    x = np.array(start[1:], dtype=float)
    size = np.array(sizes(start)[1:])
    try:
        for _ in range(_ROUNDS):
            off = apart(x)
            if float(np.max(np.abs(off))) < _NEWTON_CONVERGED:
                return start[0], *x.tolist()
            slope = np.stack([(apart(x + _STEP * size * e) - off) / _STEP for e in np.eye(2)], axis=1)
            x = x - size * np.linalg.solve(slope, off)
    except np.linalg.LinAlgError:
        raise NoMatchError("without derivative action, gain and phase cannot both be kept at one frequency") from None
    raise NoMatchError(f"no settings that keep the integral gain have the source's gain and phase at {w:g} rad/s")


def check_optimiser() -> None:
    """Refuse a match in the loop, before anything is computed for it, where scipy is not installed.

    Raises
    ------
    PidemuError
        It is not.
    """
    if find_spec("scipy") is None:
        raise PidemuError("the match 'loop' needs scipy, which is not installed; pip install 'pidemu[loop]'")


def in_loop(problem: MomentProblem, start: Sequence[float], process: Process) -> Sequence[float]:
    """Return moments with the source's ``m0`` for which the loop's response to a load step changes least.

    What is minimised is the integral of the squared difference of the two measurements after a load step, computed in the
    frequency domain (Parseval): ``|P/(1 + P Ct) - P/(1 + P Cs)|^2/w^2``.

    Parameters
    ----------
    problem : MomentProblem
        What is wanted.
    start : sequence of float
        The source's moments.
    process : Process
        The process.

    Raises
    ------
    NoMatchError
        scipy, which looks for the minimum, finds none.
    """
    from scipy.optimize import least_squares

    (low, high), _ = bands(problem.wanted if problem.wanted.scan is None else Law(problem.wanted.algorithm), problem.scan, process)
    w = np.geomspace(low, high if problem.scan is None else min(2 * high, math.pi / problem.scan), _POINTS)
    P = process.response(w)
    sign = math.copysign(1.0, process.feedback_sign * next(m for m in start if m))
    C = sign * problem.wanted.held(w)
    wanted = P / (1 + P * C)
    weight = 1 / np.sqrt(w)  # 1/w of the step, and dw = w dlog(w)
    size = np.array(sizes(start)[1:])
    count = 2 if problem.target.has_derivative else 1

    def apart(x: Floats) -> Floats:
        moments = (start[0], *(x * size[:count]), *start[1 + count :])
        try:
            found = P / (1 + sign * P * problem.law(moments).held(w))
        except NoMatchError:
            return np.full(2 * w.size, 1e3 * float(np.max(np.abs(weight * wanted))))
        off = weight * (found - wanted)
        return np.concatenate([off.real, off.imag])

    found = least_squares(apart, np.array(start[1 : 1 + count]) / size[:count], x_scale=1.0, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    if not found.success:
        raise NoMatchError(f"the minimum in the loop was not found: {found.message}")
    return start[0], *(found.x * size[:count]).tolist(), *start[1 + count :]
