"""How far two linear laws are apart: the bands, and the largest differences over them (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.certificate.models import Band, Certificate, Kick, PathComparison
from pidemu.law.law import Law, PathName
from pidemu.law.rational import Response

if TYPE_CHECKING:
    from pidemu.process.process import Process


Limits = tuple[tuple[float, float], tuple[float, float]]
"""Ends of loop band and full band [rad/s]."""
Differences = tuple[Floats, Floats, Floats]
"""Relative deviation, differences of gain [dB] and phase [deg]."""

_POINTS: Final = 300
_FINE: Final = 75
"""Frequencies of the grid over a band, and of the finer one around its largest difference."""
_NONE: Final = 1e-12
"""Deviation on the grid that is rounding: nothing larger lies between."""
_SURELY_ANOTHER: Final = 1e-6
"""Deviation on the grid that no rounding makes."""
_ROUNDING: Final = 1e-14
"""Part of a response's largest value that is rounding."""
_NO_TIME: Final = 1e-9
"""Part of the other times that a derivative time of rounding is at most."""


def time_scale(law: Law) -> float:
    """Return the effective integral time ``m1/m0`` that places the loop band [s] (section 9).

    Without integral action the derivative time ``m2/m1`` takes its place, without proportional action the reciprocal of the
    integral gain, and for proportional action alone, which has no time scale, one second.
    """
    m0, m1, _ = law.moments()
    if m0:
        return abs(m1 / m0) if m1 / m0 > 0 else 1 / abs(m0)
    return abs(_derivative_time(law, 0.0)) or 1.0


def _derivative_time(law: Law, Ti: float) -> float:
    """Return ``m2/m1`` [s]; 0 where that is rounding, which a filter without derivative leaves beside the other times."""
    _, m1, m2 = law.moments()
    den = law.feedback.den[1:] if law.feedback.den[0] == 0 else law.feedback.den
    lag = abs(den[1] / den[0]) if len(den) > 1 else 0.0
    Td = m2 / m1 if m1 else 0.0
    return Td if abs(Td) > _NO_TIME * (Ti + lag) else 0.0


def bands(law: Law, scan: float | None, process: Process | None = None) -> Limits:
    """Return loop band and full band of a source [rad/s] (section 9).

    Parameters
    ----------
    law : Law
        The source's continuous law.
    scan : float or None
        The longer scan interval [s], whose Nyquist frequency ends both bands.
    process : Process, optional
        The process, where it is known: the loop band then ends at twice the frequency where its phase is -180 degrees.
    """
    Ti = time_scale(law)
    Td = _derivative_time(law, Ti)
    Td = Td if Td > 0 else Ti
    nyquist = math.pi / scan if scan is not None else math.inf
    low = 0.01 / Ti
    end = 5 / Ti if process is None or not math.isfinite(process.w180) else 2 * process.w180
    loop = max(min(end, nyquist), low * 1.01)
    return (low, loop), (low, max(min(100 / Td, nyquist), loop))


def differences(source: Response, target: Response) -> Differences:
    """Return relative deviation, gain difference [dB] and phase difference [deg] of responses, all without sign.

    A response below 1e-14 of its largest is nothing but rounding, and counts as zero: a trapezoidal integral has none at half the
    scan rate, P on PV none to the setpoint. Where both are zero there is no difference. Where one is, the differences of gain and
    phase are infinite; so is the deviation where that one is the source, and 1 where it is the target.

    Parameters
    ----------
    source, target : ndarray of complex, shape (..., n)
        Responses over the frequencies of one band each.

    Returns
    -------
    deviation, gain, phase : ndarray of float, shape (..., n)
    """
    nothing, gone = (size <= _ROUNDING * size.max(axis=-1, keepdims=True) for size in (np.abs(source), np.abs(target)))
    if not (nothing.any() or gone.any()):
        with np.errstate(all="ignore"):
            return _of_ratio(target / source)
    either = nothing | gone
    with np.errstate(all="ignore"):
        deviation, gain, phase = _of_ratio(np.where(either, 1.0, target / np.where(either, 1.0, source)))
    deviation = np.where(nothing, np.inf, np.where(gone, 1.0, deviation))
    gain, phase = np.where(either, np.inf, gain), np.where(either, np.inf, phase)
    deviation, gain, phase = (np.where(nothing & gone, 0.0, x) for x in (deviation, gain, phase))
    return deviation, gain, phase


def _of_ratio(ratio: Response) -> Differences:
    """Return the differences that a quotient of two responses is; infinite where it is not a number."""
    found = np.abs(ratio - 1), np.abs(20 * np.log10(np.abs(ratio))), np.abs(np.degrees(np.angle(ratio)))
    deviation, gain, phase = (np.where(np.isnan(x), np.inf, x) if np.isnan(x.max()) else x for x in found)
    return deviation, gain, phase


def compare(source: Callable[[Floats], Response], target: Callable[[Floats], Response], low: float, high: float) -> Band:
    """Compare two responses over a band.

    The largest differences are looked for on a logarithmic grid, and once more, finely, around each of those found.

    Parameters
    ----------
    source, target : callable
        From frequencies [rad/s] to the complex response.
    low, high : float
        Ends of the band [rad/s].
    """
    w = _grids(((low, high),))[0]
    found = differences(source(w), target(w))
    if float(found[0].max()) < _NONE:
        return _band(w, found)
    fine = _around(w, found)
    return _band(w, found, fine, differences(source(fine), target(fine)))


@lru_cache(maxsize=64)
def _grids(bands: tuple[tuple[float, float], ...]) -> Floats:
    """Return frequencies of each band on a logarithmic scale, shape (bands, points)."""
    w = np.stack([np.geomspace(low, high, _POINTS) for low, high in bands])
    w.flags.writeable = False
    return w


def _around(w: Floats, found: Differences) -> Floats:
    """Return frequencies close to those of grids at which the differences are largest, shape (..., 3 fine grids)."""
    peaks = np.stack([x.argmax(axis=-1) for x in found], axis=-1)
    grids = np.broadcast_to(w, found[0].shape)
    low, high = (np.take_along_axis(grids, np.clip(peaks + step, 0, _POINTS - 1), axis=-1) for step in (-1, 1))
    return np.geomspace(low, high, _FINE, axis=-1).reshape(*peaks.shape[:-1], 3 * _FINE)


def _band(w: Floats, found: Differences, fine: Floats | None = None, finer: Differences | None = None) -> Band:
    """Return the largest differences on a grid, and close to where they are largest there."""
    worst = int(found[0].argmax())
    deviation, gain, phase = (float(x.max()) for x in found)
    at = float(w[worst])
    if fine is not None and finer is not None:
        close = int(finer[0].argmax())
        at = at if deviation >= finer[0][close] else float(fine[close])
        deviation, gain, phase = (max(x, float(y.max())) for x, y in zip((deviation, gain, phase), finer, strict=True))
    return Band(float(w[0]), float(w[-1]), deviation, gain, phase, at)


@lru_cache(maxsize=64)
def compare_paths(source: Law, target: Law, limits: Limits, factor: float) -> tuple[PathComparison, PathComparison]:
    """Compare feedback and setpoint path of two laws over loop band and full band.

    Discrete laws are compared as a process sees them, held from scan to scan.

    Parameters
    ----------
    source, target : Law
        Both continuous, or each discrete at its own scan interval.
    limits : tuple
        Loop band and full band [rad/s].
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    """
    w = _grids(limits)
    found = differences(factor * _on_grids(source, limits), _on_grids(target, limits))
    if float(found[0].max()) < _NONE:
        bands = [[_band(w[k], _part(found, path, k)) for k in (0, 1)] for path in (0, 1)]
    else:
        fine = _around(w, found)
        finer = differences(factor * _by_path(source, fine), _by_path(target, fine))
        bands = [[_band(w[k], _part(found, path, k), fine[path, k], _part(finer, path, k)) for k in (0, 1)] for path in (0, 1)]
    feedback, setpoint = (_comparison(*both) for both in bands)
    return feedback, setpoint


def sameness(source: Law, target: Law, limits: Limits, factor: float) -> tuple[float, float]:
    """Return by how much feedback and setpoint path deviate over both bands, to tell the same law from another one.

    What is below 1e-6 is exact; of what is more, the largest lies somewhere between the frequencies that were looked at. Arguments
    as in `compare_paths`.
    """
    found = differences(factor * _on_grids(source, limits), _on_grids(target, limits))[0].max(axis=(1, 2))
    if any(_NONE <= x < _SURELY_ANOTHER for x in found):
        found = [path.full_band.max_deviation for path in compare_paths(source, target, limits, factor)]
    return float(found[0]), float(found[1])


@lru_cache(maxsize=64)
def _on_grids(law: Law, limits: Limits) -> Response:
    """Return both paths of a law over both bands, shape (paths, bands, points); a source meets many targets."""
    return np.stack(law.held_responses(_grids(limits)))


def _by_path(law: Law, w: Floats) -> Response:
    """Return the responses of the two paths at frequencies of their own, shape of `w`."""
    return np.stack([law.held(of_path, name) for of_path, name in zip(w, _PATHS, strict=True)])


def _part(found: Differences, path: int, band: int) -> Differences:
    deviation, gain, phase = (x[path, band] for x in found)
    return deviation, gain, phase


def _comparison(loop: Band, full: Band) -> PathComparison:
    """Return what both bands say of a path: the full band holds the loop band."""
    worse = loop if loop.max_deviation > full.max_deviation else full
    gain, phase = max(loop.gain_db, full.gain_db), max(loop.phase_deg, full.phase_deg)
    return PathComparison(loop, Band(full.low, full.high, worse.max_deviation, gain, phase, worse.worst_at))


def deviation(source: Law, target: Law, band: tuple[float, float], factor: float, path: PathName = "feedback") -> float:
    """Return the largest relative deviation of one path over one band; arguments as in `compare_paths`."""
    return compare(lambda w: factor * source.held(w, path), lambda w: target.held(w, path), *band).max_deviation


def certify(
    source: Law,
    target: Law,
    at_scan: tuple[Law, Law] | None,
    factor: float = 1.0,
    process: Process | None = None,
) -> Certificate:
    """Return the linear part of the certificate of two controllers.

    Parameters
    ----------
    source, target : Law
        The continuous laws.
    at_scan : tuple of Law or None
        The discrete laws of source and target at their scan intervals.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    process : Process, optional
        The process, which places the end of the loop band.
    """
    scans = [law.scan for law in at_scan or () if law.scan is not None]
    limits = bands(source, max(scans) if scans else None, process)
    feedback, setpoint = compare_paths(source, target, limits, factor)
    discrete = compare_paths(*at_scan, limits, factor) if at_scan else (None, None)
    return Certificate(
        feedback=feedback,
        setpoint=setpoint,
        feedback_at_scan=discrete[0],
        setpoint_at_scan=discrete[1],
        setpoint_kick=Kick(factor * source.kick(), target.kick()),
        setpoint_kick_at_scan=Kick(factor * at_scan[0].kick(), at_scan[1].kick()) if at_scan else None,
        time_scale=time_scale(source),
    )


_PATHS: Final[tuple[PathName, PathName]] = ("feedback", "setpoint")
