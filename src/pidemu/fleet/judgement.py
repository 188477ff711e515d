"""How a loop of a fleet ended: its status, whether it settled, whether it is stable, and its margins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from pidemu.fleet.blocks import BlockOutcome
from pidemu.fleet.group import Prepared
from pidemu.simulation.outcome import settled

Status = Literal["done", "unstable", "ran away", "failed", "not run"]
RAN: Final[tuple[Status, ...]] = ("done", "unstable", "ran away")
"""What the status of a loop that ran may be."""
MARGINS: Final = {"gain_margin": "", "phase_margin": "deg", "Ms": ""}
"""Figures of the sampled loop within its limits, with units."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """How a loop ended.

    Attributes
    ----------
    status : {"done", "unstable", "ran away"}
        ``"unstable"``: the sampled loop is, within its limits; ``"ran away"``: the measurement outgrew all numbers.
    settled : bool or None
        Whether the measurement had settled at the end of the run (`pidemu.simulation.outcome.settled_by`); ``None`` where the run
        is too short to tell.
    stable : bool or None
        Whether the loop is stable; ``None`` where that was not computed.
    margins : mapping of str to float
        What `MARGINS` names; nothing where there are none.
    """

    status: Status
    settled: bool | None
    stable: bool | None
    margins: Mapping[str, float]


def judgements(found: BlockOutcome) -> Iterator[tuple[Prepared, Judgement]]:
    """Yield the loops of a block, and how each ended.

    Parameters
    ----------
    found : BlockOutcome
        What came of the block.
    """
    ends = zip(found.members, found.columns["swing"].tolist(), found.columns["peak"].tolist(), strict=True)
    for member, swing, peak in ends:
        m, away = member.margins, member.place in found.ran_away
        status: Status = "ran away" if away else "unstable" if member.stable is False else "done"
        is_settled = settled((member.scans - 1) * member.scan, member.answer, swing, peak)
        margins = {} if m is None else {name: getattr(m, name) for name in MARGINS}
        yield member, Judgement(status, is_settled, member.stable, margins)
