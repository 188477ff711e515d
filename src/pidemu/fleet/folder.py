"""Signals in a folder: a NumPy file per block, and an index that grows with every block."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import itertools
import os
import stat
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import FleetError
from pidemu.files.tables import text_cell, write_rows
from pidemu.files.writing import beside
from pidemu.fleet.finished import FIELDS, Finished, read_row
from pidemu.fleet.lock import FolderLock
from pidemu.fleet.writing import End, after, writing

INDEX: Final = "signals.csv"
"""The file of a folder that says where the signals of each loop are, and what came of it."""
_HEADER: Final = ("tag", "file", "loop", "sha256", *FIELDS)
_BLOCK: Final = "block-{}.npy"
_ROOM: Final = "give a folder that can be written, with enough room"

Place = tuple[Path, int]
"""A file, and the loop's number in it."""


class SignalFolder:
    """A folder of signals.

    ``block-N.npy`` has the shape (2, scans, loops): output and measurement [%], NaN after a loop's last scan. `INDEX` has a row per
    loop: tag, file, the loop's number in it, the file's SHA-256, and `FIELDS`. A block is listed when its file is on the disk, so
    that what is listed is complete, whatever ends the run.

    Parameters
    ----------
    folder : Path
        The folder; it is made where it is not there.
    resume : bool
        Go on with what is there; else there must be no signals.

    Attributes
    ----------
    listed : bool
        Whether `found` found loops in the index, of whatever fleet.
    damaged : list of str
        What is wrong with blocks whose loops are to be run again.

    Raises
    ------
    FleetError
        The folder holds signals already, or cannot be written.
    """

    def __init__(self, folder: Path, resume: bool = False) -> None:
        self._folder = folder.resolve()  # as NumPy names its files
        self._unfinished: set[Path] = set()
        self.listed = False
        self.damaged: list[str] = []
        self._digests: dict[str, str] = {}
        self._lock = threading.Lock()
        self._alone: FolderLock | None = None
        self._numbers = itertools.count(1)
        with writing(self._folder, "give a folder that can be made and written"):
            self._made = not self._folder.exists()
            self._folder.mkdir(parents=True, exist_ok=True)
            blocks = self._blocks()
        self._index = self._folder / INDEX
        if (self._index.exists() or blocks) and not resume:
            raise FleetError(
                f"{folder} holds the signals of a fleet already; go on with them (--resume, resume=True), give another folder, "
                f"or empty it"
            )

    def __str__(self) -> str:
        return str(self._folder)

    def _blocks(self) -> list[Path]:
        return sorted(self._folder.glob(_BLOCK.format("*")))

    def lock(self) -> None:
        """Keep other runs out until `close`; what is there by now stays what it is.

        Raises
        ------
        FleetError
            Another run is writing here.
        """
        self._alone = FolderLock(self._folder)
        self._numbers = after(self._blocks())

    def found(self, wanted: Mapping[str, str]) -> dict[str, tuple[Finished, Place]]:
        """Return what is complete here, by tag.

        Parameters
        ----------
        wanted : mapping of str to str
            Key by tag: what was run otherwise does not count.
        """
        written = {str(text_cell(tag)): tag for tag in wanted}
        blocks: dict[str, _Block] = {}
        faults: dict[str, str] = {}
        kept: dict[str, tuple[Finished, Place]] = {}
        for cells in self._rows():
            self.listed = True
            row = dict(zip(_HEADER, cells, strict=True))
            tag, name = written.get(row["tag"], ""), Path(row["file"]).name
            with contextlib.suppress(ValueError, TypeError, KeyError):
                one, lane = read_row(tag, row), int(row["loop"])
                if one.key != wanted[tag]:
                    continue
                if name not in blocks:
                    blocks[name] = _look(self._folder / name)
                shape, digest, fault = blocks[name]
                if digest != row["sha256"] or not (one.scans <= shape[1] and 0 <= lane < shape[2]):
                    faults[name] = f"{name} is {fault or 'damaged'}"
                else:
                    kept[tag] = one, (self._folder / name, lane)
        self.damaged = list(faults.values())
        self._digests = {name: block.digest for name, block in blocks.items()}
        return kept

    def _rows(self) -> Iterator[list[str]]:
        """Yield the rows of the index that were written whole: the last one may not have been."""
        try:
            text = self._index.read_bytes().decode(errors="replace")
        except FileNotFoundError:
            return
        except OSError as error:
            raise FleetError(f"{self._index}: cannot be read: {error.strerror}; give another folder") from None
        whole = io.StringIO(text[: text.rfind("\n") + 1], newline="")
        rows = csv.reader(whole)
        with contextlib.suppress(csv.Error, StopIteration):
            self.listed = tuple(next(rows)) != _HEADER  # another version wrote it
            if not self.listed:
                yield from (row for row in rows if len(row) == len(_HEADER))

    def begin(self, kept: Sequence[tuple[Finished, Place]]) -> None:
        """Take what is there and goes on to count; files of which nothing does are removed.

        Parameters
        ----------
        kept : sequence
            Some of what `found` returned.
        """
        if not kept and not self._index.exists():
            files: set[Path] = set()
        else:
            files = {path for _, (path, _) in kept}
            with beside(self._index, FleetError) as stream:
                write_rows(stream, [_HEADER, *(self._row(one, place) for one, place in kept)])
        for path in self._blocks():
            if path not in files:
                with contextlib.suppress(OSError):
                    path.unlink()

    def room(self, shape: tuple[int, int, int]) -> Floats:
        """Return an array for the records of a block; several threads may ask at once.

        Raises
        ------
        FleetError
            The file cannot be written, or there is no room for it.
        """
        with self._lock:
            path = self._folder / _BLOCK.format(f"{next(self._numbers):05d}")
            self._unfinished.add(path)
        with writing(path, _ROOM):
            found: Floats = np.lib.format.open_memmap(path, mode="w+", dtype=np.float64, shape=shape)
            if hasattr(os, "posix_fallocate"):  # what there is no room for is refused here, and does not end the process later
                with path.open("r+b") as file:
                    os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
        return found

    def add(self, records: Floats, rows: Sequence[Finished]) -> Path:
        """Write the records of a block to the disk, then list it; return its file.

        Parameters
        ----------
        records : ndarray, shape (2, scans, loops or more)
            What `room` returned, filled, or what came from elsewhere.
        rows : sequence of Finished
            Its loops.

        Raises
        ------
        FleetError
            They cannot be written.
        """
        if not isinstance(records, np.memmap):  # from a worker of a cluster
            here = self.room((records.shape[0], records.shape[1], records.shape[2]))
            here[:] = records
            records = here
        assert isinstance(records, np.memmap)
        path = Path(str(records.filename))
        with writing(path, _ROOM):
            records.flush()
            with path.open("r+b") as file:
                os.fsync(file.fileno())
            self._digests[path.name] = _digest(path)
        self._unfinished.discard(path)  # first: what is listed is never removed, wherever Ctrl-C comes
        text = io.StringIO()
        write_rows(text, ([] if self._index.exists() else [_HEADER]) + [self._row(one, (path, i)) for i, one in enumerate(rows)])
        with writing(self._index, _ROOM):
            _append(self._index, text.getvalue().encode(errors="backslashreplace"))
        return path

    def _row(self, one: Finished, place: Place) -> list[Any]:
        row = one.row
        return [one.tag, place[0].name, place[1], self._digests[place[0].name], *(row[name] for name in FIELDS)]

    def close(self, how: End) -> None:
        """Remove the files of blocks that were not finished; a folder of a run that is over has an index, if an empty one."""
        for path in self._unfinished:
            with contextlib.suppress(OSError):
                path.unlink()
        if how == "finished" and not self._index.exists():
            with beside(self._index, FleetError) as stream:
                write_rows(stream, [_HEADER])
        if self._made:
            with contextlib.suppress(OSError):
                self._folder.rmdir()  # where it is empty
        if self._alone is not None:
            self._alone.release()


def _append(path: Path, data: bytes) -> None:
    """Append to a file all or nothing, and to the disk; in one call, which Ctrl-C does not divide."""
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o666)
    try:
        before = os.fstat(number).st_size
        written = os.write(number, data)
        while written < len(data):
            try:
                written += os.write(number, data[written:])
            except OSError:
                os.ftruncate(number, before)
                raise
        os.fsync(number)
    finally:
        os.close(number)


class _Block(NamedTuple):
    """What the file of a block holds: the shape of its records, the hash of all of it, or what is wrong."""

    shape: tuple[int, ...] = (0, 0, 0)
    digest: str = ""
    fault: str = ""


def _look(path: Path) -> _Block:
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return _Block(fault="no file of its own")
        records = np.load(path, mmap_mode="r", allow_pickle=False)
        sound = records.ndim == 3 and records.dtype == np.float64
        return _Block(records.shape, _digest(path)) if sound else _Block()
    except FileNotFoundError:
        return _Block(fault="missing")
    except (OSError, ValueError, EOFError):
        return _Block()


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
