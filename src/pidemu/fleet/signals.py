"""Where the signals of a fleet are kept: in memory, in NumPy files, or in a Parquet file."""

from __future__ import annotations

import csv
import itertools
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.errors import FleetError
from pidemu.fleet.blocks import COLUMNS, Outcome

Floats = npt.NDArray[np.float64]
INDEX: Final = "signals.csv"
"""The file of a folder that says where the signals of each loop are."""
_INDEX_HEADER: Final = ("tag", "file", "loop", "scan", "scans")


class SignalStore:
    """Keeps the signals of a fleet, block by block, so that memory is bounded where they go to files.

    In a folder, ``block-N.npy`` has the shape (2, scans, loops): output and measurement [%]; `INDEX` names the file and the loop's
    number in it for every tag. A Parquet file has a row per loop: tag, card, scan interval, figures, and the lists ``output`` and
    ``measurement``.

    Parameters
    ----------
    folder : str or Path, optional
        Folder for NumPy files; it is made where it is not there, and holds no signals yet.
    parquet : str or Path, optional
        Parquet file. With neither, signals stay in memory.

    Raises
    ------
    FleetError
        The folder holds signals already, a place cannot be written, or pyarrow is not installed.
    """

    def __init__(self, folder: str | Path | None = None, parquet: str | Path | None = None) -> None:
        self._folder = None if folder is None else Path(folder)
        self._numbers = itertools.count(1)
        self._index: list[tuple[object, ...]] = []
        self._parquet = None if parquet is None else _Parquet(Path(parquet))
        if self._folder is not None:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise FleetError(f"{self._folder}: {error.strerror}; give a folder that can be made and written") from None
            if (self._folder / INDEX).exists():
                raise FleetError(f"{self._folder} holds the signals of a fleet already; give another folder, or empty it")

    def __enter__(self) -> SignalStore:
        return self

    def room(self, shape: tuple[int, int, int]) -> Floats:
        """Return an array for the records of a block."""
        if self._folder is None:
            return np.empty(shape)
        path = self._folder / f"block-{next(self._numbers):05d}.npy"
        found: Floats = np.lib.format.open_memmap(path, mode="w+", dtype=np.float64, shape=shape)
        return found

    def stored(self, outcome: Outcome) -> Outcome:
        """Write the records of a block, and return the outcome with them where they are kept."""
        assert outcome.records is not None
        if self._parquet is not None:
            self._parquet.write(outcome)
        if self._folder is None:
            return outcome if self._parquet is None else replace(outcome, records=None)
        records = outcome.records
        if not isinstance(records, np.memmap):  # from a worker of a cluster
            here = self.room((records.shape[0], records.shape[1], records.shape[2]))
            here[:] = records
            records = here
        assert isinstance(records, np.memmap)
        records.flush()
        path = Path(str(records.filename))
        self._index += [(m.tag, path.name, i, m.trial.scan, m.trial.scans) for i, m in enumerate(outcome.members)]
        return replace(outcome, records=np.load(path, mmap_mode="r"))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._parquet is not None:
            self._parquet.close()
        if self._folder is not None:
            with open(self._folder / INDEX, "w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([_INDEX_HEADER, *self._index])


class _Parquet:
    """A Parquet file that grows by a row group per block."""

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
        fields = [("tag", text), ("card", text), ("scan", number), *((name, number) for name in COLUMNS)]
        self._schema = pa.schema([*fields, ("output", numbers), ("measurement", numbers)])
        try:
            self._writer: Any = pq.ParquetWriter(path, self._schema)
        except OSError as error:
            raise FleetError(f"{path}: {error.strerror or error}; give a file that can be written") from None

    def write(self, outcome: Outcome) -> None:
        assert outcome.records is not None
        count = len(outcome.members)
        columns: dict[str, Any] = {
            "tag": [m.tag for m in outcome.members],
            "card": [m.trial.settings.card.id for m in outcome.members],
            "scan": [m.trial.scan for m in outcome.members],
            **outcome.columns,
            "output": list(outcome.records[0, :, :count].T),
            "measurement": list(outcome.records[1, :, :count].T),
        }
        self._writer.write_table(self._pa.table(columns, schema=self._schema))

    def close(self) -> None:
        self._writer.close()
