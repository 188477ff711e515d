"""Simpler models of a process: the half rule (S. Skogestad, Journal of Process Control 13 (2003), 291-309)."""

from __future__ import annotations

import math
from typing import Final, Literal

from pidemu.errors import ProcessError
from pidemu.process.process import Process

_EXAMPLE: Final = "fit a simpler model to its step response instead"


def half_rule(process: Process, order: Literal[1, 2] = 1) -> Process:
    """Return a process of one lag or two, with dead time, that is nearly another one with many lags.

    Parameters
    ----------
    process : Process
        Real, stable poles and at most one integrator.
    order : {1, 2}
        How many lags are kept; an integrator counts as one, the largest.

    Returns
    -------
    Process
        With the same gain and unit.

    Raises
    ------
    ProcessError
        A pole is complex or unstable, there is more than one integrator, or the leads are longer than the lags and dead time that
        they would be taken from.

    Notes
    -----
    The largest neglected lag is split: half of it goes to the smallest lag that is kept, half to the dead time. All smaller lags go
    to the dead time, and the leads of inverse responses (zeros in the right half plane). Other leads are taken from it.
    An integrator is an infinite lag, which half a lag does not change.

    Examples
    --------
    >>> print(half_rule(Process.from_lags(1, [2, 1, 0.4, 0.2, 0.05, 0.05, 0.05], [-0.3, 0.08])))
    1 exp(-1.47 s)/(2.5 s + 1)
    >>> print(half_rule(Process.from_lags(1, [1, 1, 1, 1]), order=2))
    1 exp(-1.5 s)/((s + 1)(1.5 s + 1))
    """
    if order not in (1, 2):
        raise ProcessError(f"order is {order}; give 1 or 2, the number of lags that are kept")
    lags = sorted((_lag(p) for p in process.poles if p), reverse=True)
    if process.integrators > 1:
        raise ProcessError(f"{process} has {process.integrators} integrators; the half rule is for one at most; {_EXAMPLE}")
    kept, dropped = lags[: order - process.integrators], lags[order - process.integrators :]
    half = dropped[0] / 2 if dropped else 0.0
    if kept:
        kept[-1] += half
    delay = math.fsum([process.delay, half, *dropped[1:], *(-_lead(z) for z in process.zeros)])
    rounding = 1e-12 * max([*lags, process.delay], default=0.0)
    if delay < -rounding:
        raise ProcessError(
            f"the leads of {process} are longer than the dead time and the small lags together, so that the half rule would leave "
            f"a dead time of {delay:g} s; {_EXAMPLE}"
        )
    return Process.from_lags(
        process.gain, kept, integrators=process.integrators, delay=delay if delay > rounding else 0.0, unit=process.unit
    )


def _lag(pole: complex) -> float:
    if pole.imag or pole.real > 0:
        raise ProcessError(f"the half rule is for real lags, and the pole {pole:g} rad/s is none; {_EXAMPLE}")
    return -1 / pole.real


def _lead(zero: complex) -> float:
    if zero.imag or not zero:
        raise ProcessError(f"the half rule is for real leads, and the zero {zero:g} rad/s is none; {_EXAMPLE}")
    return -1 / zero.real
