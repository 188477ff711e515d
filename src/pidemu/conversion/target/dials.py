"""From canonical numbers to the dials of a target."""

from __future__ import annotations

import math
from dataclasses import replace

from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Setting
from pidemu.conversion.target.computed import WEIGHTS, is_settled_later, placeholder
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target
from pidemu.errors import SettingError
from pidemu.settings.settings import Settings, limits, off_values
from pidemu.units import Role, from_canonical, parse_unit


def settings_with(target: Target, n: Numbers) -> Settings:
    """Return a target's settings for canonical numbers.

    Raises
    ------
    SettingError
        A dial would leave its range, or a term that cannot be switched off would have to be.
    """
    dials = {**target.options, **_idle(target), **target.given, **_dials(target, n), **target.ranges}
    return replace(target.card.settings(dials), pace=target.pace, lag=target.lag).at_scan(target.scan)


def _idle(target: Target) -> dict[str, object]:
    """Return values for filter and weights that have no default, where nothing depends on them."""
    found: dict[str, object] = {}
    for name, setting in target.without_default():
        if is_settled_later(target.variant.equation, name, Role(setting.sets)):
            found[name] = 1.0 if Role(setting.sets) in WEIGHTS else placeholder(setting)
    return found


def _dials(target: Target, n: Numbers) -> dict[str, float]:
    """Return the dials that the numbers set, by name."""
    dials = {}
    for role, value in _by_role(target, n):
        dial = target.dial(role)
        if dial is not None:
            dials[dial[0]] = _in_reach(*dial, _to_dial(target, dial[0], dial[1], value))
    if n.Tf is not None and target.filter.setting is not None:
        dials.update(_filter_dial(target, target.filter.setting, n.Tf, target.filter_base(n)))
    return dials


def _by_role(target: Target, n: Numbers) -> list[tuple[Role, float]]:
    """Return what the dials of terms and weights stand for, in canonical units."""
    parallel = target.form is Form.PARALLEL
    scale = target.multiplier if n.multiplier is None else n.multiplier
    engineering = target.percent_per_unit
    per_gain = 1 / n.K if n.K and not parallel else 0.0
    rate = n.ki / (scale * engineering) if parallel else n.ki * per_gain
    time = n.kd / (scale * engineering) if parallel else n.kd * per_gain
    rate, time = rate * target.pace, time / target.pace
    sign = target.variant.equation.action.gain_sign  # a parallel form carries it on every gain, the others on one
    each = sign if parallel else 1.0
    found = [
        (Role.GAIN, sign * n.K / scale), (Role.INTEGRAL, each * rate), (Role.DERIVATIVE, each * time), (Role.MULTIPLIER, scale),
    ]  # fmt: skip
    found += [(role, weight) for role, weight in zip(WEIGHTS, (n.b, n.c), strict=True) if weight is not None]
    return found


def _in_reach(name: str, setting: Setting, value: float) -> float:
    """Return a dial's value, at the end of its range where only rounding keeps it outside.

    Raises
    ------
    SettingError
        It would have to be negative where the dial cannot be.
    """
    ends = limits(setting)
    if value < 0 <= ends[0]:
        why = "change the action instead" if setting.sets in ("gain", "multiplier") else "with these filters no positive one fits"
        raise SettingError(f"{name} would have to be negative, {value:.6g} {setting.unit}: {why}")
    return next((end for end in ends if math.isclose(value, end, rel_tol=1e-12)), value)


def _to_dial(target: Target, name: str, setting: Setting, value: float) -> float:
    """Return what stands on a dial for a canonical value.

    Raises
    ------
    SettingError
        A term that cannot be switched off would have to be, or the value would switch off one that is at work.
    """
    role = Role(setting.sets)
    off = off_values(setting)
    if value == 0 and role in (Role.INTEGRAL, Role.DERIVATIVE, Role.FILTER_TIME):
        if off:
            return off[0]
        if role is Role.INTEGRAL:
            raise SettingError(f"{name} cannot be switched off: the card states no off value")
    found = from_canonical(role, value, parse_unit(setting.unit), target.spans)
    if value and role in (Role.INTEGRAL, Role.DERIVATIVE) and found in off:
        low, high = limits(setting)
        raise SettingError(f"{name}: {found:g} {setting.unit} is outside {low:g} to {high:g} {setting.unit}; it switches it off")
    return found


def _filter_dial(target: Target, name: str, Tf: float, base: float) -> dict[str, float]:
    """Return the dial of the derivative's filter for a filter time [s]; none where there is no derivative that it goes with."""
    kind, setting = target.filter.kind, target.variant.equation.settings[name]
    if kind == "time":
        return {name: _in_reach(name, setting, _to_dial(target, name, setting, Tf / target.pace))}
    if base == 0:
        return {}
    if kind == "ratio":
        return {name: _in_reach(name, setting, Tf / base)}
    if Tf == 0 and off_values(setting):
        return {name: off_values(setting)[0]}
    if Tf == 0:
        raise SettingError(f"{name} would have to be infinite: this target always filters its derivative")
    return {name: _in_reach(name, setting, base / Tf)}
