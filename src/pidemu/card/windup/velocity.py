"""What the incremental form does by itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal

from pidemu.card.model.base import Flag, Given, R, Reference, means
from pidemu.card.windup.scheme import Scheme
from pidemu.part import part


@part(frozen=True, slots=True, kw_only=True)
class WindupVelocity(Scheme[R]):
    """What the incremental form does by itself."""

    scheme: Annotated[
        Literal["velocity"],
        means(
            "The increment is added to the last limited output; nothing else is done. Required, and only allowed, with "
            "`implementation: velocity`."
        ),
    ]
    reads_back: Annotated[
        Flag,
        means(
            "Whether the increment is added to the external reset signal, the output read back from downstream, where there is one."
        ),
    ] = False

    implementation: ClassVar[str] = "velocity"

    @property
    def takes_external_reset(self) -> bool:
        """Whether an external reset signal has an effect."""
        return self.reads_back

    def in_words(self: WindupVelocity[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        back = ", or from what is read back from downstream" if self.reads_back else ""
        return f"increments start from the limited output{back}"

    def acts_like(self, other: Scheme[R]) -> bool:
        """Tell whether two controllers with these schemes do the same at a limit."""
        return self.scheme == other.scheme
