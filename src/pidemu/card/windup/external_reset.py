"""Integral by positive feedback."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Generic, Literal

from pidemu.card.model.base import Given, Part, R, Reference, Rule, means
from pidemu.card.model.declared import Only
from pidemu.card.model.marks import Beyond, Names
from pidemu.card.windup.scheme import NumberSource, Scheme
from pidemu.numeric import X
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class FastReturn(Part, Generic[R]):
    """An integral that comes back faster from beyond limits of its own."""

    factor: Annotated[
        float,
        Only(ge=1, le=1e6, strict=True, allow_inf_nan=False),
        means(
            "The integral time is divided by this while the output is beyond one of the limits and the integral on its "
            "way back, until the output is back at that limit."
        ),
    ]
    high: Annotated[R, means("High limit [as the output]: a number, or the name of a setting."), Names("windup-limit")]
    low: Annotated[R, means("Low limit, likewise."), Names("windup-limit")]


def _in_words(windup: Any) -> str | None:
    f = windup.fast_return
    if f is None:
        return None
    return f"integral {f.factor:g} times as fast on the way back from below {f.low:g} or above {f.high:g}"


@part(frozen=True, slots=True, kw_only=True)
class WindupExternalReset(Scheme[R]):
    """Integral by positive feedback."""

    scheme: Annotated[
        Literal["external-reset"],
        means(
            "The integral is a first-order lag, of the integral time, fed with the limited output, less the derivative, "
            "plus what P does not see of the error, `K (e - p)`: it stands still while the output stands at a limit. Backward and "
            "forward rules only. An external reset signal takes the place of the limited output."
        ),
    ]
    fast_return: Annotated[
        FastReturn[R] | None,
        means("How the integral comes back from beyond limits that are not the output's; as ever, if absent."),
        Beyond(None, _in_words),
    ] = None

    rules: ClassVar[tuple[Rule, ...]] = (Rule.BACKWARD, Rule.FORWARD)

    @property
    def takes_external_reset(self) -> bool:
        """Whether an external reset signal has an effect."""
        return True

    def in_words(self: WindupExternalReset[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        lag = "positive feedback; the integral is a lag of the limited output, or of the external reset signal"
        return lag + self._fast_in_words(named)

    def _fast_in_words(self: WindupExternalReset[Reference], named: Callable[[Given], str]) -> str:
        f = self.fast_return
        if f is None:
            return ""
        beyond = f"while the output is above {named(f.high)} or below {named(f.low)}"
        return f"; {beyond} and the integral on its way back, the integral time is divided by {f.factor:g}"

    def with_numbers(self: WindupExternalReset[Reference], read: NumberSource[X]) -> Scheme[X]:
        """Return the scheme of an algorithm, with the limits of its fast return in percent; without where that does nothing."""
        f = self.fast_return
        if f is None or f.factor == 1 or not read.integrates:
            return WindupExternalReset(scheme=self.scheme)
        low, high = read.level(f.low, -math.inf), read.level(f.high, math.inf)
        if low == -math.inf and high == math.inf:
            return WindupExternalReset(scheme=self.scheme)
        return WindupExternalReset(scheme=self.scheme, fast_return=FastReturn(factor=f.factor, low=low, high=high))

    def inside_limits(self: WindupExternalReset[float], low: float, high: float) -> str:
        """Return that it comes back faster from beyond limits of its own, where these lie inside those of the output [%]."""
        f = self.fast_return
        if f is None or (f.low <= low and f.high >= high):
            return ""
        beyond = [f"above {f.high:g} %"] if f.high < high else []
        beyond += [f"below {f.low:g} %"] if f.low > low else []
        return f"comes back {f.factor:g} times as fast while the output is {' or '.join(beyond)}"
