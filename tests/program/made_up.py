"""Copies of the package, and a windup scheme and a transfer start that are made up: two files of one name each."""

from __future__ import annotations

import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]

SCHEME = '''
"""At a limit a part of the integral is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Literal

from pidemu.card.model.base import Given, R, Reference, means
from pidemu.card.model.marks import Names
from pidemu.part import part
from pidemu.card.windup.scheme import NumberSource, Scheme
from pidemu.numeric import X

if TYPE_CHECKING:
    from pidemu.card.model.card_file import Equation


@part(frozen=True, slots=True, kw_only=True)
class WindupMadeUp(Scheme[R]):
    """At a limit a part of the integral is kept."""

    scheme: Annotated[Literal["made-up"], means("At a limit `I = share I`, after the output.")]
    share: Annotated[R, means("What is kept: a number, or the name of a setting."), Names("gap-gain")]

    def in_words(self: WindupMadeUp[Reference], named: Callable[[Given], str]) -> str:
        """Return what happens at a limit."""
        return f"the integral keeps {named(self.share)} of itself"

    def own_faults(self, equation: Equation) -> Iterator[str]:
        """Yield what is wrong with a card that has the scheme."""
        if self.share == 1.0:
            yield "a share of 1 keeps everything: write 'scheme: none'"

    def with_numbers(self: WindupMadeUp[Reference], read: NumberSource[X]) -> Scheme[X]:
        """Return the scheme of an algorithm."""
        return WindupMadeUp(scheme=self.scheme, share=read.pick(self.share, 1.0))
'''

SCHEME_HOOKS = '''
"""Scheme `made-up`: at a limit a part of the integral is kept."""

from __future__ import annotations

from pidemu.card.windup.made_up import WindupMadeUp
from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupMadeUp[float]]):
    """The integral loses a part of itself in every scan at a limit."""

    def after_output(self, x: Positional, v: Expr, out: Expr, grown: Expr | None) -> None:
        """Keep a part of the integral."""
        share = x.b.coefficient("share", self.scheme.share, "what is kept", "-")
        x.b.let("I", select((v > x.t.high) | (v < x.t.low), share * x.state, x.state), "made-up")
'''

START = '''
"""Start `made-up`: it starts with half of what the last output leaves for the integral."""

from __future__ import annotations

from pidemu.card.transfer.start import Start


class MadeUp(Start):
    """The integral starts with half of what the last output leaves for it."""

    word = "made-up"
    meaning = "Half of what the last output leaves for the integral."
    of_a_controller = "starts with half an integral"
    at_the_transfer = "the integral starts with half of what the last output leaves for it"
'''

START_HOOKS = '''
"""Start `made-up`: it starts with half of what the last output leaves for the integral."""

from __future__ import annotations

from pidemu.program.integral import Positional
from pidemu.program.ir import Expr, select
from pidemu.program.transfer.hooks import Grow, StartHooks


class Hooks(StartHooks):
    """The first automatic output is about half of the last output."""

    def set(self, x: Positional, grow: Grow, needed: Expr) -> None:
        """Set the integral at a transfer."""
        x.b.let("I", select(x.t.on, grow(x.state, False), 0.5 * needed), "made-up")
'''


def copy_of_the_package(folder: Path) -> Path:
    """Put a copy of the package into a folder, without cards, and return the folder."""
    shutil.copytree(ROOT / "src" / "pidemu", folder / "src" / "pidemu", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "vendors").mkdir()
    return folder


def with_windup(folder: Path) -> Path:
    """Add the windup scheme to a copy."""
    return _with(folder, "windup", SCHEME, SCHEME_HOOKS)


def with_transfer(folder: Path) -> Path:
    """Add the start to a copy."""
    return _with(folder, "transfer", START, START_HOOKS)


def _with(folder: Path, room: str, model: str, hooks: str) -> Path:
    for part, text in (("card", model), ("program", hooks)):
        (folder / "src" / "pidemu" / part / room / "made_up.py").write_text(text.lstrip(), encoding="utf-8")
    return folder
