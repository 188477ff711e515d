"""The integral is pulled back by what was cut off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pidemu.card.model.base import Flag, Given, R, Reference, means, short
from pidemu.card.model.marks import Names
from pidemu.card.windup.scheme import NumberSource, Scheme
from pidemu.numeric import X
from pidemu.part import part
from pidemu.units import Dimension, parse_unit

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation

_ALIKE: Final = 0.01
"""Relative difference of tracking times that counts as none."""


@part(frozen=True, slots=True, kw_only=True)
class WindupBackCalculation(Scheme[R]):
    """The integral is pulled back by the amount cut off."""

    scheme: Annotated[Literal["back-calculation"], means("After the output: `I += (h/Tt) (u - v)`, v before limits, u after.")]
    tracking_time: Annotated[
        R | Literal["Ti", "sqrt(Ti Td)"],
        means("Tracking time Tt: seconds, the name of a setting, `Ti`, or `sqrt(Ti Td)` (`Ti` where there is no derivative)."),
        Names("tracking-time", ("Ti", "sqrt(Ti Td)")),
    ]
    times: Annotated[
        Literal["Ti"] | None, means("`Ti`: the number or setting under `tracking-time` is a multiple of the integral time.")
    ] = None
    when_off: Annotated[
        Literal["Ti", "sqrt(Ti Td)"] | None,
        means("The tracking time taken where the setting under `tracking-time` has its off value."),
    ] = None
    implicit: Annotated[
        Flag, means("Whether the share per scan is `h/(Tt + h)`, as an implicit solver has it, instead of `h/Tt`.")
    ] = False

    @property
    def Tt(self) -> Any:
        """The tracking time of an algorithm [s]; 0 without integral action, or where the whole cut-off is taken out at once."""
        assert not isinstance(self.tracking_time, str)
        return self.tracking_time

    def in_words(self: WindupBackCalculation[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        share = "h/(Tt + h)" if self.implicit else "h/Tt"
        return f"each scan takes {share} of what was cut off out of the integral; {self._time_in_words(named)}"

    def _time_in_words(self: WindupBackCalculation[Reference], named: Callable[[Given], str]) -> str:
        tracked = self.tracking_time
        text = named(tracked) + (" s" if isinstance(tracked, float) else "")
        if self.times == "Ti":
            text = f"{short(tracked)} x Ti"
        text = f"the setting {text}" if tracked == "Tt" else f"Tt = {text}"
        return text + (f", or {self.when_off} where it is off" if self.when_off is not None else "")

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        given = self.tracking_time
        if given in ("Ti", "sqrt(Ti Td)") and (self.times is not None or self.when_off is not None):
            yield "'times' and 'when-off' go with a number or a setting under 'tracking-time'"
        elif isinstance(given, float) and self.when_off is not None:
            yield "'when-off' goes with a setting under 'tracking-time'"
        setting = equation.settings.get(given) if isinstance(given, str) else None
        if setting is None or setting.sets != "tracking-time" or setting.unit not in ("1", "s", "min", "h", "ms", "scan"):
            return
        ratio = parse_unit(setting.unit).dimension is Dimension.RATIO
        if ratio and self.times is None:
            yield f"'{given}' is a plain ratio; say of what: 'times: Ti'"
        if not ratio and self.times is not None:
            yield f"'{given}' is a time already; remove 'times'"

    def with_numbers(self: WindupBackCalculation[Reference], read: NumberSource[X]) -> Scheme[X]:
        """Return the scheme of an algorithm, with the tracking time in seconds."""
        return WindupBackCalculation(scheme=self.scheme, tracking_time=self._seconds(read), implicit=self.implicit)

    def _seconds(self: WindupBackCalculation[Reference], read: NumberSource[X]) -> X:
        if not read.integrates:
            return read.pick(0.0, 0.0)
        given = self.tracking_time
        if isinstance(given, str) and given in read.times:
            return read.times[given]
        found = read.pick(given, 0.0)
        if not found and self.when_off is not None:
            return read.times[self.when_off]
        return found * read.times["Ti"] if self.times == "Ti" else found

    def paced(self, pace: float) -> Self:
        """Return the scheme where every scan comes after `pace` times the interval computed with."""
        return replace(self, tracking_time=self.Tt * pace)

    def acts_like(self, other: Scheme[R]) -> bool:
        """Tell whether two controllers with these schemes do the same at a limit."""
        if not isinstance(other, WindupBackCalculation) or other.implicit != self.implicit:
            return False
        return math.isclose(self.Tt, other.Tt, rel_tol=_ALIKE)

    def too_coarse(self, h: float) -> str | None:
        """Return what a scan interval `h` [s] is too long for."""
        if self.implicit or not 0 < self.Tt < h:
            return None
        return f"the tracking time of {self.Tt:.3g} s is less, and back-calculation overshoots"
