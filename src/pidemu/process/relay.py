"""A relay in place of the controller: the oscillation that it makes, and what that tells of the process.

The relay switches exactly where the measurement crosses its hysteresis, and the process moves exactly in between
(`pidemu.process.motion`), so that the limit cycle is that of the continuous loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import ProcessError
from pidemu.plausible import INTERVAL, LEVEL, plausible
from pidemu.process.process import Process
from pidemu.process.relay_loop import SCANS, Cycle, Relay, RelayLoop, scanned_cycle

_HYSTERESIS: Final = 3.0
"""Standard deviations of the noise that the hysteresis is, where it is not given."""


@dataclass(frozen=True)
class RelayTest:
    """A relay experiment.

    Attributes
    ----------
    ultimate_gain : float
        ``4 d/(pi a)``, by the describing function of the relay (output per measurement): 6 to 19 % below the true one of usual
        processes, and lower with hysteresis, as the square wave is taken for its first harmonic.
    ultimate_period : float
        Period of the oscillation [s].
    amplitude : float
        Half of the measurement's swing, ``a``.
    high, low : float
        What the relay adds to the output at rest, as far as the limits leave it.
    hysteresis : float
        Error at which the relay switches.
    process : Process or None
        First order with dead time, or an integrator with dead time, that makes the same oscillation, from the exact relations in
        the time domain and the static gain; none where no such process does.
    time, output, measurement : ndarray of float, shape (n,)
        The last periods [s], both signals in deviations from rest.
    notes : tuple of str
        What should be known beside the numbers.
    """

    ultimate_gain: float
    ultimate_period: float
    amplitude: float
    high: float
    low: float
    hysteresis: float
    process: Process | None
    time: Floats = field(repr=False)
    output: Floats = field(repr=False)
    measurement: Floats = field(repr=False)
    notes: tuple[str, ...]

    @property
    def fitted_gain(self) -> float:
        """Ultimate gain of the fitted process, the dead time exact; NaN where there is none."""
        w = math.nan if self.process is None else self.process.w180
        return math.nan if self.process is None else float(1 / np.abs(self.process.response(w))) if math.isfinite(w) else math.inf

    @property
    def fitted_period(self) -> float:
        """Ultimate period of the fitted process [s]; NaN where there is none."""
        return math.nan if self.process is None else 2 * math.pi / self.process.w180

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the signals as plain values, the form of ``pidemu relay --json`` (specs/relay.schema.json)."""
        from pidemu.process.relay_document import plain

        return plain(self)


def relay_test(
    process: Process,
    amplitude: float,
    hysteresis: float | None = None,
    *,
    noise: float = 0.0,
    gain: float | None = None,
    output: float = 50.0,
    limits: tuple[float, float] | None = None,
    scan: float | None = None,
) -> RelayTest:
    """Put a relay in place of the controller, and return the oscillation that it makes.

    Parameters
    ----------
    process : Process
        The process, at rest.
    amplitude : float
        By how much the relay moves the output up and down.
    hysteresis : float, optional
        Error at which it switches; by default three standard deviations of the noise.
    noise : float
        Standard deviation of the measurement's noise, which decides the hysteresis; the experiment itself is free of noise.
    gain : float, optional
        Static gain that the fitted process is given, as a bump test tells it; by default the process's own.
    output : float
        Output at rest, which matters where there are limits.
    limits : tuple of float, optional
        Output limits of the controller.
    scan : float, optional
        Interval at which the relay looks [s]; by default it always does.

    Raises
    ------
    ProcessError
        The process has no static gain or no more than one integrator, the relay never switches or switches without end, or
        the oscillation does not become even.

    Examples
    --------
    >>> found = relay_test(Process.from_lags(1, [20], delay=5), amplitude=5)
    >>> print(f"{found.ultimate_gain:.4f} {found.ultimate_period:.3f} {found.process}")
    5.7561 17.993 1 exp(-5 s)/(20 s + 1)
    """
    relay = _relay(process, amplitude, hysteresis, noise, output, limits)
    notes = list(relay.notes)
    if scan is None:
        cycle = RelayLoop(process, relay).cycle()
    else:
        cycle = scanned_cycle(process, relay, plausible("scan interval", scan, INTERVAL, ProcessError))
        notes.append(f"the relay looks every {scan:g} s: period and swing are averages over {SCANS} periods, as seen at its scans")
    model = process_of(cycle, relay, process if gain is None else replace(process, gain=gain))
    if model is None:
        notes.append("no process of first order with dead time makes this oscillation with this static gain")
    return RelayTest(
        ultimate_gain=2 * (relay.high - relay.low) / (math.pi * cycle.swing / 2),
        ultimate_period=cycle.period,
        amplitude=cycle.swing / 2,
        high=relay.high,
        low=relay.low,
        hysteresis=relay.hysteresis,
        process=model,
        time=cycle.time,
        output=cycle.output,
        measurement=cycle.measurement,
        notes=tuple(notes),
    )


def _relay(
    process: Process, amplitude: float, hysteresis: float | None, noise: float, output: float, limits: tuple[float, float] | None
) -> Relay:
    d = plausible("amplitude", amplitude, LEVEL, ProcessError)
    sigma = plausible("noise", noise, LEVEL, ProcessError)
    wide = _HYSTERESIS * sigma if hysteresis is None else plausible("hysteresis", hysteresis, LEVEL, ProcessError)
    rest = plausible("output", output, LEVEL, ProcessError)
    for name, value, least in (("amplitude", d, 0.0), ("noise", sigma, -1.0), ("hysteresis", wide, -1.0)):
        if not value > least or value < 0:
            raise ProcessError(f"{name} is {value:g}; give a number above zero" + ("" if name == "amplitude" else ", or 0"))
    notes = []
    high, low = d, -d
    if limits is not None:
        bottom, top = (plausible("an output limit", x, LEVEL, ProcessError) for x in limits)
        high, low = min(d, top - rest), max(-d, bottom - rest)
        if not low < 0 < high:
            raise ProcessError(
                f"an output of {rest:g} leaves the relay no room between the limits {bottom:g} and {top:g}; let it rest between"
            )
        if (high, low) != (d, -d):
            notes.append(f"an output limit cuts the relay: it adds {high:+g} and {low:+g}: the oscillation is not symmetric")
    if hysteresis is None and sigma:
        notes.append(f"hysteresis {wide:g}: {_HYSTERESIS:g} standard deviations of the noise")
    if 0 in process.zeros:
        raise ProcessError(f"{process} has a zero at 0, so that no output keeps its measurement away: it has no static gain")
    if process.is_stable and abs(process.gain) * min(high, -low) <= wide:
        least = min(high, -low)
        raise ProcessError(
            f"the relay would not switch: its {least:g} moves the measurement by {abs(process.gain) * least:g} at most, and the "
            f"hysteresis is {wide:g}; give a larger amplitude"
        )
    return Relay(high, low, wide, process.feedback_sign, tuple(notes))


def process_of(cycle: Cycle, relay: Relay, known: Process) -> Process | None:
    """Return the process of first order, or the integrator, with dead time that oscillates like this.

    With the static gain K > 0, levels ``h`` and ``-l`` of the relay, hysteresis ``e``, extremes ``t`` and ``-b``: after a switch
    the measurement goes on for the dead time L towards the old level, ``exp(-L/T) = (K (h + l) - t - b)/(K (h + l) - 2 e)``, and
    then needs ``T ln((K h + b)/(K h - e))`` to the upper threshold, ``T ln((K l + t)/(K l - e))`` to the lower one.
    """
    high, low, e = relay.high, -relay.low, relay.hysteresis
    if known.integrators == 1:
        gain = cycle.swing * (1 / high + 1 / low) / cycle.period
        delay = (cycle.swing - 2 * e) / (gain * (high + low))
        return Process.from_lags(relay.sign * gain, integrators=1, delay=max(0.0, delay), unit=known.unit)
    K = abs(known.gain)
    swing = K * (high + low)
    if not known.is_stable or not 2 * e <= cycle.swing * (1 + 1e-9) < swing or min(K * high, K * low) <= e:
        return None
    waiting = max(0.0, math.log((swing - 2 * e) / (swing - cycle.swing)))
    moving = math.log((K * high - cycle.bottom) / (K * high - e)) + math.log((K * low + cycle.top) / (K * low - e))
    lag = cycle.period / (moving + 2 * waiting)
    return Process.from_lags(known.gain, [lag], delay=lag * waiting, unit=known.unit)
