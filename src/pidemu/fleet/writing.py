"""Files that a fleet writes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from pidemu.errors import FleetError


@contextlib.contextmanager
def writing(path: Path, remedy: str) -> Iterator[None]:
    """Make a `FleetError` of what goes wrong while a file is written, with the file and a remedy."""
    try:
        yield
    except OSError as error:
        raise FleetError(f"{path}: cannot be written: {error.strerror or error}; {remedy}") from None
