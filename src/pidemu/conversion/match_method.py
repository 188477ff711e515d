"""What a conversion aims at: which match, and at which frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

from pidemu.errors import SettingError, suggest

Match = Literal["exact", "same-numbers", "low-frequency", "textbook", "frequency", "loop", "constrained"]
MATCHES: Final[tuple[Match, ...]] = get_args(Match)
"""Matches a user may ask for; which of them is the default, `pidemu.conversion.solver.solver` says."""

_UNITS: Final = {"rad/s": 1.0, "rad/min": 1 / 60, "rad/h": 1 / 3600, "mhz": 2e-3 * math.pi, "hz": 2 * math.pi}
"""Frequencies in rad/s."""


@dataclass(frozen=True, slots=True)
class Aim:
    """What a conversion aims at.

    Attributes
    ----------
    match : str or None
        The match asked for; ``None``: the default.
    frequency : float or None
        Where, for a match at a frequency [rad/s]; ``None``: at the crossover of the loop with the process.
    """

    match: Match | None = None
    frequency: float | None = None


def read_aim(text: str | None) -> Aim:
    """Read ``"textbook"``, ``"frequency"`` or ``"frequency:0.02rad/s"``.

    Raises
    ------
    SettingError
        There is no such match, or what stands behind the colon is not a frequency.

    Examples
    --------
    >>> read_aim("frequency:0.02rad/s")
    Aim(match='frequency', frequency=0.02)
    >>> round(read_aim("frequency: 10 mHz").frequency, 6)
    0.062832
    """
    if text is None:
        return Aim()
    if not isinstance(text, str):
        raise SettingError(f"match is {text!r}; it is a word such as 'textbook'")
    word, colon, rest = text.partition(":")
    found: Match | None = next((m for m in MATCHES if m == word.strip()), None)
    if found is None:
        near = suggest(word, MATCHES)
        raise SettingError(f"match is '{text}'; it is one of {', '.join(MATCHES)}, or frequency:0.02rad/s{near}")
    if not colon:
        return Aim(found)
    if found != "frequency":
        raise SettingError(f"match is '{text}'; only 'frequency' takes a number, such as frequency:0.02rad/s")
    return Aim(found, _frequency(rest.strip(), text))


def _frequency(rest: str, text: str) -> float:
    unit = next((u for u in _UNITS if rest.lower().endswith(u)), None)
    try:
        if unit is None:
            raise ValueError
        value = float(rest[: -len(unit)]) * _UNITS[unit]
    except ValueError:
        raise SettingError(
            f"match is '{text}'; write the frequency as a number with one of the units rad/s, rad/min, rad/h, Hz, mHz"
        ) from None
    if not (math.isfinite(value) and value > 0):
        raise SettingError(f"match is '{text}'; the frequency must be above 0")
    return value
