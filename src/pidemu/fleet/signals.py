"""Where the signals of a fleet are kept: in memory, in NumPy files, or in a Parquet file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import FleetError
from pidemu.files.cache import warn
from pidemu.files.outputs import refuse_overlap
from pidemu.fleet.blocks import BlockOutcome
from pidemu.fleet.finished import Finished, finished
from pidemu.fleet.folder import Place, SignalFolder
from pidemu.fleet.parquet import ParquetFile
from pidemu.fleet.writing import End, with_parts

_FAULTS: Final = 5
"""Damaged files that are named; there may be thousands."""


class SignalStore:
    """Keeps the signals of a fleet, block by block, so that memory is bounded where they go to files.

    Parameters
    ----------
    keep : bool
        Keep signals in memory where they do not go to a folder.
    folder : str or Path, optional
        Folder for NumPy files (`SignalFolder`).
    parquet : str or Path, optional
        Parquet file (`ParquetFile`).
    resume : bool
        Go on with what an earlier run left there.

    Raises
    ------
    FleetError
        There are signals already, a place cannot be written, there is nothing to go on with, or pyarrow is not installed.
    """

    def __init__(
        self, keep: bool = True, folder: str | Path | None = None, parquet: str | Path | None = None, resume: bool = False
    ) -> None:
        if resume and folder is None and (parquet is None or keep):
            raise FleetError(
                "there is nothing to go on with: what is done is kept where signals go to files; "
                "give the folder (--signals, folder=) or the Parquet file (--parquet, parquet=) of the run that did not end"
            )
        refuse_overlap(with_parts({"folder": folder, "parquet": parquet}), FleetError)
        self._keep = keep
        self._folder = None if folder is None else SignalFolder(Path(folder), resume)
        self._parquet = None if parquet is None else ParquetFile(Path(parquet), resume)
        self._keys: Sequence[str] = ()

    def begin(self, tags: Sequence[str], keys: Sequence[str]) -> Iterator[tuple[int, Finished, Place | None]]:
        """Yield what is complete already: the loop's place in the fleet, its row, and where its signals are.

        Parameters
        ----------
        tags, keys : sequence of str
            Tag and key of every loop of the fleet. What was run with other ones is dropped.
        """
        self._keys = keys
        for place in (self._folder, self._parquet):
            if place is not None:
                place.lock()
        wanted = dict(zip(tags, keys, strict=True))
        in_folder = None if self._folder is None else self._folder.found(wanted)
        in_parquet = None if self._parquet is None else self._parquet.found(wanted)
        kept = [t for t in tags if (in_folder is None or t in in_folder) and (in_parquet is None or t in in_parquet)]
        damaged = [fault for place in (self._folder, self._parquet) if place is not None for fault in place.damaged]
        if damaged:
            more = f" and {len(damaged) - _FAULTS} more" if len(damaged) > _FAULTS else ""
            warn(f"{self._folder or self._parquet}: {', '.join(damaged[:_FAULTS])}{more}; the loops in it are run again")
        both = ((self._folder, in_folder), (self._parquet, in_parquet))
        others = [] if damaged else [place for place, found in both if place is not None and place.listed and not found]
        if others:
            raise FleetError(
                f"none of the loops in {others[0]} is one of this fleet as it is run now, with its settings, "
                f"process, steps and this version of pidemu; give the place of the run that did not end, or an empty one"
            )
        if self._folder is not None and in_folder is not None:
            self._folder.begin([in_folder[tag] for tag in kept])
        if self._parquet is not None:
            self._parquet.begin(kept)
        places = {tag: i for i, tag in enumerate(tags)}
        for tag in kept:
            if in_folder is not None:
                yield places[tag], *in_folder[tag]
            elif in_parquet is not None:
                yield places[tag], in_parquet[tag], None

    def __enter__(self) -> SignalStore:
        return self

    def room(self, shape: tuple[int, int, int]) -> Floats:
        """Return an array for the records of a block; several threads may ask at once.

        Raises
        ------
        FleetError
            The file cannot be written, or there is no room for it.
        """
        return np.empty(shape) if self._folder is None else self._folder.room(shape)

    def stored(self, outcome: BlockOutcome) -> BlockOutcome:
        """Write the records of a block, and return the outcome with them, or with the file, where they are kept.

        Raises
        ------
        FleetError
            They cannot be written.
        """
        assert outcome.records is not None
        if self._folder is None and self._parquet is None:
            return outcome
        rows = finished(outcome, self._keys)
        if self._parquet is not None:
            self._parquet.add(outcome, rows)
        if self._folder is None:
            return outcome if self._keep else replace(outcome, records=None)
        path = self._folder.add(outcome.records, rows)
        return replace(outcome, records=None, file=path)  # an open file for every block would be too many

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        how: End = "finished" if kind is None else "interrupted" if issubclass(kind, KeyboardInterrupt) else "failed"
        with contextlib.ExitStack() as both:  # whatever becomes of one of them, the other is closed
            if self._parquet is not None:
                both.callback(self._parquet.close, how)
            if self._folder is not None:
                both.callback(self._folder.close, how)
