"""What a windup scheme may do within a scan: the hooks that the files beside this one fill in (specs/equations.md, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pidemu.card.windup import Scheme
from pidemu.program.blocks import Builder
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, Name

S = TypeVar("S", bound=Scheme[Any])


@dataclass(frozen=True, slots=True)
class WindupHooks(Generic[S]):
    """What a scheme does, in the order of a scan. A hook that is not filled in does nothing.

    Attributes
    ----------
    scheme : Scheme
        What the card says of it.
    """

    scheme: S

    @property
    def adds_provisionally(self) -> bool:
        """Whether this scan's increment counts for the output and is kept only if the sum stays within the limits."""
        return False

    def gate(self, x: Positional, grown: Expr) -> Expr:
        """Return the increment of the integral's state, stopped or hastened."""
        return grown

    def after_growth(self, x: Positional) -> None:
        """Change the state after it has grown, before the integral's own limits."""

    def after_terms(self, x: Positional) -> None:
        """Change the state before it is used for the sum, behind the integral's own limits."""

    def without_integral(self, x: Positional, inner: Expr) -> Expr:
        """Return the sum before the derivative, where there is no integral action."""
        return inner

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Change the state after the output: `v` before limits, `out` behind them; forward growth comes later."""

    def at_the_end(self, x: Positional) -> None:
        """Change the state after everything else."""

    def remember(self, x: Positional, inner: Expr) -> None:
        """Keep for the next scan what the scheme needs there; `inner` is the sum before the derivative."""

    def velocity_base(self, b: Builder, last: Name) -> Expr:
        """Return the output that increments are added to."""
        return last
