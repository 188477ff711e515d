"""Noise on a measurement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import ProcessError
from pidemu.plausible import LEVEL, PROCESS_TIME, plausible, shown

_SEEDS: Final = 2**64


@dataclass(frozen=True, slots=True)
class Noise:
    """Normal noise that is added to the measurement; the same seed gives the same noise.

    Attributes
    ----------
    deviation : float
        Standard deviation [%].
    lag : float
        Time constant of the first-order lag that white noise went through [s]; with 0 every scan has noise of its own. The standard
        deviation is that behind the lag.
    seed : int
        Which noise.

    Raises
    ------
    ProcessError
        A number is negative or not one that a loop has.

    Examples
    --------
    >>> Noise(0.5, seed=3).at(1000, 1.0).std().round(2)
    np.float64(0.5)
    """

    deviation: float
    lag: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, quantity, unit in (("deviation", LEVEL, "%"), ("lag", PROCESS_TIME, "s")):
            value = plausible(f"noise: {name}", getattr(self, name), quantity, ProcessError)
            if value < 0:
                raise ProcessError(f"noise: {name} is {value:g} {unit}; give 0 or more")
            object.__setattr__(self, name, value)
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or not 0 <= self.seed < _SEEDS:
            raise ProcessError(f"noise: the seed {shown(self.seed)} is not a whole number from 0 on")

    def at(self, scans: int, scan: float) -> Floats:
        """Return the noise at the scans [%], shape (scans,).

        Parameters
        ----------
        scans : int
            How many.
        scan : float
            Scan interval [s].
        """
        white = np.random.default_rng(self.seed).standard_normal(scans) * self.deviation
        if not self.lag or not scans:
            return white
        kept = math.exp(-scan / self.lag)
        white[1:] *= math.sqrt(-math.expm1(-2 * scan / self.lag))  # the variance stays that of the first scan
        return np.fromiter(accumulate(white.tolist(), lambda last, new: kept * last + new), np.float64, scans)
