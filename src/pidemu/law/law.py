"""The linear law: what a PID algorithm does to small signals (specs/equations.md, sections 2 and 4).

Unlimited and in automatic, every controller is ``U = Cr R - Cy Y`` (reverse acting). Both paths are rational: in ``s`` for the
continuous law, in ``q = z^-1`` for the discrete law of one scan interval. The paths are written once, in `paths`, in terms of
three operators: integrator, differentiator and lag; the continuous and the discrete law differ in these only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from pidemu.algorithm.model import Algorithm, Dahlin, check_filters
from pidemu.card.model.base import Rule
from pidemu.card.model.signals import SignalFilter
from pidemu.errors import ScanError, UndefinedError
from pidemu.law.power_series import hold, one_minus_delay
from pidemu.law.rational import Rational, Response, add, multiply

PathName = Literal["feedback", "setpoint"]

_DERIVATIVE_ONLY: Final = "the {} rule is one of the derivative only"


@dataclass(frozen=True, slots=True)
class Operators:
    """What stands for integration, filtered differentiation and lag.

    Attributes
    ----------
    integrator : object
        ``1/s``.
    differentiator : callable
        From filter time [s] to ``s/(1 + Tf s)``.
    lag : callable
        From filter time [s] and order to ``1/(1 + Tf s)`` or ``1/(1 + Tf s + Tf^2 s^2/2)``.
    signal_lag : callable
        The same from a `SignalFilter`, the filter on a signal.
    delay : object
        One scan; 1 in the continuous law, which has none.
    pole_cancellation : callable
        From a `Dahlin` to its law.
    """

    integrator: Any
    differentiator: Callable[[Any], Any]
    lag: Callable[[Any, int], Any]
    signal_lag: Callable[[SignalFilter[Any]], Any]
    delay: Any
    pole_cancellation: Callable[[Dahlin], Any]


def paths(a: Algorithm[Any], op: Operators) -> tuple[Any, Any]:
    """Return feedback and setpoint path of an algorithm (specs/equations.md, section 2).

    Parameters
    ----------
    a : Algorithm
        The algorithm; its numbers may be arrays where `op` works on arrays.
    op : Operators
        The operators, rational functions or their values at some frequencies.

    Returns
    -------
    feedback, setpoint
        ``Cy`` and ``Cr``, of the type that the operators make.
    """
    if a.dahlin is not None:
        law = op.pole_cancellation(a.dahlin)
        return _before_the_algorithm(a, op, law, law)
    d = op.differentiator(a.Tf if a.filter_on == "term" else 0.0)
    pi = a.ki * op.integrator + a.kp
    setpoint = a.ki * op.integrator + a.kp * a.b
    if a.series:
        lead = d * a.derivative_per_gain
        feedback = pi * (lead + 1.0)
        if a.c:
            setpoint = pi * (lead * a.c + 1.0) + a.kp * (a.b - 1.0)
    else:
        feedback = pi + d * a.kd
        setpoint = setpoint + d * (a.kd * a.c)
    if a.filter_on == "measurement":
        feedback = feedback * op.lag(a.Tf, a.filter_order)
    elif a.filter_on == "output":
        lag = op.lag(a.Tf, a.filter_order)
        feedback, setpoint = feedback * lag, setpoint * lag
    return _before_the_algorithm(a, op, feedback, setpoint)


def _before_the_algorithm(a: Algorithm, op: Operators, feedback: Any, setpoint: Any) -> tuple[Any, Any]:
    """Return both paths with what is done to the signals first (specs/equations.md, sections 4 and 6)."""
    if a.error.filter is not None:
        lag = op.signal_lag(a.error.filter)
        feedback, setpoint = feedback * lag, setpoint * lag
    if a.setpoint.filter is not None:
        setpoint = setpoint * op.signal_lag(a.setpoint.filter)
    if a.measurement.filter is not None:
        feedback = feedback * op.signal_lag(a.measurement.filter)
    if a.measurement.previous_scan:
        feedback = feedback * op.delay
    return feedback, setpoint


def _no_continuous_law(d: Dahlin) -> Any:
    raise UndefinedError(
        f"pole cancellation for a dead time of {d.delay:g} s is a recursion in scans and has no continuous law; give a scan "
        f"interval"
    )


CONTINUOUS: Final = Operators(
    integrator=Rational((1.0,), (0.0, 1.0)),
    differentiator=lambda Tf: Rational((0.0, 1.0), (1.0, Tf)),
    lag=lambda Tf, order: Rational((1.0,), (1.0, Tf, Tf * Tf / 2) if order == 2 else (1.0, Tf)),
    signal_lag=lambda f: Rational((1.0,), (1.0, f.seconds)),
    delay=1.0,
    pole_cancellation=_no_continuous_law,
)
"""Rational functions of ``s``."""


def at_frequencies(w: npt.ArrayLike) -> Operators:
    """Return the continuous operators' values at frequencies `w` [rad/s], for numbers or arrays of settings."""
    s = 1j * np.asarray(w, dtype=float)
    return Operators(
        integrator=1 / s,
        differentiator=lambda Tf: s / (1 + Tf * s),
        lag=lambda Tf, order: 1 / (1 + Tf * s + (Tf * s) ** 2 / 2) if order == 2 else 1 / (1 + Tf * s),
        signal_lag=lambda f: 1 / (1 + f.seconds * s),
        delay=1.0,
        pole_cancellation=_no_continuous_law,
    )


def at_scan(a: Algorithm, h: float, w: npt.ArrayLike) -> Operators:
    """Return the discrete operators' values at frequencies `w` [rad/s].

    Computed from ``1 - q`` itself, which stays accurate for frequencies far below the scan rate, where the expanded polynomials of
    `discrete_operators` cancel.
    """
    angle = -1j * np.asarray(w, dtype=float) * h
    return _by_rules(a, h, -np.expm1(angle), lambda d: _cancelled(d, h, angle))


def _cancelled(d: Dahlin, h: float, angle: Any) -> Response:
    g, p, q, delay = d.numbers(h)
    rest, old = -np.expm1(angle), -np.expm1(angle * (delay + 1))  # 1 - z^-1, 1 - z^-(N+1)
    value: Response = g * (1 - p * (1 - rest)) / (q * rest + (1 - q) * old)
    return value


def in_series(a: Algorithm, h: float) -> Operators:
    """Return the discrete operators as power series in ``s``, for low frequencies."""
    return _by_rules(a, h, one_minus_delay(h), _no_continuous_law)


def _by_rules(a: Algorithm, h: float, rest: Any, pole_cancellation: Callable[[Dahlin], Any]) -> Operators:
    """Return the operators of an algorithm's scan rules by ``rest = 1 - q``, be it values or a series."""

    def s_of(rule: Rule) -> Any:
        match rule:
            case Rule.BACKWARD:
                return rest / h
            case Rule.FORWARD:
                return rest / (h * (1 - rest))
            case Rule.TRAPEZOIDAL:
                return 2 * rest / (h * (2 - rest))
        raise ValueError(_DERIVATIVE_ONLY.format(rule.value))

    def differentiator(Tf: float) -> Any:
        if a.derivative.rule is Rule.FOUR_POINT:
            q = 1 - rest
            return rest * (3 + 4 * q + 3 * q * q) / (10 * h)
        if Tf and a.derivative.rule in (Rule.EXACT, Rule.LAGGED_DIFFERENCE):
            keep, take = math.exp(-h / Tf), -math.expm1(-h / Tf)
            gain = take / h if a.derivative.rule is Rule.EXACT else keep / Tf
            return gain * rest / (take + keep * rest)
        s = s_of(a.derivative.rule if Tf else Rule.BACKWARD)
        return s / (1 + Tf * s)

    def lag(Tf: float, order: int) -> Any:
        s = s_of(a.filter_rule)
        return 1 / (1 + Tf * s + (Tf * s) * (Tf * s) / 2) if order == 2 else 1 / (1 + Tf * s)

    return Operators(
        integrator=1 / s_of(a.integral.rule),
        differentiator=differentiator,
        lag=lag,
        signal_lag=lambda f: 1 / (1 + f.at(h) * s_of(f.rule)),
        delay=1 - rest,
        pole_cancellation=pole_cancellation,
    )


def discrete_operators(a: Algorithm, h: float) -> Operators:
    """Return the operators of an algorithm's scan rules, rational in ``q = z^-1`` (specs/equations.md, section 4).

    Parameters
    ----------
    a : Algorithm
        The algorithm, for its rules.
    h : float
        Scan interval [s].
    """

    def s_of(rule: Rule) -> tuple[tuple[float, ...], tuple[float, ...]]:
        match rule:
            case Rule.BACKWARD:
                return (1.0, -1.0), (h,)
            case Rule.FORWARD:
                return (1.0, -1.0), (0.0, h)
            case Rule.TRAPEZOIDAL:
                return (2.0, -2.0), (h, h)
        raise ValueError(_DERIVATIVE_ONLY.format(rule.value))

    integral = s_of(a.integral.rule)

    def differentiator(Tf: float) -> Rational:
        if a.derivative.rule is Rule.FOUR_POINT:
            return Rational((3.0, 1.0, -1.0, -3.0), (10 * h,))
        if Tf and a.derivative.rule in (Rule.EXACT, Rule.LAGGED_DIFFERENCE):
            keep = math.exp(-h / Tf)
            gain = -math.expm1(-h / Tf) / h if a.derivative.rule is Rule.EXACT else keep / Tf
            return Rational((gain, -gain), (1.0, -keep))
        top, bottom = s_of(a.derivative.rule if Tf else Rule.BACKWARD)
        return Rational(top, add(bottom, multiply((Tf,), top)))

    def lag(Tf: float, order: int) -> Rational:
        top, bottom = s_of(a.filter_rule)
        if order == 1 or not Tf:
            return Rational(bottom, add(bottom, multiply((Tf,), top))) if Tf else Rational((1.0,))
        square = multiply(bottom, bottom)
        den = add(add(square, multiply((Tf,), multiply(top, bottom))), multiply((Tf * Tf / 2,), multiply(top, top)))
        return Rational(square, den)

    def signal_lag(f: SignalFilter[Any]) -> Rational:
        top, bottom = s_of(f.rule)
        return Rational(bottom, add(bottom, multiply((f.at(h),), top)))

    def pole_cancellation(d: Dahlin) -> Rational:
        g, p, q, delay = d.numbers(h)
        return Rational((g, -g * p), add((1.0, -q), (*[0.0] * (delay + 1), q - 1)))

    return Operators(
        integrator=Rational(integral[1], integral[0]),
        differentiator=differentiator,
        lag=lag,
        signal_lag=signal_lag,
        delay=Rational((0.0, 1.0)),
        pole_cancellation=pole_cancellation,
    )


@dataclass(frozen=True)
class Law:
    """The linear law of a controller, reverse acting.

    Attributes
    ----------
    algorithm : Algorithm
        The algorithm it is the law of.
    scan : float or None
        Scan interval [s] of the discrete law; ``None``: the continuous one.

    Raises
    ------
    ScanError
        The scan interval is not a positive number, or a filter is unstable at it.
    """

    algorithm: Algorithm
    scan: float | None = None

    def __hash__(self) -> int:
        a = self.algorithm
        return hash((a.kp, a.ki, a.kd, a.Tf, a.b, a.c, self.scan))

    def __post_init__(self) -> None:
        if self.scan is not None:
            if not (math.isfinite(self.scan) and self.scan > 0):
                raise ScanError(f"scan interval {self.scan:g} s is not a positive number")
            check_filters(self.algorithm, self.scan)

    @cached_property
    def _rational(self) -> tuple[Rational, Rational]:
        a = self.algorithm
        if self.scan is None:
            return paths(a, CONTINUOUS)
        if not a.kd and a.filter_on == "term":  # nothing passes its filter, whose pole need not be stable then
            a = replace(a, Tf=0.0)
        return paths(a, discrete_operators(a, self.scan))

    @property
    def feedback(self) -> Rational:
        """``Cy``, from measurement to output: in ``s``, or in ``q = z^-1`` for the discrete law."""
        return self._rational[0]

    @property
    def setpoint(self) -> Rational:
        """``Cr``, from setpoint to output."""
        return self._rational[1]

    def path(self, name: PathName) -> Rational:
        """Return the path of this name.

        Raises
        ------
        ValueError
            `name` is neither ``"feedback"`` nor ``"setpoint"``.
        """
        if name not in ("feedback", "setpoint"):
            raise ValueError(f"path is '{name}'; it is 'feedback' or 'setpoint'")
        return self.feedback if name == "feedback" else self.setpoint

    def response(self, w: npt.ArrayLike, path: PathName = "feedback") -> Response:
        """Return the frequency response.

        Parameters
        ----------
        w : array_like, shape (n,) or scalar
            Angular frequencies [rad/s], above zero; for the discrete law below ``pi/scan``.
        path : {"feedback", "setpoint"}
            Which path.

        Returns
        -------
        ndarray of complex, shape of `w`
            Gain [%/%] and phase of the path.
        """
        self.path(path)  # refuses a wrong name
        return self.responses(w)[0 if path == "feedback" else 1]

    def responses(self, w: npt.ArrayLike) -> tuple[Response, Response]:
        """Return the frequency responses of feedback and setpoint path; arguments and shapes as of `response`."""
        values = at_frequencies(w) if self.scan is None else at_scan(self.algorithm, self.scan, w)
        feedback, setpoint = paths(self.algorithm, values)
        return _spread(feedback, w), _spread(setpoint, w)

    def held(self, w: npt.ArrayLike, path: PathName = "feedback") -> Response:
        """Return the frequency response as a process sees it: of the discrete law, with the output held from scan to scan.

        The hold is ``(1 - exp(-j w h))/(j w h)``, at low frequencies a delay of half a scan interval. The continuous law has none.

        Parameters
        ----------
        w : array_like, shape (n,) or scalar
            Angular frequencies [rad/s], as in `response`.
        path : {"feedback", "setpoint"}
            Which path.
        """
        self.path(path)  # refuses a wrong name
        return self.held_responses(w)[0 if path == "feedback" else 1]

    def held_responses(self, w: npt.ArrayLike) -> tuple[Response, Response]:
        """Return the frequency responses of feedback and setpoint path as a process sees them; see `held`."""
        feedback, setpoint = self.responses(w)
        if self.scan is None:
            return feedback, setpoint
        angle = 1j * np.asarray(w, dtype=float) * self.scan
        hold = -np.expm1(-angle) / angle
        return feedback * hold, setpoint * hold

    def held_expansion(self, terms: int, path: PathName = "feedback") -> tuple[float, ...]:
        """Return the first `terms` coefficients of ``s C(s)``, at most 5, of what a process sees of the law (see `held`).

        Of the continuous law they are those of `expansion`.
        """
        self.path(path)
        if self.scan is None:
            return self.expansion(terms, path)
        found = paths(self.algorithm, in_series(self.algorithm, self.scan))[0 if path == "feedback" else 1]
        return tuple((hold(self.scan) * found).terms[:terms])

    def coefficients(self) -> tuple[float, float, float, float, float]:
        """Return ``n0, n1, n2, d1, d2`` of the continuous feedback path (specs/equations.md, section 2).

        Raises
        ------
        ValueError
            The law is discrete.
        UndefinedError
            More filters are at work than these coefficients can hold, or there is no continuous law.
        """
        self._continuous()
        num, den = self.feedback.num, self.feedback.den
        if den[0] == 0:
            den = den[1:]
        else:
            num = (0.0, *num)
        if len(_trim(num)) > 3 or len(_trim(den)) > 3:
            raise UndefinedError("more than one filter is at work: the law cannot be written with five coefficients")
        n0, n1, n2 = (*(x / den[0] for x in num), 0.0, 0.0, 0.0)[:3]
        d1, d2 = (*(x / den[0] for x in den[1:]), 0.0, 0.0)[:2]
        return n0, n1, n2, d1, d2

    def moments(self, path: PathName = "feedback") -> tuple[float, float, float]:
        """Return ``m0, m1, m2`` of ``s C(s) = m0 + m1 s + m2 s^2 + ...`` (specs/equations.md, section 2).

        Raises
        ------
        ValueError
            The law is discrete.
        """
        m0, m1, m2 = self.expansion(3, path)
        return m0, m1, m2

    def expansion(self, terms: int, path: PathName = "feedback") -> tuple[float, ...]:
        """Return the first `terms` coefficients of ``s C(s)`` in powers of ``s``; the first three are the moments.

        Raises
        ------
        ValueError
            The law is discrete.
        """
        self._continuous()
        r = self.path(path)
        num, den = (r.num, r.den[1:]) if r.den[0] == 0 else ((0.0, *r.num), r.den)
        out: list[float] = []
        for k in range(terms):
            value = num[k] if k < len(num) else 0.0
            value -= sum(den[j] * out[k - j] for j in range(1, min(k + 1, len(den))))
            out.append(value / den[0])
        return tuple(out)

    def kick(self, path: PathName = "setpoint") -> float:
        """Return the output step that a unit step of setpoint or measurement makes at once [%/%].

        It is infinite where a derivative without filter sees the step. Behind a lag on the output nothing moves at once. For the
        discrete law it is the first sample.
        """
        r = self.path(path)
        if self.scan is not None:
            return r.num[0] / r.den[0]
        num, den = _trim(r.num), _trim(r.den)
        if len(num) > len(den):
            return math.copysign(math.inf, num[-1])
        return num[-1] / den[-1] if len(num) == len(den) else 0.0

    def impulse(self, n: int, path: PathName = "feedback") -> npt.NDArray[np.float64]:
        """Return the first `n` samples of the discrete impulse response.

        Parameters
        ----------
        n : int
            Number of samples.
        path : {"feedback", "setpoint"}
            Which path.

        Returns
        -------
        ndarray of float, shape (n,)
            Output [%] per unit impulse [%] at the first scan.

        Raises
        ------
        ValueError
            The law is continuous.
        """
        if self.scan is None:
            raise ValueError("the continuous law has no samples; give law() a scan interval")
        num, den = self.path(path).num, self.path(path).den
        out = np.zeros(n)
        for i in range(n):
            value = num[i] if i < len(num) else 0.0
            for j in range(1, min(i + 1, len(den))):
                value -= den[j] * out[i - j]
            out[i] = value / den[0]
        return out

    def _continuous(self) -> None:
        if self.scan is not None:
            raise ValueError("this is the discrete law; the coefficients belong to the continuous one")


def _spread(value: Any, w: npt.ArrayLike) -> Response:
    """Return a response at every frequency, which may be the same at all of them."""
    return np.broadcast_to(np.asarray(value, dtype=np.complex128), np.shape(w)).copy()


def _trim(coefficients: Sequence[float]) -> list[float]:
    trimmed = list(coefficients)
    while len(trimmed) > 1 and trimmed[-1] == 0:
        trimmed.pop()
    return trimmed
