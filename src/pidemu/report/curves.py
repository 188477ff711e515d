"""The curves of a certificate in numbers: both laws over frequency, both controllers in steps, both loops with the process."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from pidemu.arrays import Floats
from pidemu.conversion.result import Conversion
from pidemu.errors import PidemuError
from pidemu.law.law import Law
from pidemu.law.rational import Response
from pidemu.records.files import Record
from pidemu.records.side_by_side import run_on
from pidemu.records.standard import REST, scale_of
from pidemu.settings.action import acting_alike
from pidemu.settings.ranges import UNLIMITED
from pidemu.settings.settings import Settings

Who = Literal["source", "target", "textbook"]

_POINTS: Final = 400
_NEAR: Final = 4.0
"""Factor beyond the full band within which a Nyquist frequency is still shown."""
_BEFORE, _AFTER = 0.2, 2.0
"""How long the controllers rest and how long their response is shown, in characteristic times."""
_MOST: Final = 2_000
"""Scans per characteristic time at the most."""
_STEP: Final = 5.0
"""Steps of setpoint and load in the closed loop [%]."""
_MOST_SCANS: Final = 20_000
"""Scans of the closed loop after each step, at the most."""


@dataclass(frozen=True)
class Bode:
    """Frequency responses of both feedback paths.

    Attributes
    ----------
    w : ndarray of float, shape (n,)
        Angular frequencies [rad/s].
    source, target : ndarray of complex, shape (n,)
        Responses [%/%], the source's with the gain factor of new signal ranges; NaN beyond a controller's own Nyquist frequency.
    loop_band : tuple of float
        Ends of the loop band [rad/s].
    nyquist : tuple of float
        Nyquist frequencies of source and target [rad/s]; empty where no scan intervals were given.
    """

    w: Floats
    source: Response
    target: Response
    loop_band: tuple[float, float]
    nyquist: tuple[float, ...]

    @property
    def ratio(self) -> Response:
        """Target per source; NaN where one of them is, or where the source does nothing."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Response = self.target / self.source
        found[~np.isfinite(found)] = np.nan
        return found


@dataclass(frozen=True)
class Trace:
    """A signal that holds from scan to scan.

    Attributes
    ----------
    who : {"source", "target", "textbook"}
        Whose it is.
    times, values : ndarray of float, shape (n,)
        Times of the scans [s] and the signal there [%].
    """

    who: Who
    times: Floats
    values: Floats


@dataclass(frozen=True)
class StepResponses:
    """Outputs of the emulated controllers in the linear range.

    Attributes
    ----------
    at : float
        When setpoint or measurement steps [s].
    size : float
        By how much, up [% of span].
    setpoint, measurement : tuple of Trace
        Outputs after a step of the setpoint, and after one of the measurement [% of output span].
    notes : tuple of str
        What is not shown, and why.
    """

    at: float
    size: float
    setpoint: tuple[Trace, ...]
    measurement: tuple[Trace, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ClosedLoops:
    """Both controllers, each in a closed loop with the process, without output limits.

    Attributes
    ----------
    setpoint_at, load_at : float
        When setpoint and load step [s].
    size : float
        By how much, up [%].
    scan : tuple of float
        Scan intervals of source and target [s].
    measurement, output : tuple of Trace
        The two signals [% of span].
    """

    setpoint_at: float
    load_at: float
    size: float
    scan: tuple[float, float]
    measurement: tuple[Trace, ...]
    output: tuple[Trace, ...]


def bode(c: Conversion) -> Bode:
    """Return the responses of both feedback paths, at the scan intervals held from scan to scan where these were given.

    Parameters
    ----------
    c : Conversion
        The conversion.
    """
    laws = (c.source.law(c.scan[0]), c.settings.law(c.scan[1])) if c.scan else (c.source.law(), c.settings.law())
    band, full = c.certificate.headline.loop_band, c.certificate.headline.full_band
    nyquist = tuple(math.pi / h for h in c.scan or ())
    high = max([full.high, *(w for w in nyquist if w <= _NEAR * full.high)])
    ends = [w for w in (band.high, full.high, *nyquist) if w <= high]
    w = np.unique(np.concatenate([np.geomspace(full.low, high, _POINTS), ends]))
    return Bode(w, c.factor * _held(laws[0], w), _held(laws[1], w), (band.low, band.high), nyquist)


def _held(law: Law, w: Floats) -> Response:
    found = np.full(w.size, complex(math.nan, math.nan))
    known = np.full(w.size, True) if law.scan is None else w <= math.pi / law.scan
    found[known] = law.held(w[known])
    return found


def responses(c: Conversion) -> StepResponses | None:
    """Return the outputs of both emulated controllers, and of the textbook settings where they are others.

    They run at the scan intervals of the certificate's emulation, from rest at 50 %, without output limits; the steps move the
    source's output by about 8 % (`pidemu.records.standard.scale_of`).

    Parameters
    ----------
    c : Conversion
        The conversion.

    Returns
    -------
    StepResponses or None
        ``None`` where the certificate holds no emulation.
    """
    if c.certificate.scan_by_scan is None:
        return None
    scans = c.certificate.scan_by_scan.scan
    time, size = scale_of(c.source, scans[0])
    time = max(min(time, _MOST * min(scans)), 20 * max(scans))
    at = math.ceil(_BEFORE * time / max(scans)) * max(scans)
    shown: list[tuple[Who, Settings, float]] = [("source", c.source, scans[0]), ("target", c.settings, scans[1])]
    notes: list[str] = []
    book = c.textbook.settings
    if book is not None and _differ(book, c.settings):
        try:
            book.law(scans[1])
            shown.append(("textbook", book, scans[1]))
        except PidemuError as error:
            notes.append(f"the textbook settings are not shown: {error}")
    signals: tuple[Literal["setpoint", "measurement"], ...] = ("setpoint", "measurement")
    first, second = (tuple(_trace(c, one, (at, _AFTER * time), size, moves) for one in shown) for moves in signals)
    return StepResponses(at, size, first, second, tuple(notes))


def _differ(a: Settings, b: Settings) -> bool:
    return a.options != b.options or any(not math.isclose(v.value, b[n].value, rel_tol=1e-9) for n, v in a.items())


def _trace(
    c: Conversion,
    one: tuple[Who, Settings, float],
    when: tuple[float, float],
    size: float,
    moves: Literal["setpoint", "measurement"],
) -> Trace:
    who, settings, h = one
    times: Floats = np.arange(math.ceil(sum(when) / h), dtype=np.float64) * h
    moved = REST + np.where(times >= when[0] - 1e-6 * h, size, 0.0)
    still = np.full(times.size, REST)
    record = Record(sp=moved, pv=still) if moves == "setpoint" else Record(sp=still, pv=moved)
    action = acting_alike(c.settings, c.factor)[0 if who == "source" else 1]
    run = run_on(record, moves, settings, who, (h, h), action, UNLIMITED, REST, [])
    factor = abs(c.factor) if who == "source" else 1.0
    outputs: Floats = REST + factor * (run.playback.outputs - REST)
    return Trace(who, times, outputs)


def closed_loops(c: Conversion) -> ClosedLoops | None:
    """Return what both controllers do in a closed loop with the process, after a setpoint step and then a load step.

    They run at the scan intervals of the conversion; where none were given both at the shorter of those that
    `pidemu.simulation.simulate.scan_for` finds. In both loops the process is as the target sees it.

    Parameters
    ----------
    c : Conversion
        The conversion.

    Returns
    -------
    ClosedLoops or None
        ``None`` where no process was given.

    Raises
    ------
    ProcessError, ScanError
        A loop cannot be simulated.
    """
    process = c.process
    if process is None:
        return None
    from pidemu.analysis.figures import scan_for, settling_time
    from pidemu.simulation.simulate import simulate

    scale = abs(c.factor)
    seen = replace(process, gain=process.gain * scale)  # by the source: its output counts in other percent
    h = c.scan or (min(scan_for(c.source, seen), scan_for(c.settings, process)),) * 2
    shown = max(settling_time(c.source, seen, h[0]), settling_time(c.settings, process, h[1])) / 2
    shown = min(shown, _MOST_SCANS * min(h))
    first, then = 0.1 * shown, 1.1 * shown
    measurement, output = [], []
    sides: tuple[tuple[Who, Settings, float], ...] = (("source", c.source, scale), ("target", c.settings, 1.0))
    for (who, settings, factor), interval in zip(sides, h, strict=True):
        run = simulate(
            settings,
            replace(process, gain=process.gain * factor),
            interval,
            setpoint=(first, _STEP),
            load=(then, _STEP / factor),
            time=2.1 * shown,
            output_limits=UNLIMITED,
        )
        measurement.append(Trace(who, run.times, run.measurement))
        output.append(Trace(who, run.times, REST + factor * (run.output - REST)))
    return ClosedLoops(first, then, _STEP, h, tuple(measurement), tuple(output))
