"""What a controller's output does after steps of measurement and setpoint, and what it makes of noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pidemu.algorithm.model import Algorithm
from pidemu.certificate.noise import noise_gain_of
from pidemu.law.law import Law


@dataclass(frozen=True, slots=True)
class Responses:
    """What the output does, of a reverse-acting controller with positive gain, per percent of the signal.

    Attributes
    ----------
    measurement_kick, setpoint_kick : float
        What the output moves by at once [%/%]; infinite with a derivative that has no filter. At a scan interval: in the first
        scan.
    noise_gain : float
        The gain for the fastest changes of the measurement [%/%]: at infinite frequency; where a filter lets nothing through there,
        the largest above the corner of the fastest filter; at a scan interval, at half the scan rate.
    """

    measurement_kick: float
    setpoint_kick: float
    noise_gain: float


@dataclass(frozen=True, slots=True)
class Ramp:
    """What a step of the measurement comes to, when derivative and filters have died out.

    Attributes
    ----------
    jump : float
        Where the ramp begins: what the output has moved by, besides the ramp [%/%].
    slope : float
        What it moves on by [%/% per s].
    """

    jump: float
    slope: float


def responses_of(a: Algorithm, scan: float | None = None) -> Responses:
    """Return what the output does at once.

    Parameters
    ----------
    a : Algorithm
        The algorithm.
    scan : float, optional
        Scan interval [s]; without it the continuous law.

    Raises
    ------
    ScanError
        A filter is unstable at the scan interval.
    UndefinedError
        The algorithm is a recursion in scans, and no interval is given.
    """
    law = Law(a, scan)
    kick = law.kick("feedback")
    if scan is None:
        return Responses(kick, law.kick(), noise_gain_of(law))
    fastest = math.pi / scan * (1 - 1e-9)
    return Responses(kick, law.kick(), float(abs(law.response(fastest))))


def ramp_of(a: Algorithm) -> Ramp:
    """Return what a step of the measurement comes to: the first two moments (specs/equations.md, section 2)."""
    slope, jump, _ = Law(a).moments()
    return Ramp(jump, slope)
