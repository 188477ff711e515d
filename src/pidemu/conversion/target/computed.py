"""Which dials of a card a conversion sets, and what stands there meanwhile."""

from __future__ import annotations

import math
from typing import Final

from pidemu.card.model.card_file import Equation, Setting
from pidemu.settings.settings import limits, off_values
from pidemu.units import Role

CORE: Final = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
"""Dials of the three terms."""
WEIGHTS: Final = (Role.PROPORTIONAL_WEIGHT, Role.DERIVATIVE_WEIGHT)
"""Dials of the setpoint weights."""


def is_computed(equation: Equation, name: str, role: Role) -> bool:
    """Tell whether a conversion sets a dial: a term's, the derivative's filter or a setpoint weight."""
    return role in CORE or is_settled_later(equation, name, role)


def is_settled_later(equation: Equation, name: str, role: Role) -> bool:
    """Tell whether a conversion sets a dial only where something depends on it."""
    filt = equation.derivative.filter
    return role in WEIGHTS or (filt is not None and name in (filt.ratio, filt.gain, filt.time))


def placeholder(setting: Setting) -> float:
    """Return a value at which a dial's term is at work, for where nothing depends on the number."""
    low, high = limits(setting)
    candidate = setting.default if setting.default is not None else 1.0
    if low <= candidate <= high and candidate not in off_values(setting) and (candidate or setting.sets == "derivative"):
        return candidate or min(1.0, high)
    return low if low > 0 else high if math.isfinite(high) else 1.0
