"""What a match decides: the numbers of a target's own form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of a target's own form, in canonical units.

    Attributes
    ----------
    K : float
        Gain [%/%]. The first three may be arrays in `Target.algorithm_of`.
    ki : float
        Integral gain, ``K/Ti`` in the standard and series forms [1/s].
    kd : float
        ``K Td`` with Td the derivative dial, or the parallel form's derivative gain [s].
    Tf : float or None
        Filter time [s], where the target's filter is free; ``None``: as the target fixes it.
    b, c : float or None
        Setpoint weights, where the target's are free.
    multiplier : float or None
        Overall multiplier, where the conversion chooses one; ``None``: as it is.
    """

    K: Any
    ki: Any
    kd: Any
    Tf: float | None = None
    b: float | None = None
    c: float | None = None
    multiplier: float | None = None
