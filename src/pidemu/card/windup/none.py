"""No windup protection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class WindupNone(Scheme[R]):
    """The integral goes on whatever the output does."""

    scheme: Annotated[Literal["none"], means("Integrate always.")]

    def in_words(self: WindupNone[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        return "the integral goes on"
