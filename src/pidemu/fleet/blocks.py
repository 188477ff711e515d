"""Blocks: loops of a group side by side, run by an engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.backends.choice import Choice
from pidemu.backends.runner import Block
from pidemu.fleet.group import Group
from pidemu.simulation.experiment import FIGURES, integral_of_error
from pidemu.simulation.outcome import late_scan
from pidemu.simulation.simulate import run_trial
from pidemu.simulation.trial import Trial

Room = Callable[[tuple[int, int, int]], Floats]
"""From the shape of a block's records to the array that takes them."""

COLUMNS: Final = {**FIGURES, "error": "%"}
"""What is known of every loop that ran, with units: the figures, and the last error."""
_IN_CACHE: Final = 2**15
"""Loops times scans from one look at whether to stop to the next; what is not kept of them stays in a processor's cache."""


@dataclass(frozen=True)
class BlockOutcome:
    """What came of a block of loops.

    Attributes
    ----------
    members : Group
        The loops.
    columns : dict of str to ndarray, shape (loops,)
        What `COLUMNS` names.
    records : ndarray, shape (2, scans, loops or more), or None
        Output and measurement [%], where they are kept in memory; NaN after a loop's last scan.
    engine : Choice
        What ran it.
    ran_away : frozenset of int
        Places in the fleet of loops whose measurement outgrew all numbers.
    file : Path or None
        The NumPy file that holds the records, where they are kept in files.
    """

    members: Group
    columns: dict[str, Floats]
    records: Floats | None
    engine: Choice
    ran_away: frozenset[int] = frozenset()
    file: Path | None = None


class Stopped(Exception):  # noqa: N818 (no error)
    """The run was called off."""


def run_block(
    members: Group,
    engine: Choice,
    function: Block,
    width: int,
    room: Room | None,
    stop: Callable[[], bool],
) -> BlockOutcome:
    """Run loops of a group side by side, until the last of them is done.

    Parameters
    ----------
    members : Group
        At most `width` loops of one structure, in the order of their numbers of scans.
    engine : Choice
        What runs them, for the record.
    function : Block
        The engine's function for their structure.
    width : int
        Loops in a block: it is filled up with copies of the last one.
    room : callable or None
        Where signals that are kept go.
    stop : callable
        Whether to stop; asked now and then.

    Raises
    ------
    Stopped
        It said so.
    """
    structure, numbers = members.structure, members.columns
    ends = members.scans.tolist()
    scans = ends[-1]
    filled = np.minimum(np.arange(width), len(members) - 1)
    values, states = (x[filled].T.copy() for x in (numbers.values, numbers.initial))
    under_way = np.minimum(numbers.lengths, numbers.scans[:, None])  # what comes later than the last scan is not seen
    lengths = under_way[filled].T.astype(np.int64)
    rings = np.zeros((len(lengths), int(lengths.max(initial=0)) + 1, width))
    at_once = min(scans, max(64, _IN_CACHE // width))
    shape = (len(structure.recorded), scans, width)
    records = None if room is None else room(shape)
    buffer = np.empty((shape[0], at_once, width)) if records is None else None
    places = [structure.states.index(name) for name in (*FIGURES, "error_was")]
    columns = np.empty((len(places), len(members)))
    done = 0
    for at, end in _spans(ends, at_once):
        if stop():
            raise Stopped
        part = records[:, at:end] if records is not None else buffer[:, : end - at]  # type: ignore[index]  # one of them is there
        with np.errstate(all="ignore"):  # what outgrows all numbers is seen to below
            function(values, states, np.empty((0, end - at, width)), rings, lengths, at, part)
        part[:, :, :done] = np.nan
        while done < len(ends) and ends[done] == end:
            columns[:, done] = states[places, done]
            done += 1
    found = dict(zip(COLUMNS, columns, strict=True))
    return BlockOutcome(members, found, records, engine, frozenset(_mend(members, found, records)))


def _spans(ends: Sequence[int], at_once: int) -> Iterator[tuple[int, int]]:
    """Yield from where to where a block is run in one go: no longer than `at_once`, and to each of the ends."""
    at = 0
    for end in sorted(set(ends)):
        while at < end:
            yield at, min(at + at_once, end)
            at = min(at + at_once, end)


def _mend(members: Group, columns: dict[str, Floats], records: Floats | None) -> list[int]:
    """Run loops again, scan by scan, whose measurement outgrew all numbers: what the card does then is not in its program."""
    away = []
    for i in np.flatnonzero(~np.isfinite(list(columns.values())).all(axis=0)).tolist():
        trial = members.trial(int(members.places[i]))
        run = run_trial(trial)
        for name, value in figures_of(trial, run.measurement, run.output).items():
            columns[name][i] = value
        if records is not None:
            records[:, : trial.scans, i] = run.output, run.measurement
        away.append(int(members.places[i]))
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
        return {
            "iae": integral_of_error(error[start:], trial.scan),
            "peak": float(np.max(np.abs(error[start:]))),
            "travel": float(np.sum(np.abs(np.diff(out, prepend=trial.initial[2])))),
            "at_low": float(np.count_nonzero(out <= trial.limits[0]) * trial.scan),
            "at_high": float(np.count_nonzero(out >= trial.limits[1]) * trial.scan),
            "swing": float(np.ptp(error[late_scan(trial.scans) :])),
            "error": float(error[-1]),
        }
