"""What every windup scheme says of itself: the base of the files beside this one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, Self, TypeVar, cast

from pidemu.card.model.base import GENERAL_RULES, Given, Part, R, Reference, Rule
from pidemu.numeric import Real, X
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation

N_co = TypeVar("N_co", bound=Real, covariant=True)


class NumberSource(Protocol[N_co]):
    """What a scheme reads its numbers from, when a card is resolved with its settings."""

    @property
    def integrates(self) -> bool:
        """Whether there is integral action."""
        ...

    @property
    def times(self) -> Mapping[str, N_co]:
        """Times that a card names by a word [s]: ``Ti`` and ``sqrt(Ti Td)``."""
        ...

    def pick(self, given: Given, default: float) -> N_co:
        """Return a number that a card gives itself, or by the name of a setting; `default` where there is none or it is off."""
        ...

    def level(self, given: Reference, default: float) -> N_co:
        """Return a level of the output [%], likewise."""
        ...


@part(frozen=True, slots=True, kw_only=True)
class Scheme(Part, Generic[R]):
    """A windup scheme: what happens to the integral at an output limit (specs/equations.md, section 5).

    The file says what the scheme is. What it does scan by scan stands in the file of the same name in `pidemu.program.windup`.
    """

    scheme: str

    rules: ClassVar[tuple[Rule, ...]] = GENERAL_RULES
    """Scan rules of the integral for which it is defined."""
    implementation: ClassVar[str] = "positional"
    """The implementation that it belongs to."""

    @property
    def takes_external_reset(self) -> bool:
        """Whether an external reset signal has an effect."""
        return False

    @property
    def holds_proportional(self) -> bool:
        """Whether an accumulated P on PV is part of the integral's own sum."""
        return False

    @property
    def limits_the_term(self) -> bool:
        """Whether it limits the integral term itself, which then has to hold ``ki e``."""
        return False

    @property
    def limits_without_integral(self) -> bool:
        """Whether there is a sum to limit where the integral is switched off."""
        return False

    def in_words(self: Scheme[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit, as a data sheet has it.

        Parameters
        ----------
        named : callable
            From a number or a setting's name to what is shown of it.
        """
        raise NotImplementedError

    def faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme in that equation."""
        if equation.implementation != self.implementation:
            yield f"windup '{self.scheme}' does not go with implementation '{equation.implementation}'"
        if equation.integral.rule not in self.rules:
            words = " and ".join(rule.value for rule in self.rules)
            yield f"{self.scheme} is defined for the {words} rules"
        yield from self.own_faults(equation)

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong by the scheme's own rules."""
        yield from ()

    def with_numbers(self: Scheme[Reference], read: NumberSource[X]) -> Scheme[X]:
        """Return the scheme of an algorithm: with numbers where the card names settings. Most have none."""
        return cast("Scheme[X]", self)

    def paced(self, pace: float) -> Self:
        """Return the scheme where every scan comes after `pace` times the interval computed with: its times are as much longer."""
        return self

    def acts_like(self, other: Scheme[R]) -> bool:
        """Tell whether two controllers with these schemes do the same at a limit, their integral times being the same."""
        return self == other

    def inside_limits(self: Scheme[float], low: float, high: float) -> str:
        """Return what it does with the output inside its limits [%], as a sentence goes on; most do nothing there."""
        return ""

    def too_coarse(self, h: float) -> str | None:
        """Return what a scan interval `h` [s] is too long for, if anything."""
        return None
