"""Dials rounded as they are typed: to a target's resolution, or to significant digits."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from typing import Final

from pidemu.certificate.models import Rounded
from pidemu.errors import SettingError
from pidemu.plausible import shown
from pidemu.settings.settings import Settings, Value, limits, off_values
from pidemu.units import Role, is_reciprocal, parse_unit

_NOTHING: Final = 1e-12
"""Relative change that is only that of floating point."""


def checked_digits(digits: object) -> int | None:
    """Return significant digits to round to; ``None`` for no rounding.

    Raises
    ------
    SettingError
        They are not a whole number from 1 to 17.
    """
    if digits is None:
        return None
    if not isinstance(digits, int) or isinstance(digits, bool) or not 1 <= digits <= 17:
        raise SettingError(f"digits is {shown(digits)}; it is a whole number from 1 to 17")
    return digits


def rounded(settings: Settings, digits: int, kept: Collection[str] = ()) -> tuple[Settings, tuple[Rounded, ...]]:
    """Round every dial to its resolution or, where the card states none, to significant digits; return what changed as well.

    Dials that are `kept`, as the user gave them, stay as they are.
    """
    names = {name.casefold() for name in kept}
    values = {name: value if name.casefold() in names else _round(value, digits) for name, value in settings.items()}
    dials = tuple(
        Rounded(n, settings[n].value, v.value, v.setting.resolution is not None)
        for n, v in values.items()
        if not math.isclose(v.value, settings[n].value, rel_tol=_NOTHING)
    )
    return replace(settings, values_by_name=values), dials


def rounding_error(settings: Settings) -> float:
    """Return the largest relative change that the resolution of the dials makes."""
    errors = [abs(_round(v, 17).value / v.value - 1) for v in settings.values() if v.setting.resolution and v.active and v.value]
    return max(errors, default=0.0)


def _round(value: Value, digits: int) -> Value:
    step = value.setting.resolution
    if not value.active or value.off or not math.isfinite(value.value):
        return value
    low, high = limits(value.setting)
    if step is None:
        new = min(max(float(f"{value.value:.{digits}g}"), low), high)
        return replace(value, value=new, typed=None) if _works(value, new) or not value.value else value
    new = _on_grid(value.value, step, low, high)
    infinite = new == 0 and is_reciprocal(value.role, parse_unit(value.unit))
    if infinite or new in off_values(value.setting) or (new == 0 and value.role is Role.GAIN):  # it is a term at work
        new = min(
            (x for x in (_on_grid(new - step, step, low, high), _on_grid(new + step, step, low, high)) if _works(value, x)),
            key=lambda x: abs(x - value.value),
            default=value.value,
        )
    return replace(value, value=new, typed=None)


def _on_grid(x: float, step: float, low: float, high: float) -> float:
    return float(f"{min(max(round(x / step) * step, low), high):.12g}")


def _works(value: Value, x: float) -> bool:
    return x != 0 and x not in off_values(value.setting)
