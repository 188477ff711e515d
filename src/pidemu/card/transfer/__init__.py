"""Transfers: what a controller does when it is put into automatic, and in manual before that.

What the integral does at the start has one file for each way. A new way is a file here and one of the same name in
`pidemu.program.transfer`, which says what it does; nothing else names it.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pidemu.card.model.base import Part, means
from pidemu.card.model.marks import AtRest
from pidemu.card.transfer.start import Start
from pidemu.part import part

__all__ = ["STARTS", "Start", "Transfer"]


def _starts() -> dict[str, type[Start]]:
    found: dict[str, type[Start]] = {}
    for file in pkgutil.iter_modules(__path__, f"{__name__}."):
        for kind in vars(importlib.import_module(file.name)).values():
            if isinstance(kind, type) and issubclass(kind, Start) and kind.__module__ == file.name and kind is not Start:
                found[kind.word] = kind
    return found


STARTS: Final = _starts()
"""All starts, by the word that a card writes, in the order of the names of their files."""

if TYPE_CHECKING:
    StartWord = str
else:
    StartWord = Literal[tuple(STARTS)]


@part(frozen=True, slots=True, kw_only=True)
class Transfer(Part):
    """What happens when the controller is put into automatic, and in manual before that."""

    start: Annotated[StartWord, means(" ".join(f"`{w}`: {s.meaning}" for w, s in STARTS.items())), AtRest("bumpless")]
    preset: Annotated[
        Literal["none", "output", "integral", "initial"],
        means(
            "What a user can set by hand for the transfer. `none`: no source says that there is such a thing. `output`, "
            "with `load-output`: the value that is loaded, which may be another than the last output. `integral`, with `keep`, "
            "`zero` and `running`: what the integral holds (`integral.holds`), at any time. `initial`, with these: the same, "
            "before the first scan of all only."
        ),
    ] = "none"
    derivative: Annotated[
        Literal["running", "restarted", "zeroed", "preset"],
        means(
            "`running`: filters and differences go on in manual. `restarted`: they start afresh at the transfer. "
            "`zeroed`: at the transfer the previous signal counts as zero, so that the derivative kicks. `preset`: in manual the "
            "history is the present sample and the term is zero."
        ),
        AtRest("running"),
    ] = "running"
    without_integral: Annotated[
        Literal["kept", "zero"],
        means(
            "With the integral switched off: what it holds stays as a constant (with `load-output` what was loaded, "
            "otherwise what it held when it was switched off while running), or is zero."
        ),
    ] = "kept"
    first_scan: Annotated[
        Literal["integrates", "holds"],
        means(
            "Whether the integral grows in the first automatic scan after `load-output`, `keep` or `zero`; with "
            "`running`, in the very first scan."
        ),
        AtRest("integrates"),
    ] = "integrates"
    loaded: Annotated[
        Literal["limited", "as-it-is"],
        means("With `load-output`: whether the output is limited to the output limits before it is loaded."),
    ] = "limited"
    power_up: Annotated[
        Literal["transfer", "zero"],
        means(
            "The very first scan, in automatic: a `transfer` from the initial output, or the integral begins at `zero`, "
            "whatever the output was."
        ),
        AtRest("transfer"),
    ] = "transfer"
    first_output: Annotated[
        Literal["computed", "zero"],
        means("The output of the very first scan: computed, or zero because that scan only prepares the block."),
        AtRest("computed"),
    ] = "computed"
    manual_output: Annotated[
        Literal["operator", "gain-times-operator", "zero"],
        means("The output in manual: the operator's, that multiplied by the gain, or zero."),
        AtRest("operator"),
    ] = "operator"
    changes: Annotated[
        Literal["as-held", "bumpless"],
        means(
            "A setting changed in automatic: the new setting acts on what the integral holds (`integral.holds`), or the "
            "integral is set so that the output does not move."
        ),
    ] = "as-held"
    zero_gain: Annotated[
        Literal["removes", "runs-on"],
        means(
            "What a gain of 0 does to its term, which shows when the gain comes back while running. `removes`: the term starts at "
            "rest, from the last signals, and an integral where the output stays. `runs-on`: sums and histories have gone on "
            "unseen, as they do in a program that computes every term every time."
        ),
    ] = "removes"

    @property
    def way(self) -> type[Start]:
        """What the start says of itself."""
        return STARTS[self.start]
