"""No integral outside the proportional band."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation


@part(frozen=True, slots=True, kw_only=True)
class WindupResetOutsideBand(Scheme[R]):
    """The integral is cleared while the measurement is outside the proportional band."""

    scheme: Annotated[
        Literal["reset-outside-band"],
        means("`I = 0` while the proportional action alone, `kp |e|`, is larger than the output span."),
    ]

    def in_words(self: WindupResetOutsideBand[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        return "the integral is 0 while PV is outside the proportional band"

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        if equation.proportional.on == "none":
            yield "reset-outside-band needs a proportional term, whose band it is"
