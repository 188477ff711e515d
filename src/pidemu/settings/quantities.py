"""Units that a signal range may be in: which quantity they measure, and how large they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, Literal

Kind = Literal["physical", "signal", "count", "unknown", "none"]


@dataclass(frozen=True, slots=True)
class Measure:
    """What a unit measures.

    Attributes
    ----------
    kind : str
        ``physical``; ``signal``: a standard signal, such as mA, which carries another quantity; ``count``: a scale without a
        unit, such as counts; ``unknown``: a word that is not in the table; ``none``: no unit.
    quantity : str
        The quantity; the word itself where it is unknown, empty where there is no unit.
    factor : Fraction
        One of this unit in the quantity's basic unit; of a temperature, its difference.
    zero : Fraction
        The zero of this unit in the quantity's basic unit: of degC, 273.15 K.
    """

    kind: Kind
    quantity: str
    factor: Fraction = Fraction(1)
    zero: Fraction = Fraction(0)

    @property
    def is_raw(self) -> bool:
        """Whether the numbers need not be those of the quantity that the signal carries."""
        return self.kind in ("signal", "count", "unknown")

    @property
    def is_quantity(self) -> bool:
        """Whether another range in the same unit is a range of the same quantity."""
        return self.kind in ("physical", "unknown")


_POUND: Final = Fraction("0.45359237")
_INCH: Final = Fraction("0.0254")
_GRAVITY: Final = Fraction("9.80665")
_GALLON: Final = Fraction("0.003785411784")  # of the United States

_Sizes = Mapping[str, int | str | Fraction]
_TIMES: Final[_Sizes] = {"s": 1, "min": 60, "h": 3600, "d": 86400}
_LENGTHS: Final[_Sizes] = {"m": 1, "cm": "0.01", "mm": "0.001", "um": "1e-6", "km": 1000, "in": _INCH, "ft": 12 * _INCH}
_MASSES: Final[_Sizes] = {"kg": 1, "g": "0.001", "mg": "1e-6", "t": 1000, "lb": _POUND, "klb": 1000 * _POUND}
_VOLUMES: Final[_Sizes] = {
    "m3": 1, "l": "0.001", "ml": "1e-6", "cm3": "1e-6", "gal": _GALLON, "ft3": (12 * _INCH) ** 3, "bbl": 42 * _GALLON,
}  # fmt: skip
_PSI: Final = _POUND * _GRAVITY / _INCH**2

_PHYSICAL: Final[dict[str, _Sizes]] = {
    "temperature": {"K": 1, "degC": 1, "degF": Fraction(5, 9), "degR": Fraction(5, 9)},
    "pressure": {
        "Pa": 1, "hPa": 100, "kPa": 1000, "MPa": "1e6", "mbar": 100, "bar": "1e5", "psi": _PSI, "atm": 101325,
        "kg/cm2": _GRAVITY * 10**4, "mmH2O": _GRAVITY, "cmH2O": 10 * _GRAVITY, "mH2O": 1000 * _GRAVITY,
        "inH2O": _GRAVITY * 1000 * _INCH, "mmHg": "133.322387415", "inHg": Fraction("133322.387415") * _INCH,
        "torr": Fraction(101325, 760),
    },
    "length": _LENGTHS,
    "mass": _MASSES,
    "volume": _VOLUMES,
    "time": _TIMES,
    "density": {"kg/m3": 1, "g/l": 1, "g/cm3": 1000, "kg/l": 1000, "lb/ft3": _POUND / (12 * _INCH) ** 3},
    "power": {"W": 1, "kW": 1000, "MW": "1e6"},
    "force": {"N": 1, "kN": 1000, "lbf": _POUND * _GRAVITY},
    "rotation": {"rpm": 1, "rps": 60},
    "frequency": {"Hz": 1, "kHz": 1000},
    "conductivity": {"S/m": 1, "mS/m": "0.001", "mS/cm": "0.1", "uS/cm": "1e-4"},
    "acidity": {"pH": 1},
    "angle": {"deg": 1},
    "concentration": {"ppm": 1, "ppb": "0.001"},
}  # fmt: skip
_ZEROS: Final = {"degC": Fraction("273.15"), "degF": Fraction("459.67") * Fraction(5, 9)}
_RATES: Final[dict[str, _Sizes]] = {"speed": _LENGTHS, "mass flow": _MASSES, "volume flow": _VOLUMES}
_SIGNALS: Final[dict[str, _Sizes]] = {
    "current": {"A": 1, "mA": "0.001"},
    "voltage": {"V": 1, "mV": "0.001"},
    "percent": {"%": 1},
}
_COUNTS: Final = (
    "count", "counts", "raw", "bit", "bits", "digit", "digits", "lsb", "adc", "dac", "code", "codes", "step", "steps", "pwm",
    "duty", "fraction", "ratio", "pu", "p.u.", "per unit", "1",
)  # fmt: skip
_ALIASES: Final = {
    "c": "degC", "celsius": "degC", "degcelsius": "degC", "f": "degF", "fahrenheit": "degF", "degfahrenheit": "degF", "kelvin": "K",
    "degk": "K", "barg": "bar", "bara": "bar", "psig": "psi", "psia": "psi", "kpag": "kPa", "kpaa": "kPa",
    "inwc": "inH2O", "mmwc": "mmH2O", "gpm": "gal/min", "cfm": "ft3/min", "lpm": "l/min", "lph": "l/h", "cmh": "m3/h", "tph": "t/h",
    "kgh": "kg/h", "pph": "lb/h", "fpm": "ft/min", "inch": "in", "inches": "in", "feet": "ft", "g/cc": "g/cm3", "kgf/cm2": "kg/cm2",
    "percent": "%", "rev/min": "rpm", "1/min": "rpm", "volt": "V", "volts": "V", "ampere": "A", "amps": "A",
}  # fmt: skip
_TIME_WORDS: Final = {"sec": "s", "second": "s", "minute": "min", "hr": "h", "hour": "h", "day": "d"}


def _table() -> dict[str, Measure]:
    found = {word: Measure("count", "count") for word in _COUNTS}
    for quantity, sizes in _PHYSICAL.items():
        found |= {
            name: Measure("physical", quantity, Fraction(size), _ZEROS.get(name, Fraction(0))) for name, size in sizes.items()
        }
    for quantity, sizes in _RATES.items():
        found |= {
            f"{name}/{time}": Measure("physical", quantity, Fraction(size) / Fraction(seconds))
            for name, size in sizes.items()
            for time, seconds in _TIMES.items()
        }
    for quantity, sizes in _SIGNALS.items():
        found |= {name: Measure("signal", quantity, Fraction(size)) for name, size in sizes.items()}
    return found


_TABLE: Final = _table()


def measure_of(unit: str) -> Measure:
    """Return what a unit measures: ``"degF"``, ``"kg/hr"``, ``"°C"``, ``"counts"``, ``"mA"``, or an empty text.

    Gauge and absolute pressures have the same unit: only spans are compared. A word that is not in the table is a quantity of its
    own; two ranges in the same such word are ranges of one quantity.

    Examples
    --------
    >>> measure_of("psig").quantity, measure_of("degF").factor, measure_of("counts").is_raw
    ('pressure', Fraction(5, 9), True)
    """
    word = _spelled(unit)
    if not word:
        return Measure("none", "")
    known = _TABLE.get(word)
    if known is None:
        folded = [name for name in _TABLE if name.casefold() == word.casefold()]
        known = _TABLE[folded[0]] if len(folded) == 1 else None
    return known or Measure("unknown", word.casefold())


def _spelled(unit: str) -> str:
    """Return a unit in the table's spelling, where it has an alias."""
    word = unit.strip().replace("°", "deg").replace("²", "2").replace("³", "3").replace("µ", "u").replace(" per ", "/")
    word = word.replace(" ", "") if word.casefold() != "per unit" else word
    over, slash, time = word.partition("/")
    word = f"{over}/{_TIME_WORDS.get(time.casefold(), time)}" if slash else word
    return _ALIASES.get(word.casefold(), word)
