"""Files that a fleet writes."""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pidemu.errors import FleetError


@contextlib.contextmanager
def writing(path: Path, remedy: str) -> Iterator[None]:
    """Make a `FleetError` of what goes wrong while a file is written, with the file and a remedy."""
    try:
        yield
    except OSError as error:
        raise FleetError(f"{path}: cannot be written: {error.strerror or error}; {remedy}") from None


def write_rows(path: str | Path, header: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write the columns of a header as CSV; numbers are written so that they read back the same.

    Parameters
    ----------
    path : str or Path
        The file.
    header : sequence of str
        The columns; what else is in a row is left out.
    rows : iterable of mapping
        Value by column; ``None`` is an empty cell.

    Raises
    ------
    FleetError
        The file cannot be written.
    """
    target = Path(path)
    with writing(target, "give a file that can"), target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, header, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
