"""Two controllers with their own numbers brought to percent, to be held side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pidemu.algorithm.model import Algorithm
from pidemu.settings.ranges import SignalRange, infinite_where_none
from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class ScaledController:
    """One of two controllers.

    Attributes
    ----------
    name : str
        The card's id; ``the source`` and ``the target`` where both have the same.
    settings : Settings
        Its settings.
    scan : float
        Scan interval [s].
    own : Algorithm
        The algorithm at that interval, in the units that the card computes in.
    """

    name: str
    settings: Settings
    scan: float
    own: Algorithm

    @property
    def engineering(self) -> bool:
        """Whether the card computes in engineering units."""
        return self.settings.equation.signals == "engineering"

    @property
    def pv(self) -> SignalRange:
        """The measurement's range in the units that the card computes in; 0 to 100 where none is given."""
        return self.settings.own_ranges.pv

    @property
    def op(self) -> SignalRange:
        """The same of the output."""
        return self.settings.own_ranges.op

    @property
    def integrates(self) -> bool:
        """Whether there is integral action."""
        return bool(self.own.ki)

    @property
    def sign(self) -> float:
        """Sign of the gains: -1 where a reverse-acting controller raises its output as the measurement rises."""
        return math.copysign(1.0, self.own.kp or self.own.ki or self.own.kd)

    @property
    def limits(self) -> tuple[float, float]:
        """The card's output limits [as it computes]; infinite where there is none."""
        return infinite_where_none(self.settings.equation.output.limits)

    @property
    def limits_percent(self) -> tuple[float, float]:
        """The same [% of the output span]; where no range is given 0 to 100 is taken for it."""
        return self.op.limits_in_percent(self.limits)

    @property
    def unit(self) -> str:
        """What output limits are in."""
        return "engineering units" if self.engineering else "%"


def scaled_controllers(source: Settings, target: Settings, scans: tuple[float, float]) -> tuple[ScaledController, ScaledController]:
    """Return source and target at their scan intervals [s]."""
    names = ("the source", "the target") if source.card.id == target.card.id else (source.card.id, target.card.id)
    both = zip(names, (source, target), scans, strict=True)
    first, second = (ScaledController(name, s, h, s.algorithm(own_units=True, scan=h)) for name, s, h in both)
    return first, second


def alike(x: float, y: float) -> bool:
    """Tell whether two numbers of percent are the same but for rounding.

    A band or step below the rounding of a signal of 100 % is none: it cannot be told from zero.
    """
    return x == y or math.isclose(x, y, rel_tol=1e-9, abs_tol=math.ulp(100.0))
