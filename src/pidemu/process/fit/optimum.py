"""The numbers of a fitted model, before they are a process."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Optimum:
    """The numbers of a model.

    Attributes
    ----------
    gain : float
        Gain, in units of the measurement per unit of the output, per second too for an integrator.
    lags : tuple of float
        Time constants, the largest first [s]; none of an integrator.
    delay : float
        Dead time [s].
    start, drift : float
        Measurement at the first sample without the output's moves, and how fast it drifts [1/s].
    """

    gain: float
    lags: tuple[float, ...]
    delay: float
    start: float
    drift: float
