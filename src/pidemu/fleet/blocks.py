"""Blocks: loops of a group side by side, run by an engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pidemu.engines import Choice
from pidemu.fleet.prepare import Group, Prepared
from pidemu.loop.experiment import FIGURES
from pidemu.loop.simulation import run_trial
from pidemu.loop.trial import Trial
from pidemu.targets.runner import Block

Floats = npt.NDArray[np.float64]
Room = Callable[[tuple[int, int, int]], Floats]
"""From the shape of a block's records to the array that takes them."""

COLUMNS: Final = {**FIGURES, "error": "%"}
"""What is known of every loop that ran, with units: the figures, and the last error."""
_IN_CACHE: Final = 2**15
"""Loops times scans from one look at whether to stop to the next; what is not kept of them stays in a processor's cache."""


@dataclass(frozen=True)
class Outcome:
    """What came of a block of loops.

    Attributes
    ----------
    members : tuple of Prepared
        The loops.
    columns : dict of str to ndarray, shape (loops,)
        What `COLUMNS` names.
    records : ndarray, shape (2, scans, loops or more), or None
        Output and measurement [%], where they are kept.
    engine : Choice
        What ran it.
    ran_away : frozenset of int
        Places in the fleet of loops whose measurement outgrew all numbers.
    """

    members: tuple[Prepared, ...]
    columns: dict[str, Floats]
    records: Floats | None
    engine: Choice
    ran_away: frozenset[int] = frozenset()


class Stopped(Exception):  # noqa: N818 (no error)
    """The run was called off."""


def run_block(
    group: Group,
    members: Sequence[Prepared],
    engine: Choice,
    function: Block,
    width: int,
    room: Room | None,
    stop: Callable[[], bool],
) -> Outcome:
    """Run loops of a group side by side.

    Parameters
    ----------
    group : Group
        The group.
    members : sequence of Prepared
        At most `width` of its loops; the block is filled up with copies of the last one.
    engine : Choice
        What runs them, for the record.
    function : Block
        The engine's function for the group's structure.
    width : int
        Loops in a block.
    room : callable or None
        Where signals that are kept go.
    stop : callable
        Whether to stop; asked now and then.

    Raises
    ------
    Stopped
        It said so.
    """
    filled = [*members, *[members[-1]] * (width - len(members))]
    values, states = (np.array([getattr(m, what) for m in filled]).T.copy() for what in ("values", "initial"))
    lengths = np.array([m.lengths for m in filled], dtype=np.int64).reshape(width, -1).T.copy()
    rings = np.zeros((len(lengths), int(lengths.max(initial=0)) + 1, width))
    at_once = max(64, _IN_CACHE // width)
    shape = (len(group.structure.recorded), group.scans, width)
    records = None if room is None else room(shape)
    buffer = np.empty((shape[0], min(at_once, group.scans), width)) if records is None else None
    for at in range(0, group.scans, at_once):
        if stop():
            raise Stopped
        count = min(at_once, group.scans - at)
        part = records[:, at : at + count] if records is not None else buffer[:, :count]  # type: ignore[index]  # one of them is there
        function(values, states, np.empty((0, count, width)), rings, lengths, at, part)
    names = group.structure.states
    columns = {name: states[names.index(name), : len(members)] for name in FIGURES}
    columns["error"] = states[names.index("error_was"), : len(members)]
    away = frozenset(_mend(members, columns, records))
    return Outcome(tuple(members), columns, records, engine, away)


def _mend(members: Sequence[Prepared], columns: dict[str, Floats], records: Floats | None) -> list[int]:
    """Run loops again, scan by scan, whose measurement outgrew all numbers: what the card does then is not in its program."""
    away = []
    for i, member in enumerate(members):
        if all(np.isfinite(column[i]) for column in columns.values()):
            continue
        pv, out, _ = run_trial(member.trial)
        for name, value in figures_of(member.trial, pv, out).items():
            columns[name][i] = value
        if records is not None:
            records[:, :, i] = out, pv
        away.append(member.place)
    return away


def figures_of(trial: Trial, pv: Floats, out: Floats) -> dict[str, float]:
    """Return what `COLUMNS` names, from signals.

    Parameters
    ----------
    trial : Trial
        What ran.
    pv, out : ndarray, shape (scans,)
        Measurement and output [%].
    """
    start = 0 if trial.load_step is None else trial.first(trial.load_step[0])
    with np.errstate(all="ignore"):
        error = trial.setpoint - pv
        a, b = error[start:-1], error[start + 1 :]
        straight = np.where(a * b < 0, (a * a + b * b) / (2 * np.abs(a - b)), np.abs(a + b) / 2)
        return {
            "iae": float(np.sum(straight) * trial.scan),
            "peak": float(np.max(np.abs(error[start:]))),
            "travel": float(np.sum(np.abs(np.diff(out, prepend=trial.initial[2])))),
            "at_low": float(np.count_nonzero(out <= trial.limits[0]) * trial.scan),
            "at_high": float(np.count_nonzero(out >= trial.limits[1]) * trial.scan),
            "error": float(error[-1]),
        }
