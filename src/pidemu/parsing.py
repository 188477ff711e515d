"""What people write on a command line or in a cell of a table: assignments, pairs of numbers, times, steps."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final

from pidemu.columns.functions import isfinite
from pidemu.errors import SettingError, UnitError
from pidemu.excerpt import quoted
from pidemu.plausible import plain_number
from pidemu.settings.ranges import RANGES, read_range
from pidemu.units import Role, parse_quantity, to_canonical

_SEVERAL: Final = re.compile(r"[\s,;]\w+\s*=")
"""A value that another ``NAME=`` follows."""


def assignments(
    words: Iterable[str],
    what: str = "NAME=VALUE",
    such: str = 'GAIN=2 or "RESET=20 s/repeat"',
    between: str = "blanks, such as GAIN=2 RESET=20",
) -> dict[str, Any]:
    """Read ``NAME=VALUE`` words; `what` and `such` describe them in messages, and `between` what stands between them.

    A signal range, such as ``pv_range=0,400 degC``, is read; every other value stays a text.

    Raises
    ------
    SettingError
        A word has no ``=``, or several, a name comes twice, or a signal range is not one.
    """
    found: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.strip()
        if not equals or not name or not value.strip():
            raise SettingError(f"'{word}' is not {what}; write for example {such}")
        if _SEVERAL.search(value):
            raise SettingError(f"'{quoted(word.strip(), 200)}' is more than one setting; separate them by {between}")
        first = next((n for n in found if n.casefold() == name.casefold()), None)
        if first is not None:
            raise SettingError(f"{name} is given twice, {found[first]} and {value.strip()}; give it once")
        found[name] = value.strip()
    return {name: read_range(value) if name in RANGES else value for name, value in found.items()}


def pair(text: str) -> tuple[float, float]:
    """Read two numbers with a comma between, the lower one first, such as ``0,200``.

    Raises
    ------
    SettingError
        They are not two numbers, or the first is not the lower one.
    """
    try:
        low, high = (plain_number(x, words=True) for x in text.split(","))
    except ValueError:
        raise SettingError(f"'{quoted(text)}' is not two numbers such as 0,200") from None
    if not low < high:  # not a number compares false as well
        raise SettingError(f"'{quoted(text)}' is not low and high; write the lower number first, such as 0,100")
    return low, high


def seconds(text: str) -> float:
    """Read a time: seconds, or a number with a unit such as ``10 min`` [s].

    Raises
    ------
    SettingError
        It is not a time.
    """
    try:
        number, unit = parse_quantity(text.strip())
        return number if unit is None else to_canonical(Role.PROCESS_TIME, number, unit)
    except UnitError:
        raise SettingError(f"'{quoted(text)}' is not a time; write seconds, such as 0.5, or a unit too, such as 10 min") from None


def step(text: str) -> float | tuple[float, float]:
    """Read a step: its size [%], or when [s] and its size with a comma between.

    Raises
    ------
    SettingError
        It is neither.
    """
    when, comma, size = text.rpartition(",")
    try:
        found = (seconds(when), plain_number(size, words=True)) if comma else (0.0, plain_number(text, words=True))
        if not all(map(isfinite, found)):
            raise ValueError
    except (ValueError, SettingError):
        raise SettingError(
            f"'{quoted(text)}' is not a step; write its size in %, such as 5, or its time and size, such as 60,5"
        ) from None
    return found if comma else found[1]
