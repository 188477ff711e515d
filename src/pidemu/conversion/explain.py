"""Why these options were chosen: every choice with what it would cost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pidemu.certificate.figures import percent
from pidemu.conversion.beside import dials_text

if TYPE_CHECKING:
    from pidemu.conversion.options import Attempt
    from pidemu.conversion.result import Conversion


@dataclass(frozen=True, slots=True)
class Explained:
    """One choice of the options in words.

    Attributes
    ----------
    options, verdict, dials : str
        The options, the verdict, the dials in use.
    loop_band, setpoint : str
        Largest deviation in the loop band of feedback and setpoint path.
    why : str
        By what it is worse than the best, or why it is refused; of the best that it is taken.
    """

    options: str
    verdict: str
    loop_band: str
    setpoint: str
    dials: str
    why: str


def explained(c: Conversion) -> tuple[Explained, ...]:
    """Return every choice of the target's options that was looked at, the best first; refusals for one reason are one."""
    found = [_explained(a, c.ranking[0]) for a in c.ranking]
    refused: dict[str, list[Explained]] = {}
    for choice in found:
        if choice.verdict == "refused":
            refused.setdefault(choice.why, []).append(choice)
    return (*(x for x in found if x.verdict != "refused"), *(_together(same) for same in refused.values()))


def _together(same: list[Explained]) -> Explained:
    """Return choices that are refused for the same reason as one."""
    more = len(same) - 1
    return replace(same[0], options=f"{same[0].options}, and {more} more" if more else same[0].options)


def _explained(a: Attempt, best: Attempt) -> Explained:
    if a.settings is None or a.certificate is None or a.merit is None:
        options = ", ".join(f"{n}={x}" for n, x in a.changed.items()) or "as delivered"
        return Explained(options, "refused", "-", "-", "", str(a.error))
    options = ", ".join(f"{n}={x}" for n, x in a.settings.options.items()) or "none"
    paths = (a.certificate.headline, a.certificate.setpoint_headline)
    off = [percent(p.loop_band.max_deviation) for p in paths]
    why = "taken" if a is best else (best.merit and a.merit.worse_by(best.merit)) or "as good, but it comes later in the card"
    return Explained(options, a.verdict, off[0], off[1], dials_text(a.settings), why)
