"""No integration while the output stands at a limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, Rule, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation


@part(frozen=True, slots=True, kw_only=True)
class WindupFreeze(Scheme[R]):
    """Integration stops while the output is at a limit."""

    scheme: Annotated[Literal["freeze"], means("No integration that pushes further while the last output is at a limit.")]
    judged_on: Annotated[
        Literal["output", "sum-without-derivative", "sum"],
        means(
            "What it looks at: the last output; P + I of the last scan, before the derivative was added; or this "
            "scan's sum with the increment, which then counts for the output but is not kept."
        ),
    ] = "output"
    direction: Annotated[
        Literal["further", "both", "unless-smaller"],
        means(
            "Stop only what pushes further; stop the integral whichever way it would move; or stop it "
            "unless its size becomes smaller."
        ),
    ] = "further"
    resumes_from: Annotated[
        Literal["last", "last-integrated"],
        means(
            "With the trapezoidal rule: after a freeze the increment starts from the last error, or from the "
            "last one that was integrated."
        ),
    ] = "last"

    def in_words(self: WindupFreeze[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        where = {
            "output": "while the last output is at a limit",
            "sum-without-derivative": "while P + I of the last scan is at a limit",
            "sum": "where the sum leads beyond a limit; that increment counts for the output and is then forgotten",
        }[self.judged_on]
        what = {
            "further": "no integration that pushes further",
            "both": "no integration",
            "unless-smaller": "no integration that makes it larger",
        }[self.direction]
        resumes = "; afterwards it starts from the last error that was integrated" if self.resumes_from == "last-integrated" else ""
        return f"{'no integration' if self.judged_on == 'sum' else what} {where}{resumes}"

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        rule = equation.integral.rule
        if self.resumes_from != "last" and rule is not Rule.TRAPEZOIDAL:
            yield "'resumes-from' belongs to the trapezoidal rule"
        if self.judged_on == "sum" and rule is Rule.FORWARD:
            yield "'judged-on: sum' needs this scan's increment in the sum: a backward or trapezoidal rule"
        if self.judged_on == "sum" and self.direction != "both":
            yield "'judged-on: sum' forgets the increment whichever way it goes: write 'direction: both'"
        if self.judged_on == "sum" and self.resumes_from != "last":
            yield "'resumes-from' has no meaning with 'judged-on: sum'"
