"""The certificate of a conversion: what stays the same, what does not, and by how much (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal, Protocol

from pidemu.analysis.loop_figures import LoopComparison
from pidemu.formatting import json_safe

if TYPE_CHECKING:
    from pidemu.certificate.proof import Proof

Verdict = Literal["exact", "exact-feedback", "approximate", "refused"]
RANK: Final[dict[str, int]] = {"exact": 0, "exact-feedback": 1, "approximate": 2, "refused": 3}
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
    to_resolution : bool
        Whether it was the dial's resolution, not a number of digits, that decided.
    """

    name: str
    exact: float
    rounded: float
    to_resolution: bool = False


@dataclass(frozen=True, slots=True)
class ScanByScan:
    """Both controllers emulated on the same signals, in their linear range: no limit is reached (point 3 of the certificate).

    Attributes
    ----------
    scan : tuple of float
        Scan intervals of source and target [s].
    taken : bool
        Whether no interval was given, so that one was taken for both.
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
    same_rules : bool
        Whether both compute by the same scan rules at the same interval: then equal laws have equal outputs.
    """

    scan: tuple[float, float]
    taken: bool
    largest: float
    largest_at: float
    segment: str
    on_measurement: float
    size: float
    same_rules: bool = False

    @property
    def is_exact(self) -> bool:
        """Whether the outputs agree on all signals to 1e-9 of what they move over, of the span at least."""
        return self.largest <= EXACT * max(100.0, self.size)

    @property
    def is_exact_on_measurement(self) -> bool:
        """The same while the setpoint rests."""
        return self.on_measurement <= EXACT * max(100.0, self.size)


_BENT: Final = ("arithmetic", "error", "integral", "output")
"""Aspects that signals inside the limits show."""


@dataclass(frozen=True, slots=True)
class NonlinearDifference:
    """What two controllers do differently beyond the linear law (point 5 of the certificate).

    Attributes
    ----------
    aspect : {"windup", "transfer", "bias", "limits", "arithmetic", "error", "integral", "output", "setpoint"}
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
        return self.aspect in (*_BENT, "setpoint")


class Emulation(Protocol):
    """What running both controllers shows; it may be run only when somebody asks."""

    @property
    def scan_by_scan(self) -> ScanByScan | None:
        """Both run on the same signals, in their linear range; ``None`` where they cannot be, see `not_emulated`."""

    @property
    def not_emulated(self) -> str:
        """Why they could not be run; empty where they could."""

    @property
    def nonlinear(self) -> tuple[NonlinearDifference, ...]:
        """What differs beyond the linear law."""

    @property
    def inside_limits(self) -> tuple[NonlinearDifference, ...]:
        """What of that shows in automatic with the output inside its limits: it counts for the verdict."""


@dataclass(frozen=True, slots=True)
class EmulationFigures:
    """What running both controllers has shown; for the attributes see `Emulation`."""

    scan_by_scan: ScanByScan | None = None
    not_emulated: str = ""
    nonlinear: tuple[NonlinearDifference, ...] = ()

    @property
    def inside_limits(self) -> tuple[NonlinearDifference, ...]:
        """What shows in automatic with the output inside its limits."""
        return tuple(d for d in self.nonlinear if d.inside_limits)


TooSlow = Literal["", "source", "target", "both"]

COARSE: Final = 1e-3
"""What rounding may cost in the loop band before it counts against the verdict."""
LEAST_PHASE: Final = 1.0
"""Phase that may be lost to a scan without a word in the verdict [deg]."""
_ALIKE: Final = 0.02
"""Relative difference of first moves that is not worth a word."""
_NEARLY: Final = 0.1
"""Deviation of the setpoint path in the loop band up to which a first move that comes late is not another setpoint response."""


@dataclass(frozen=True, slots=True)
class ScanCost:
    """What the scan intervals and rules of two controllers cost, apart from what their laws differ by.

    Attributes
    ----------
    at : float
        The crossover of the loop, or where it usually lies without a process [rad/s]; NaN for proportional action alone.
    phase_deg : float
        Phase that the target, sampled and held, loses there against the source [deg]; negative: it gains. Infinite where it cannot
        be said, since one of two scans is too slow; where both have one interval that is, what their rules lose at a quarter of the
        scan rate.
    too_slow : {"", "source", "target", "both"}
        Whose scan interval is so long that half the scan rate lies below that frequency.
    """

    at: float
    phase_deg: float
    too_slow: TooSlow = ""

    @property
    def matters(self) -> bool:
        """Whether more than a degree of phase is lost."""
        return self.phase_deg > LEAST_PHASE


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
    setpoint_in_cascade : PathComparison or None
        The continuous setpoint paths in cascade, where one of the equations is another one there and both modes count.
    kick_in_cascade : Kick or None
        The setpoint kicks in cascade, likewise.
    compensated : bool
        Whether the settings make up for the scans: what counts is then the laws at the scan intervals, else the continuous ones.
    time_scale : float
        The source's effective integral time, which places the loop band [s].
    shifts_for_good : bool
        Whether a limit leaves the two apart for good, as nothing integrates and the target forgets where it was.
    proof : Proof or None
        Both laws compared without rounding, where they agree as far as floats can tell.
    emulation : Emulation
        What running both controllers shows.
    scan_cost : ScanCost or None
        What different scan intervals cost, where they were given.
    loop : LoopComparison or None
        The closed loop before and after, where a process was given.
    dials : tuple of Rounded
        What rounding to the target's resolution did.
    feedback_before_rounding, setpoint_before_rounding : PathComparison or None
        The paths that count with the dials not rounded, where they were.
    """

    feedback: PathComparison
    setpoint: PathComparison
    feedback_at_scan: PathComparison | None
    setpoint_at_scan: PathComparison | None
    setpoint_kick: Kick
    setpoint_kick_at_scan: Kick | None
    time_scale: float
    setpoint_in_cascade: PathComparison | None = None
    kick_in_cascade: Kick | None = None
    compensated: bool = False
    shifts_for_good: bool = False
    proof: Proof | None = None
    emulation: Emulation = EmulationFigures()
    scan_cost: ScanCost | None = None
    loop: LoopComparison | None = None
    dials: tuple[Rounded, ...] = ()
    feedback_before_rounding: PathComparison | None = None
    setpoint_before_rounding: PathComparison | None = None

    @property
    def scan_by_scan(self) -> ScanByScan | None:
        """Both controllers emulated; ``None`` where they cannot be, see `not_emulated`."""
        return self.emulation.scan_by_scan

    @property
    def not_emulated(self) -> str:
        """Why they could not be emulated."""
        return self.emulation.not_emulated

    @property
    def nonlinear(self) -> tuple[NonlinearDifference, ...]:
        """What differs beyond the linear law."""
        return self.emulation.nonlinear

    @property
    def headline(self) -> PathComparison:
        """The feedback path that counts: of the continuous laws, or at the scan intervals where the settings make up for these."""
        return (self.compensated and self.feedback_at_scan) or self.feedback

    @property
    def setpoint_headline(self) -> PathComparison:
        """The setpoint path that counts, likewise; in the first of the modes looked at."""
        return (self.compensated and self.setpoint_at_scan) or self.setpoint

    @property
    def moves_alike_at_once(self) -> bool:
        """Whether a setpoint step moves both outputs alike at once, or one behind a short lag only, so that the paths are near."""
        kick, band = self.setpoint_kick, self.setpoint_headline.loop_band
        if kick.source == kick.target or math.isclose(kick.source, kick.target, rel_tol=_ALIKE):
            return True
        return 0 in (kick.source, kick.target) and band.max_deviation <= _NEARLY

    @property
    def is_bent(self) -> bool:
        """Whether something beyond the law differs that signals inside the limits show: a deadband, a rate limit, arithmetic."""
        return any(d.aspect in _BENT for d in self.emulation.inside_limits)

    @property
    def _is_contradicted(self) -> bool:
        """Whether two that compute alike have other outputs, though their laws are the same."""
        run = self.scan_by_scan
        return run is not None and run.same_rules and not run.is_exact_on_measurement

    @property
    def verdict(self) -> Verdict:
        """``exact``, ``exact-feedback`` or ``approximate``; where both modes count, the worse of the two."""
        return max((self.verdict_in("auto"), self.verdict_in("cascade")), key=RANK.__getitem__)

    @property
    def rounding(self) -> float | None:
        """What rounding the dials costs in the loop band; ``None`` where none was rounded, or where they were not exact before."""
        before = self.feedback_before_rounding
        return self.headline.loop_band.max_deviation if before is not None and before.is_exact else None

    def verdict_in(self, mode: Literal["auto", "cascade"]) -> Verdict:
        """Return the verdict in one mode; they differ only where `setpoint_in_cascade` is stated."""
        slow = self.scan_cost is not None and self.scan_cost.matters and not self.compensated
        coarse = self.rounding is not None and self.rounding > COARSE
        if slow or coarse or self.shifts_for_good or not self.feedback_is_exact or self.is_bent or self._is_contradicted:
            return "approximate"
        same = self.setpoint_is_exact_in(mode) and not self.setpoint_is_limited
        return "exact" if same else "exact-feedback"

    @property
    def setpoint_is_limited(self) -> bool:
        """Whether one of the two limits the rate of the setpoint otherwise than the other one."""
        return any(d.aspect == "setpoint" and d.figures for d in self.emulation.inside_limits)  # without figures it is about manual

    @property
    def feedback_is_exact(self) -> bool:
        """Whether the laws for measurement are the same: proven without rounding where that is decided, else by floats."""
        if self.proof is not None and self.proof.decided:
            return self.proof.feedback_equal
        return (self.feedback_before_rounding or self.headline).is_exact

    def setpoint_is_exact_in(self, mode: Literal["auto", "cascade"]) -> bool:
        """Whether the setpoint paths are the same in a mode, likewise."""
        if self.proof is not None and self.proof.decided:
            if self.setpoint_in_cascade is None:  # one path in every mode looked at
                return self.proof.setpoint_equal
            return self.proof.equal("setpoint in cascade" if mode == "cascade" else "setpoint")
        if mode == "cascade" and self.setpoint_in_cascade is not None:
            return self.setpoint_in_cascade.is_exact
        return (self.setpoint_before_rounding or self.setpoint_headline).is_exact

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain values for JSON; what is infinite becomes the string ``"inf"``."""
        shown = EmulationFigures(self.scan_by_scan, self.not_emulated, self.nonlinear)
        plain: dict[str, Any] = json_safe(asdict(replace(self, proof=None, emulation=shown)))
        plain |= plain.pop("emulation")
        plain["proof"] = None if self.proof is None else self.proof.to_dict()
        for name in ("setpoint_kick", "setpoint_kick_at_scan", "kick_in_cascade"):
            kick: Kick | None = getattr(self, name)
            if kick is not None:
                plain[name]["ratio"] = json_safe(kick.ratio)
        return plain
