"""Many computations of one kind: one is recorded, the others are replayed, and what is left is recorded anew or done one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from pidemu.arrays import Floats
from pidemu.columns.replay import Recording

_WORTH: Final = 4
"""Recording takes about three times as long as computing: so many of a kind are worth it."""
_TRIES: Final = 6
"""So many recordings that failed, or did for less than `_WORTH`, and the others of the kind are done one by one."""


class Recorded(Protocol):
    """What holds a recording, and what else is known of those it did for."""

    @property
    def recording(self) -> Recording:
        """The recording."""
        ...


R = TypeVar("R", bound=Recorded)


@dataclass(frozen=True)
class Lot:
    """Some of one kind.

    Attributes
    ----------
    which : ndarray, shape (n,)
        Their numbers in a list.
    columns : ndarray, shape (inputs, n)
        The numbers to compute with; or, of what was done, shape (results, n).
    """

    which: npt.NDArray[np.int64]
    columns: Floats

    def __len__(self) -> int:
        return len(self.which)

    def chosen(self, which: npt.NDArray[Any]) -> Lot:
        """Return some of them."""
        return Lot(self.which[which], self.columns[:, which])

    @classmethod
    def joined(cls, lots: Sequence[Lot]) -> Lot:
        """Return several lots as one, in the order of their numbers."""
        if len(lots) == 1:
            return lots[0]
        which, columns = np.concatenate([lot.which for lot in lots]), np.concatenate([lot.columns for lot in lots], axis=1)
        order = np.argsort(which)
        return cls(which[order], columns[:, order])


@dataclass
class KindOfComputation(Generic[R]):
    """How those of a kind are computed, as far as it is known."""

    _recordings: list[R] = field(default_factory=list)
    _vain: int = 0

    def compute(self, lot: Lot, record: Callable[[int, Sequence[float]], R]) -> tuple[list[tuple[R, Lot]], list[int]]:
        """Return what was done, with the recording that did it; and which are to be done one by one.

        Parameters
        ----------
        lot : Lot
            Those to compute.
        record : callable
            From the number of one in the list, and its numbers, to its recording. What it raises is no matter here: this one is
            then done alone, where it is raised again, or it cannot be recorded.
        """
        done: list[tuple[R, Lot]] = []
        alone: list[int] = []
        for recorded in self._recordings:
            lot = self._replayed(recorded, lot, done)
        while len(lot) >= _WORTH and self._vain < _TRIES:
            count = len(lot)
            try:
                recorded = record(int(lot.which[0]), lot.columns[:, 0].tolist())
            except Exception:
                self._vain += 1
                alone.append(int(lot.which[0]))
                lot = lot.chosen(np.arange(1, count))
                continue
            self._recordings.append(recorded)
            lot = self._replayed(recorded, lot, done)
            self._vain += count - len(lot) < _WORTH
        return done, [*alone, *lot.which.tolist()]

    def _replayed(self, recorded: R, lot: Lot, done: list[tuple[R, Lot]]) -> Lot:
        """Do those of a lot that a recording does for, and return the others."""
        if not len(lot):
            return lot
        found, fits = recorded.recording.replay(lot.columns)
        if fits.any():
            done.append((recorded, Lot(lot.which[fits], found[:, fits])))
        return lot.chosen(~fits)
