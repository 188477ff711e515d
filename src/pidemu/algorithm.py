"""One PID algorithm with its numbers in canonical units: what the law and the scan program are both made from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pidemu.card.models import Rule
from pidemu.errors import ScanError

Place = Literal["term", "measurement", "output"]
Scheme = Literal["none", "clamp", "clamp-sum", "freeze", "conditional", "back-calculation", "external-reset", "velocity"]


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
    tracking_time : float
        Tracking time of back-calculation [s].
    accumulated : bool
        P on PV is accumulated from its value at the start.
    load_output : bool
        At the transfer to automatic the integral sum is loaded with the output, and the terms come on top.
    restarted : bool
        Filters and differences start afresh at the transfer.
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
    tracking_time: float = 0.0
    accumulated: bool = False
    load_output: bool = False
    restarted: bool = False

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
        none = isinstance(self.kd, float | int) and not self.kd  # the numbers may be arrays
        return 0.0 if none else self.kd / self.kp


def check_filters(a: Algorithm, h: float) -> None:
    """Refuse a forward-rule filter that is unstable at a scan interval `h` [s].

    Raises
    ------
    ScanError
        The forward rule with ``0 < Tf <= h/2``, or with ``0 < Tf <= h`` for the second-order filter.
    """
    rules = [a.derivative_rule] if a.has_term_filter else [a.filter_rule] if a.has_signal_filter else []
    share = 0.5 if a.filter_order == 1 else 1.0
    if Rule.FORWARD in rules and a.Tf <= share * h:
        raise ScanError(
            f"the filter time {a.Tf:g} s is too short for the scan interval {h:g} s: the forward rule is unstable; "
            f"use a scan interval below {a.Tf / share:g} s or no filter"
        )
