"""Dials rounded to a target's resolution."""

from __future__ import annotations

from dataclasses import replace

from pidemu.certificate.models import Rounded
from pidemu.settings import Settings, Value, limits, off_values
from pidemu.units import Role, is_reciprocal, parse_unit


def rounded(settings: Settings) -> tuple[Settings, tuple[Rounded, ...]]:
    """Round every dial that has a resolution."""
    values = {name: _round(value) for name, value in settings.items()}
    dials = tuple(Rounded(n, settings[n].value, v.value) for n, v in values.items() if v.value != settings[n].value)
    return replace(settings, values_by_name=values), dials


def _round(value: Value) -> Value:
    step = value.setting.resolution
    if step is None or not value.active or value.off:
        return value
    low, high = limits(value.setting)
    new = _on_grid(value.value, step, low, high)
    infinite = new == 0 and is_reciprocal(value.role, parse_unit(value.unit))
    if infinite or new in off_values(value.setting) or (new == 0 and value.role is Role.GAIN):  # it is a term at work
        new = min(
            (x for x in (_on_grid(new - step, step, low, high), _on_grid(new + step, step, low, high)) if _works(value, x)),
            key=lambda x: abs(x - value.value),
            default=value.value,
        )
    return replace(value, value=new)


def _on_grid(x: float, step: float, low: float, high: float) -> float:
    return float(f"{min(max(round(x / step) * step, low), high):.12g}")


def _works(value: Value, x: float) -> bool:
    return x != 0 and x not in off_values(value.setting)
