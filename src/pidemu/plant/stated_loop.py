"""What a line states of a loop's settings, before they stand on dials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from pidemu.plant.cells import ListCell
from pidemu.plant.layout import ListColumn
from pidemu.plant.numbers import CellNumber
from pidemu.plant.settings_units import UnitReading
from pidemu.plant.unit_words import Setting
from pidemu.settings.ranges import SignalRange
from pidemu.units import Role

ROLES: Final[Mapping[Setting, Role]] = {"gain": Role.GAIN, "integral": Role.INTEGRAL, "derivative": Role.DERIVATIVE}
"""What each of the three settings sets."""


@dataclass
class SettingCell:
    """A gain, an integral or a derivative as a line states it.

    Attributes
    ----------
    cell, column
        Where it stands.
    number : CellNumber or None
        What it holds; ``None`` where it is switched off.
    unit : UnitReading
        The unit that is stated.
    """

    cell: ListCell
    column: ListColumn
    number: CellNumber | None
    unit: UnitReading


@dataclass
class StatedLoop:
    """What a line states of a loop's settings, before they stand on dials.

    Attributes
    ----------
    options : dict
        Options that it states.
    dials : dict
        Dials that it states by name.
    cells : dict of str to SettingCell
        Gain, integral and derivative.
    pv_range, op_range : SignalRange or None
        The ranges.
    """

    options: dict[str, str]
    dials: dict[str, Any]
    cells: dict[Setting, SettingCell] = field(default_factory=dict)
    pv_range: SignalRange | None = None
    op_range: SignalRange | None = None
