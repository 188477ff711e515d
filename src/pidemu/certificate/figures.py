"""The figures of a conversion in print, alike on the terminal and on the page."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pidemu.analysis.loop_figures import LoopComparison
from pidemu.certificate.models import EXACT, Band, Certificate, PathComparison
from pidemu.formatting import number
from pidemu.units import Role

if TYPE_CHECKING:
    from pidemu.settings.settings import Value

BAND_COLUMNS: Final = ("path", "band", "rad/s", "deviation", "gain", "phase")
"""Headings of `band_rows`."""
_LOOP_ROWS: Final = (
    ("gain margin", "gain_margin"),
    ("phase margin [deg]", "phase_margin"),
    ("delay margin [s]", "delay_margin"),
    ("crossover [rad/s]", "crossover"),
    ("Ms", "Ms"),
    ("Mt", "Mt"),
    ("IAE, load step of 1 % [% s]", "iae"),
)


def percent(deviation: float) -> str:
    """Return a relative deviation in percent, with two digits; ``none`` for one that is only rounding.

    An infinite one is ``not comparable``: the source has no response there, and the target has one.
    """
    if math.isinf(deviation):
        return "not comparable"
    if deviation < EXACT:
        return "none"
    return f"{number(100 * deviation, 2)} %" if deviation < 10 else "over 1000 %"


def decibels(band: Band) -> str:
    """Return the largest difference of gain; ``-`` where one of the two has no response."""
    return f"{band.gain_db:.2f} dB" if math.isfinite(band.gain_db) else "-"


def degrees(band: Band) -> str:
    """Return the largest difference of phase; ``-`` where one of the two has no response."""
    return f"{band.phase_deg:.1f} deg" if math.isfinite(band.phase_deg) else "-"


def unit_of(v: Value) -> str:
    """Return a dial's unit; nothing for a plain ratio."""
    return "" if v.unit == "1" else v.unit


def other_units(v: Value) -> str:
    """Return an integral, derivative or gain dial in the other usual unit, so that nobody has to convert in the head."""
    if v.off:
        return "off"
    if v.role is Role.INTEGRAL and "repeat" in v.unit:
        other = "repeat/min" if v.unit == "s/repeat" else "s/repeat"
    elif v.role is Role.INTEGRAL and v.unit in ("s", "min"):
        other = "repeat/min"
    elif v.role in (Role.DERIVATIVE, Role.INTEGRAL) and "min" in v.unit:
        other = v.unit.replace("min", "s")
    elif v.role is Role.GAIN and v.unit == "%":
        other = "%/%"
    else:
        return ""
    return f"= {number(v.to(other))} {other}"


def band_rows(c: Certificate) -> list[list[str]]:
    """Return how far the two are apart by path and band, under `BAND_COLUMNS`: first at the scans, where these were given."""
    if c.feedback_at_scan is None or c.setpoint_at_scan is None:
        return [*_rows("feedback (PV)", c.feedback), *_rows("setpoint", c.setpoint)]
    return [
        *_rows("feedback, at the scans", c.feedback_at_scan),
        *_rows("setpoint, at the scans", c.setpoint_at_scan),
        *_rows("feedback, continuous", c.feedback),
        *_rows("setpoint, continuous", c.setpoint),
    ]


def _rows(title: str, p: PathComparison) -> list[list[str]]:
    out = []
    for name, band in (("loop band", p.loop_band), ("full band", p.full_band)):
        ends = f"{band.low:.3g} to {band.high:.3g}"
        out.append([title, name, ends, percent(band.max_deviation), decibels(band), degrees(band)])
        title = ""
    return out


def emulation_line(c: Certificate) -> str:
    """Return what running both against each other gave; nothing where they were not."""
    e = c.scan_by_scan
    if e is None:
        return ""
    scans = f"{number(e.scan[0])} s" if e.scan[0] == e.scan[1] else f"{number(e.scan[0])} s and {number(e.scan[1])} s"
    taken = " (taken, as none was given)" if e.taken else ""
    before = ", before rounding" if c.dials else ""
    if e.is_exact:
        return f"run against each other every {scans}{taken} without limits{before}: the same output, scan by scan"
    rules = "; they compute by different scan rules" if e.scan[0] == e.scan[1] and not e.same_rules else ""
    still = "none" if e.is_exact_on_measurement else f"{number(e.on_measurement, 2)} %"
    return (
        f"run against each other every {scans}{taken} without limits{before}: outputs differ by up to "
        f"{number(e.largest, 2)} % of span ({e.segment}, at {number(e.largest_at)} s; the source moves by "
        f"{number(e.size, 3)} %), while the setpoint rests: {still}{rules}"
    )


def kick_line(c: Certificate) -> str:
    """Return what a setpoint step does to both outputs at once."""
    kick, what = c.setpoint_kick_at_scan, "setpoint kick, output step in the first scan"
    if kick is None:
        kick, what = c.setpoint_kick, "setpoint kick (output step per setpoint step, at once)"
    return f"{what}: {number(kick.source)} on the source, {number(kick.target)} on the target"


def rounding_line(c: Certificate, digits: int | None) -> str:
    """Return what rounding the dials did; nothing where none was rounded."""
    before = c.feedback_before_rounding
    if before is None:
        return ""
    how = ", ".join(d.name for d in c.dials if d.to_resolution)
    words = f"rounded to {digits} digit{'' if digits == 1 else 's'}" + (f", {how} to the dial's resolution" if how else "")
    if before.is_exact:
        off = c.headline.loop_band.max_deviation
        return f"{words}: {'without effect' if off < EXACT else f'within {percent(off)}'}"
    old, new = (percent(p.loop_band.max_deviation) for p in (before, c.headline))
    return f"{words}: {new} in the loop band, {'as before' if old == new else f'instead of {old}'}"


def _four_digits(x: float, instead: str = "-") -> str:
    return instead if math.isnan(x) else number(x, 4)


def loop_rows(loop: LoopComparison) -> list[list[str]]:
    """Return the closed loop's figures: name, before, after; an integral that was not settled in time is said to be open."""
    both = (loop.source, loop.target)
    instead = {"iae": "not computed: it takes too many scans"}
    rows = [[name, *(_four_digits(getattr(x, of), instead.get(of, "-")) for x in both)] for name, of in _LOOP_ROWS]
    return [*rows, ["stable", *("yes" if x.stable else "NO" for x in both)]]
