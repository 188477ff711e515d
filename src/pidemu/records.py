"""Recorded signals: CSV files with setpoint, measurement, and perhaps mode, operator's output and recorded output."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final, TextIO

import numpy as np
import numpy.typing as npt

from pidemu.errors import RecordError, suggest

Floats = npt.NDArray[np.float64]

_COLUMNS: Final = {
    "time": ("time", "t", "timestamp"),
    "sp": ("sp", "setpoint", "r"),
    "pv": ("pv", "measurement", "y"),
    "auto": ("auto", "automatic"),
    "manual": ("manual", "man"),
    "output": ("output", "out", "op", "cv", "u"),
}
_UNEVEN: Final = 0.01
"""Relative jitter of a time column that counts as none."""
_TRUE: Final = {"1", "1.0", "true", "yes", "auto", "automatic", "a"}
_FALSE: Final = {"0", "0.0", "false", "no", "man", "manual", "m"}


@dataclass(frozen=True)
class Record:
    """Recorded signals.

    Attributes
    ----------
    header : tuple of str
        Column names of the file.
    rows : tuple of tuple of str
        Its cells, as they stand.
    sp, pv : ndarray of float, shape (n,)
        Setpoint and measurement.
    time : ndarray of float, shape (n,), or None
        Time of the samples [s].
    auto, manual, output : ndarray of float, shape (n,), or None
        Automatic (1) or manual (0); the operator's output, NaN where empty; the recorded output, NaN where empty.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    sp: Floats
    pv: Floats
    time: Floats | None
    auto: Floats | None
    manual: Floats | None
    output: Floats | None


def read_record(path: str | Path) -> Record:
    """Read a CSV file with a header line; lines that start with ``#`` are comments.

    Columns are found by name: ``sp``, ``pv``, ``time`` (or ``t``: seconds or timestamps), ``auto``, ``manual`` (or ``man``),
    ``output`` (or ``out``, ``op``); others are kept and ignored.

    Parameters
    ----------
    path : path
        The file.

    Raises
    ------
    RecordError
        The file cannot be read, lacks a column, or holds what is no number: with line and column name.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise RecordError(f"{path}: not UTF-8 text; save the file as UTF-8") from None
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from None
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise RecordError(f"{path}: no samples; a record has a header line such as sp,pv and one line per scan")
    dialect = csv.get_dialect("excel")
    table = [(i, next(csv.reader([line], dialect))) for i, line in lines]
    header = [cell.strip() for cell in table[0][1]]
    places = _places(str(path), table[0][0], header)
    for i, row in table[1:]:
        if len(row) != len(header):
            raise RecordError(f"{path}:{i}: {len(row)} cells, the header has {len(header)}")
    columns: dict[str, Floats | None] = {
        name: np.array([_cell(str(path), i, row[at], header[at], name) for i, row in table[1:]]) if at is not None else None
        for name, at in places.items()
    }
    sp, pv = columns["sp"], columns["pv"]
    assert sp is not None
    assert pv is not None
    rows = tuple(tuple(row) for _, row in table[1:])
    return Record(tuple(header), rows, sp, pv, columns["time"], columns["auto"], columns["manual"], columns["output"])


def _places(path: str, line: int, header: list[str]) -> dict[str, int | None]:
    places: dict[str, int | None] = {}
    for name, words in _COLUMNS.items():
        hits = [i for i, cell in enumerate(header) if cell.casefold() in words]
        if len(hits) > 1:
            raise RecordError(f"{path}:{line}: columns {', '.join(header[i] for i in hits)} all mean {name}; keep one")
        places[name] = hits[0] if hits else None
    for name in ("sp", "pv"):
        if places[name] is None:
            split = "; the cells are separated by semicolons, save the file with commas" if ";" in "".join(header) else ""
            raise RecordError(f"{path}:{line}: no column '{name}' among {', '.join(header)}{suggest(name, header)}{split}")
    return places


def _cell(path: str, line: int, text: str, column: str, name: str) -> float:
    word = text.strip().casefold()
    if name == "auto":
        if word in _TRUE or word in _FALSE:
            return float(word in _TRUE)
        raise RecordError(f"{path}:{line}: column {column}: '{text}' is neither 1 (automatic) nor 0 (manual)")
    if not word and name in ("manual", "output"):
        return math.nan
    if name == "time":
        return _time(path, line, column, text.strip())
    if not word:
        raise RecordError(f"{path}:{line}: column {column}: empty; every sample needs a number")
    try:
        value = float(word)
    except ValueError:
        if re.fullmatch(r"[+-]?\d+,\d+", word):
            raise RecordError(f"{path}:{line}: column {column}: '{text}' has a comma; write a decimal point") from None
        raise RecordError(f"{path}:{line}: column {column}: '{text}' is not a number") from None
    if not math.isfinite(value) and name in ("sp", "pv"):
        raise RecordError(f"{path}:{line}: column {column}: '{text}' is not a finite number")
    return value


def _time(path: str, line: int, column: str, text: str) -> float:
    """Return seconds: the cell is a number of them, or a timestamp such as 2026-11-22T08:00:05."""
    try:
        return float(text)
    except ValueError:
        pass
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        wanted = "a number of seconds nor a timestamp such as 2026-11-22T08:00:05"
        raise RecordError(f"{path}:{line}: column {column}: '{text}' is neither {wanted}") from None


def interval(record: Record, path: str | Path, given: float | None) -> float | None:
    """Return the scan interval of a record [s]: the given one, else that of its time column, else ``None``.

    Parameters
    ----------
    record : Record
        The record.
    path : path
        Its file, for messages.
    given : float or None
        What the user says [s].

    Raises
    ------
    RecordError
        The time column is uneven, or contradicts `given`.
    """
    if record.time is None or record.time.size < 2:
        return given
    steps = np.diff(record.time)
    step = float(np.median(steps))
    uneven = int(np.argmax(np.abs(steps - step)))
    if not step > 0 or abs(steps[uneven] - step) > _UNEVEN * step:
        raise RecordError(
            f"{path}: the time column goes on by {steps[uneven]:g} s after sample {uneven} (counted from 0), elsewhere by "
            f"{step:g} s; one line per scan is needed"
        )
    if given is not None and abs(given - step) > _UNEVEN * step:
        raise RecordError(
            f"{path}: the time column has a step of {step:g} s, --scan says {given:g} s; leave --scan out, or the column"
        )
    return step if given is None else given


def write_record(record: Record, column: str, values: Iterable[float], stream: TextIO) -> None:
    """Write a record with one more column.

    Parameters
    ----------
    record : Record
        The record.
    column : str
        Name of the new column.
    values : iterable of float
        Its values, written so that they read back the same.
    stream : text stream
        Where to.
    """
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*record.header, column])
    for row, value in zip(record.rows, values, strict=True):
        writer.writerow([*row, repr(float(value))])
