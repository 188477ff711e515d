"""What happened while a controller ran, in a few lines for people."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from pidemu.cli.common import echo, number, table
from pidemu.controller.signals import Event
from pidemu.records.playback import NO_BUMP, Playback

_ROWS: Final = 12
"""Rows after which it is said how many more there are."""

Row = tuple[int, int, str, float]
"""First and last scan, what happened, and what the output moved by in it."""


def happened(playback: Playback) -> list[Row]:
    """Return what happened, in order: transfers, spells at a limit, and runs of the same remark on signals or intervals.

    A first scan that moves nothing is nothing to tell.
    """
    rows: list[Row] = []
    for e in playback.events:
        if e.kind == "transfer":
            if e.text.startswith("power-up") and abs(e.bump) < NO_BUMP:
                continue
            rows.append((e.scan, e.scan, e.text, e.bump))
            continue
        rows.append((e.scan, e.scan + e.scans - 1, e.text, 0.0))
    rows += [(s.first, s.last, f"at the {s.limit} limit", 0.0) for s in playback.saturations]
    return sorted(rows, key=lambda row: row[0])


def largest_bump(events: Iterable[Event]) -> Event | None:
    """Return the transfer to automatic or cascade that moves the output most, if there is one that moves it."""
    into = [e for e in events if e.kind == "transfer" and e.text.endswith((" to automatic", " to cascade"))]
    worst = max(into, key=lambda e: abs(e.bump), default=None)
    return worst if worst is not None and abs(worst.bump) >= NO_BUMP else None


def tell(playback: Playback) -> None:
    """Print on stderr what happened, at most a dozen rows, and the largest bump."""
    rows = happened(playback)
    if not rows:
        return
    cells = []
    for first, last, text, bump in rows[:_ROWS]:
        scans = f"{first}" if first == last else f"{first} to {last}"
        cells.append([scans, number(float(playback.times[first])), text, moved(bump) if " to " in text else ""])
    table(["scan", "time [s]", "what happened", "output moves by"], cells, err=True, right=(0, 1, 3))
    if len(rows) > _ROWS:
        echo(f"  and {len(rows) - _ROWS} more; --json lists all", err=True)
    worst = largest_bump(playback.events)
    if worst is not None:
        echo(f"largest bump into automatic or cascade: {moved(worst.bump)} in scan {worst.scan} ({worst.text})", err=True)


def moved(bump: float) -> str:
    """Return what an output moved by, with its sign."""
    return "0" if abs(bump) < NO_BUMP else f"{'+' if bump > 0 else ''}{number(bump)}"
