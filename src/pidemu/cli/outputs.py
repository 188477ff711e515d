"""What a command writes, looked at before the work: none of it is read, and no two are one file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from pidemu.card.library import loaded_files
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.writing import check


def inputs(*files: str | Path | None) -> list[str | Path]:
    """Return what a command reads: these files, and those of all cards that were read."""
    return [*(file for file in files if file is not None), *loaded_files()]


def check_outputs(outputs: Mapping[str, str | None], error: type[PidemuError], read: Iterable[str | Path] = ()) -> None:
    """Refuse outputs that cannot be written, are read, or are one file.

    Parameters
    ----------
    outputs : mapping of str to str
        File by option; ``None`` where it is not given.
    error : class
        What is raised.
    read : iterable of path
        What is read, such as `inputs` returns.

    Raises
    ------
    PidemuError
        Of the class `error`.
    """
    read = tuple(read)
    found: dict[str, str] = {}
    for option, path in outputs.items():
        if path is None:
            continue
        check(path, error, read)
        first = next((o for o, other in found.items() if _is_one(path, other)), None)
        if first is not None:
            raise error(f"{visible(path)}: is given for two results, {first} and {option}; give each a file of its own")
        found[option] = path


def _is_one(path: str, other: str) -> bool:
    """Whether two names lead to one file; a device, such as ``/dev/null``, takes anything."""
    if os.path.exists(path) and os.path.exists(other):
        return os.path.isfile(path) and os.path.samefile(path, other)
    return os.path.normcase(os.path.realpath(path)) == os.path.normcase(os.path.realpath(other))
