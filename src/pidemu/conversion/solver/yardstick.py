"""How far settings of a target are from the source: the figures that a conversion is judged by."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from pidemu.certificate.linear import bands, certify, compare_paths, deviation
from pidemu.certificate.models import Certificate, Kick, ScanCost
from pidemu.certificate.scan_cost import scan_cost
from pidemu.conversion.modes import Mode, Modes, law_in, looked_at
from pidemu.law.law import Law
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.process.process import Process


@dataclass(frozen=True)
class Yardstick:
    """What settings of a target are held against.

    Attributes
    ----------
    source : Settings
        What is converted.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    scans : tuple of float or None
        Scan intervals of source and target [s].
    process : Process or None
        The process, where the user states it.
    mode : {"auto", "cascade", "both"}
        The modes in which the setpoint path counts; where it is another one in each, weights are matched in automatic.
    compensates : bool
        Whether targets are matched as a process sees them, sampled and held.
    law : Law
        The source's law.
    at_source_scan : Law or None
        The source's law at its scan interval.
    """

    source: Settings
    factor: float
    scans: tuple[float, float] | None
    process: Process | None
    mode: Modes
    compensates: bool
    law: Law
    at_source_scan: Law | None

    @property
    def first_mode(self) -> Mode:
        """The mode in which weights are matched and the figures of both modes begin."""
        return first_of(self.mode)

    def certify(self, settings: Settings) -> Certificate:
        """Return the linear figures of settings of the target."""
        at_scan = None
        if self.scans and self.at_source_scan:
            at_scan = (self.at_source_scan, law_in(settings, self.first_mode, self.scans[1]))
        found = certify(self.law, law_in(settings, self.first_mode), at_scan, self.factor, self.process)
        others = looked_at(self.mode, self.source, settings)[1:]
        if others:
            limits = bands(self.law, max(self.scans) if self.scans else None, self.process)
            laws = {mode: (law_in(self.source, mode), law_in(settings, mode)) for mode in others}
            found = replace(
                found,
                setpoint_in_cascade=compare_paths(*laws["cascade"], limits, self.factor)[1],
                kick_in_cascade=Kick(self.factor * laws["cascade"][0].kick(), laws["cascade"][1].kick()),
            )
        return found

    def deviation(self, settings: Settings) -> float:
        """Return the largest deviation of the feedback path in the loop band; at the scans, where these are compensated for."""
        if self.compensates and self.scans and self.at_source_scan:
            band = bands(self.law, max(self.scans), self.process)[0]
            return deviation(self.at_source_scan, settings.law(self.scans[1]), band, self.factor)
        return self.continuous_deviation(settings)

    def continuous_deviation(self, settings: Settings) -> float:
        """Return the largest deviation of the continuous feedback paths in the loop band, wherever a scan interval would end it."""
        band = bands(self.law, None, self.process)[0]  # plain settings do not depend on the scan intervals
        return deviation(self.law, settings.law(), band, self.factor)

    def distance(self, settings: Settings) -> float:
        """Return by what settings are judged: the change of Ms with a process, else the deviation in the loop band."""
        if self.process is None:
            return self.continuous_deviation(settings)
        old, new = _Ms(self.law, self.process, self.factor), _Ms(settings.law(), self.process, 1.0)
        if not (math.isfinite(old) and math.isfinite(new)):
            return self.continuous_deviation(settings)
        return abs(new / old - 1)

    def scan_cost(self, settings: Settings) -> ScanCost | None:
        """Return what the scan intervals cost, at the crossover of the loop or where it usually lies."""
        if self.scans is None or self.at_source_scan is None:
            return None
        return scan_cost(self.at_source_scan, settings.law(self.scans[1]), self.factor, self.process)


@lru_cache(maxsize=256)
def _Ms(law: Law, process: Process, factor: float) -> float:
    """Return Ms of a loop; choices of options share the source's, and many share the target's."""
    from pidemu.analysis.figures import loop_figures

    return loop_figures(law, process, factor).Ms


def first_of(mode: Modes) -> Mode:
    """Return the mode in which weights are matched."""
    return "cascade" if mode == "cascade" else "auto"
