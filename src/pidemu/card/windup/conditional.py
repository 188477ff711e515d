"""No integration beyond a limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, Rule, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation


@part(frozen=True, slots=True, kw_only=True)
class WindupConditional(Scheme[R]):
    """Integration stops where it leads beyond a limit."""

    scheme: Annotated[
        Literal["conditional"],
        means("No integration beyond a limit; an increment that leads there counts as far as the limit."),
    ]
    test: Annotated[
        Literal["increment", "error-times-output"],
        means("What it takes for pushing further: the sign of the increment, or that of error times the sum before limits."),
    ] = "increment"
    last_increment: Annotated[
        Literal["to-the-limit", "dropped"],
        means(
            "What it does with an increment that leads beyond the limit: it keeps what leads to the limit, or "
            "nothing. `dropped` stops short of the limit for as long as the error stays: only with a source that says so."
        ),
    ] = "to-the-limit"

    def in_words(self: WindupConditional[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        if self.test == "error-times-output":
            return "the integral stands still while the sum is beyond a limit and has the sign of the error"
        if self.last_increment == "dropped":
            return "an increment that would lead beyond a limit is dropped; the output stops short of the limit"
        return "an increment that leads beyond a limit counts as far as the limit"

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        rule = equation.integral.rule
        if self.last_increment == "dropped" and rule is Rule.FORWARD:
            yield "'last-increment' has no meaning under the forward rule, whose increment comes after the output"
        if self.test == "error-times-output" and self.last_increment != "dropped" and rule is not Rule.FORWARD:
            yield "'test: error-times-output' stops the way back too and keeps nothing: write 'last-increment: dropped'"
