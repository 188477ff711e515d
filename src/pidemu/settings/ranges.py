"""Signal ranges with their units: how they are read, and how a signal in percent of one is written in the units of it.

Everything that goes between percent and the units that a controller computes in goes through here: levels, such as a setpoint, from
the low end on; changes, such as a step, a band or a rate, in proportion to the span; limits, which may be none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeVar

from pidemu.columns.functions import plain
from pidemu.errors import SettingError
from pidemu.excerpt import quoted
from pidemu.formatting import exactly
from pidemu.part import part
from pidemu.plausible import ENDS, SIGNAL, SPAN, number, plain_number, shown

if TYPE_CHECKING:
    from pidemu.arrays import Floats  # NumPy takes its time, and who reads a card needs none of it

Limits = tuple[float, float]
"""The low and the high limit of an output."""
NO_LIMIT: Final = SIGNAL
"""A limit of this size is none, whatever its unit: no signal reaches it, and cards write their largest float32 for it."""
UNLIMITED: Final[Limits] = (-NO_LIMIT, NO_LIMIT)
"""Output limits with which a controller runs as if it had none. They are finite, so that what grows without end stays a number."""

_Signal = TypeVar("_Signal", float, "Floats")

Which = Literal["pv_range", "op_range"]

RANGES: Final[tuple[Which, ...]] = ("pv_range", "op_range")
"""The ranges of measurement and output, by the names that state them."""

_NUMBER = r"[+-]?(?:\d+(?:\.\d+)?(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?|inf|nan)"
_ENDS: Final = re.compile(rf"\s*({_NUMBER})\s*(?:,|\.\.|\bto\b)\s*({_NUMBER})(?![\d.])\s*([^,=]*?)\s*", re.IGNORECASE | re.ASCII)
_SUCH: Final = 'low and high with a unit, such as "0,400 degC"'


@part(frozen=True, slots=True)
class SignalRange:
    """What 0 and 100 % of a signal are.

    Attributes
    ----------
    low, high : float
        The signal at 0 and at 100 % [`unit`].
    unit : str
        The unit, as it was written; empty where none was given.
    meaning : SignalRange or None
        What a raw scale stands for: 0 to 27648 counts can stand for 0 to 300 degC.

    Examples
    --------
    >>> read_range("0,27648 counts = 0..300 degC").meaning
    SignalRange(low=0.0, high=300.0, unit='degC', meaning=None)
    >>> read_range((0, 400, "degC")).argument
    '0,400 degC'
    """

    low: float
    high: float
    unit: str = ""
    meaning: SignalRange | None = None

    def __str__(self) -> str:
        own = f"{self.low:.10g} to {self.high:.10g} {self.unit}".rstrip()
        return own if self.meaning is None else f"{own} (which is {self.meaning})"

    @property
    def ends(self) -> tuple[float, float]:
        """Low and high end [`unit`]."""
        return self.low, self.high

    @property
    def span(self) -> float:
        """Width [`unit`]."""
        return self.high - self.low

    def from_percent(self, x: _Signal) -> _Signal:
        """Return the level at so many percent [`unit`]."""
        return x if self.ends == _FULL else self.low + x * (self.span / 100)

    def in_percent(self, level: _Signal) -> _Signal:
        """Return a level [`unit`] in percent."""
        return level if self.ends == _FULL else (level - self.low) * (100 / self.span)

    def change_from_percent(self, x: _Signal) -> _Signal:
        """Return a change by so many percent of the span, or a width or a rate [`unit`]."""
        return x * (self.span / 100)

    def change_in_percent(self, change: _Signal) -> _Signal:
        """Return a change, a width or a rate [`unit`] in percent of the span."""
        return change * (100 / self.span)

    def limits_from_percent(self, limits: Limits) -> Limits:
        """Return limits in percent as levels [`unit`]; what is no limit stays as it is."""
        low, high = (self.from_percent(x) if is_limit(x) else x for x in map(plain, limits))
        return low, high

    def limits_in_percent(self, limits: Limits) -> Limits:
        """Return limits [`unit`] in percent; what is no limit stays as it is."""
        low, high = (self.in_percent(x) if is_limit(x) else x for x in map(plain, limits))
        return low, high

    @property
    def argument(self) -> str:
        """The range as ``--pv-range`` and `read_range` take it."""
        own = f"{exactly(self.low)},{exactly(self.high)} {self.unit}".rstrip()
        return own if self.meaning is None else f"{own} = {self.meaning.argument}"

    def to_dict(self) -> dict[str, Any]:
        """Return the range as plain values, for JSON."""
        plain: dict[str, Any] = {"low": self.low, "high": self.high, "unit": self.unit}
        return plain if self.meaning is None else {**plain, "meaning": self.meaning.to_dict()}


class SignalRanges(NamedTuple):
    """The ranges of measurement and output; the setpoint has that of the measurement."""

    pv: SignalRange
    op: SignalRange


RangeGiven = SignalRange | str | Sequence[float | str]
"""What `read_range` reads."""
PERCENT: Final = SignalRange(0.0, 100.0, "%")
"""The range of a signal in percent."""
_FULL: Final = PERCENT.ends


def is_limit(x: float) -> bool:
    """Tell whether a limit is one: cards without an output limit write infinity for it, or the largest number that they can."""
    return abs(x) < NO_LIMIT


def are_limits(limits: Limits) -> bool:
    """Tell whether both limits are limits."""
    return all(map(is_limit, limits))


def infinite_where_none(limits: Limits) -> Limits:
    """Return limits with infinity for those that are none, for words and comparisons."""
    low, high = (x if is_limit(x) else math.copysign(math.inf, x) for x in limits)
    return low, high


def read_range(given: object) -> SignalRange:
    """Read a signal range.

    Parameters
    ----------
    given : SignalRange, str or sequence
        ``(0, 400, "degC")`` or ``(0, 400)``; as text ``"0,400 degC"``, ``"0..400"`` or, for a raw scale that stands for something,
        ``"0,27648 counts = 0..300 degC"``.

    Raises
    ------
    SettingError
        It is not a range: not two numbers, or the low end is not below the high end; or no signal has such a range.
    """
    if isinstance(given, SignalRange):
        return given
    found = _from_text(given) if isinstance(given, str) else _from_sequence(given)
    for stated in (found, found.meaning):
        if stated is None:
            continue
        if not (math.isfinite(stated.low) and math.isfinite(stated.high) and stated.low < stated.high):
            raise SettingError(f"{stated} is not a range; give two finite numbers, low before high")
        for x, quantity in ((stated.low, ENDS), (stated.high, ENDS), (stated.span, SPAN)):
            if not quantity.has(x):
                raise SettingError(f"{stated}: {quantity.refusal(f'{x:g}')}")
    return found


def _from_text(text: str) -> SignalRange:
    parts = [_ENDS.fullmatch(part) for part in text.split("=")]
    if None in parts or len(parts) > 2:
        raise SettingError(f"'{quoted(text)}' is not a range; write {_SUCH}")
    try:
        own, *meaning = (
            SignalRange(plain_number(m[1], words=True), plain_number(m[2], words=True), m[3]) for m in parts if m is not None
        )
    except ValueError as error:
        raise SettingError(f"{error}; write {_SUCH}") from None
    return replace(own, meaning=meaning[0]) if meaning else own


def _from_sequence(given: object) -> SignalRange:
    parts = list(given) if isinstance(given, Iterable) else []
    numbers, words = parts[:2], parts[2:]
    unit = words[0] if words else ""
    if len(numbers) == 2 and len(words) <= 1 and isinstance(unit, str):
        try:
            return SignalRange(number(numbers[0]), number(numbers[1]), unit.strip())
        except ValueError:
            pass
    raise SettingError(f"'{shown(given)}' is not a range; give {_SUCH} or (0, 400, \"degC\")")


def option_of(which: Which, *, target: bool = False) -> str:
    """Return the option of the command line that states a range: ``--pv-range``, ``--to-op-range``."""
    return f"--{'to-' if target else ''}{which.replace('_', '-')}"
