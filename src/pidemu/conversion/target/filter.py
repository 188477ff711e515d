"""The filter that goes with a target's derivative: how its card states it, and the value that a match gives it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

FilterKind = Literal["none", "time", "ratio", "gain"]

_HARDLY: Final = 100.0
"""Derivative gain of a filter that is hardly one."""


@dataclass(frozen=True, slots=True)
class TargetFilter:
    """The filter that goes with a target's derivative.

    Attributes
    ----------
    kind : str
        How the card states it.
    setting : str or None
        The dial that sets it.
    free : bool
        Whether the conversion may choose it.
    value : float
        Its value: time [s], ratio or gain.
    needed : bool
        Whether the derivative is nothing without it: the lagged-difference rule.
    lead_lag : bool
        Whether it is the lag of a lead-lag.
    of : {"derivative", "derivative-time", "effective-derivative"}
        What ratio or gain refer to: the derivative dial, ``kd/kp`` of a parallel form, ``Ti Td/(Ti + Td)``.
    low, high : float
        Allowed values, in the dial's own terms made canonical.
    """

    kind: FilterKind = "none"
    setting: str | None = None
    free: bool = False
    value: float = 0.0
    needed: bool = False
    lead_lag: bool = False
    of: Literal["derivative", "derivative-time", "effective-derivative"] = "derivative"
    low: float = 0.0
    high: float = math.inf

    @property
    def ratio(self) -> float:
        """``Tf`` per derivative time; 0 where the filter is none or a fixed time."""
        if self.kind == "ratio":
            return self.value
        return 1 / self.value if self.kind == "gain" and self.value else 0.0

    @property
    def time(self) -> float:
        """``Tf`` [s] of a filter stated as a time; otherwise 0."""
        return self.value if self.kind == "time" else 0.0

    def nearest_to(self, Tf: float, base: float) -> TargetFilter:
        """Return the filter fixed at the allowed value nearest to `Tf` [s]; `base` is the derivative time it refers to [s].

        Where none is wanted of a target that always has one, it is a hundredth of the derivative time: far above the loop band.
        """
        if self.kind == "time":
            wanted = Tf or (base / _HARDLY if self.needed else 0.0)
        elif self.kind == "ratio":
            wanted = Tf / base if base > 0 else self.value
        elif self.kind == "gain":
            wanted = base / Tf if Tf > 0 else min(self.high, max(_HARDLY, self.value))
        else:
            return self
        return self.fixed_at(min(max(wanted, self.low), self.high))

    def fixed_at(self, value: float) -> TargetFilter:
        """Return the filter with a value that the conversion no longer chooses."""
        return replace(self, free=False, value=value)

    @property
    def fixed(self) -> TargetFilter:
        """The filter as it is, no longer free."""
        return replace(self, free=False)
