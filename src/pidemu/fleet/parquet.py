"""A Parquet file of figures and signals: parts while the fleet runs, each of them whole, and one file when it is over."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from pidemu.errors import FleetError
from pidemu.files.leftovers import UNFINISHED
from pidemu.files.reading import is_file
from pidemu.files.writing import beside, check
from pidemu.fleet.blocks import COLUMNS, BlockOutcome
from pidemu.fleet.finished import FIELDS, Finished, read_row
from pidemu.fleet.judgement import MARGINS
from pidemu.fleet.lock import FolderLock
from pidemu.fleet.writing import End, after, instead_of, interrupted_name, writing

_PART: Final = "part-{}.parquet"
_SIGNALS: Final = ("output", "measurement")


class ParquetFile:
    """A Parquet file that takes a fleet block by block.

    Each block is a file of the folder ``FILE.parts``, which appears when it is on the disk. When the run is over, or interrupted,
    they become row groups of one file, with a row per loop: tag, card, `FIELDS`, and the lists ``output`` and ``measurement``.

    Parameters
    ----------
    path : Path
        The file.
    resume : bool
        Go on with its rows and with the parts; else there must be no parts.

    Attributes
    ----------
    listed : bool
        Whether `found` found loops, of whatever fleet.
    damaged : list of str
        What is wrong with parts whose loops are to be run again.

    Raises
    ------
    FleetError
        It cannot be written, there are parts of a run that did not end, or pyarrow is not installed.
    """

    def __init__(self, path: Path, resume: bool = False) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            raise FleetError(
                "a Parquet file needs pyarrow, which is not installed; pip install 'pidemu[parquet]' brings it"
            ) from None
        self._pa, self._pq = pa, pq
        self._schema: Any = _schema(pa)
        self._path, self._parts = path, path.with_name(f"{path.name}.parts")
        check(path, FleetError)
        if self._there() and not resume:
            raise FleetError(
                f"{self._parts} holds what a run had done that did not end; go on with it (--resume, resume=True), or remove it"
            )
        self._resume = resume
        self._alone: FolderLock | None = None
        self._numbers = itertools.count(1)
        self._begun = False
        self._taken: list[tuple[Path, set[str]]] = []
        self.listed = False
        self.damaged: list[str] = []

    def __str__(self) -> str:
        return str(self._path)

    def _there(self) -> list[Path]:
        return sorted(self._parts.glob(_PART.format("*")))

    def lock(self) -> None:
        """Keep other runs out until `close`.

        Raises
        ------
        FleetError
            Another run is writing the file, or the folder of its parts cannot be made.
        """
        with writing(self._parts, "give a file in a folder that can be written"):
            self._parts.mkdir(exist_ok=True)
        self._alone = FolderLock(self._parts)
        self._numbers = after(self._there())

    def found(self, wanted: Mapping[str, str]) -> dict[str, Finished]:
        """Return what is complete here, by tag.

        Parameters
        ----------
        wanted : mapping of str to str
            Key by tag: what was run otherwise does not count.
        """
        kept: dict[str, Finished] = {}
        self._taken = []
        for path in [self._path, interrupted_name(self._path), *self._there()] if self._resume else []:
            try:
                every = self._rows(path)
            except (OSError, ValueError, TypeError, KeyError):  # Arrow's are such
                every = []
                if path.parent == self._parts:
                    self.damaged.append(f"{path.name} is damaged")
            self.listed = self.listed or bool(every)
            rows = {one.tag: one for one in every if wanted.get(one.tag) == one.key and one.tag not in kept}
            self._taken.append((path, set(rows)))
            kept |= rows
        return kept

    def _rows(self, path: Path) -> list[Finished]:
        """Return the loops of a file, all of which is read: that its numbers are what was written is seen then only."""
        if not is_file(path):  # a pipe would be waited for
            return []
        with self._pq.ParquetFile(path, page_checksum_verification=True) as file:
            if not file.schema_arrow.equals(self._schema):
                return []
            for group in range(file.num_row_groups):
                file.read_row_group(group)
            return [read_row(row["tag"], row) for row in file.read(["tag", *FIELDS]).to_pylist()]

    def begin(self, kept: Iterable[str]) -> None:
        """Take the tags that go on to count, of those that `found` returned."""
        tags = set(kept)
        self._taken = [(path, own & tags) for path, own in self._taken]
        self._begun = True

    def add(self, outcome: BlockOutcome, rows: Sequence[Finished]) -> None:
        """Write a block.

        Raises
        ------
        FleetError
            It cannot be written.
        """
        assert outcome.records is not None
        records = [one.row for one in rows]
        columns: dict[str, Any] = {
            "tag": outcome.members.tags,
            "card": outcome.members.cards,
            **{name: [row[name] for row in records] for name in FIELDS},
            **{
                name: [outcome.records[k, :scans, i] for i, scans in enumerate(outcome.members.scans.tolist())]
                for k, name in enumerate(_SIGNALS)
            },
        }
        part = self._parts / _PART.format(f"{next(self._numbers):05d}")
        with beside(part, FleetError, binary=True) as stream:
            self._pq.write_table(self._pa.table(columns, schema=self._schema), stream, write_page_checksum=True)
        self._taken.append((part, {one.tag for one in rows}))

    def close(self, how: End) -> None:
        """Make one file of the parts where the run is over or interrupted; else leave them to a run that goes on.

        An interrupted run replaces no older file, and writes none where it did nothing.

        Raises
        ------
        FleetError
            The file cannot be written; the parts are there.
        """
        if self._alone is None:  # another run is writing
            return
        try:
            interrupted = how == "interrupted" and any(tags for path, tags in self._taken if path != self._path)
            if self._begun and (how == "finished" or interrupted):
                self._join(instead_of(self._path) if interrupted else self._path)
            with contextlib.suppress(OSError):
                self._parts.rmdir()  # where it is empty
        finally:
            self._alone.release()

    def _join(self, target: Path) -> None:
        with (
            beside(target, FleetError, binary=True) as stream,
            self._pq.ParquetWriter(stream, self._schema, write_page_checksum=True) as writer,
        ):
            for path, tags in self._taken:
                if tags:
                    self._copy(path, tags, writer)
        taken = [path for path, tags in self._taken if tags and path not in (target, self._path)]
        for path in {*taken, *self._there(), *self._parts.glob(f".*{UNFINISHED}")}:
            with contextlib.suppress(OSError):
                path.unlink()

    def _copy(self, path: Path, tags: set[str], writer: Any) -> None:
        with self._pq.ParquetFile(path) as file:
            for group in range(file.num_row_groups):
                table = file.read_row_group(group)
                own = [tag in tags for tag in table["tag"].to_pylist()]
                if any(own):
                    writer.write_table(table if all(own) else table.filter(self._pa.array(own)))


def _schema(pa: Any) -> Any:
    numbers = pa.list_(pa.float64())
    kinds = {**dict.fromkeys((*COLUMNS, *MARGINS, "scan"), pa.float64()), "scans": pa.int64()}
    kinds |= {"settled": pa.bool_(), "stable": pa.bool_()} | dict.fromkeys(_SIGNALS, numbers)
    return pa.schema([(name, kinds.get(name, pa.string())) for name in ("tag", "card", *FIELDS, *_SIGNALS)])
