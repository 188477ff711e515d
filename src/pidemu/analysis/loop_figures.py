"""A closed loop in figures: margins, sensitivity, and what a load costs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoopFigures:
    """A closed loop in figures (point 6 of the certificate).

    Attributes
    ----------
    stable : bool
        Whether the loop is stable.
    gain_margin, phase_margin, delay_margin : float
        Margins [factor, deg, s]; infinite where there is no such crossover.
    crossover : float
        Gain crossover frequency [rad/s]; NaN where there is none.
    Ms, Mt : float
        Largest sensitivity and complementary sensitivity.
    iae : float
        Integral of the absolute error after a load step of 1 % at the process input [% s]; infinite where the loop is unstable,
        NaN where it could not be computed.
    """

    stable: bool
    gain_margin: float
    phase_margin: float
    delay_margin: float
    crossover: float
    Ms: float
    Mt: float
    iae: float


@dataclass(frozen=True, slots=True)
class LoopComparison:
    """The closed loop before and after.

    Attributes
    ----------
    process : str
        The process, as a transfer function.
    source, target : LoopFigures
        Figures of both.
    """

    process: str
    source: LoopFigures
    target: LoopFigures
