"""One PID algorithm with its numbers: a card's tree, resolved, which law and scan program are both made from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, Generic, Literal, Self

from pidemu.card.model.base import Form, Rule
from pidemu.card.model.integral import Integral
from pidemu.card.model.marks import AtRest, Beyond, walk, without
from pidemu.card.model.operation import Action, Arithmetic, Output
from pidemu.card.model.signals import ErrorShape, Measurement, Setpoint, SignalFilter
from pidemu.card.model.terms import Derivative, Feedforward, Proportional
from pidemu.card.transfer import Transfer
from pidemu.columns.functions import exp
from pidemu.errors import ScanError
from pidemu.numeric import X

Place = Literal["term", "measurement", "output"]

LONGEST_DELAY: Final = 1000
"""Scans of dead time beyond which the program of a pole cancellation would be absurdly long."""


@dataclass(frozen=True, slots=True)
class Dahlin:
    """A pole-cancellation algorithm's process and wish (specs/equations.md, section 4).

    Attributes
    ----------
    gain : float
        Process gain [%/%].
    time, delay : float
        Process time constant and dead time [s].
    wanted : float
        Time constant of the closed loop [s].
    """

    gain: float
    time: float
    delay: float
    wanted: float

    def numbers(self, h: float) -> tuple[float, float, float, int]:
        """Return ``g, p, q, N`` of ``u_n = q u_(n-1) + (1-q) u_(n-N-1) + g (e_n - p e_(n-1))`` at a scan interval `h` [s].

        Raises
        ------
        ScanError
            The dead time is too many scans, or a time so long that floating point cannot tell a scan of it.
        """
        if self.delay / h > LONGEST_DELAY + 0.5:
            scans = f"{self.delay / h:.0f} scans of {h:g} s"
            raise ScanError(f"the dead time is {scans}, the most is {LONGEST_DELAY}; use a longer scan interval")
        q = exp(-h / self.wanted) if self.wanted else 0.0
        p = exp(-h / self.time) if self.time else 0.0
        if p == 1 or q == 1:
            raise ScanError(
                f"a time of {max(self.time, self.wanted):g} s is too long for a scan interval of {h:g} s; use a longer one"
            )
        return (1 - q) / (self.gain * (1 - p)), p, q, round(self.delay / h)


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm(Generic[X]):
    """Numbers and choices of one controller, reverse acting (specs/equations.md, section 2).

    The choices are the card's own, under the card's own names: ``transfer.first_scan``, ``integral.windup.scheme``. What is off is
    not there. The numbers that make the law are canonical. With ``D(s) = s/(1 + Tf s)`` where the filter is on the term, and
    ``D(s) = s`` otherwise, the terms are::

        P = kp (b r - y)      D = kd D(s) (c r - y)
        I = (ki/s) (r - y)                     parallel and standard form
        I = (ki/s) (r - y + D/kp)              series form: the integral acts on the derivative term as well

    A lead-lag ``(1 + Td s)/(1 + Tf s)`` is the series form with ``kd = kp (Td - Tf)``.

    Attributes
    ----------
    form : Form
        How the terms are put together.
    implementation : {"positional", "velocity"}
        Whether the output is a sum of terms, or of their increments.
    kp, ki, kd : float
        Gains of the terms [%/%, 1/s, s]; 0 where there is no such term.
    b, c : float
        Setpoint weights of P and D.
    cascade_b : float or None
        That of P in cascade, where it is another one.
    Tf : float
        Filter time [s].
    Ti : float
        Integral time [s], of the dial where that is one; 0 without integral action.
    bias : float
        Output at zero error without integral [%], from a setting.
    error, proportional, integral, derivative, setpoint, measurement, feedforward, transfer, action, output, arithmetic
        The parts of the card, with numbers where the card names settings; numbers that are canonical are left out there. A signal's
        filter that sets its share per scan has the time it amounts to at the card's own scan interval besides.
    shaped_in_cascade : bool
        Whether the shape of the error counts for P in cascade.
    dahlin : Dahlin or None
        The pole-cancellation algorithm in place of all terms.
    """

    form: Form
    implementation: Literal["positional", "velocity"]
    kp: X
    ki: X
    kd: X
    b: X
    c: X
    cascade_b: X | None
    Tf: X
    Ti: X
    bias: Annotated[X, Beyond(0.0)]
    error: ErrorShape[X]
    proportional: Proportional[X]
    integral: Integral[X]
    derivative: Derivative[X]
    setpoint: Setpoint[X]
    measurement: Measurement[X]
    feedforward: Feedforward[X] | None
    transfer: Transfer
    action: Action
    output: Output[X]
    arithmetic: Arithmetic
    shaped_in_cascade: bool
    dahlin: Dahlin | None

    @property
    def series(self) -> bool:
        """Whether the integral acts on the derivative term."""
        return self.form is Form.SERIES

    @property
    def has_gain_on_sum(self) -> bool:
        """Whether one gain multiplies the sum of the terms, and with it what the integral remembers."""
        alone = self.form is Form.PARALLEL and self.integral.holds == "e"  # the integral gain comes afterwards, and only that
        return self.integral.holds != "ki e" and not alone and not self.velocity

    @property
    def velocity(self) -> bool:
        """Whether increments are added to the last output."""
        return self.implementation == "velocity"

    @property
    def filter_on(self) -> Place:
        """Where the filter that goes with the derivative sits; a lead-lag's is on the term."""
        f = self.derivative.filter
        return "term" if f is None or f.applies_to == "lead-lag" else f.applies_to

    @property
    def filter_order(self) -> Literal[1, 2]:
        """Order of that filter; 2 is Butterworth, on the measurement only."""
        return 1 if self.derivative.filter is None else self.derivative.filter.order

    @property
    def filter_rule(self) -> Rule:
        """Scan rule of that filter where it is not on the term."""
        f = self.derivative.filter
        return self.derivative.rule if f is None or f.rule is None else f.rule

    @property
    def has_term_filter(self) -> bool:
        """Whether the derivative term is filtered."""
        return self.filter_on == "term" and bool(self.Tf != 0 and self.kd != 0)

    @property
    def has_signal_filter(self) -> bool:
        """Whether measurement or output is filtered."""
        return self.filter_on != "term" and bool(self.Tf != 0)

    @property
    def signal_filters(self) -> tuple[SignalFilter[X], ...]:
        """Filters on setpoint, measurement and error, those that there are."""
        found = (self.setpoint.filter, self.measurement.filter, self.error.filter)
        return tuple(f for f in found if f is not None)

    @property
    def is_shaped(self) -> bool:
        """Whether the error is shaped before P or I use it."""
        return self.error.shape != "linear"

    @property
    def shapes_proportional(self) -> bool:
        """Whether P uses the shaped error in automatic; P on the measurement itself is no error."""
        return self.is_shaped and self.error.on != "integral" and self.proportional.on != "pv"

    @property
    def shapes_in_cascade(self) -> bool:
        """Whether P uses the shaped error in cascade."""
        return self.is_shaped and self.shaped_in_cascade

    @property
    def shapes_integral(self) -> bool:
        """Whether I uses the shaped error."""
        return self.is_shaped and self.error.on != "proportional"

    @property
    def derivative_per_gain(self) -> Any:
        """``kd/kp`` [s]: the derivative time that the integral of the series form sees."""
        none = getattr(self.kd, "ndim", 0) == 0 and not self.kd  # the numbers may be columns
        return 0.0 if none else self.kd / self.kp

    def filtered(self, filter: SignalFilter[X] | None) -> Self:  # noqa: A002 (the card's word)
        """Return the algorithm with another filter on the measurement, or none."""
        return replace(self, measurement=replace(self.measurement, filter=filter))

    def too_coarse(self: Algorithm, h: float) -> list[str]:
        """What a scan interval `h` [s] is too long for, in words: rules that ring or overshoot there, though they are stable."""
        found = []
        rule = self.derivative.rule if self.has_term_filter else self.filter_rule if self.has_signal_filter else None
        if rule is Rule.TRAPEZOIDAL and 0 < self.Tf < h / 2:
            found.append(f"the filter time of {self.Tf:.3g} s is less than half of it, and the trapezoidal rule rings")
        at_limits = self.integral.windup.too_coarse(h) if self.ki else None
        if at_limits is not None:
            found.append(at_limits)
        if self.ki and self.kp and abs(self.kp / self.ki) < h:
            found.append(f"the integral time of {abs(self.kp / self.ki):.3g} s is less")
        return found

    def paced(self, pace: Any) -> Self:
        """Return the algorithm as it works when every scan comes after `pace` times the interval that it computes with.

        What happens per scan stays, so all its times become longer by that factor (specs/equations.md, section 3).
        """
        if pace == 1:
            return self
        sp, output = self.setpoint, self.output
        return replace(
            self,
            ki=self.ki / pace,
            kd=self.kd * pace,
            Tf=self.Tf * pace,
            Ti=self.Ti * pace,
            integral=replace(self.integral, windup=self.integral.windup.paced(pace)),
            setpoint=replace(
                sp, rate=_slower(sp.rate, pace), rate_down=_slower(sp.rate_down, pace), filter=_paced(sp.filter, pace)
            ),
            measurement=replace(self.measurement, filter=_paced(self.measurement.filter, pace)),
            error=replace(self.error, filter=_paced(self.error.filter, pace)),
            output=replace(output, rate=_slower(output.rate, pace)),
        )

    @property
    def in_cascade(self) -> Self:
        """The algorithm with what P sees in cascade (specs/equations.md, section 6)."""
        return self if self.cascade_b is None else replace(self, b=self.cascade_b)

    @property
    def linear(self) -> Self:
        """The algorithm without what the linear law leaves out."""
        return without(self, Beyond)

    @property
    def at_rest(self) -> Self:
        """The algorithm with a first scan that moves nothing and a transfer that does not bump; itself where it is so."""
        return without(self, AtRest)

    @property
    def beyond_the_law(self) -> list[str]:
        """What the linear law leaves out, in words: everything at work that is not linear."""
        said = (None if mark.words is None else mark.words(owner) for _, owner, mark in walk(self, Beyond))
        return [words for words in said if words is not None]


def _paced(f: SignalFilter[X] | None, pace: Any) -> SignalFilter[X] | None:
    return None if f is None else replace(f, time=f.seconds * pace)


def _slower(rate: X | None, pace: Any) -> X | None:
    return None if rate is None else rate / pace


def check_filters(a: Algorithm, h: float) -> None:
    """Refuse a derivative rule that does not fit the filter, and a forward-rule filter that is unstable at an interval `h` [s].

    Raises
    ------
    ScanError
        The forward rule with ``0 < Tf <= h/2``, or with ``0 < Tf <= h`` for the second-order filter; the lagged-difference rule
        without a filter; the four-point rule with one.
    """
    if a.derivative.rule is Rule.LAGGED_DIFFERENCE and a.kd and not a.has_term_filter:
        raise ScanError("the lagged-difference rule needs a filter on the derivative term")
    if a.derivative.rule is Rule.FOUR_POINT and a.has_term_filter:
        raise ScanError("the four-point rule is the filter; it goes with no other on the derivative term")
    share = 0.5 if a.filter_order == 1 else 1.0
    checked: list[tuple[Rule, float, float]] = [(lag.rule, lag.at(h), 0.5) for lag in a.signal_filters]
    if a.has_term_filter or a.has_signal_filter:
        checked.append((a.derivative.rule if a.has_term_filter else a.filter_rule, a.Tf, share))
    for rule, Tf, least in checked:
        if rule is Rule.FORWARD and 0 < Tf <= least * h:
            raise ScanError(
                f"the filter time {Tf:g} s is too short for the scan interval {h:g} s: the forward rule is unstable; "
                f"use a scan interval below {Tf / least:g} s or no filter"
            )
