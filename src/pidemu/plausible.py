"""Numbers as they enter: read once, and held against what a control loop can have.

A gain of 1e-308, a time of 1e300 s or a whole number of 5,000 digits is a slip, and what is computed from it leaves the range of
floating point. The ranges leave several powers of ten beyond what is known of any plant, and below what rounding leaves of a dial
that should be 0; within them everything can be computed.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal
from numbers import Real
from typing import Any, Final

from pidemu.columns.functions import as_written, isfinite
from pidemu.columns.traced import Traced
from pidemu.errors import PidemuError
from pidemu.excerpt import quoted
from pidemu.part import part

_PLAIN: Final = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WITH_COMMA: Final = re.compile(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?")
_WORDS: Final = re.compile(r"nan|[+-]?inf(?:inity)?", re.IGNORECASE)
_LONGEST: Final = 40
"""Characters of what was given that a message repeats."""


@part(frozen=True, slots=True)
class PlausibleSize:
    """How large the values of a quantity can be, apart from 0.

    Attributes
    ----------
    what : str
        The quantity, as a message names it.
    unit : str
        Its unit; empty for a ratio.
    smallest, largest : float
        Smallest and largest size [`unit`].
    """

    what: str
    unit: str
    smallest: float
    largest: float

    def has(self, x: float) -> bool:
        """Tell whether a number is 0 or of a size that the quantity can have."""
        return x == 0 or self.smallest <= abs(x) <= self.largest

    def refusal(self, words: str) -> str:
        """Return what is wrong with a number, which is given in words."""
        unit = f" {self.unit}" if self.unit else ""
        return f"{words} is not {self.what}, {self.smallest:g} to {self.largest:g}{unit} in size; check the number and its unit"


GAIN: Final = PlausibleSize("a gain that a loop has", "%/%", 1e-30, 1e12)
TIME: Final = PlausibleSize("a time that a loop has", "s", 1e-30, 1e15)
RATE: Final = PlausibleSize("a reset rate that a loop has", "1/s", 1e-30, 1e20)
LEVEL: Final = PlausibleSize("a signal or a rate that a loop has", "%", 0.0, 1e40)
RATIO: Final = PlausibleSize("a ratio that a filter has", "", 1e-15, 1e15)
WEIGHT: Final = PlausibleSize("a weight that a controller has", "", 0.0, 1e15)
ENDS: Final = PlausibleSize("the end of a signal's range", "", 0.0, 1e15)
SPAN: Final = PlausibleSize("the width of a signal's range", "", 1e-12, 1e15)
INTERVAL: Final = PlausibleSize("an interval at which a controller is executed", "s", 1e-9, 1e9)
PROCESS_TIME: Final = PlausibleSize("a time that a process has", "s", 1e-9, 1e9)
ROOT: Final = PlausibleSize("a pole or zero of a process", "rad/s", 1e-9, 1e9)
POLES: Final = 20
"""Poles that a process can have; a chain of more is a dead time."""
INTEGRATORS: Final = 4
"""Integrators that a process can have."""
SIGNAL: Final = 1e30
"""No signal is larger, whatever its unit: beyond this it counts as a bad one."""


def number(given: object) -> float:
    """Return a number that was given from Python: int, float, fraction, decimal or NumPy scalar; NaN and infinity, too.

    Raises
    ------
    ValueError
        It is none, or too large or too small to compute with; the message says so.
    """
    if isinstance(given, Traced):
        return given  # type: ignore[return-value]  # it stands for a number that was read
    if isinstance(given, bool) or not isinstance(given, Real | Decimal):
        raise ValueError(f"{shown(given)} is not a number")
    try:
        found = float(given)
    except OverflowError:
        raise ValueError(f"{shown(given)} is too large a number") from None
    except ValueError:  # a decimal that signals
        raise ValueError(f"{shown(given)} is not a number") from None
    if not found and given != 0:
        raise ValueError(f"{shown(given)} is too small a number")
    return found


def plain_number(text: str, *, words: bool = False) -> float:
    """Read a number in plain decimal notation, such as ``-1.5`` or ``2e-3``.

    Parameters
    ----------
    text : str
        The number; blanks around it do not count.
    words : bool
        Whether ``nan``, ``inf`` and ``-inf`` are numbers, too.

    Raises
    ------
    ValueError
        It is none, or larger or smaller than any number a computer has; the message quotes it, with the remedy.

    Examples
    --------
    >>> plain_number("-1.5e3")
    -1500.0
    >>> plain_number("1_0")
    Traceback (most recent call last):
        ...
    ValueError: '1_0' is not a number; write digits and a decimal point only, such as 10 or 1.5e-3
    """
    text = text.strip(" \t")
    traced = as_written(text)
    if traced is not None:
        return traced  # type: ignore[return-value]  # it stands for a number that is read
    if _PLAIN.fullmatch(text):
        value = float(text)
        if math.isinf(value):
            raise ValueError(f"'{quoted(text)}' is too large a number")
        if not value and re.search("[1-9]", text.casefold().partition("e")[0]):
            raise ValueError(f"'{quoted(text)}' is too small a number")
        return value
    if words and _WORDS.fullmatch(text):
        return float(text)
    if _WITH_COMMA.fullmatch(text):
        raise ValueError(f"'{quoted(text)}' has a comma; write a decimal point")
    try:
        float(text)
    except ValueError:
        raise ValueError(f"'{quoted(text)}' is not a number") from None
    raise ValueError(f"'{quoted(text)}' is not a number; write digits and a decimal point only, such as 10 or 1.5e-3")


def plausible(name: str, given: Any, quantity: PlausibleSize, error: type[PidemuError]) -> float:
    """Return a number that a quantity can have.

    Parameters
    ----------
    name : str
        What it is called where it was given.
    given : object
        What was given.
    quantity : PlausibleSize
        What it must be.
    error : type
        What is raised where it is not.
    """
    try:
        found = number(given)
    except ValueError as reason:
        remedy = f"{name} is {shown(given)}; give a number" if "is not" in str(reason) else f"{name}: {reason}"
        raise error(remedy) from None
    if not isfinite(found):
        raise error(f"{name} is {found:g}; give a finite number")
    if not quantity.has(found):
        raise error(f"{name}: {quantity.refusal(f'{found:g} {quantity.unit}'.rstrip())}")
    return found


def shown(given: object) -> str:
    """Return what was given in a few characters, whatever it is."""
    if isinstance(given, int) and given.bit_length() > 4 * _LONGEST:
        return f"a whole number of {int(given.bit_length() * math.log10(2)) + 1:,} digits"
    try:
        return quoted(repr(given), _LONGEST)
    except Exception:  # a stranger's class, or a fraction of numbers too long to print
        return f"a {type(given).__name__}"
