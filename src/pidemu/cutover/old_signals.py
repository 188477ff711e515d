"""Setpoint, measurement and output at the cut-over: as the old controller shows them, and as the new one does."""

from __future__ import annotations

from math import isfinite
from typing import Final

from pidemu.errors import ScanError
from pidemu.formatting import number
from pidemu.settings.range_relation import in_target_units
from pidemu.settings.ranges import PERCENT, Limits, SignalRange, is_limit
from pidemu.settings.settings import Settings

Signals = tuple[float, float, float]
"""Setpoint, measurement and output."""
_NAMES: Final = ("setpoint", "measurement", "output")
_BEYOND: Final = 10.0
"""How far outside its range a signal can lie [% of span]: a transmitter saturates sooner."""


def as_the_target_shows(source: Settings, target: Settings, signals: Signals) -> tuple[Signals, str]:
    """Return the signals in the target's units, with a sentence where they are other numbers than the source's.

    Parameters
    ----------
    source, target : Settings
        The settings of both, with their ranges.
    signals : tuple of float
        Setpoint, measurement and output as the source shows them [units of its ranges; %, where there are none].

    Raises
    ------
    ScanError
        A signal is outside the source's range.
    SettingError
        One range is of a gauge pressure and the other one of an absolute pressure.
    """
    old = (source.pv_range, source.pv_range, source.op_range)
    new = (target.pv_range, target.pv_range, target.op_range)
    if not all(isfinite(x) for x in signals):
        return signals, ""  # which the plan refuses
    for name, x, given in list(zip(_NAMES, signals, old, strict=True))[:2]:  # the output is held against its limits
        if given is not None or source.equation.signals == "percent":
            _check(name, x, given)
    sp, pv, op = (in_target_units(x, a, b) for x, a, b in zip(signals, old, new, strict=True))
    if (sp, pv, op) == tuple(signals):
        return signals, ""
    shown = ", ".join(
        f"{name} {_text(x, a)} is {_text(y, b)}"
        for name, x, y, a, b in zip(_NAMES, signals, (sp, pv, op), old, new, strict=True)
        if x != y
    )
    return (sp, pv, op), f"on the new controller, {shown}"


def limits_in_signal_units(percent: Limits, given: SignalRange | None) -> Limits:
    """Return output limits in percent in the units of a range; as they are where none is given."""
    low, high = (in_target_units(x, PERCENT, given) if is_limit(x) else x for x in percent)
    return low, high


def _check(name: str, x: float, given: SignalRange | None) -> None:
    part = round(x if given is None else given.in_percent(x), 9)
    if not -_BEYOND <= part <= 100 + _BEYOND:
        raise ScanError(
            f"the {name} {_text(x, given)} is outside the old controller's range, {given or PERCENT}; give the signals at the "
            "cut-over as the old controller shows them"
        )


def _text(x: float, given: SignalRange | None) -> str:
    unit = "%" if given is None else given.unit
    return f"{number(x)} {unit}".rstrip()
