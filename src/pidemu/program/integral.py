"""A positional controller under construction, as windup schemes and transfers see it, and what the integral's state counts for."""

from __future__ import annotations

from dataclasses import dataclass

from pidemu.algorithm.model import Algorithm
from pidemu.program import blocks
from pidemu.program.blocks import Builder
from pidemu.program.ir import Expr, Name, equal, select
from pidemu.program.terms import Terms


@dataclass(frozen=True, slots=True)
class HeldSum:
    """How the integral's state counts in the sum of the terms.

    The state holds the integral of ``ki e``, of ``e/Ti`` with the gain on the whole sum, or of ``e`` with both applied afterwards;
    in the parallel form of ``e`` with ``ki`` applied afterwards, and no gain on the sum.

    Attributes
    ----------
    gain : Name or None
        Gain on the whole sum.
    time : Name or None
        Integral time that the state is divided by.
    factor : Name or None
        Integral gain that the state is multiplied by.
    """

    gain: Name | None = None
    time: Name | None = None
    factor: Name | None = None

    @classmethod
    def of(cls, b: Builder, a: Algorithm) -> HeldSum:
        """Return how the state counts with an algorithm."""
        if a.integral.holds == "ki e":
            return cls()
        if not a.has_gain_on_sum:
            return cls(factor=b.coefficient("ki", a.ki, "integral gain, signed for action", "%/%/s")) if a.ki else cls()
        gain = b.coefficient("kp", a.kp, "gain on the sum of the terms, signed for action", "%/%")
        if a.integral.holds == "e/Ti" or not a.ki:
            return cls(gain)
        return cls(gain, b.coefficient("Ti", a.kp / a.ki, "integral time", "s"))

    def term(self, state: Expr) -> Expr:
        """Return the integral term of a state."""
        if self.factor is not None:
            return self.factor * state
        return state if self.time is None else state / self.time

    def state(self, term: Expr) -> Expr:
        """Return the state of an integral term."""
        if self.factor is not None:
            return term / self.factor
        return term if self.time is None else term * self.time

    def output(self, total: Expr) -> Expr:
        """Return the output of a sum of terms."""
        return total if self.gain is None else self.gain * total

    def total(self, out: Expr) -> Expr:
        """Return the sum of terms of an output."""
        return out if self.gain is None else out / self.gain


@dataclass(frozen=True, slots=True)
class Positional:
    """A positional controller under construction.

    Attributes
    ----------
    b : Builder
        The program.
    a : Algorithm
        What it computes.
    h : float
        Scan interval [s].
    t : Terms
        Signals, P and D.
    held : HeldSum
        How the integral's state counts.
    P : Expr
        Proportional term, which may have been accumulated.
    last : Name
        Last output, as the algorithm knows it.
    feed : Expr or None
        Feedforward.
    runs_on : bool
        Whether it computes on in manual.
    """

    b: Builder
    a: Algorithm
    h: float
    t: Terms
    held: HeldSum
    P: Expr
    last: Name
    feed: Expr | None
    runs_on: bool

    @property
    def state(self) -> Name:
        """The integral's state."""
        return Name("I")

    def sum_with(self, state: Expr, D: Expr | None) -> Expr:
        """Return the output that the terms make with a state of the integral."""
        return self.held.output(blocks.summed([self.P, self.held.term(state), D]))

    def behind(self, v: Expr) -> Expr:
        """Return a sum with the feedforward, if there is one."""
        return v if self.feed is None else v + self.feed

    def before(self, out: Expr) -> Expr:
        """Return an output less the feedforward, if there is one."""
        return out if self.feed is None else out - self.feed

    def left_for_integral(self, out: Expr, D: Expr | None) -> Expr:
        """Return the state with which the terms make an output, from which the feedforward is taken already."""
        return self.held.state(blocks.difference(self.held.total(out), self.P, D))

    def left_by_hand(self, manual: Expr) -> Expr:
        """Return the state with which the terms make the operator's output, from which the feedforward is taken already.

        Where that output is the operator's number times the gain, the number itself is the sum of the terms.
        """
        if self.held.gain is None or self.a.transfer.manual_output != "gain-times-operator":
            return self.left_for_integral(manual, self.t.D)
        given = Name("manual")
        own: Expr = given if self.a.action.gain_sign > 0 else 0.0 - given  # of an error that the vendor forms the other way round
        total = select(equal(given, given), own, self.held.total(manual))
        return self.held.state(blocks.difference(total, self.P, self.t.D))

    @property
    def begun(self) -> Expr:
        """Whether there has been a scan."""
        return equal(self.b.state("begun", "there has been a scan", "-"), 1.0)

    @property
    def going(self) -> Expr:
        """Whether this scan follows one in which the algorithm ran."""
        return self.begun if self.runs_on else self.t.on
