"""The certificate of a conversion: what stays the same, what does not, and by how much (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal

from pidemu.plain import json_safe

Verdict = Literal["exact", "exact-feedback", "approximate", "refused"]
RANK: Final = {"exact": 0, "exact-feedback": 1, "approximate": 2, "refused": 3}
"""Verdicts, the best first."""

EXACT: Final = 1e-9
"""Largest relative deviation that counts as none: rounding, many times over."""


@dataclass(frozen=True, slots=True)
class Band:
    """How far two controllers differ over a band of frequencies.

    Attributes
    ----------
    low, high : float
        Ends of the band [rad/s].
    max_deviation : float
        ``max |Ct/Cs - 1|``; infinite where the source has no response and the target has one, so that the two cannot be compared.
    gain_db, phase_deg : float
        Largest difference of gain [dB] and phase [deg], whatever its sign; infinite where one of the two has no response.
    worst_at : float
        Frequency of the largest deviation [rad/s].
    """

    low: float
    high: float
    max_deviation: float
    gain_db: float
    phase_deg: float
    worst_at: float


@dataclass(frozen=True, slots=True)
class PathComparison:
    """One signal path of both controllers, compared.

    Attributes
    ----------
    loop_band : Band
        Where usual tuning puts the crossover.
    full_band : Band
        On to the highest frequencies, which noise will see.
    """

    loop_band: Band
    full_band: Band

    @property
    def is_exact(self) -> bool:
        """Whether there is no difference beyond rounding."""
        return max(self.loop_band.max_deviation, self.full_band.max_deviation) < EXACT


@dataclass(frozen=True, slots=True)
class Kick:
    """What a unit setpoint step does to the output at once [%/%].

    Attributes
    ----------
    source, target : float
        The two kicks; infinite for an unfiltered derivative on the error.
    """

    source: float
    target: float

    @property
    def ratio(self) -> float:
        """Target's kick per source's; 1 where both are alike, also zero or infinite."""
        if self.source == self.target:
            return 1.0
        if math.isinf(self.source):
            return 0.0
        return self.target / self.source if self.source else math.inf


@dataclass(frozen=True, slots=True)
class Rounded:
    """A dial rounded to the target's resolution.

    Attributes
    ----------
    name : str
        The dial.
    exact, rounded : float
        Its value before and after [the dial's unit].
    """

    name: str
    exact: float
    rounded: float


@dataclass(frozen=True, slots=True)
class ScanByScan:
    """Both controllers emulated on the same signals, in their linear range: no limit is reached (point 3 of the certificate).

    Attributes
    ----------
    scan : tuple of float
        Scan intervals of source and target [s].
    taken : bool
        Whether nobody gave these intervals, so that one was taken for both.
    largest : float
        Largest difference of the two outputs [% of the output span].
    largest_at : float
        When [s].
    segment : str
        In which part of the record.
    on_measurement : float
        Largest difference while the setpoint rests and only the measurement moves [% of the output span].
    size : float
        What the source's output moves over [% of the output span].
    """

    scan: tuple[float, float]
    taken: bool
    largest: float
    largest_at: float
    segment: str
    on_measurement: float
    size: float

    @property
    def is_exact(self) -> bool:
        """Whether the outputs agree on all signals to 1e-9 of what they move over, of the span at least."""
        return self.largest <= EXACT * max(100.0, self.size)

    @property
    def is_exact_on_measurement(self) -> bool:
        """The same while the setpoint rests."""
        return self.on_measurement <= EXACT * max(100.0, self.size)


@dataclass(frozen=True, slots=True)
class NonlinearDifference:
    """What two controllers do differently beyond the linear law (point 5 of the certificate).

    Attributes
    ----------
    aspect : {"windup", "transfer", "bias", "limits", "arithmetic", "error", "output", "setpoint"}
        What it is about.
    text : str
        The difference in a sentence or two, with its numbers.
    figures : dict of str to tuple of float
        The numbers by name, with the unit in brackets, of source and target; infinite where something never happens.
    """

    aspect: str
    text: str
    figures: Mapping[str, tuple[float, float]]

    @property
    def inside_limits(self) -> bool:
        """Whether it shows in automatic with the output inside its limits; the others show at limits and transfers only."""
        return self.aspect in ("arithmetic", "error", "output", "setpoint")


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


@dataclass(frozen=True, slots=True)
class ScanCost:
    """What a change of scan interval costs at the end of the loop band, before and after compensation.

    Attributes
    ----------
    at : float
        The end of the loop band [rad/s].
    phase_deg : float
        Phase that the target's hold has less than the source's, half the difference of the intervals [deg]; negative: it gains.
    compensated : bool
        Whether the settings make up for interval and rule.
    uncompensated : float
        Largest deviation of the held, sampled controllers in the loop band with the settings of the continuous law; with the
        settings themselves where these are those of the textbook rule or constrained, which know nothing of scans. Infinite where
        a filter would be unstable.
    cut : bool
        Whether half the scan rate lies within the loop band, and ends it.
    """

    at: float
    phase_deg: float
    compensated: bool
    uncompensated: float
    cut: bool = False


@dataclass(frozen=True, slots=True)
class Certificate:
    """All figures of a conversion.

    Attributes
    ----------
    feedback, setpoint : PathComparison
        The continuous laws.
    feedback_at_scan, setpoint_at_scan : PathComparison or None
        The discrete laws at the two scan intervals, where these were given.
    setpoint_kick : Kick
        The setpoint kicks of the continuous laws.
    setpoint_kick_at_scan : Kick or None
        What the output moves by in the first scan, at the two scan intervals.
    time_scale : float
        The source's effective integral time, which places the loop band [s].
    scan_by_scan : ScanByScan or None
        Both controllers emulated; ``None`` where they cannot be, see `not_emulated`.
    not_emulated : str
        Why they could not be emulated.
    scan_cost : ScanCost or None
        What different scan intervals cost, where they were given.
    nonlinear : tuple of NonlinearDifference
        What differs beyond the linear law.
    loop : LoopComparison or None
        The closed loop before and after, where a process was given.
    dials : tuple of Rounded
        What rounding to the target's resolution did.
    feedback_before_rounding : PathComparison or None
        The feedback path with the dials not rounded, where they were.
    """

    feedback: PathComparison
    setpoint: PathComparison
    feedback_at_scan: PathComparison | None
    setpoint_at_scan: PathComparison | None
    setpoint_kick: Kick
    setpoint_kick_at_scan: Kick | None
    time_scale: float
    scan_by_scan: ScanByScan | None = None
    not_emulated: str = ""
    scan_cost: ScanCost | None = None
    nonlinear: tuple[NonlinearDifference, ...] = ()
    loop: LoopComparison | None = None
    dials: tuple[Rounded, ...] = ()
    feedback_before_rounding: PathComparison | None = None

    @property
    def headline(self) -> PathComparison:
        """The feedback path as it runs: at the scan intervals where these were given, else of the continuous law."""
        return self.feedback_at_scan or self.feedback

    @property
    def verdict(self) -> Verdict:
        """``exact``, ``exact-feedback`` or ``approximate``: laws at the scans, and emulations, count where there are any."""
        emulated, aspects = self.scan_by_scan, {d.aspect for d in self.nonlinear}
        bent = not aspects.isdisjoint(
            ("error", "output")
        )  # a deadband, a rate limit: signals that are large or small enough show it
        if bent or not self.headline.is_exact or not (emulated is None or emulated.is_exact_on_measurement):
            return "approximate"
        same = (self.setpoint_at_scan or self.setpoint).is_exact and (emulated is None or emulated.is_exact)
        return "exact" if same and "setpoint" not in aspects else "exact-feedback"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain values for JSON; what is infinite becomes the string ``"inf"``."""
        plain: dict[str, Any] = json_safe(asdict(self))
        for name in ("setpoint_kick", "setpoint_kick_at_scan"):
            kick: Kick | None = getattr(self, name)
            if kick is not None:
                plain[name]["ratio"] = json_safe(kick.ratio)
        return plain
