"""Signals of a controller besides setpoint and measurement, the modes that follow from them, and what happens while it runs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Flags, Floats
from pidemu.errors import ScanError

Mode = Literal["power-up", "manual", "automatic", "cascade", "tracking", "hold"]

MODES: Final[tuple[Mode, ...]] = ("manual", "automatic", "cascade", "tracking", "hold")
SIGNALS: Final = {"cascade": "cascade", "track": "track", "external_reset": "reset", "feedforward": "feedforward"}
"""Name of the program's input by the name of the argument."""


FINITE: Final = {
    "manual": "manual output",
    "track": "output to follow",
    "external_reset": "external reset",
    "feedforward": "feedforward",
}
"""Signals that may be absent, and may not be infinite or larger than any signal."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened while a controller ran.

    Attributes
    ----------
    scan : int
        Which scan, counted from 0.
    kind : {"transfer", "settings", "signal", "interval", "state"}
        A change of mode, of settings, a signal that is not a number, a scan interval that is not positive, or a state that is no
        longer a finite number.
    text : str
        What happened.
    bump : float
        What the output moved by in this scan [as output limits]; for `settings`, how much further than without the change.
    scans : int
        For how many scans in a row, from `scan` on.
    """

    scan: int
    kind: Literal["transfer", "settings", "signal", "interval", "state"]
    text: str
    bump: float = 0.0
    scans: int = 1


def absent(signal: str) -> float:
    """Return what a signal is where there is none."""
    return 0.0 if signal == "feedforward" else nan


def mode_of(auto: bool, given: Mapping[str, float]) -> Mode:
    """Return the mode of a scan from the flag and the signals given."""
    if not isnan(given.get("track", nan)):
        return "tracking"
    if auto and not isnan(given.get("cascade", nan)):
        return "cascade"
    return "automatic" if auto else "manual"


def modes_of(signals: Mapping[str, Floats]) -> npt.NDArray[np.int_]:
    """Return the number in `MODES` of every sample's mode."""
    modes = np.where(signals["auto"] > 0, 1, 0)
    if "cascade" in signals:
        modes = np.where((modes == 1) & ~np.isnan(signals["cascade"]), 2, modes)
    if "track" in signals:
        modes = np.where(~np.isnan(signals["track"]), 3, modes)
    return np.where(signals["hold"] > 0, 4, modes)


def stretches(modes: npt.NDArray[np.int_], odd: Flags) -> Iterator[tuple[int, int]]:
    """Yield start and end of every stretch in one mode that is odd, or not, throughout."""
    if modes.size:
        edges = np.flatnonzero((np.diff(modes) != 0) | (np.diff(odd.astype(int)) != 0)) + 1
        yield from itertools.pairwise([0, *edges.tolist(), modes.size])


def broadcast(columns: Sequence[npt.ArrayLike]) -> list[Floats]:
    """Return signals of equal length, one-dimensional.

    Raises
    ------
    ScanError
        They have different lengths, or more dimensions.
    """
    try:
        arrays = [np.asarray(c, dtype=float) for c in columns]
    except (TypeError, ValueError, OverflowError) as error:
        raise ScanError(f"a signal is not made of numbers: {error}") from None
    try:
        signals = np.broadcast_arrays(*(np.atleast_1d(a) for a in arrays))
    except ValueError:
        lengths = ", ".join(str(a.size) for a in arrays[:4])
        raise ScanError(f"the signals have different lengths: {lengths}") from None
    if signals[0].ndim != 1:
        raise ScanError("the signals must be one-dimensional")
    return list(signals)
