"""A PID algorithm in parallel, standard and series form (specs/equations.md, sections 2 and 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import LARGEST, SMALLEST


@dataclass(frozen=True, slots=True)
class Parallel:
    """Gains of ``kp + ki/s + kd s``.

    Attributes
    ----------
    kp, ki, kd : float
        Gains of the terms [%/%, 1/s, s].
    """

    kp: float
    ki: float
    kd: float


@dataclass(frozen=True, slots=True)
class Times:
    """Gain and times of ``K (1 + 1/(Ti s) + Td s)``, or of ``K (1 + 1/(Ti s)) (1 + Td s)``.

    Attributes
    ----------
    K : float
        Gain [%/%].
    Ti, Td : float
        Integral and derivative time [s]; an infinite integral time is no integral action.
    """

    K: float
    Ti: float
    Td: float


@dataclass(frozen=True, slots=True)
class Forms:
    """One controller in three forms, exactly.

    Attributes
    ----------
    parallel : Parallel
        Always there.
    standard, series : Times or None
        ``None`` where there is no such form.
    why_not : dict of str to str
        Why there is none, by form.
    own : {"parallel", "standard", "series"}
        The card's form.
    term_filter : bool
        Whether there is a filter on the derivative.
    lead_lag : bool
        Whether it is, in the series form, that of a lead-lag, ``(1 + Td s)/(1 + Tf s)``, and not one of the D term alone.
    """

    parallel: Parallel
    standard: Times | None
    series: Times | None
    why_not: dict[str, str]
    own: str
    term_filter: bool
    lead_lag: bool


def forms_of(a: Algorithm, own: str, *, lead_lag: bool) -> Forms:
    """Return an algorithm in all forms that it has.

    The filter keeps its time in all of them. On the measurement or the output it stays there; that of the D term of a parallel or
    standard form is, in the series form, the lag of a lead-lag.

    Parameters
    ----------
    a : Algorithm
        The algorithm; not one of pole cancellation.
    own : {"parallel", "standard", "series"}
        The card's form.
    lead_lag : bool
        Whether it is a series form whose derivative is a lead-lag.
    """
    parallel = _parallel(a)
    if not all(x == 0 or SMALLEST <= abs(x) <= LARGEST for x in (parallel.kp, parallel.ki, parallel.kd, a.kp, a.kd, a.Tf)):
        told = dict.fromkeys(("standard", "series"), "a gain or time is too large or too small to compute with")
        return Forms(parallel, None, None, told, own, a.has_term_filter, lead_lag or not a.series)
    standard, no_standard = _standard(parallel)
    if a.series and a.kp:
        lead = a.kd + (a.kp * a.Tf if lead_lag else 0.0)
        series: Times | None = Times(a.kp, _ratio(a.kp, a.ki), lead / a.kp)
        no_series = ""
    else:
        series, no_series = _series(parallel, a.Tf if a.has_term_filter else 0.0)
    why = {"standard": no_standard, "series": no_series}
    told = {form: text for form, text in why.items() if text}
    return Forms(parallel, standard, series, told, own, a.has_term_filter, lead_lag or not a.series)


def _ratio(top: float, bottom: float) -> float:
    return top / bottom if bottom else math.inf


def _parallel(a: Algorithm) -> Parallel:
    if not a.series or not a.kd:
        return Parallel(a.kp, a.ki, a.kd)
    through = a.ki * a.kd / a.kp  # what the integral makes of the derivative
    return Parallel(a.kp + through, a.ki, a.kd - through * a.Tf if a.filter_on == "term" else a.kd)


def _standard(p: Parallel) -> tuple[Times | None, str]:
    if not p.kp:
        return None, "there is no proportional action, and a gain of zero leaves nothing of the standard form"
    if p.ki / p.kp < 0 or p.kd / p.kp < 0:
        return None, "its terms have gains of different signs, and times are not negative"
    return Times(p.kp, _ratio(p.kp, p.ki), p.kd / p.kp), ""


def _series(p: Parallel, Tf: float) -> tuple[Times | None, str]:
    """Return the series form with a lead-lag: real roots of ``n0 T^2 - n1 T + n2``, the larger as integral time."""
    n0, n1, n2 = p.ki, p.kp + p.ki * Tf, p.kd + p.kp * Tf
    if not p.kp or not n1:
        return None, "there is no proportional action, and a gain of zero leaves nothing of the series form"
    if n0 / n1 < 0 or n2 / n1 < 0:
        return None, "its terms have gains of different signs, and times are not negative"
    if not n0:
        return Times(n1, math.inf, n2 / n1), ""
    root = n1 * n1 - 4 * n0 * n2
    if root < -1e-12 * n1 * n1:
        counted = ", with the filter counted," if Tf else ""
        return None, (
            f"a series form has an integral time of at least 4 derivative times in the standard form; here{counted} "
            f"Ti is {n1 / n0:.4g} s and Td {n2 / n1:.4g} s"
        )
    Ti = (n1 + math.copysign(math.sqrt(max(root, 0.0)), n1)) / (2 * n0)
    return Times(n0 * Ti, Ti, n2 / (n0 * Ti)), ""
