"""One PID algorithm with its numbers in canonical units: what the law and the scan program are both made from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

from pidemu.card.model.base import Rule
from pidemu.errors import ScanError

Place = Literal["term", "measurement", "output"]
Scheme = Literal[
    "none", "clamp", "clamp-sum", "freeze", "conditional", "recompute", "back-calculation", "external-reset", "velocity",
    "reset-outside-band",
]  # fmt: skip
Start = Literal["bumpless", "load-output", "tracked", "keep", "zero", "running"]


@dataclass(frozen=True, slots=True)
class Lag:
    """A first-order filter on setpoint, measurement or error (specs/equations.md, section 4).

    Attributes
    ----------
    time : float
        Filter time at the card's own scan interval [s].
    factor : float
        Share of the new sample per scan, where that is what the card sets; 1: it sets the time.
    rule : Rule
        Scan rule.
    """

    time: float
    factor: float = 1.0
    rule: Rule = Rule.BACKWARD

    def at(self, h: float) -> float:
        """Return the filter time at a scan interval `h` [s]."""
        return h * (1 - self.factor) / self.factor if self.factor != 1 else self.time


@dataclass(frozen=True, slots=True)
class Shape:
    """What is done to the error before P and I use it (specs/equations.md, section 8).

    Attributes
    ----------
    kind : {"gap", "squared", "gain-linear"}
        Which.
    band : float
        Half width of the gap [%].
    gain : float
        Gain within the gap; 0: a deadband.
    subtracted, zero_crossing, open_edge : bool
        Whether the error is continuous at the edge; whether the gap waits for a change of sign; whether the edge itself is outside.
    linearity : float
        ``L`` of gain-linear.
    over : float
        The error at which squared and gain-linear have gain 1 [%].
    on_integral, on_proportional, on_cascade : bool
        Whether the error of I, of P, and of P in cascade is shaped.
    """

    kind: Literal["gap", "squared", "gain-linear"]
    band: float = 0.0
    gain: float = 0.0
    subtracted: bool = False
    zero_crossing: bool = False
    open_edge: bool = False
    linearity: float = 1.0
    over: float = 100.0
    on_integral: bool = True
    on_proportional: bool = True
    on_cascade: bool = True


@dataclass(frozen=True, slots=True)
class Gate:
    """The fine print of a windup scheme (specs/equations.md, section 5).

    Attributes
    ----------
    without_derivative : bool
        The limits are held against ``P + I``.
    this_scan : bool
        `freeze` looks at this scan's sum, with the increment.
    both : bool
        `freeze` stops the integral whichever way it would move.
    unless_smaller : bool
        `freeze` stops the integral unless its size becomes smaller.
    from_integrated : bool
        After a freeze the trapezoidal rule goes on from the last error that was integrated.
    by_output_sign : bool
        `conditional` judges by the sign of error times output.
    drops : bool
        `conditional` drops an increment that leads beyond a limit, instead of keeping what leads to the limit.
    fast_return : float
        With `external-reset`: factor on an increment that leads back from beyond `fast_beyond`.
    fast_beyond : tuple of float
        Low and high limit of the output for that [%].
    clamped : bool
        `recompute` limits the integral to the output limits as well.
    """

    without_derivative: bool = False
    this_scan: bool = False
    both: bool = False
    unless_smaller: bool = False
    from_integrated: bool = False
    by_output_sign: bool = False
    drops: bool = False
    fast_return: float = 1.0
    fast_beyond: tuple[float, float] = (-math.inf, math.inf)
    clamped: bool = False


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
        q = math.exp(-h / self.wanted) if self.wanted else 0.0
        p = math.exp(-h / self.time) if self.time else 0.0
        if p == 1 or q == 1:
            raise ScanError(
                f"a time of {max(self.time, self.wanted):g} s is too long for a scan interval of {h:g} s; use a longer one"
            )
        return (1 - q) / (self.gain * (1 - p)), p, q, round(self.delay / h)


@dataclass(frozen=True, slots=True)
class Algorithm:
    """Numbers and choices of one controller, reverse acting (specs/equations.md, section 2).

    With ``D(s) = s/(1 + Tf s)`` where the filter is on the term, and ``D(s) = s`` otherwise, the terms are::

        P = kp (b r - y)      D = kd D(s) (c r - y)
        I = (ki/s) (r - y)                     parallel and standard form
        I = (ki/s) (r - y + D/kp)              series form: the integral acts on the derivative term as well

    A lead-lag ``(1 + Td s)/(1 + Tf s)`` is the series form with ``kd = kp (Td - Tf)``.

    Attributes
    ----------
    series : bool
        Whether the integral acts on the derivative term.
    kp, ki, kd : float
        Gains of the terms [%/%, 1/s, s]; 0 where there is no such term.
    b, c : float
        Setpoint weights of P and D.
    Tf : float
        Filter time [s].
    filter_on : {"term", "measurement", "output"}
        Where the filter sits.
    filter_order : {1, 2}
        Its order; 2 is Butterworth, on the measurement only.
    velocity : bool
        Incremental implementation.
    integral_rule, derivative_rule, filter_rule : Rule
        Scan rules.
    windup : str
        Windup scheme (specs/equations.md, section 5).
    gate : Gate
        Its fine print.
    tracking_time : float
        Tracking time of back-calculation [s].
    implicit_tracking : bool
        Its share per scan is ``h/(Tt + h)``.
    limits_without_integral : bool
        With `clamp` and no integral action, the sum is what the limits make of zero.
    reads_back : bool
        A velocity implementation starts from the output read back, where there is one.
    accumulated : bool
        P on PV is accumulated from its value at the start.
    start : str
        What the integral does at the transfer to automatic (specs/equations.md, section 6).
    keeps_integral : bool
        Without integral action the integral stays as it is, a constant: what was loaded, or what it held when it was switched off.
    first_scan_holds : bool
        The integral does not grow in the first automatic scan.
    loads_as_it_is : bool
        With ``start="load-output"``: the output is not limited before it is loaded.
    zero_power_up : bool
        The integral begins at zero at the very first scan.
    derivative_start : {"running", "restarted", "zeroed", "preset"}
        What filters and differences do at the transfer.
    derivative_from_zero, integral_from_zero : bool
        At the very first scan the previous signal of the derivative, of the trapezoidal integral, is zero.
    zero_first_output : bool
        The output of the very first scan is zero.
    manual_output : {"operator", "gain-times-operator", "zero"}
        The output in manual.
    gain_sign : float
        -1 where the vendor's gain has the opposite sign of `kp`.
    bumpless_changes : bool
        A setting changed in automatic does not move the output.
    holds : {"ki e", "e/Ti", "e"}
        What the integral's state is the integral of.
    integral_limits : tuple of float or None, optional
        Limits of that state; ``None`` stands for the output's own limit.
    integral_deadband : float, optional
        No integration while the error is at most this [%].
    sp_filter, pv_filter, e_filter : Lag, optional
        Filters before the algorithm.
    previous_pv : bool
        The measurement of the previous scan is used.
    sp_rate, sp_rate_down : float
        Fastest rise and fall of the setpoint [%/s].
    sp_rate_local : bool
        In cascade the remote setpoint is not limited.
    sp_from_zero, sp_tracks : bool
        The limited setpoint starts at zero; the setpoint follows the measurement in manual.
    shape : Shape, optional
        What is done to the error.
    cascade_b : float, optional
        Setpoint weight of P in cascade, where it is another one.
    feedforward : float, optional
        Gain of the feedforward signal, where there is one.
    feedforward_after : bool
        It is added to the limited output.
    bias : float
        Output at zero error without integral [%], from a setting.
    output_rate, output_deadband, resolution : float
        Output rate limit [%/s], deadband [%] and step [%]; infinity and zero: none.
    precision : {"float64", "float32", "integer"}
        Arithmetic (specs/equations.md, section 7).
    wide_literals : bool
        With float32: literals are float64.
    counts, gain_counts : int
        With integers: counts per percent and per unit of gain.
    dahlin : Dahlin, optional
        The pole-cancellation algorithm in place of all terms.
    """

    series: bool
    kp: float
    ki: float
    kd: float
    b: float = 1.0
    c: float = 1.0
    Tf: float = 0.0
    filter_on: Place = "term"
    filter_order: Literal[1, 2] = 1
    velocity: bool = False
    integral_rule: Rule = Rule.BACKWARD
    derivative_rule: Rule = Rule.BACKWARD
    filter_rule: Rule = Rule.BACKWARD
    windup: Scheme = "none"
    gate: Gate = Gate()
    tracking_time: float = 0.0
    implicit_tracking: bool = False
    limits_without_integral: bool = False
    reads_back: bool = False
    accumulated: bool = False
    start: Start = "bumpless"
    keeps_integral: bool = True
    first_scan_holds: bool = False
    loads_as_it_is: bool = False
    zero_power_up: bool = False
    derivative_start: Literal["running", "restarted", "zeroed", "preset"] = "running"
    derivative_from_zero: bool = False
    integral_from_zero: bool = False
    zero_first_output: bool = False
    manual_output: Literal["operator", "gain-times-operator", "zero"] = "operator"
    gain_sign: float = 1.0
    bumpless_changes: bool = False
    holds: Literal["ki e", "e/Ti", "e"] = "ki e"
    integral_limits: tuple[float | None, float | None] | None = None
    integral_deadband: float | None = None
    sp_filter: Lag | None = None
    pv_filter: Lag | None = None
    e_filter: Lag | None = None
    previous_pv: bool = False
    sp_rate: float = math.inf
    sp_rate_down: float = math.inf
    sp_rate_local: bool = False
    sp_from_zero: bool = False
    sp_tracks: bool = False
    shape: Shape | None = None
    cascade_b: float | None = None
    feedforward: float | None = None
    feedforward_after: bool = False
    bias: float = 0.0
    output_rate: float = math.inf
    output_deadband: float = 0.0
    resolution: float = 0.0
    precision: Literal["float64", "float32", "integer"] = "float64"
    wide_literals: bool = False
    counts: int = 1
    gain_counts: int = 1
    dahlin: Dahlin | None = None

    @property
    def has_term_filter(self) -> bool:
        """Whether the derivative term is filtered."""
        return self.filter_on == "term" and self.Tf != 0 and self.kd != 0

    @property
    def has_signal_filter(self) -> bool:
        """Whether measurement or output is filtered."""
        return self.filter_on != "term" and self.Tf != 0

    @property
    def derivative_per_gain(self) -> float:
        """``kd/kp`` [s]: the derivative time that the integral of the series form sees."""
        none = getattr(self.kd, "ndim", 0) == 0 and not self.kd  # the numbers may be arrays
        return 0.0 if none else self.kd / self.kp

    def too_coarse(self, h: float) -> list[str]:
        """What a scan interval `h` [s] is too long for, in words: rules that ring or overshoot there, though they are stable."""
        found = []
        rule = self.derivative_rule if self.has_term_filter else self.filter_rule if self.has_signal_filter else None
        if rule is Rule.TRAPEZOIDAL and 0 < self.Tf < h / 2:
            found.append(f"the filter time of {self.Tf:.3g} s is less than half of it, and the trapezoidal rule rings")
        explicit = self.windup == "back-calculation" and not self.implicit_tracking and self.ki
        if explicit and 0 < self.tracking_time < h:
            found.append(f"the tracking time of {self.tracking_time:.3g} s is less, and back-calculation overshoots")
        if self.ki and self.kp and abs(self.kp / self.ki) < h:
            found.append(f"the integral time of {abs(self.kp / self.ki):.3g} s is less")
        return found

    def paced(self, pace: float) -> Algorithm:
        """Return the algorithm as it works when every scan comes after `pace` times the interval that it computes with.

        What happens per scan stays, so all its times become longer by that factor (specs/equations.md, section 3).
        """
        if pace == 1:
            return self
        lags = {
            name: None if lag is None else replace(lag, time=lag.time * pace)
            for name, lag in (("sp_filter", self.sp_filter), ("pv_filter", self.pv_filter), ("e_filter", self.e_filter))
        }
        return replace(
            self,
            ki=self.ki / pace,
            kd=self.kd * pace,
            Tf=self.Tf * pace,
            tracking_time=self.tracking_time * pace,
            sp_rate=self.sp_rate / pace,
            output_rate=self.output_rate / pace,
            sp_filter=lags["sp_filter"],
            pv_filter=lags["pv_filter"],
            e_filter=lags["e_filter"],
        )

    @property
    def in_cascade(self) -> Algorithm:
        """The algorithm with what P sees in cascade (specs/equations.md, section 6)."""
        return self if self.cascade_b is None else replace(self, b=self.cascade_b)

    @property
    def linear(self) -> Algorithm:
        """The algorithm without what the linear law leaves out."""
        return replace(
            self,
            precision="float64",
            gate=replace(self.gate, fast_return=1.0, fast_beyond=(-math.inf, math.inf)),
            shape=None,
            integral_deadband=None,
            integral_limits=None,
            sp_rate=math.inf,
            sp_rate_down=math.inf,
            output_rate=math.inf,
            output_deadband=0.0,
            resolution=0.0,
            bias=0.0,
        )

    @property
    def beyond_the_law(self) -> list[str]:
        """What the linear law leaves out, in words: everything at work that is not linear."""
        found = []
        if self.shape is not None:
            band = f" of {self.shape.band:g}" if self.shape.kind == "gap" else ""
            name = "deadband" if self.shape.kind == "gap" and not self.shape.gain else self.shape.kind
            found.append(f"error: {name}{band}")
        if self.integral_deadband:
            found.append(f"integral deadband of {self.integral_deadband:g}")
        if self.ki and self.gate.fast_return != 1:
            low, high = self.gate.fast_beyond
            found.append(f"integral {self.gate.fast_return:g} times as fast on the way back from below {low:g} or above {high:g}")
        if math.isfinite(self.sp_rate):
            found.append(f"setpoint rate limit of {self.sp_rate:g} per s")
        if math.isfinite(self.sp_rate_down) and self.sp_rate_down != self.sp_rate:
            found.append(f"setpoint rate limit of {self.sp_rate_down:g} per s downwards")
        if math.isfinite(self.output_rate):
            found.append(f"output rate limit of {self.output_rate:g} per s")
        if self.output_deadband:
            found.append(f"output deadband of {self.output_deadband:g}")
        if self.resolution:
            found.append(f"output in steps of {self.resolution:g}")
        if self.precision != "float64":
            found.append(f"{self.precision} arithmetic")
        return found


def check_filters(a: Algorithm, h: float) -> None:
    """Refuse a derivative rule that does not fit the filter, and a forward-rule filter that is unstable at an interval `h` [s].

    Raises
    ------
    ScanError
        The forward rule with ``0 < Tf <= h/2``, or with ``0 < Tf <= h`` for the second-order filter; the lagged-difference rule
        without a filter; the four-point rule with one.
    """
    if a.derivative_rule is Rule.LAGGED_DIFFERENCE and a.kd and not a.has_term_filter:
        raise ScanError("the lagged-difference rule needs a filter on the derivative term")
    if a.derivative_rule is Rule.FOUR_POINT and a.has_term_filter:
        raise ScanError("the four-point rule is the filter; it goes with no other on the derivative term")
    share = 0.5 if a.filter_order == 1 else 1.0
    checked = [(lag.rule, lag.at(h), 0.5) for lag in (a.sp_filter, a.pv_filter, a.e_filter) if lag is not None]
    if a.has_term_filter or a.has_signal_filter:
        checked.append((a.derivative_rule if a.has_term_filter else a.filter_rule, a.Tf, share))
    for rule, Tf, least in checked:
        if rule is Rule.FORWARD and 0 < Tf <= least * h:
            raise ScanError(
                f"the filter time {Tf:g} s is too short for the scan interval {h:g} s: the forward rule is unstable; "
                f"use a scan interval below {Tf / least:g} s or no filter"
            )
