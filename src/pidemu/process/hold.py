"""A process behind a zero-order hold, sampled: exact at the scans, also where the dead time ends within one.

The output of a controller stands from scan to scan. With ``delay = d h + f``, ``0 <= f < h``, the process sees the output of
``d + 1`` scans ago for ``f`` and that of ``d`` scans ago for ``h - f`` (the modified z transform)::

    x_(n+1) = x_n + F x_n + E u_(n-d-1) + G u_(n-d)
    y_n     = c x_n + D u_(n-d-1)

The measurement is read just before the output of the same scan goes out. ``F = exp(A h) - I`` is computed as such, so that
processes with times far longer than the scan interval stay accurate.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.errors import ProcessError
from pidemu.law.rational import Response
from pidemu.process.roots import polynomial_of
from pidemu.program.blocks import TINY

_TERMS: Final = 18
"""Terms of the series of ``exp(X) - 1`` for a norm of X up to 1/2: the next one is below 1e-22."""
_WHOLE: Final = 1e-9
"""A dead time within this share of a scan interval of a multiple is one."""


@dataclass(frozen=True)
class SampledProcess:
    """The exact model of a process at the scans.

    Attributes
    ----------
    scan : float
        Scan interval [s].
    growth : ndarray, shape (n, n)
        ``F``: what a scan adds to the states.
    early, late : ndarray, shape (n,)
        ``E`` and ``G``: what the outputs of ``d + 1`` and ``d`` scans ago add.
    row : ndarray, shape (n,)
        ``c``: measurement per state.
    through : float
        ``D``: what the measurement has of the input at once [%/%].
    scans : int
        ``d``: whole scans in the dead time.
    """

    scan: float
    growth: Floats
    early: Floats
    late: Floats
    row: Floats
    through: float
    scans: int

    def response(self, w: npt.ArrayLike) -> Response:
        """Return the response from held output to sampled measurement, ``z = exp(j w h)``.

        Parameters
        ----------
        w : array_like, shape (n,) or scalar
            Angular frequencies [rad/s], above zero, up to ``pi/h``.

        Raises
        ------
        ProcessError
            A time of the process is so long beside the scan interval that floating point cannot tell it from infinite.
        """
        at = np.atleast_1d(np.asarray(w, dtype=float))
        turn = np.exp(-1j * at * self.scan)  # z^-1
        rest = np.expm1(1j * at * self.scan)  # z - 1
        found = self.through * turn
        if self.row.size:
            left = rest[:, None, None] * np.eye(self.row.size) - self.growth
            right = self.late + self.early * turn[:, None]
            try:
                found = found + np.linalg.solve(left, right[..., None])[..., 0] @ self.row
            except np.linalg.LinAlgError:
                raise ProcessError(
                    f"times of the process are too far from the scan interval of {self.scan:g} s to compute with both; "
                    f"leave out the lags that do not matter, or give another interval"
                ) from None
        return np.asarray(found * np.exp(-1j * at * self.scan * self.scans), dtype=np.complex128).reshape(np.shape(w))


def responses(gain: float, poles: Sequence[complex], zeros: Sequence[complex], h: float, w: Floats, delays: Floats) -> Response:
    """Return the response of `SampledProcess` at frequencies with a dead time for each.

    Parameters
    ----------
    gain, poles, zeros
        As in `pidemu.Process`.
    h : float
        Scan interval [s].
    w, delays : ndarray, shape (n,)
        Angular frequencies [rad/s], and the dead time [s] that counts at each.
    """
    A, B = chain(poles)
    row, through = outputs(poles, zeros)
    scans, fraction = _whole_scans(delays, h)
    n = w.size
    grown = expm1(A, B, np.concatenate([h - fraction, fraction, [h]]))
    (after, late), (begun, whole) = (grown[0][:n], grown[1][:n]), (grown[1][n : 2 * n], grown[0][-1])
    early = begun + (after @ begun[..., None])[..., 0]
    turn, rest = np.exp(-1j * w * h), np.expm1(1j * w * h)
    found = through * turn
    if row.size:
        left = rest[:, None, None] * np.eye(row.size) - whole
        found = found + np.linalg.solve(left, (late + early * turn[:, None])[..., None])[..., 0] @ row
    return np.asarray(gain * found * np.exp(-1j * w * h * scans), dtype=np.complex128)


def _whole_scans(delays: Floats, h: float | Floats) -> tuple[Floats, Floats]:
    """Return the whole scans in dead times [s], and what is left of each."""
    scans = np.floor(delays / h + _WHOLE)
    fraction = delays - scans * h
    return scans, np.where(fraction < _WHOLE * h, 0.0, fraction)


class Plant:
    """A sampled process that runs, in deviations from where it rests.

    Parameters
    ----------
    model : SampledProcess
        The process.
    """

    def __init__(self, model: SampledProcess) -> None:
        n = model.row.size
        self._on_the_way = deque([0.0] * model.scans)
        self._step = [_sparse(row) for row in np.column_stack([model.growth, model.early, model.late]).tolist()]
        self._row = _sparse([*model.row.tolist(), model.through])
        self._states = [0.0] * n
        self._input = 0.0  # of d + 1 scans ago

    def measure(self) -> float:
        """Return the measurement [%]."""
        return _weighted(self._row, (*self._states, self._input))

    def move(self, u: float) -> None:
        """Go on by a scan with an input [%]."""
        self._on_the_way.append(u)
        before, self._input = self._input, self._on_the_way.popleft()
        now = (*self._states, before, self._input)  # plain numbers: quicker than arrays of two or three
        moved = (x + _weighted(row, now) for x, row in zip(self._states, self._step, strict=True))
        self._states = [0.0 if -TINY < x < TINY else x for x in moved]  # no denormal numbers (section 7)


_Weights = list[tuple[int, float]]


def _sparse(weights: Sequence[float]) -> _Weights:
    """Return the places and sizes of weights that are not 0."""
    return [(i, weight) for i, weight in enumerate(weights) if weight]


def _weighted(weights: _Weights, values: Sequence[float]) -> float:
    total = 0.0
    for i, weight in weights:  # in the order of the scan program; `sum` compensates in later Pythons
        total += weight * values[i]
    return total


def sample(gain: float, poles: Sequence[complex], zeros: Sequence[complex], delay: float, h: float) -> SampledProcess:
    """Return the sampled model; see `pidemu.Process.sampled`."""
    if not (math.isfinite(h) and h > 0):
        raise ProcessError(f"the scan interval {h:g} s is not a positive number; give the time between two scans")
    row, through = outputs(poles, zeros)
    (growth,), (early,), (late,), (scans,) = held(*chain(poles), np.array([delay]), np.array([h]))
    if not all(np.isfinite(x).all() for x in (growth, late, early)):
        raise ProcessError(f"the process outgrows all numbers within one scan of {h:g} s; give a shorter scan interval")
    return SampledProcess(h, growth, early, late, gain * row, gain * through, int(scans))


def held(A: Floats, B: Floats, delays: Floats, h: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return F, E, G and d of processes behind a hold.

    Parameters
    ----------
    A, B : ndarray, shape (..., n, n) and (..., n)
        States, as `chain` returns them; of each process, or of all.
    delays, h : ndarray, shape (processes,)
        Dead times and scan intervals [s].
    """
    scans, fractions = _whole_scans(delays, h)
    with np.errstate(over="ignore", invalid="ignore"):
        grown, moved = expm1(A, B, np.stack([h, h - fractions, fractions], axis=-1))
        begun = moved[:, 2]
        early = begun + (grown[:, 1] @ begun[..., None])[..., 0]
    return grown[:, 0], early, moved[:, 1], scans


def _in_order(poles: Sequence[complex]) -> list[complex]:
    """Return one pole per section, the fastest first: of a pair the upper one."""
    return sorted((p for p in poles if p.imag >= 0), key=abs, reverse=True)


def chain(poles: Sequence[complex]) -> tuple[Floats, Floats]:
    """Return A and B of first- and second-order sections in a row, each with the low-frequency gain 1."""
    n = len(poles)
    A, B = np.zeros((n, n)), np.zeros(n)
    k, before = 0, -1
    for p in _in_order(poles):
        size = abs(p) or 1.0
        last = k + 1 if p.imag else k
        A[k, k] = A[last, last] = p.real
        if p.imag:  # x1 = 1/((1 - s/p)(1 - s/p*)), x2 = (s - Re p)/|p| x1
            A[k, last], A[last, k] = size, -p.imag * (p.imag / size)
        drive = -p.real if p.real and not p.imag else size
        if k:
            A[last, before] = drive
        else:
            B[last] = drive
        k, before = last + 1, k
    return A, B


def outputs(poles: Sequence[complex], zeros: Sequence[complex]) -> tuple[Floats, float]:
    """Return what of the states makes the numerator, and what is left at once: division by one section after the other."""
    rest = list(polynomial_of(zeros))
    row: list[float] = []
    for p in reversed(_in_order(poles)):
        rest, left = _divided(rest, polynomial_of([p]))
        constant, slope = (*left, 0.0)[:2]
        row = [constant + slope * p.real, slope * abs(p), *row] if p.imag else [constant, *row]
    return np.array(row, dtype=np.float64), rest[0]


def _divided(polynomial: Sequence[float], by: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return quotient and remainder of polynomials, coefficients ascending, in plain numbers: arrays of two or three are slower."""
    left, degree = list(polynomial), len(by) - 1
    while len(left) > 1 and not left[-1]:
        left.pop()
    lower = [x / by[-1] for x in by[:-1]]
    for last in range(len(left) - 1, degree - 1, -1):
        for i, x in enumerate(lower, last - degree):
            left[i] -= x * left[last]
    return [x / by[-1] for x in left[degree:]] or [left[0] * 0.0], left[:degree]


def expm1(A: Floats, B: Floats, times: Sequence[float] | Floats) -> tuple[Floats, Floats]:
    """Return ``exp(A t) - I`` and ``integral_0^t exp(A x) dx B`` for several times, by series and doubling.

    ``F(2t) = 2 F(t) + F(t)^2``: nothing cancels in that, as it would in the squaring of ``exp(A t)``.

    Parameters
    ----------
    A, B : ndarray, shape (..., n, n) and (..., n)
        The system, or one after the other.
    times : array_like, shape (..., m)
        Times [s]; those of one system are computed with the same number of doublings.
    """
    n = B.shape[-1]
    t = np.array(times)
    X = np.zeros((*t.shape, n + 1, n + 1))
    X[..., :n, :n], X[..., :n, n] = A[..., None, :, :] * t[..., None, None], B[..., None, :] * t[..., None]
    sizes = np.abs(X).sum(axis=-1).max(axis=(-2, -1))
    doublings = np.array([_doublings(size) for size in sizes.ravel().tolist()], dtype=np.int64).reshape(sizes.shape)
    X /= np.ldexp(1.0, doublings)[..., None, None, None]
    F, term = X.copy(), X
    for k in range(2, _TERMS):
        term = term @ X
        term /= k
        F += term
    for done in range(doublings.max(initial=0)):
        left = doublings > done
        some = F if left.all() else F[left]
        F[left] = 2 * some + some @ some
    return F[..., :n, :n], F[..., :n, n]


def _doublings(size: float) -> int:
    """Return how often a step of the series is doubled, from the norm of the whole."""
    return max(0, math.ceil(math.log2(2 * size))) if 0 < size < math.inf else 0
