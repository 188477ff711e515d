"""The nearest settings a target allows, where no closed form fits (specs/equations.md, section 3, constrained match)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.card.model.base import Form
from pidemu.certificate.linear import bands
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target
from pidemu.law.law import Law, at_frequencies, paths
from pidemu.settings.settings import limits
from pidemu.units import Role, parse_unit, to_canonical

if TYPE_CHECKING:
    from pidemu.process.process import Process

_GRID: Final = 25
_ROUNDS: Final = 16
_SHRINK: Final = 0.45
_POINTS: Final = 40
USELESS: Final = 0.99
"""Deviation from which settings are not worth offering."""
_MARGIN: Final = 1e-9
"""Relative distance kept from a range's end, so that unit conversion does not step over it."""


def nearest(law: Law, target: Target, factor: float, process: Process | None = None) -> Numbers | None:
    """Return numbers inside the target's ranges that minimise the largest deviation over the loop band.

    The low-frequency gain ``m0`` is kept as far as the ranges allow. The search is a grid in the logarithms of gain and derivative
    time that closes in on its best point: it needs no derivative, is the same on every machine, and there are two unknowns only.

    Parameters
    ----------
    law : Law
        The source's law.
    target : Target
        The target; the filter is its own, as the settings have it.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    process : Process, optional
        The process, which places the end of the loop band.

    Returns
    -------
    Numbers or None
        ``None`` where the deviation of all is near 1 or above, that is, where no controller at all would be as near.
    """
    (low, high), _ = bands(law, None, process)
    w = np.geomspace(low, high, _POINTS)
    wanted = factor * law.response(w)
    m0, m1, m2 = (factor * m for m in law.moments())
    scale = 1 / low * 0.01
    size = abs(m1) or abs(m0) * scale or abs(m2) / scale
    sign = math.copysign(1.0, m1 or m0 or m2)
    gains = _clip((size * 1e-3, size * 1e3), _range(target, Role.GAIN))
    rates = _range(target, Role.INTEGRAL)
    if m0 and target.has_integral and target.form is not Form.PARALLEL:  # gains that keep m0, if there are any
        keeping = max(gains[0], abs(m0) / rates[1]), min(gains[1], abs(m0) / rates[0] if rates[0] else math.inf)
        gains = keeping if keeping[0] < keeping[1] else gains
    times = _clip((scale * 1e-4, scale * 1e2), _range(target, Role.DERIVATIVE))
    center, width = (
        [_middle(gains), _middle(times)],
        [math.log(gains[1] / gains[0]) / 2, math.log(times[1] / times[0]) / 2],
    )
    in_order = target.form is Form.SERIES and not _is_out_of_order(law)
    best: tuple[float, float, float, float] | None = None
    for _ in range(_ROUNDS):
        K = _axis(center[0], width[0], gains)[:, None]
        Td = np.concatenate(([0.0], _axis(center[1], width[1], times)))[None, :]
        if not target.has_derivative:
            Td = np.zeros((1, 1))
        ki = _integral(m0, K, rates, target)
        cost = np.where(_in_order(K, ki, Td, in_order), _cost(target, sign * K, sign * ki, Td, w, wanted), np.inf)
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        if best is None or cost[i, j] < best[0]:
            best = (float(cost[i, j]), float(K[i, 0]), float(np.broadcast_to(ki, cost.shape)[i, 0]), float(Td[0, j]))
        center = [best[1], best[3] or center[1]]
        width = [x * _SHRINK for x in width]
    if best is None or not best[0] < USELESS:
        return None
    _, K_best, ki_best, Td_best = best
    return Numbers(sign * K_best, sign * ki_best, sign * K_best * Td_best)


def _is_out_of_order(law: Law) -> bool:
    """Whether the source is a series form whose derivative time is longer than its integral time."""
    a = law.algorithm
    return a.series and bool(a.kp and a.ki) and a.derivative_per_gain + a.Tf > abs(a.kp / a.ki)


def _in_order(K: Any, ki: Any, Td: Any, wanted: bool) -> Any:
    """Return where the integral time of a series form is no shorter than its derivative time, where that is wanted."""
    return (Td * ki <= K * (1 + _MARGIN)) if wanted else True


def _range(target: Target, role: Role) -> tuple[float, float]:
    """Return the allowed canonical values of a dial, in ascending order."""
    dial = target.dial(role)
    if dial is None:
        return 0.0, math.inf
    unit = parse_unit(dial[1].unit)
    low, high = limits(dial[1])
    ends = sorted(to_canonical(role, max(x, 0.0), unit, target.spans) for x in (low, high))
    return ends[0] * (1 + _MARGIN), ends[1] * (1 - _MARGIN)


def _clip(wide: tuple[float, float], allowed: tuple[float, float]) -> tuple[float, float]:
    low, high = max(wide[0], allowed[0]), min(wide[1], allowed[1])
    if low < high:
        return low, high
    if wide[0] >= allowed[1]:  # all that is allowed lies below
        return max(allowed[0], allowed[1] * 1e-3), allowed[1]
    return allowed[0], min(allowed[1], allowed[0] * 1e3)


def _middle(ends: tuple[float, float]) -> float:
    return math.sqrt(ends[0] * ends[1])


def _axis(center: float, width: float, ends: tuple[float, float]) -> npt.NDArray[np.float64]:
    points = center * np.exp(np.linspace(-width, width, _GRID))
    clipped: npt.NDArray[np.float64] = np.clip(points, *ends)
    return clipped


def _integral(m0: float, K: Any, rates: tuple[float, float], target: Target) -> Any:
    """Return the integral gain: ``m0``, or what the range of the dial leaves of it."""
    if not m0 or not target.has_integral:
        return np.zeros_like(K)
    if target.form is Form.PARALLEL:
        return np.clip(abs(m0), *rates) + 0 * K
    return K * np.clip(abs(m0) / K, *rates)


def _cost(target: Target, K: Any, ki: Any, Td: Any, w: Any, wanted: Any) -> npt.NDArray[np.float64]:
    """Return the largest relative deviation over the frequencies, for every combination."""
    grid = [np.asarray(x, dtype=float)[..., None] for x in (K, ki, Td)]
    with np.errstate(all="ignore"):
        a = target.algorithm_of(Numbers(grid[0], grid[1], grid[0] * grid[2]), target.filter)
        response = paths(a, at_frequencies(w))[0]
        deviation = np.max(np.abs(response / wanted - 1), axis=-1)
    result: npt.NDArray[np.float64] = np.where(np.isfinite(deviation), deviation, np.inf)
    return result
