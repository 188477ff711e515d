"""Typical settings of any card: a gain of 2, 90 s of integral time and 10 s of derivative time, on each card's own dials."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Final

from pidemu.card.load import Card, Variant, variants
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Equation, Setting, default_scan
from pidemu.checks.runs import working
from pidemu.conversion.target.computed import is_computed
from pidemu.errors import UndefinedError
from pidemu.settings.settings import Settings, limits, off_values
from pidemu.units import Dimension, Role, Spans, from_canonical, parse_unit

GAIN: Final = 2.0
"""Typical gain [%/%]."""
INTEGRAL_TIME: Final = 90.0
"""Typical integral time [s]."""
DERIVATIVE_TIME: Final = 10.0
"""Typical derivative time [s]."""
DIGITS: Final = 4
"""Significant digits of a typical dial: what a person would enter."""
_OTHERS: Final = {
    Role.MULTIPLIER: 1.0,
    Role.FILTER_TIME: 1.0,
    Role.FILTER_RATIO: 0.1,
    Role.FILTER_GAIN: 10.0,
    Role.PROPORTIONAL_WEIGHT: 1.0,
    Role.DERIVATIVE_WEIGHT: 1.0,
    Role.TRACKING_TIME: math.sqrt(INTEGRAL_TIME * DERIVATIVE_TIME),
    Role.INTEGRAL_LIMIT: 100.0,
    Role.WINDUP_LIMIT: 100.0,
}
"""What a dial is set to where the card has no default, in canonical units; the tracking time as Astrom and Hagglund propose."""


def typical_settings(card: Card, *, derivative: bool = True) -> Settings:
    """Return typical settings of a card, in the first choice of its options that makes a controller: mostly the card's defaults.

    All options are stated, so that nothing about them is left to be asked.

    Gain 2, integral time 90 s and derivative time 10 s; where the form is parallel, integral gain 2/90 1/s and derivative gain
    20 s. Other dials are at the card's defaults, or at something sensible where it has none. Dials are rounded to their resolution
    where the card states one, else to four digits. A value outside a dial's range gives way to the nearest inside, which
    `Settings.notes` then says.

    Parameters
    ----------
    card : Card
        The card.
    derivative : bool
        Whether the derivative acts; otherwise it is off.

    Raises
    ------
    SettingError
        No choice of the options makes a controller with such settings; a recursion for a process model has none.

    Examples
    --------
    >>> import pidemu
    >>> typical_settings(pidemu.load_card("fisher/provox"))
    <Settings fisher/provox: GAIN=2 %/%, RESET=0.6667 repeat/min, RATE=0.1667 min>
    >>> typical_settings(pidemu.load_card("emerson/deltav")).defaulted
    ()
    """
    if not has_terms(card):
        raise UndefinedError(f"{card.id} has no PID settings: it cancels the pole of a process model")
    for variant in variants(card):
        dials, notes = _dials(variant, derivative)
        with suppress(UndefinedError):
            settings = card.settings({**variant.chosen, **dials})
            settings.algorithm()
            return replace(settings, notes=(*settings.notes, *notes))
    raise UndefinedError(f"{card.id}: no choice of its options makes a controller with typical settings; give settings of your own")


def has_terms(card: Card) -> bool:
    """Whether a card has the terms of a PID controller, so that it can be converted from and to."""
    return card.data.form is not Form.DAHLIN


def held_dials(card: Card) -> dict[str, float]:
    """Return sensible values for the dials of a target that a conversion does not compute and that have no default.

    They are what `pidemu.convert` must be given, as `given`, lest it refuse.
    """
    variant = card.variant()
    return {
        name: _sensible(name, setting, variant.equation)
        for name, setting in _active(variant)
        if setting.default is None
        and Role(setting.sets) is not Role.MULTIPLIER
        and not is_computed(variant.equation, name, Role(setting.sets))
    }


def _active(variant: Variant) -> Iterator[tuple[str, Setting]]:
    return ((n, s) for n, s in variant.equation.settings.items() if n in variant.active)


def _dials(variant: Variant, derivative: bool) -> tuple[dict[str, float], list[str]]:
    """Return the dials that are not left at their defaults, and notes on those whose range was in the way."""
    found: dict[str, float] = {}
    notes: list[str] = []
    terms = _terms(variant.equation, derivative)
    for name, setting in _active(variant):
        role = Role(setting.sets)
        if role in terms:
            value = _term(role, terms[role], setting, variant.equation)
        elif setting.default is None:
            value = _sensible(name, setting, variant.equation)
        else:
            continue
        low, high = limits(setting)
        found[name] = value if value in off_values(setting) else min(max(value, low), high)
        if found[name] != value:
            notes.append(f"{name}: {value:g} {setting.unit} is outside {low:g} to {high:g}; {found[name]:g} is the nearest inside")
    return found, notes


def _terms(equation: Equation, derivative: bool) -> dict[Role, float]:
    """Return the dials of the three terms in canonical units, with the sign that makes the controller reverse acting."""
    sign = equation.action.gain_sign
    time = DERIVATIVE_TIME if derivative else 0.0
    if equation.form is Form.PARALLEL:
        gain = sign * GAIN
        return {Role.GAIN: gain, Role.INTEGRAL: gain / INTEGRAL_TIME, Role.DERIVATIVE: gain * time}
    return {Role.GAIN: sign * GAIN, Role.INTEGRAL: 1 / INTEGRAL_TIME, Role.DERIVATIVE: time}


def _term(role: Role, canonical: float, setting: Setting, equation: Equation) -> float:
    off = off_values(setting)
    if canonical == 0 and off:
        return off[0]
    value = _rounded(from_canonical(role, canonical, parse_unit(setting.unit), _spans(equation)))
    return value if setting.resolution is None else _rounded(round(value / setting.resolution) * setting.resolution)


def _sensible(name: str, setting: Setting, equation: Equation) -> float:
    """Return a sensible value for a dial without default, inside its range."""
    role, unit = Role(setting.sets), parse_unit(setting.unit)
    low, high = limits(setting)
    share_of_a_time = role is Role.TRACKING_TIME and unit.dimension is Dimension.RATIO
    if role not in _OTHERS or share_of_a_time:
        return working(low, high)
    own = equation.integral.limits
    below = -1.0 if own is not None and own.low == name else 1.0
    return min(max(below * _rounded(from_canonical(role, _OTHERS[role], unit, _spans(equation))), low), high)


def _spans(equation: Equation) -> Spans:
    """Return full spans, and the card's scan interval for dials that count in scans."""
    return Spans(scan=default_scan(equation))


def _rounded(x: float) -> float:
    return float(f"{x:.{DIGITS}g}")
