"""Where the signals of a fleet are kept: in memory, in NumPy files, or in a Parquet file."""

from __future__ import annotations

import contextlib
import csv
import itertools
import os
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.errors import FleetError
from pidemu.fleet.blocks import COLUMNS, Outcome
from pidemu.fleet.judgement import MARGINS, judgement
from pidemu.fleet.writing import writing

Floats = npt.NDArray[np.float64]
INDEX: Final = "signals.csv"
"""The file of a folder that says where the signals of each loop are."""
_INDEX_HEADER: Final = ("tag", "file", "loop", "scan", "scans")
_BLOCK: Final = "block-{}.npy"
_OTHER_FILE: Final = "give a file that can be written, where there is enough room"


class SignalStore:
    """Keeps the signals of a fleet, block by block, so that memory is bounded where they go to files.

    In a folder, ``block-N.npy`` has the shape (2, scans, loops): output and measurement [%], NaN after a loop's last scan; `INDEX`
    names the file, the loop's number in it, scan interval [s] and number of scans for every tag. A Parquet file has a row per loop:
    tag, card, status, scan interval, figures, margins, and the lists ``output`` and ``measurement``; it appears when the run is
    over.

    Parameters
    ----------
    keep : bool
        Keep signals in memory where they do not go to a folder.
    folder : str or Path, optional
        Folder for NumPy files; it is made where it is not there, and holds no signals yet.
    parquet : str or Path, optional
        Parquet file.

    Raises
    ------
    FleetError
        The folder holds signals already, a place cannot be written, or pyarrow is not installed.
    """

    def __init__(self, keep: bool = True, folder: str | Path | None = None, parquet: str | Path | None = None) -> None:
        self._keep, self._folder = keep, None if folder is None else Path(folder).resolve()  # as NumPy names its files
        self._numbers = itertools.count(1)
        self._unfinished: set[Path] = set()
        self._index: list[tuple[object, ...]] = []
        if self._folder is not None:
            with writing(self._folder, "give a folder that can be made and written"):
                self._folder.mkdir(parents=True, exist_ok=True)
            if (self._folder / INDEX).exists() or any(self._folder.glob(_BLOCK.format("*"))):
                raise FleetError(f"{folder} holds the signals of a fleet already; give another folder, or empty it")
        self._parquet = None if parquet is None else _Parquet(Path(parquet))

    def __enter__(self) -> SignalStore:
        return self

    def room(self, shape: tuple[int, int, int]) -> Floats:
        """Return an array for the records of a block; several threads may ask at once.

        Raises
        ------
        FleetError
            The file cannot be written, or there is no room for it.
        """
        if self._folder is None:
            return np.empty(shape)
        path = self._folder / _BLOCK.format(f"{next(self._numbers):05d}")
        self._unfinished.add(path)
        with writing(path, "give a folder that can be written, with enough room"):
            found: Floats = np.lib.format.open_memmap(path, mode="w+", dtype=np.float64, shape=shape)
            if hasattr(os, "posix_fallocate"):  # what there is no room for is refused here, and does not end the process later
                with path.open("r+b") as file:
                    os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
        return found

    def stored(self, outcome: Outcome) -> Outcome:
        """Write the records of a block, and return the outcome with them, or with the file, where they are kept.

        Raises
        ------
        FleetError
            They cannot be written.
        """
        assert outcome.records is not None
        if self._parquet is not None:
            self._parquet.write(outcome)
        if self._folder is None:
            return outcome if self._keep else replace(outcome, records=None)
        records = outcome.records
        if not isinstance(records, np.memmap):  # from a worker of a cluster
            here = self.room((records.shape[0], records.shape[1], records.shape[2]))
            here[:] = records
            records = here
        assert isinstance(records, np.memmap)
        path = Path(str(records.filename))
        with writing(path, "give a folder that can be written, with enough room"):
            records.flush()
        self._index += [(m.tag, path.name, i, m.trial.scan, m.trial.scans) for i, m in enumerate(outcome.members)]
        self._unfinished.discard(path)
        return replace(outcome, records=None, file=path)  # an open file for every block would be too many

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._folder is not None:
            for path in self._unfinished:
                with contextlib.suppress(OSError):
                    path.unlink()
            if self._index or kind is None:
                index = self._folder / INDEX
                with writing(index, "give a folder that can be written"), index.open("w", newline="", encoding="utf-8") as file:
                    csv.writer(file).writerows([_INDEX_HEADER, *self._index])
        if self._parquet is not None:
            self._parquet.close(finished=kind is None)


class _Parquet:
    """A Parquet file that grows by a row group per block, under another name until it is finished."""

    def __init__(self, path: Path) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            raise FleetError(
                "a Parquet file needs pyarrow, which is not installed; pip install 'pidemu[parquet]' brings it"
            ) from None
        self._pa: Any = pa
        text, number, numbers = pa.string(), pa.float64(), pa.list_(pa.float64())
        fields = [("tag", text), ("card", text), ("status", text), ("scan", number), *((name, number) for name in COLUMNS)]
        fields += [("settled", pa.bool_()), ("stable", pa.bool_()), *((name, number) for name in MARGINS)]
        self._schema = pa.schema([*fields, ("output", numbers), ("measurement", numbers)])
        self._path, self._unfinished = path, path.with_name(f"{path.name}.unfinished")
        if path.is_dir():
            raise FleetError(f"{path} is a folder; give a file that can be written")
        with writing(path, _OTHER_FILE):
            self._writer: Any = pq.ParquetWriter(self._unfinished, self._schema)

    def write(self, outcome: Outcome) -> None:
        assert outcome.records is not None
        lanes = [(i, m.trial.scans) for i, m in enumerate(outcome.members)]
        judged = [judgement(outcome, i) for i, _ in lanes]
        columns: dict[str, Any] = {
            "tag": [m.tag for m in outcome.members],
            "card": [m.trial.settings.card.id for m in outcome.members],
            "status": [j.status for j in judged],
            "scan": [m.trial.scan for m in outcome.members],
            **outcome.columns,
            "settled": [j.settled for j in judged],
            "stable": [j.stable for j in judged],
            **{name: [j.margins.get(name) for j in judged] for name in MARGINS},
            "output": [outcome.records[0, :scans, i] for i, scans in lanes],
            "measurement": [outcome.records[1, :scans, i] for i, scans in lanes],
        }
        with writing(self._path, _OTHER_FILE):
            self._writer.write_table(self._pa.table(columns, schema=self._schema))

    def close(self, *, finished: bool) -> None:
        with writing(self._path, _OTHER_FILE):
            try:
                self._writer.close()
                if finished:
                    os.replace(self._unfinished, self._path)
            finally:
                self._unfinished.unlink(missing_ok=True)
