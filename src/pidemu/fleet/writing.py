"""Files that a fleet writes."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal

from pidemu.errors import FleetError
from pidemu.files.outputs import Outputs
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


def with_parts(outputs: Outputs) -> Outputs:
    """Return what a fleet writes together with the folder in which a Parquet file grows.

    Parameters
    ----------
    outputs : mapping of str to path or None
        What is written, by what the user calls it; a Parquet file's name holds ``parquet``.
    """
    parts = {f"the parts of {name} in": f"{path}.parts" for name, path in outputs.items() if path is not None and "parquet" in name}
    return {**outputs, **parts}
