"""What is written of a loop that ran: its row, and a key by which a later run knows whether the row is still true."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pidemu import __version__
from pidemu.fleet.blocks import COLUMNS, BlockOutcome
from pidemu.fleet.judgement import MARGINS, RAN, Judgement, judgements
from pidemu.fleet.loops import FleetPlan, Loop

FIELDS: Final = ("scan", "scans", "status", *COLUMNS, "settled", "stable", *MARGINS, "engine", "key")
"""What is written of a loop beside its tag."""
_TRUTH: Final[Mapping[object, bool | None]] = {"True": True, "False": False, "": None, True: True, False: False, None: None}


@dataclass(frozen=True, slots=True)
class Finished:
    """A loop that ran.

    Attributes
    ----------
    tag : str
        Its name.
    scan : float
        Scan interval [s].
    scans : int
        How many scans.
    figures : mapping of str to float
        What `COLUMNS` names.
    judged : Judgement
        How it ended.
    engine : str
        What ran it.
    key : str
        What it was, as `keys` returns it.
    """

    tag: str
    scan: float
    scans: int
    figures: Mapping[str, float]
    judged: Judgement
    engine: str
    key: str

    @property
    def row(self) -> dict[str, Any]:
        """Value by name, for each of `FIELDS`."""
        j = self.judged
        return {
            "scan": self.scan,
            "scans": self.scans,
            "status": j.status,
            **self.figures,
            "settled": j.settled,
            "stable": j.stable,
            **{name: j.margins.get(name) for name in MARGINS},
            "engine": self.engine,
            "key": self.key,
        }


def finished(outcome: BlockOutcome, known: Sequence[str]) -> list[Finished]:
    """Return the rows of a block.

    Parameters
    ----------
    outcome : BlockOutcome
        What came of it.
    known : sequence of str
        The key of every loop of the fleet.
    """
    columns = {name: column.tolist() for name, column in outcome.columns.items()}
    return [
        Finished(
            m.tag,
            m.scan,
            m.scans,
            {name: column[i] for name, column in columns.items()},
            judged,
            outcome.engine.engine,
            known[m.place],
        )
        for i, (m, judged) in enumerate(judgements(outcome))
    ]


def read_row(tag: str, row: Mapping[str, Any]) -> Finished:
    """Return a loop that ran from its row, the values of which may be text.

    Parameters
    ----------
    tag : str
        Its name.
    row : mapping
        Value by name.

    Raises
    ------
    ValueError, TypeError, KeyError
        It is not a row that was written whole.
    """
    status = next((s for s in RAN if s == row["status"]), None)
    settled = _TRUTH[row["settled"]]
    if status is None or len(row["key"]) != _LENGTH:
        raise ValueError(tag)
    margins = {name: float(row[name]) for name in MARGINS if row[name] not in ("", None)}
    judged = Judgement(status, settled, _TRUTH[row["stable"]], margins)
    figures = {name: float(row[name]) for name in COLUMNS}
    return Finished(tag, float(row["scan"]), int(row["scans"]), figures, judged, str(row["engine"]), row["key"])


_LENGTH: Final = 32


def keys(loops: Iterable[Loop], plan: FleetPlan) -> list[str]:
    """Return a hash per loop of all that its numbers depend on: card and settings, process, scan, steps, time and pidemu itself.

    Parameters
    ----------
    loops : iterable of Loop
        The loops.
    plan : FleetPlan
        What is done to them. The engine does not count, as all give the same bits.
    """
    equations: dict[int, str] = {}  # many loops share a variant of a card, which lives as long as they do
    return [_key(loop, plan, equations) for loop in loops]


def _key(loop: Loop, plan: FleetPlan, equations: dict[int, str]) -> str:
    settings, process = loop.settings, loop.process
    variant = settings.variant
    if id(variant) not in equations:
        equations[id(variant)] = f"{variant.card.id} {sorted(variant.chosen.items())} {variant.equation!r}"
    said = {name: getattr(plan, name) if (own := getattr(loop, name)) is None else own for name in ("setpoint", "load", "time")}
    what = (
        __version__,
        equations[id(variant)],
        [(name, v.value, v.unit, v.spans) for name, v in settings.items()],
        (settings.pv_range, settings.op_range, settings.pace, settings.lag, settings.scan),
        (process.gain, [complex(p) for p in process.poles], [complex(z) for z in process.zeros], process.delay),
        (loop.scan, loop.action, loop.output_limits, loop.initial, said, plan.margins),
    )
    return hashlib.sha256(repr(what).encode(errors="backslashreplace")).hexdigest()[:_LENGTH]
