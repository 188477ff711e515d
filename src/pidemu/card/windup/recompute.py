"""The integral is what a limit leaves for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from pidemu.card.model.base import Flag, Given, R, Reference, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class WindupRecompute(Scheme[R]):
    """At a limit the integral is set to what the limit leaves for it."""

    scheme: Annotated[Literal["recompute"], means("Where the sum reaches a limit: `I = limit - P - D`, after the output.")]
    without_derivative: Annotated[
        Flag,
        means(
            "Whether the derivative comes last: `P + I` is limited, with `I = limit - P`, then D is added and the sum "
            "limited again."
        ),
    ] = False
    clamped: Annotated[Flag, means("Whether the integral is limited to the output limits as well.")] = False

    def in_words(self: WindupRecompute[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        then = "; D comes on top, and is limited again" if self.without_derivative else ""
        sides = "P" if self.without_derivative else "P - D"
        kept = "; it is kept within the output limits too" if self.clamped else ""
        return f"the integral is set to what the limit leaves for it, limit - {sides}{then}{kept}"
