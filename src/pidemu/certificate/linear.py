"""How far two linear laws are apart: the bands, and the largest differences over them (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.certificate.models import Band, Certificate, Kick, PathComparison
from pidemu.law.law import Law, PathName
from pidemu.law.rational import Response

if TYPE_CHECKING:
    from pidemu.process.process import Process


_POINTS: Final = 300
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


def bands(law: Law, scan: float | None, process: Process | None = None) -> tuple[tuple[float, float], tuple[float, float]]:
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


def differences(source: Response, target: Response) -> tuple[Floats, Floats, Floats]:
    """Return relative deviation, gain difference [dB] and phase difference [deg] of two responses, all without sign.

    A response below 1e-14 of its largest is nothing but rounding, and counts as zero: a trapezoidal integral has none at half the
    scan rate, P on PV none to the setpoint. Where both are zero there is no difference. Where one is, the differences of gain and
    phase are infinite; so is the deviation where that one is the source, and 1 where it is the target.
    """
    nothing, gone = (np.abs(x) <= _ROUNDING * np.max(np.abs(x)) for x in (source, target))
    either = nothing | gone
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(either, 1.0, target / np.where(either, 1.0, source))
        deviation = np.where(gone, 1.0, np.abs(ratio - 1))
        gain = np.abs(20 * np.log10(np.abs(ratio)))
        phase = np.abs(np.degrees(np.angle(ratio)))
    found = np.where(nothing, np.inf, deviation), np.where(either, np.inf, gain), np.where(either, np.inf, phase)
    first, second, third = (np.where(nothing & gone, 0.0, np.where(np.isnan(x), np.inf, x)) for x in found)
    return first, second, third


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
    w = np.geomspace(low, high, _POINTS)
    found = differences(source(w), target(w))
    peaks = {int(np.argmax(x)) for x in found}
    fine = np.concatenate([np.geomspace(w[max(k - 1, 0)], w[min(k + 1, w.size - 1)], _POINTS // 4) for k in sorted(peaks)])
    finer = differences(source(fine), target(fine))
    deviation, gain, phase = (np.concatenate(pair) for pair in zip(found, finer, strict=True))
    worst = int(np.argmax(deviation))
    at = float(np.concatenate([w, fine])[worst])
    return Band(low, high, float(deviation[worst]), float(np.max(gain)), float(np.max(phase)), at)


def compare_paths(
    source: Law, target: Law, path: PathName, limits: tuple[tuple[float, float], tuple[float, float]], factor: float
) -> PathComparison:
    """Compare one path of two laws over loop band and full band, discrete ones as a process sees them, held from scan to scan.

    Parameters
    ----------
    source, target : Law
        Both continuous, or each discrete at its own scan interval.
    path : {"feedback", "setpoint"}
        Which path.
    limits : tuple
        Loop band and full band [rad/s].
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    """
    loop, full = (_compared(source, target, path, band, factor) for band in limits)
    worse = loop if loop.max_deviation > full.max_deviation else full  # the full band holds the loop band
    gain, phase = max(loop.gain_db, full.gain_db), max(loop.phase_deg, full.phase_deg)
    return PathComparison(loop, Band(full.low, full.high, worse.max_deviation, gain, phase, worse.worst_at))


def _compared(source: Law, target: Law, path: PathName, band: tuple[float, float], factor: float) -> Band:
    return compare(lambda w: factor * source.held(w, path), lambda w: target.held(w, path), *band)


def deviation(source: Law, target: Law, band: tuple[float, float], factor: float, path: PathName = "feedback") -> float:
    """Return the largest relative deviation of one path over one band; arguments as in `compare_paths`."""
    return _compared(source, target, path, band, factor).max_deviation


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
    discrete = [compare_paths(*at_scan, path, limits, factor) for path in _PATHS] if at_scan else [None, None]
    return Certificate(
        feedback=compare_paths(source, target, "feedback", limits, factor),
        setpoint=compare_paths(source, target, "setpoint", limits, factor),
        feedback_at_scan=discrete[0],
        setpoint_at_scan=discrete[1],
        setpoint_kick=Kick(factor * source.kick(), target.kick()),
        setpoint_kick_at_scan=Kick(factor * at_scan[0].kick(), at_scan[1].kick()) if at_scan else None,
        time_scale=time_scale(source),
    )


_PATHS: Final[tuple[PathName, PathName]] = ("feedback", "setpoint")
