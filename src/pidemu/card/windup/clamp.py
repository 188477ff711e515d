"""The integral sum within the output limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation


@part(frozen=True, slots=True, kw_only=True)
class WindupClamp(Scheme[R]):
    """The integral sum is limited."""

    scheme: Annotated[
        Literal["clamp", "clamp-sum"],
        means(
            "`clamp`: limit the integral sum to the output limits, before it is used. `clamp-sum`: the same for an "
            "accumulator that also holds P on PV."
        ),
    ]
    without_integral: Annotated[
        Literal["zero", "limited"],
        means("With the integral switched off and nothing loaded: the sum is zero, or what the limits make of zero."),
    ] = "zero"

    @property
    def holds_proportional(self) -> bool:
        """Whether an accumulated P on PV is part of the integral's own sum."""
        return self.scheme == "clamp-sum"

    @property
    def limits_the_term(self) -> bool:
        """Whether it limits the integral term itself."""
        return True

    @property
    def limits_without_integral(self) -> bool:
        """Whether there is a sum to limit where the integral is switched off."""
        return self.without_integral == "limited"

    def in_words(self: WindupClamp[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        if self.holds_proportional:
            return "the sum of integral and P on PV is kept within the output limits, before it is used"
        off = "; with the integral off it is what they make of zero" if self.limits_without_integral else ""
        return f"the integral sum is kept within the output limits, before it is used{off}"

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        P = equation.proportional
        if self.holds_proportional and equation.implementation == "positional" and P.on == "pv" and not P.accumulated:
            yield "clamp-sum with P on pv needs 'proportional.accumulated: true'"

    def acts_like(self, other: Scheme[R]) -> bool:
        """Tell whether two controllers with these schemes do the same at a limit."""
        return self.scheme == other.scheme
