"""The record of a bump test: its samples, looked at before anything is fitted, and the moves of the output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.errors import FitRefusedError, RecordError
from pidemu.files.tables import counted
from pidemu.plausible import SIGNAL, shown

_FEWEST: Final = 8
"""Samples below which nothing is fitted."""
_PLACES: Final = 3
"""Samples that a note names one by one."""


@dataclass(frozen=True)
class BumpTest:
    """Samples of a test in which the output moves and the measurement answers.

    Attributes
    ----------
    time, output, measurement : ndarray of float, shape (n,)
        Times that rise [s], the output, which holds from one sample to the next, and the measurement, all finite.
    setpoint : ndarray of float, shape (n,), or None
        The setpoint, where it was recorded.
    first : int
        Sample at which the output first moves.
    notes : tuple of str
        What was left out of the record.
    given_time : ndarray of float
        The times of all samples that were given, those without a measurement included [s].
    """

    time: Floats
    output: Floats
    measurement: Floats
    setpoint: Floats | None
    first: int
    notes: tuple[str, ...]
    given_time: Floats

    @property
    def moves(self) -> list[tuple[float, float]]:
        """When the output moves, and how far."""
        at = np.flatnonzero(np.diff(self.output)) + 1
        return list(zip(self.time[at].tolist(), np.diff(self.output)[at - 1].tolist(), strict=True))

    @property
    def spacing(self) -> float:
        """Median time between samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Time from the first move to the end [s]."""
        return float(self.time[-1] - self.time[self.first])


def read_bump(time: Any, output: Any, measurement: Any, setpoint: Any = None) -> BumpTest:
    """Return the samples of a bump test.

    Parameters
    ----------
    time, output, measurement : array_like, shape (n,)
        Times [s], output and measurement. Samples whose measurement is NaN are left out; an output that is NaN is the one before.
    setpoint : array_like, shape (n,), optional
        The setpoint.

    Raises
    ------
    RecordError
        They are no lists of numbers of one length, too few, or their times do not rise.
    FitRefusedError
        The output does not move, or only with the last sample.
    """
    given = {"time": time, "output": output, "measurement": measurement, **({} if setpoint is None else {"setpoint": setpoint})}
    columns = {name: _column(name, values) for name, values in given.items()}
    lengths = {name: values.size for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} {n:,}" for name, n in lengths.items())
        raise RecordError(f"the columns have different numbers of samples: {told}; give one value of each per sample")
    notes: list[str] = []
    held, note = _held(columns["output"])
    notes += note
    good = np.isfinite(columns["measurement"])
    if not good.all():
        notes.append(f"left out: {counted(int((~good).sum()), 'sample')} without a measurement, {_places(~good)}")
    given_time = columns["time"]
    columns = {name: values[good] for name, values in (columns | {"output": held}).items()}
    if columns["time"].size < _FEWEST:
        raise RecordError(
            f"{counted(columns['time'].size, 'sample')} with a measurement; a fit needs {_FEWEST} at least, better dozens"
        )
    _check_times(given_time)
    return BumpTest(
        columns["time"],
        columns["output"],
        columns["measurement"],
        columns.get("setpoint"),
        _first_move(columns["output"]),
        tuple(notes),
        given_time,
    )


def _column(name: str, values: Any) -> Floats:
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise RecordError(f"{name} is {shown(values)}; give a list of numbers") from None
    if found.ndim != 1:
        raise RecordError(f"{name} has the shape {found.shape}; give one value per sample")
    large = np.abs(np.nan_to_num(found, nan=0.0)) > SIGNAL
    if large.any():
        i = int(np.flatnonzero(large)[0])
        raise RecordError(f"{name}: sample {i + 1} is {found[i]:g}, which no signal is; correct it, or make it nan")
    return found


def _held(output: Floats) -> tuple[Floats, list[str]]:
    """Return the output with the last value before each NaN in its place."""
    missing = np.isnan(output)
    if not missing.any():
        return output, []
    if missing[0]:
        raise RecordError("the output of the first sample is missing; begin the record where the output is known")
    last = np.maximum.accumulate(np.where(missing, 0, np.arange(output.size)))
    return output[last], [f"the output is missing at {counted(int(missing.sum()), 'sample')}, {_places(missing)}: taken as held"]


def _places(marked: npt.NDArray[np.bool_]) -> str:
    """Return which samples are marked, counted from 1."""
    at = np.flatnonzero(marked) + 1
    words = ", ".join(str(i) for i in at[:_PLACES])
    return f"number {words}{' and others' if at.size > _PLACES else ''}"


def _check_times(time: Floats) -> None:
    if not np.isfinite(time).all():
        i = int(np.flatnonzero(~np.isfinite(time))[0])
        raise RecordError(f"time: sample {i + 1} has no time; give every sample its time in seconds")
    falls = np.flatnonzero(np.diff(time) <= 0)
    if falls.size:
        i = int(falls[0]) + 1
        what = "is that of the sample before" if time[i] == time[i - 1] else f"goes back from {time[i - 1]:g} s"
        raise RecordError(f"time: sample {i + 1}, {time[i]:g} s, {what}; give samples in the order of their times, one for each")


def _first_move(output: Floats) -> int:
    moves = np.flatnonzero(np.diff(output)) + 1
    if not moves.size:
        raise FitRefusedError(
            f"the output stays at {output[0]:g}: without a bump there is nothing to fit; move the output in manual by some percent "
            f"and record until the measurement has settled"
        )
    if moves[0] >= output.size - 3:
        raise FitRefusedError(
            f"the output first moves at sample {moves[0] + 1} of {output.size}, at the end of the record; go on recording until "
            f"the measurement has settled"
        )
    return int(moves[0])


def name_moves(moves: Sequence[tuple[float, float]]) -> str:
    """Return the first moves of the output in words."""
    words = ", ".join(f"{size:+g} at {when:g} s" for when, size in moves[:_PLACES])
    return f"{words} and {len(moves) - _PLACES:,} more" if len(moves) > _PLACES else words
