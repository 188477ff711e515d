"""Which dials an equation uses: by their role alone, or because a field names them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Equation, Setting

BY_ROLE: Final = (
    "gain", "multiplier", "integral", "derivative", "bias", "process-gain", "process-time", "process-delay", "closed-loop-time",
)  # fmt: skip
"""Roles that need no field to name them."""
_FIELDS: Final = (
    (("proportional", "weight"), "proportional-weight"),
    (("cascade", "proportional", "weight"), "proportional-weight"),
    (("derivative", "weight"), "derivative-weight"),
    (("derivative", "filter", "ratio"), "filter-ratio"),
    (("derivative", "filter", "gain"), "filter-gain"),
    (("derivative", "filter", "time"), "filter-time"),
    (("integral", "windup", "tracking_time"), "tracking-time"),
    (("integral", "windup", "fast_return", "high"), "windup-limit"),
    (("integral", "windup", "fast_return", "low"), "windup-limit"),
    (("integral", "limits", "low"), "integral-limit"),
    (("integral", "limits", "high"), "integral-limit"),
    (("integral", "deadband"), "deadband"),
    (("setpoint", "filter", "time"), "filter-time"),
    (("setpoint", "filter", "factor"), "filter-factor"),
    (("setpoint", "rate"), "setpoint-rate"),
    (("setpoint", "rate_down"), "setpoint-rate"),
    (("measurement", "filter", "time"), "filter-time"),
    (("measurement", "filter", "factor"), "filter-factor"),
    (("error", "filter", "time"), "filter-time"),
    (("error", "filter", "factor"), "filter-factor"),
    (("error", "band"), "deadband"),
    (("error", "gain"), "gap-gain"),
    (("error", "linearity"), "linearity"),
    (("feedforward", "gain"), "feedforward-gain"),
    (("output", "rate"), "output-rate"),
    (("output", "deadband"), "deadband"),
    (("output", "resolution"), "resolution"),
)
"""Fields that may name a setting, and what that setting must set."""


_WORDS: Final = {"tracking-time": ("Ti", "sqrt(Ti Td)"), "integral-limit": ("output",)}
"""Words that stand where a setting's name could."""


def references(equation: Equation) -> Iterator[tuple[tuple[str, ...], object, str]]:
    """Yield every field that may name a setting: its path, its value, and the role that the setting must have."""
    for path, role in _FIELDS:
        part: object = equation
        for key in path:
            part = getattr(part, key, None)
        if part is not None:
            yield tuple(key.replace("_", "-") for key in path), part, role


def named_settings(equation: Equation) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Yield every field that names a setting: its path, the name, and the role that the setting must have."""
    for path, name, role in references(equation):
        if isinstance(name, str) and name not in _WORDS.get(role, ()):
            yield path, name, role


def is_active(equation: Equation, name: str, setting: Setting) -> bool:
    """Tell whether an equation uses a dial: its term exists, or a field at work names it."""
    has_derivative, filt = equation.derivative.on != "none", equation.derivative.filter
    if setting.sets == "gain":
        return not (equation.form is Form.PARALLEL and equation.proportional.on == "none")
    if setting.sets in ("integral", "derivative"):
        return equation.integral.on != "none" if setting.sets == "integral" else has_derivative
    if setting.sets in BY_ROLE:
        return True
    without_derivative = filt is not None and filt.applies_to not in ("term", "lead-lag") and filt.time == name
    for path, value, role in references(equation):
        if value != name or role != setting.sets:
            continue
        of_the_integral = path[0] == "integral" and equation.integral.on == "none"
        of_the_derivative = path[0] == "derivative" and not has_derivative and not without_derivative
        if not of_the_integral and not of_the_derivative:
            return True
    return False
