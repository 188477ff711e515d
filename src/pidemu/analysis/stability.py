"""Whether a closed loop is stable: zeros of ``1 + L`` in the unstable region, counted."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pidemu.arrays import Complexes, Floats
from pidemu.law.rational import Response

_EDGE: Final = 1e-12
"""A root nearer to the edge of stability, relative to its size, is on it."""


def unstable_continuous(num: Floats, den: Floats, delay: float, crossovers: Floats) -> bool:
    """Tell whether ``1 + num(s)/den(s) exp(-delay s)`` has a zero with a real part that is not negative.

    Without dead time these are roots of a polynomial. When the dead time grows, roots cross the imaginary axis only where the loop
    gain is 1: to the right where it falls with frequency, to the left where it rises (Walton and Marshall, Direct method for TDS
    stability analysis, IEE Proc. D 134 (1987) 101).

    Parameters
    ----------
    num, den : ndarray of float
        Coefficients of the open loop without dead time, ascending.
    delay : float
        Dead time [s].
    crossovers : ndarray of float, shape (m,)
        Frequencies at which its gain is 1 [rad/s].
    """
    if delay and turns_for_ever(num, den):
        return True
    count, at_zero = without_delay(num, den)
    if not delay:
        return count > 0
    if at_zero:
        return True
    for w in crossovers:
        value, slightly_more = (_value(num, den, x) for x in (w, w * (1 + 1e-6)))
        first = math.fmod(float(np.angle(value)) + math.pi, 2 * math.pi)  # of w delay, where L is -1
        passed = math.floor((w * delay - first) / (2 * math.pi)) + 1 if w * delay >= first else 0
        count += (2 if abs(slightly_more) < abs(value) else -2) * passed
    return count > 0


def turns_for_ever(num: Floats, den: Floats) -> bool:
    """Tell whether the loop gain never falls below 1, so that any dead time turns it for ever: a derivative without filter."""
    num, den = np.trim_zeros(num, "b"), np.trim_zeros(den, "b")
    return bool(num.size > den.size or (num.size == den.size and abs(num[-1]) >= abs(den[-1])))


def without_delay(num: Floats, den: Floats) -> tuple[int, bool]:
    """Return how many roots of ``num + den`` are not stable, and whether one is at zero, where it stays whatever the dead time."""
    num, den = np.trim_zeros(num, "b"), np.trim_zeros(den, "b")
    size = max(num.size, den.size)
    closed = np.pad(num, (0, size - num.size)) + np.pad(den, (0, size - den.size))
    roots = _roots(closed)
    return int(np.sum(roots.real >= -_EDGE * np.abs(roots))), not closed[0]


def _roots(ascending: Floats) -> Complexes:
    """Return the roots of a polynomial, computed in a unit of frequency that suits it."""
    some = np.flatnonzero(ascending)
    if some.size < 2:
        return np.zeros(some[0] if some.size else 0, dtype=np.complex128)
    low, high = int(some[0]), int(some[-1])
    unit = abs(ascending[low] / ascending[high]) ** (1 / (high - low))
    found = np.roots((ascending * unit ** np.arange(ascending.size))[::-1]) * unit
    return np.asarray(found, dtype=np.complex128)


def _value(num: Floats, den: Floats, w: float) -> complex:
    s = 1j * w
    return complex(np.polyval(num[::-1], s) / np.polyval(den[::-1], s))


def unstable_sampled(values: Response, poles: int, integrators: int) -> bool:
    """Tell whether the closed sampled loop has a pole on or outside the unit circle; see `outside_the_unit_circle`."""
    return not (1 + values).all() or outside_the_unit_circle(values, poles, integrators) > 0.25


def outside_the_unit_circle(values: Response, poles: int, integrators: int) -> float:
    """Return how many poles of the closed sampled loop are outside the unit circle, by Nyquist's criterion.

    ``1 + L`` is 1 at infinity and has as many zeros as poles. Along the upper half of the unit circle it turns by pi for every pole
    outside, back by pi for every zero outside, and by half of that for a pole at ``z = 1``.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        The open loop along the upper half circle, from low frequencies on to where its gain stays below 1, or to the end.
    poles : int
        Poles of the open loop outside the unit circle.
    integrators : int
        Poles at ``z = 1``.
    """
    f = 1 + values
    turned = float(np.sum(np.angle(f[1:] / f[:-1])))
    if abs(values[-1]) < 1:
        turned -= float(np.angle(f[-1]))  # on to the real axis
    return poles + integrators / 2 - turned / math.pi
