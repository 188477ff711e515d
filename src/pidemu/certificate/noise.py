"""What measurement noise does to the output before and after a conversion, and what would keep it as it was.

The noise gain is the largest move of the output that one measurement which is off by 1 % makes, at the scan interval: of a
derivative with a first-order filter ``kp + kd/(Tf + h)`` with the backward rule, and the integral's share of that scan (the impulse
response of specs/equations.md, section 4). Without a scan interval it is the gain at high frequencies, infinite for a derivative
without filter; what is above the corner of a filter that lets nothing through at infinite frequency.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.certificate.figures import unit_of
from pidemu.errors import PidemuError
from pidemu.formatting import number
from pidemu.law.law import Law
from pidemu.settings.settings import Settings, Value, limits
from pidemu.units import Role

MORE: Final = 1.25
"""A rise of the noise gain from which it is stated, with or without derivative."""
_SAME: Final = 1.02
"""Noise gains nearer than this are the same."""
_ROUNDED: Final = 0.99
"""Filter times nearer than this differ by rounding."""
_FILTERS: Final = (Role.FILTER_RATIO, Role.FILTER_TIME, Role.FILTER_GAIN)
_SAMPLES: Final = 512
"""Samples of the impulse response in which its largest is looked for."""


@dataclass(frozen=True, slots=True)
class NoiseChange:
    """What noise does to the output, on the source and on the target.

    Attributes
    ----------
    source, target : float
        Noise gains [%/%], the source's with the factor of new ranges; infinite for a derivative without filter and scan interval.
    at_old_scan : float or None
        The target's at the source's scan interval, where its own is shorter.
    dial : Value or None
        The target's filter dial with the value that keeps the noise gain as it was, where there is one.
    text : str
        One sentence, with the alternative; empty where there is nothing to say.
    """

    source: float
    target: float
    at_old_scan: float | None
    dial: Value | None
    text: str

    @property
    def ratio(self) -> float:
        """The target's noise gain over the source's; 1 where both are infinite."""
        if self.source == self.target:
            return 1.0
        return self.target / self.source if self.source else math.inf


def noise_gain(settings: Settings, scan: float | None = None) -> float:
    """Return the largest move of the output that one measurement which is off by 1 % makes [%/%].

    Parameters
    ----------
    settings : Settings
        The controller.
    scan : float, optional
        Scan interval [s]; without it the gain of the continuous law at high frequencies: at infinite frequency or, where a filter
        lets nothing through there, the largest above the corner of the fastest filter.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("emerson/deltav").settings(GAIN=2.5, RESET=30, RATE=4.32, ALPHA=0.1111, FORM="Series")
    >>> round(noise_gain(s, 0.2), 1)
    18.5
    """
    return noise_gain_of(settings.law(scan))


def noise_gain_of(law: Law) -> float:
    """Return the noise gain of a law; see `noise_gain`."""
    if law.scan is not None:
        return float(np.max(np.abs(law.impulse(_SAMPLES))))
    return abs(law.kick("feedback")) or _beyond_the_corner(law)


def _beyond_the_corner(law: Law) -> float:
    """Return the largest gain above the corner of the fastest filter; 0 where there is none."""
    a = law.algorithm
    times = [
        a.Tf if a.has_signal_filter or a.has_term_filter else 0.0,
        *(f.seconds for f in (a.measurement.filter, a.error.filter) if f is not None),
    ]
    fastest = min((t for t in times if t), default=0.0)
    return float(np.abs(law.response(np.geomspace(1, 1e3, 301) / fastest)).max()) if fastest else 0.0


def noise_change(source: Settings, target: Settings, scans: tuple[float, float] | None = None, factor: float = 1.0) -> NoiseChange:
    """Return what a conversion does to the noise on the output.

    There is a sentence where the target differentiates and scans faster, or has a shorter filter, and wherever the noise gain rises
    by more than 25 %.

    Parameters
    ----------
    source, target : Settings
        The two controllers.
    scans : tuple of float, optional
        Their scan intervals [s]; without them the continuous laws are compared.
    factor : float
        What the source's gain was multiplied by for new ranges.
    """
    h_source, h_target = scans or (None, None)
    before = noise_gain(source, h_source) * abs(factor)
    after = noise_gain(target, h_target)
    faster = h_source is not None and h_target is not None and h_target < h_source
    derivative = bool(target.algorithm().kd)
    shorter = derivative and _filter_time(target, h_target) < _ROUNDED * _filter_time(source, h_source)
    rises = after > MORE * before
    if not (rises or (derivative and (faster or shorter))):
        return NoiseChange(before, after, None, None, "")
    worse = after > _SAME * before
    at_old = noise_gain(target, h_source) if faster else None
    dial = _kept_by(target, h_target, before) if worse and derivative else None
    reasons = [*(["it scans faster"] if faster else []), *(["its filter is shorter"] if shorter else [])]
    text = _gains(before, after, reasons if worse else [])
    if worse:
        text += f"; {_alternative(target, h_source, before, at_old, dial)}"
    return NoiseChange(before, after, at_old, dial, text)


def _gains(before: float, after: float, reasons: list[str]) -> str:
    if math.isinf(after):
        return f"measurement noise: the new controller's derivative has no filter; the old one's noise gain is {_digits(before)}"
    because = f", as {' and '.join(reasons)}" if reasons else ""
    return (
        f"measurement noise: one measurement that is 1 % off moves the old controller's output by {_digits(before)} %, the new "
        f"one's by {_digits(after)} %{because}"
    )


def _alternative(target: Settings, h_source: float | None, before: float, at_old: float | None, dial: Value | None) -> str:
    """Return what would keep the noise as it was, in words."""
    keeps, also = [], ""
    if dial is not None:
        unit = f" {unit_of(dial)}" if unit_of(dial) else ""
        keeps.append(f"with {dial.name} {number(dial.value)}{unit}{_phase_lost(target, dial)}")
    if at_old is not None and h_source is not None:
        old = f"at the old scan interval of {number(h_source)} s"
        if at_old <= _SAME * before:
            keeps.append(old)
        else:
            also = f"{old} it would be {_digits(at_old)} %"
    kept = f"{' or '.join(keeps)} it would stay as it was" if keeps else ""
    return "; ".join(x for x in (kept, also) if x) or "a filter on the measurement before the new controller would keep it down"


def _phase_lost(target: Settings, dial: Value) -> str:
    """Return what a longer filter costs where a loop's crossover usually lies, ``2 m0/m1``."""
    m0, m1, _ = target.law().moments()
    if not m0 * m1:
        return ""
    w = abs(2 * m0 / m1)
    before, after = (complex(s.law().response(w)) for s in (target, target.changed({dial.name: dial.value})))
    lost = math.degrees(cmath.phase(before / after))
    return f" ({_digits(lost)} degrees of phase less at {number(w, 3)} rad/s)" if lost >= 0.5 else ""


def _digits(x: float) -> str:
    return "infinite" if math.isinf(x) else number(x, 3)


def _filter_time(settings: Settings, h: float | None) -> float:
    """Return the filter times that the measurement passes on its way through the derivative [s]."""
    a = settings.algorithm(scan=h)
    before = [lag.seconds if h is None else lag.at(h) for lag in (a.measurement.filter, a.error.filter) if lag is not None]
    return float(a.Tf + sum(before))


def _kept_by(target: Settings, h: float | None, wanted: float) -> Value | None:
    """Return the filter dial with the value, in two or three digits, at which the noise gain is no more than wanted.

    The other dials stay.
    """
    for role in _FILTERS:
        dial = target.by_role(role)
        if dial is None or dial.setting.scope == "module":
            continue
        found = _solved(target, dial, lambda s: noise_gain(s, h) - wanted)
        if found is not None:
            return found
    return None


def _solved(target: Settings, dial: Value, excess: Callable[[Settings], float]) -> Value | None:
    """Return a dial with the value nearest to its own at which nothing is in excess; ``None`` where there is none in its range."""
    more = -1.0 if dial.role is Role.FILTER_GAIN else 1.0  # a larger gain is a shorter filter
    low, high = limits(dial.setting)
    start = dial.value or (1e-3 if dial.role is Role.FILTER_RATIO else 1.0)
    try:
        a, b = start, start
        for _ in range(40):
            b = min(max(a * 1.3**more, low), high)
            if excess(target.changed({dial.name: b})) <= 0:
                break
            if b == a:
                return None
            a = b
        else:
            return None
        for _ in range(40):
            middle = (a + b) / 2
            a, b = (a, middle) if excess(target.changed({dial.name: middle})) <= 0 else (middle, b)
        value = _rounded(b, more)
        return target.changed({dial.name: min(max(value, low), high)})[dial.name]
    except PidemuError:
        return None


def _rounded(x: float, direction: float) -> float:
    """Return `x` in two digits, rounded towards the longer filter."""
    step = 10.0 ** (math.floor(math.log10(abs(x))) - 1)
    return float(f"{(math.ceil if direction > 0 else math.floor)(x / step - 1e-9 * direction) * step:.6g}")
