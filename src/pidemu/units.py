"""Dial quantities: how a number on a controller's dial becomes a canonical one, and back.

Canonical values (specs/equations.md, section 1):

=================== ======================================= =========
role of the dial    canonical quantity                      unit
=================== ======================================= =========
gain                proportional gain                       %/%
integral            reset rate ``1/Ti``, or ``ki``          1/s
derivative          ``Td``, or ``kd``                       s
all other times     the time                                s
levels              a signal: deadband, bias, limit         %
rates               change of a signal                      %/s
all others          the plain ratio                         1
=================== ======================================= =========

Unit conversion is exact rational arithmetic, rounded once, so that 4 repeats per minute are 15 s per repeat and not
15.000000000000002. A card that computes in engineering units has its levels and rates in those. Infinity is a value of the
integral time (no integral action); zero is its reset rate.

A dial may count in scans (``%/scan``, ``scan``): what that is per second depends on the scan interval. Engineering units of the
measurement may be degrees (``degC``, ``K``, ``degF``): differences of temperature, of which 9 degF are 5 degC.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from enum import StrEnum
from fractions import Fraction
from functools import cache, lru_cache, partial
from typing import Any, Final

from pidemu.columns.functions import each, is_traced, isfinite, isinf, isnan, plain, sign_of
from pidemu.errors import UnitError, suggest
from pidemu.excerpt import quoted
from pidemu.part import part
from pidemu.plausible import plain_number


class Dimension(StrEnum):
    """What kind of quantity a unit measures; the value is the word used in messages."""

    RATIO = "a plain ratio"
    PERCENT = "a percentage"
    PV_UNITS = "engineering units of the measurement"
    OP_PER_PV = "output engineering units per measurement engineering unit"
    PERCENT_PER_PV = "percent of output per measurement engineering unit"
    TIME = "a time"
    TIME_PER_REPEAT = "a time per repeat"
    REPEATS_PER_TIME = "repeats per time"
    PER_TIME = "a rate (1/time)"
    PERCENT_PER_TIME = "percent per time"
    UNITS_PER_TIME = "engineering units per time"
    FREQUENCY = "a frequency"


class Role(StrEnum):
    """What a setting sets."""

    GAIN = "gain"
    MULTIPLIER = "multiplier"
    INTEGRAL = "integral"
    DERIVATIVE = "derivative"
    FILTER_TIME = "filter-time"
    FILTER_RATIO = "filter-ratio"
    FILTER_GAIN = "filter-gain"
    PROPORTIONAL_WEIGHT = "proportional-weight"
    DERIVATIVE_WEIGHT = "derivative-weight"
    TRACKING_TIME = "tracking-time"
    FILTER_FACTOR = "filter-factor"
    INTEGRAL_LIMIT = "integral-limit"
    WINDUP_LIMIT = "windup-limit"
    DEADBAND = "deadband"
    GAP_GAIN = "gap-gain"
    LINEARITY = "linearity"
    FEEDFORWARD_GAIN = "feedforward-gain"
    BIAS = "bias"
    OUTPUT_RATE = "output-rate"
    SETPOINT_RATE = "setpoint-rate"
    RESOLUTION = "resolution"
    PROCESS_GAIN = "process-gain"
    PROCESS_TIME = "process-time"
    PROCESS_DELAY = "process-delay"
    CLOSED_LOOP_TIME = "closed-loop-time"


LEVELS: Final = (Role.INTEGRAL_LIMIT, Role.WINDUP_LIMIT, Role.DEADBAND, Role.BIAS, Role.RESOLUTION)
"""Roles whose canonical value is a signal's [%]."""
RATES: Final = (Role.OUTPUT_RATE, Role.SETPOINT_RATE)
"""Roles whose canonical value is a signal's rate of change [%/s]."""
OF_MEASUREMENT: Final = (Role.DEADBAND, Role.SETPOINT_RATE)
"""Levels and rates of the measurement; the others are the output's."""


@part(frozen=True, slots=True)
class Unit:
    """A unit of a dial.

    Attributes
    ----------
    name : str
        The spelling used in cards and in print.
    dimension : Dimension
        What it measures.
    factor : Fraction
        One of this unit in seconds, 1/s or plain ratio; where it counts in scans, at an interval of 1 s.
    scans : {-1, 0, 1}
        Power of the scan interval in it: 1 for a time in scans, -1 for what is per scan.
    degree : Fraction or None
        Size of its degree [K], where it measures a difference of temperature.
    """

    name: str
    dimension: Dimension
    factor: Fraction = Fraction(1)
    scans: int = 0
    degree: Fraction | None = None

    @property
    def meaning(self) -> str:
        """What it measures, in words."""
        if self.degree is None:
            return self.dimension.value
        return {
            Dimension.PV_UNITS: "a difference of temperature",
            Dimension.PERCENT_PER_PV: "percent of output per degree",
        }.get(self.dimension, "degrees per time")


@part(frozen=True, slots=True)
class Spans:
    """What a dial's unit may refer to: the widths of the signal ranges and the scan interval.

    Attributes
    ----------
    pv, op : float
        Span of the measurement and of the output [engineering units].
    scan : float or None
        Scan interval [s], where a dial counts in scans.
    degree : Fraction or None
        Size of the measurement's unit [K], where that is a known degree; otherwise a dial in degrees is taken to be in the
        measurement's own unit.
    """

    pv: float = 100.0
    op: float = 100.0
    scan: float | None = None
    degree: Fraction | None = None

    @property
    def ratio(self) -> Fraction:
        """Percent gain that one output unit per measurement unit amounts to [%/%]."""
        return Fraction(self.pv) / Fraction(self.op)

    def pv_in(self, unit: Unit) -> Fraction:
        """Span of the measurement, in the engineering unit that a dial's unit refers to."""
        degrees = 1 if self.degree is None or unit.degree is None else self.degree / unit.degree
        return Fraction(self.pv) * degrees


FULL: Final = Spans()
"""Spans of 100: percent."""


DEGREES: Final = {"degC": Fraction(1), "K": Fraction(1), "degF": Fraction(5, 9)}
"""Size of a degree [K]."""


def _table() -> dict[str, Unit]:
    seconds = {"ms": Fraction(1, 1000), "s": Fraction(1), "min": Fraction(60), "h": Fraction(3600), "scan": Fraction(1)}
    units = [
        Unit("1", Dimension.RATIO),
        Unit("%/%", Dimension.RATIO),
        Unit("%", Dimension.PERCENT, Fraction(1, 100)),
        Unit("eu", Dimension.PV_UNITS),
        Unit("eu/eu", Dimension.OP_PER_PV),
        Unit("%/eu", Dimension.PERCENT_PER_PV),
        Unit("Hz", Dimension.FREQUENCY, Fraction(2 * math.pi)),
    ]
    for name, size in DEGREES.items():
        units += [
            Unit(name, Dimension.PV_UNITS, degree=size),
            Unit(f"%/{name}", Dimension.PERCENT_PER_PV, degree=size),
        ]
    for name, size in seconds.items():
        up, down = (1, -1) if name == "scan" else (0, 0)
        units += [
            Unit(name, Dimension.TIME, size, up),
            Unit(f"{name}/repeat", Dimension.TIME_PER_REPEAT, size, up),
            Unit(f"repeat/{name}", Dimension.REPEATS_PER_TIME, 1 / size, down),
            Unit(f"1/{name}", Dimension.PER_TIME, 1 / size, down),
            Unit(f"%/{name}", Dimension.PERCENT_PER_TIME, 1 / size, down),
            Unit(f"eu/{name}", Dimension.UNITS_PER_TIME, 1 / size, down),
            *(Unit(f"{word}/{name}", Dimension.UNITS_PER_TIME, 1 / size, down, degree) for word, degree in DEGREES.items()),
        ]
    return {u.name: u for u in units}


UNITS: Final = _table()
"""Every unit a card may name, by its spelling."""

_WORDS: Final = {
    "ms": "ms", "msec": "ms", "millisecond": "ms", "s": "s", "sec": "s", "second": "s", "min": "min", "minute": "min",
    "mn": "min", "h": "h", "hr": "h", "hour": "h", "repeat": "repeat", "rep": "repeat", "rpt": "repeat", "": "1",
    "1": "1", "%": "%", "percent": "%", "eu": "eu", "hz": "Hz", "scan": "scan", "sample": "scan", "k": "K", "kelvin": "K",
    "degc": "degC", "°c": "degC", "celsius": "degC", "degf": "degF", "°f": "degF", "fahrenheit": "degF",
}  # fmt: skip
_WHOLE: Final = {"rpm": "repeat/min", "psi/in": "eu/eu", "psi/inch": "eu/eu"}
_NUMBER: Final = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?|inf(?:inity)?|nan))\s*(.*?)\s*$", re.I | re.A
)

_TIMELIKE: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT, Dimension.REPEATS_PER_TIME, Dimension.PER_TIME)
_ACCEPTED: Final[dict[Role, tuple[Dimension, ...]]] = {
    Role.GAIN: (
        Dimension.RATIO, Dimension.PERCENT, Dimension.PV_UNITS, Dimension.OP_PER_PV, Dimension.PERCENT_PER_PV,
    ),
    Role.INTEGRAL: _TIMELIKE,
    Role.DERIVATIVE: (Dimension.TIME,),
    Role.FILTER_TIME: (Dimension.TIME, Dimension.FREQUENCY),
    Role.TRACKING_TIME: (Dimension.TIME, Dimension.RATIO),
    Role.PROCESS_TIME: (Dimension.TIME,),
    Role.PROCESS_DELAY: (Dimension.TIME,),
    Role.CLOSED_LOOP_TIME: (Dimension.TIME,),
    **dict.fromkeys(LEVELS, (Dimension.PERCENT, Dimension.PV_UNITS, Dimension.RATIO)),
    **dict.fromkeys(RATES, (Dimension.PERCENT_PER_TIME, Dimension.UNITS_PER_TIME)),
}  # fmt: skip
_PLAIN: Final = (Dimension.RATIO, Dimension.PERCENT)
_INVERTED: Final = (Dimension.TIME, Dimension.TIME_PER_REPEAT)


_EXACT: Final = 2**53
"""Whole numbers up to here are floats without rounding, so that one operation with them rounds once."""


@cache
def parse_unit(text: str) -> Unit:
    """Return the unit a person wrote: ``"rep/min"``, ``"minutes per repeat"``, ``"sec"``, ``"%"``.

    Raises
    ------
    UnitError
        The unit is not known; the message suggests the nearest one.
    """
    spelled = re.sub(r"\s+per\s+", "/", text.strip().lower()).replace(" ", "")
    whole = _WHOLE.get(spelled)
    if whole is None:
        parts = [_WORDS.get(p, _WORDS.get(p.removesuffix("s"))) for p in spelled.split("/")]
        whole = "/".join(p or "?" for p in parts)
    unit = UNITS.get(whole)
    if unit is None:
        known = [u.name for u in UNITS.values() if u.degree is None and not u.scans]
        raise UnitError(
            f"unknown unit '{text.strip()}'{suggest(spelled, UNITS)}; known units: {', '.join(known)}; "
            f"also scan in place of a time, and {', '.join(DEGREES)} in place of eu"
        )
    return unit


def parse_quantity(text: str) -> tuple[float, Unit | None]:
    """Split ``"20 s/repeat"`` into its number and its unit (``None`` where no unit is written).

    Raises
    ------
    UnitError
        There is no number, it is too large or too small, a decimal comma is used, or the unit is not known.
    """
    match = _NUMBER.match(text)
    if match is None:
        raise UnitError(f"'{quoted(text)}' is not a number, nor a number with a unit such as \"20 s/repeat\"")
    number, unit = match.groups()
    if unit.startswith(","):
        raise UnitError(f"'{quoted(text)}' has a comma; write a decimal point")
    try:
        return plain_number(number, words=True), parse_unit(unit) if unit else None
    except ValueError as error:
        raise UnitError(str(error)) from None


def _constant(role: Role, unit: Unit, spans: Spans) -> Fraction:
    """Return the constant c of ``canonical = c x``, or of ``canonical = c/x`` where the dial is reciprocal."""
    if role is Role.GAIN:
        match unit.dimension:
            case Dimension.PERCENT:
                return Fraction(100)
            case Dimension.PV_UNITS:
                return spans.pv_in(unit)
            case Dimension.OP_PER_PV:
                return spans.ratio
            case Dimension.PERCENT_PER_PV:
                return spans.pv_in(unit) / 100
            case _:
                return Fraction(1)
    factor = _in_seconds(unit, spans)
    if role in LEVELS or role in RATES:
        per_time = factor if role in RATES else Fraction(1)
        span = spans.pv_in(unit) if role in OF_MEASUREMENT else Fraction(spans.op)
        in_units = unit.dimension in (Dimension.PV_UNITS, Dimension.UNITS_PER_TIME)
        return 100 / span * per_time if in_units else per_time
    return 1 / factor if is_reciprocal(role, unit) else factor


def _in_seconds(unit: Unit, spans: Spans) -> Fraction:
    """Return a unit's factor at the scan interval."""
    if not unit.scans:
        return unit.factor
    if spans.scan is None:
        raise UnitError(f"'{unit.name}' counts in scans, and the scan interval is not known; write it per second, or in seconds")
    return unit.factor * Fraction(spans.scan) ** unit.scans


def _inward(role: Role, x: Fraction, unit: Unit, spans: Spans) -> Fraction:
    c = _constant(role, unit, spans)
    return c / x if is_reciprocal(role, unit) else c * x


def _outward(role: Role, x: Fraction, unit: Unit, spans: Spans) -> Fraction:
    c = _constant(role, unit, spans)
    return c / x if is_reciprocal(role, unit) else x / c


def is_reciprocal(role: Role, unit: Unit) -> bool:
    """Tell whether a larger dial value means a smaller canonical one (proportional band, integral time)."""
    if role is Role.GAIN:
        return unit.dimension in (Dimension.PERCENT, Dimension.PV_UNITS)
    if role is Role.FILTER_TIME:
        return unit.dimension is Dimension.FREQUENCY
    return role is Role.INTEGRAL and unit.dimension in _INVERTED


def check_unit(role: Role, unit: Unit) -> None:
    """Refuse a unit that cannot measure what the dial sets.

    Raises
    ------
    UnitError
        The unit's dimension does not fit the role.
    """
    accepted = _ACCEPTED.get(role, _PLAIN)
    purpose = role.value.replace("-", " ")
    if unit.dimension not in accepted:
        usual = [u for u in UNITS.values() if u.dimension in accepted and not u.degree and not u.scans]
        names = [u.name for u in usual if not u.name.startswith(("ms", "h"))]
        raise UnitError(
            f"'{unit.name}' is {unit.meaning} and cannot set {purpose}; "
            f"use one of: {', '.join(n for n in names if '/ms' not in n and not n.endswith('/h'))}"
        )
    if unit.degree is not None and role not in (Role.GAIN, *OF_MEASUREMENT):
        other = unit.name.replace(unit.name.split("/")[0], "eu", 1)
        raise UnitError(f"'{unit.name}' is {unit.meaning}, and the {purpose} belongs to the output; use '{other}'")


def to_canonical(role: Role, value: float, unit: Unit, spans: Spans = FULL) -> float:
    """Return the canonical value of a dial (specs/equations.md, section 1).

    Parameters
    ----------
    role : Role
        What the dial sets.
    value : float
        The dial's value, in `unit`.
    unit : Unit
        The dial's unit.
    spans : Spans
        Spans of measurement and output, for units that refer to them, and the scan interval, for units that count in scans.

    Returns
    -------
    float
        Gain [%/%], reset rate [1/s], time [s] or ratio [-].

    Raises
    ------
    UnitError
        The unit does not fit the role, the value is not a number, or it counts in scans of unknown length.

    Examples
    --------
    >>> to_canonical(Role.GAIN, 20, UNITS["%"])  # Honeywell UDC2800 manual p. 77: PB 20 % is gain 5
    5.0
    >>> to_canonical(Role.INTEGRAL, 15, UNITS["s/repeat"]) == 1 / 15
    True
    """
    return _convert(role, value, unit, spans, inward=True)


def from_canonical(role: Role, value: float, unit: Unit, spans: Spans = FULL) -> float:
    """Return the dial value, in `unit`, of a canonical one; the inverse of `to_canonical`.

    Examples
    --------
    >>> from_canonical(Role.INTEGRAL, 1 / 15, UNITS["repeat/min"])
    4.0
    >>> from_canonical(Role.INTEGRAL, 0.0, UNITS["s/repeat"])
    inf
    """
    return _convert(role, value, unit, spans, inward=False)


def to_canonical_exactly(role: Role, value: Any, unit: Unit, spans: Spans) -> Any:
    """Return the canonical value of a finite dial without rounding, for a fraction or a `pidemu.law.exact.Exact`."""
    check_unit(role, unit)
    return _inward(role, value, unit, spans)


def from_canonical_exactly(role: Role, value: Any, unit: Unit, spans: Spans) -> Any:
    """Return the dial value of a canonical one without rounding; the inverse of `to_canonical_exactly`."""
    return _outward(role, value, unit, spans)


@lru_cache(maxsize=4096)
def _known_constant(role: Role, unit: Unit, pv: float, op: float, scan: float | None, degree: Fraction | None) -> Fraction:
    """Return `_constant`, which most dials of one card have in common."""
    return _constant(role, unit, Spans(pv, op, scan, degree))


def _convert(role: Role, value: float, unit: Unit, spans: Spans, *, inward: bool) -> float:
    check_unit(role, unit)
    value = plain(value) + 0.0  # no negative zero
    if isnan(value):
        raise UnitError("not a number (NaN)")
    inverted = is_reciprocal(role, unit)
    if isinf(value):
        return (0.0 if inverted else math.inf) * sign_of(value)
    if value == 0 and inverted:
        return math.inf
    if unit.scans and is_traced(spans.scan):
        return _at_any_scan(role, value, unit, spans, inward=inward)
    c = _known_constant(role, unit, spans.pv, spans.op, spans.scan if unit.scans else None, spans.degree)
    return _over(c, value) if inverted else _times(c if inward else 1 / c, value)


def _at_any_scan(role: Role, value: float, unit: Unit, spans: Spans, *, inward: bool) -> float:
    """Return what a dial that counts in scans converts to, at a traced scan interval."""
    c, twice = (_constant(role, unit, replace(spans, scan=h)) for h in (1.0, 2.0))
    grows, inverted = twice > c, is_reciprocal(role, unit)  # in proportion to the interval, or to its reciprocal
    if not inward and not inverted:
        c, grows = 1 / c, not grows

    def converted(x: float, h: float) -> float:
        scans, parts = h.as_integer_ratio() if grows else h.as_integer_ratio()[::-1]
        return (_quotient if inverted else _product)(c.numerator * scans, c.denominator * parts, x)

    found: float = each(converted, value, spans.scan)
    return found


def _times(c: Fraction, x: float) -> float:
    """Return a product, rounded once."""
    if c == 1:
        return x
    if c.denominator == 1 and c <= _EXACT:
        return x * float(c)
    if c.numerator == 1 and c.denominator <= _EXACT:
        return x / float(c.denominator)
    product: float = each(partial(_product, c.numerator, c.denominator), x)
    return product


def _over(c: Fraction, x: float) -> float:
    """Return a quotient, rounded once."""
    if c.denominator == 1 and c <= _EXACT:
        return float(c) / x
    quotient: float = each(partial(_quotient, c.numerator, c.denominator), x)
    return quotient


def _product(numerator: int, denominator: int, x: float) -> float:
    whole, parts = x.as_integer_ratio()
    return _divided(numerator * whole, denominator * parts, x)


def _quotient(numerator: int, denominator: int, x: float) -> float:
    whole, parts = x.as_integer_ratio()
    return _divided(numerator * parts, denominator * whole, x)


def _divided(over: int, under: int, x: float) -> float:
    """Return a quotient of whole numbers, which Python rounds once."""
    try:
        return over / under
    except OverflowError:
        return math.copysign(math.inf, x)


def convert_unit(role: Role, value: float, old: Unit, new: Unit, spans: Spans = FULL) -> float:
    """Express a dial value in another unit, rounding once.

    Examples
    --------
    >>> convert_unit(Role.INTEGRAL, 4, UNITS["repeat/min"], UNITS["s/repeat"])
    15.0
    >>> convert_unit(Role.DEADBAND, 9, UNITS["degF"], UNITS["degC"])
    5.0
    """
    value = plain(value) + 0.0  # no negative zero
    if spans.degree is None:  # two kinds of degree: the span is in one of them
        spans = replace(spans, degree=old.degree or new.degree)
    inverted = is_reciprocal(role, old), is_reciprocal(role, new)
    if not isfinite(value) or (value == 0 and inverted[0]):
        return from_canonical(role, to_canonical(role, value, old, spans), new, spans)
    check_unit(role, old)
    check_unit(role, new)
    c, d = _constant(role, old, spans), _constant(role, new, spans)
    match inverted:
        case (False, False):
            return _times(c / d, value)
        case (True, True):
            return _times(d / c, value)
        case (True, False):
            return _over(c / d, value)
    return math.inf if value == 0 else _over(d / c, value)
