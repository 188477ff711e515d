"""Files that a fleet writes."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Literal

from pidemu.errors import FleetError
from pidemu.excerpt import visible
from pidemu.files.writing import is_replaced

End = Literal["finished", "interrupted", "failed"]
"""How a run ended."""


@contextlib.contextmanager
def writing(path: Path, remedy: str) -> Iterator[None]:
    """Make a `FleetError` of what goes wrong while a file is written, with the file and a remedy."""
    try:
        yield
    except OSError as error:
        raise FleetError(f"{path}: cannot be written: {error.strerror or error}; {remedy}") from None


def after(files: Iterable[Path]) -> itertools.count[int]:
    """Return the numbers after those of files such as ``block-00001.npy``."""
    numbers = (path.stem.rpartition("-")[2] for path in files)
    return itertools.count(1 + max((int(n) for n in numbers if n.isdecimal()), default=0))


def interrupted_name(path: str | Path) -> Path:
    """Return the name for what an interrupted run has done, beside that of the whole."""
    return Path(path).with_name(f"{Path(path).stem}.interrupted{Path(path).suffix}")


def instead_of(path: str | Path) -> Path:
    """Return where what an interrupted run has done is written: an older file is not replaced."""
    return interrupted_name(path) if is_replaced(path) else Path(path)


def refuse_overlap(outputs: Mapping[str, str | Path | None]) -> None:
    """Refuse files and folders that are the same or inside each other: one would be lost.

    Parameters
    ----------
    outputs : mapping of str to path or None
        What is written, by what the user calls it; a Parquet file's name holds ``parquet``.

    Raises
    ------
    FleetError
        Two of them overlap.
    """
    places = [(f"{name} {visible(str(path))}", _real(path)) for name, path in outputs.items() if path is not None]
    parts = [
        (f"the parts of {n} {visible(str(p))}", _real(f"{p}.parts")) for n, p in outputs.items() if p is not None and "parquet" in n
    ]
    for (one, first), (other, second) in itertools.combinations([*places, *parts], 2):
        if first == second:
            raise FleetError(f"{one} and {other} are the same; give each its own name")
        for (inner, inside), (outer, outside) in (((one, first), (other, second)), ((other, second), (one, first))):
            if outside in inside.parents:
                raise FleetError(f"{inner} lies in {outer}, where nothing else may be written; give another place")


def _real(path: str | Path) -> Path:
    return Path(os.path.normcase(os.path.realpath(path)))
