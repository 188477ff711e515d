"""Recorded signals: CSV files with setpoint, measurement, and perhaps mode, operator's output, recorded output and more."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, TextIO

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import RecordError, suggest
from pidemu.excerpt import quoted, visible
from pidemu.files.columns import AT_ONCE, RowsOfText, plain_numbers, rows_of, write_longer
from pidemu.files.reading import Kind, read_text
from pidemu.files.tables import counted, split_lines, split_row, write_rows
from pidemu.plausible import TIME, plain_number

_COLUMNS: Final = {
    "time": ("time", "t", "timestamp"),
    "sp": ("sp", "setpoint", "r"),
    "pv": ("pv", "measurement", "y"),
    "auto": ("auto", "automatic"),
    "manual": ("manual", "man"),
    "output": ("output", "out", "op", "cv", "u"),
    "cascade": ("cascade", "cas", "remote_sp", "rsp", "remote_setpoint"),
    "track": ("track", "tracking"),
    "external_reset": ("external_reset", "reset_signal", "ext_reset"),
    "feedforward": ("feedforward", "ff"),
    "hold": ("hold",),
    "interval": ("interval", "dt"),
}
_MAY_BE_EMPTY: Final = ("manual", "output", "cascade", "track", "external_reset", "feedforward", "interval")
SIGNALS: Final = ("cascade", "track", "external_reset", "feedforward", "hold")
"""Columns that go to the controller as they are, under the names of its arguments."""
_KIND: Final = Kind("a record", "save it as CSV text in UTF-8, with a header line such as sp,pv", limit=2**30)
_TRUE: Final = {"1", "1.0", "true", "yes", "auto", "automatic", "a"}
_FALSE: Final = {"0", "0.0", "false", "no", "man", "manual", "m"}


@dataclass(frozen=True)
class Record:
    """Recorded signals.

    Attributes
    ----------
    sp, pv : ndarray of float, shape (n,)
        Setpoint and measurement; NaN and infinity where the file says so.
    time : ndarray of float, shape (n,), or None
        Time of the samples [s]; of timestamps, since the first one.
    auto, manual, output : ndarray of float, shape (n,), or None
        Automatic (1) or manual (0); the operator's output, NaN where empty; the recorded output, NaN where empty.
    cascade, track, external_reset, feedforward : ndarray of float, shape (n,), or None
        Remote setpoint, output to follow, external reset and feedforward; NaN where empty: no signal.
    hold : ndarray of float, shape (n,), or None
        Whether the controller stands still (1).
    interval : ndarray of float, shape (n,), or None
        Time since the last scan [s], NaN where empty: nominal.
    header : tuple of str
        Column names of the file.
    rows : sequence of tuple of str
        Its cells, as they stand, without blanks around.
    names : mapping
        The file's own name of a column, by the names above.
    comments : tuple of str
        The comment lines above the header.
    skipped : str
        Which lines of the file say nothing, in words: ``skipped: 2 comment lines above the header``.
    delimiter : str
        What separates its cells: a comma, a semicolon or a tab.
    said : str
        The first line of the file, where it says so: ``sep=;``.
    """

    sp: Floats
    pv: Floats
    time: Floats | None = None
    auto: Floats | None = None
    manual: Floats | None = None
    output: Floats | None = None
    cascade: Floats | None = None
    track: Floats | None = None
    external_reset: Floats | None = None
    feedforward: Floats | None = None
    hold: Floats | None = None
    interval: Floats | None = None
    header: tuple[str, ...] = ()
    rows: Sequence[tuple[str, ...]] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    comments: tuple[str, ...] = ()
    skipped: str = ""
    delimiter: str = ","
    said: str = ""

    @property
    def signals(self) -> dict[str, Floats]:
        """The signals beyond setpoint, measurement, mode and operator's output, by the name of the controller's argument.

        A column that is empty throughout is not a signal.
        """
        found = {name: getattr(self, name) for name in SIGNALS}
        return {name: x for name, x in found.items() if x is not None and not np.isnan(x).all()}

    @property
    def by_hand(self) -> Floats | None:
        """What is taken for the operator's output: the column of that name, else the recorded output."""
        return self.output if self.manual is None else self.manual


def read_record(path: str | Path, needed: Sequence[str] = ("sp", "pv")) -> Record:
    """Read a CSV file with a header line; lines above it that begin with ``# ``, or are just ``#``, are comments.

    The cells are separated by commas, or by semicolons or tabs where the header line has these.

    Columns are found by name, in any case: ``sp``, ``pv``, ``time`` (or ``t``: seconds or timestamps), ``auto``, ``manual`` (or
    ``man``), ``output`` (or ``out``, ``op``), ``cascade`` (or ``cas``, ``rsp``), ``track``, ``external_reset``, ``feedforward`` (or
    ``ff``), ``hold``, ``interval`` (or ``dt``); others are kept and ignored. Numbers are written with the digits 0 to 9 and a
    decimal point; ``nan`` and ``inf`` where the signal was none.

    Parameters
    ----------
    path : path
        The file.
    needed : sequence of str
        Columns that it must have, by the names above. A setpoint or measurement that it need not have, and has not, is NaN.

    Raises
    ------
    RecordError
        The file cannot be read, lacks a column, or holds what is not a number: with line and column name.
    """
    lines = split_lines(read_text(path, RecordError, _KIND))
    shown = visible(str(path))
    if len(lines.rows) < 2:
        raise RecordError(f"{shown}: no samples; a record has a header line such as {','.join(needed)} and one line per scan")
    if lines.contradiction:
        raise RecordError(f"{shown}:{lines.rows[0][0]}: {lines.contradiction}")
    numbers, texts = zip(*lines.rows, strict=True)
    header = _row(f"{shown}:{numbers[0]}", texts[0], lines.delimiter)
    places = _places(shown, numbers[0], header, needed)
    read = _Columns(shown, header, places)
    for start in range(1, len(texts), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        read.add(numbers[part], texts[part], lines.delimiter)
    columns = read.columns()
    for name in ("sp", "pv"):
        columns.setdefault(name, np.full(len(texts) - 1, math.nan))
    return Record(
        header=tuple(header),
        rows=RowsOfText(texts[1:], lines.delimiter),
        names={name: header[at] for name, at in places.items()},
        comments=lines.comments,
        skipped=lines.skipped,
        delimiter=lines.delimiter,
        said=lines.said,
        **columns,
    )


class _Columns:
    """The columns of a record, read some rows at a time.

    Parameters
    ----------
    path : str
        The file, for messages.
    header : list of str
        The names of its columns.
    places : mapping of str to int
        Which of them are what.
    """

    def __init__(self, path: str, header: list[str], places: Mapping[str, int]) -> None:
        self._path, self._header, self._places = path, header, places
        self._parts: dict[str, list[Floats]] = {name: [] for name in places}
        self._first: float | datetime | None = None

    def add(self, numbers: Sequence[int], texts: Sequence[str], delimiter: str) -> None:
        """Read rows, with their lines in the file."""
        rows = self._rows(numbers, texts, delimiter)
        cells = list(zip(*rows, strict=True))
        for name, at in self._places.items():
            self._parts[name].append(self._column(name, at, cells[at], numbers))

    def columns(self) -> dict[str, Floats]:
        """Return what was read, by name."""
        return {name: np.concatenate(parts) for name, parts in self._parts.items()}

    def _rows(self, numbers: Sequence[int], texts: Sequence[str], delimiter: str) -> list[list[str]]:
        try:
            rows = rows_of(texts, delimiter)
        except ValueError:  # once more, to find out which
            rows = [_row(f"{self._path}:{i}", text, delimiter) for i, text in zip(numbers, texts, strict=True)]
        for i, row in zip(numbers, rows, strict=True):
            if len(row) != len(self._header):
                remark = "; comments stand above the header" if row[0].startswith("#") else ""
                raise RecordError(f"{self._path}:{i}: {counted(len(row), 'cell')}, the header has {len(self._header)}{remark}")
        return rows

    def _column(self, name: str, at: int, cells: Sequence[str], numbers: Sequence[int]) -> Floats:
        """Return a column's numbers: all at once where they are plain, else cell by cell."""
        found = None if name in ("auto", "hold") or isinstance(self._first, datetime) else plain_numbers(cells)
        if found is not None and (name not in ("time", "interval") or all(map(TIME.has, set(found.tolist())))):
            if name == "time" and self._first is None:
                self._first = float(found[0])
            return found
        known: dict[str, float] = {}
        for i, cell in zip(numbers, cells, strict=True):
            if cell not in known:
                where, text = f"{self._path}:{i}: column {self._header[at]}", cell.strip()
                known[cell] = self._seconds(where, text) if name == "time" else _cell(where, text, name)
        return np.array([known[cell] for cell in cells])

    def _seconds(self, where: str, text: str) -> float:
        """Return a time in seconds; that of a timestamp, such as 2026-11-22T08:00:05, since the first one."""
        x = _time(where, text)
        self._first = x if self._first is None else self._first
        if isinstance(x, datetime) and isinstance(self._first, datetime):
            return (x - self._first).total_seconds()
        if isinstance(x, datetime) or isinstance(self._first, datetime):
            raise RecordError(f"{where}: '{quoted(text)}' is not like the cells above; write seconds or timestamps throughout")
        return x


def _row(where: str, line: str, delimiter: str) -> list[str]:
    try:
        return split_row(line, delimiter)
    except ValueError as error:
        raise RecordError(f"{where}: {error}") from None


def _places(path: str, line: int, header: list[str], needed: Sequence[str]) -> dict[str, int]:
    places: dict[str, int] = {}
    for name, words in _COLUMNS.items():
        hits = [i for i, cell in enumerate(header) if cell.casefold() in words]
        if len(hits) > 1:
            raise RecordError(f"{path}:{line}: columns {', '.join(header[i] for i in hits)} all mean {name}; keep one")
        if hits:
            places[name] = hits[0]
    for name in needed:
        if name not in places:
            among = quoted(", ".join(header), 200)
            marked = next((cell for cell in header if cell.startswith("#") and cell[1:].strip().casefold() in _COLUMNS[name]), None)
            hint = suggest(name, header) if marked is None else f"; remove the # of '{quoted(marked)}'"
            raise RecordError(f"{path}:{line}: no column '{name}' among {among}{hint}")
    return places


def _cell(where: str, text: str, name: str) -> float:
    word = text.casefold()
    if name in ("auto", "hold"):
        return _yes_or_no(where, text, name)
    if not word and name in _MAY_BE_EMPTY:
        return math.nan
    if not word:
        raise RecordError(f"{where}: empty; every sample needs a number")
    try:
        value = plain_number(text, words=True)
    except ValueError as error:
        raise RecordError(f"{where}: {error}") from None
    if name == "interval" and math.isnan(value):
        raise RecordError(f"{where}: '{text}' is not an interval; leave the cell empty for the nominal one")
    if name == "interval" and math.isfinite(value) and not TIME.has(value):
        raise RecordError(f"{where}: {TIME.refusal(f'{value:g} s')}")
    if name in SIGNALS and math.isinf(value):
        raise RecordError(f"{where}: '{text}' is not a finite number; leave the cell empty where there is no signal")
    return value


def _yes_or_no(where: str, text: str, name: str) -> float:
    word = text.casefold()
    if name == "hold" and not word:
        return 0.0
    if word in _TRUE or word in _FALSE:
        return float(word in _TRUE)
    meaning = ("automatic", "manual") if name == "auto" else ("hold", "no hold")
    raise RecordError(f"{where}: '{quoted(text)}' is neither 1 ({meaning[0]}) nor 0 ({meaning[1]})")


def _time(where: str, text: str) -> float | datetime:
    with contextlib.suppress(ValueError):
        time = plain_number(text)
        if TIME.has(time):
            return time
        raise RecordError(f"{where}: {TIME.refusal(f'{time:g} s')}")
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        wanted = "a number of seconds nor a timestamp such as 2026-11-22T08:00:05"
        raise RecordError(f"{where}: '{quoted(text)}' is neither {wanted}") from None
    return stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)  # a clock change is no gap


def write_record(record: Record, columns: Mapping[str, Sequence[float] | Floats], stream: TextIO) -> None:
    """Write a record with its comments and with more columns, its cells separated as they were.

    Parameters
    ----------
    record : Record
        The record, with its comments, header, rows and delimiter.
    columns : mapping
        Values of the new columns by name, written so that they read back the same.
    stream : text stream
        Where to.
    """
    stream.writelines(f"{line}\n" for line in ([record.said] if record.said else []) + [*record.comments])
    write_rows(stream, [[*record.header, *columns]], delimiter=record.delimiter)
    write_longer(stream, record.rows, list(columns.values()), record.delimiter)
