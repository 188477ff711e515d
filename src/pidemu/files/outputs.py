"""What is written, looked at before the work: each can be, none is read, and none would destroy another."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.reading import reason
from pidemu.files.writing import check

Outputs = Mapping[str, str | Path | None]
"""Files and folders by what the user calls them, ``None`` where one is not given."""


def check_outputs(outputs: Outputs, error: type[PidemuError], read: Iterable[str | Path] = ()) -> None:
    """Refuse files that cannot be written, are read, or are one.

    Parameters
    ----------
    outputs : mapping of str to path or None
        Files by option.
    error : class
        What is raised.
    read : iterable of path
        What is read.

    Raises
    ------
    PidemuError
        Of the class `error`.
    """
    read = tuple(read)
    for path in outputs.values():
        if path is not None:
            check(path, error, read)
    refuse_overlap(outputs, error)


def refuse_overlap(outputs: Outputs, error: type[PidemuError]) -> None:
    """Refuse files and folders that are the same or inside each other: one would be lost.

    Parameters
    ----------
    outputs : mapping of str to path or None
        What is written.
    error : class
        What is raised.

    Raises
    ------
    PidemuError
        Of the class `error`: two of them overlap, or a name can be no file's.
    """
    given = [(f"{name} {visible(str(path))}", path) for name, path in outputs.items() if path is not None]
    places = [(said, path, _real(path, error)) for said, path in given]
    for (one, path, first), (other, another, second) in itertools.combinations(places, 2):
        if _is_one(path, another, first == second):
            raise error(f"{one} and {other} are the same; give each its own name")
        for inner, inside, outer, outside in ((one, first, other, second), (other, second, one, first)):
            if outside in inside.parents:
                raise error(f"{inner} lies in {outer}, where nothing else may be written; give another place")


def _real(path: str | Path, error: type[PidemuError]) -> Path:
    try:
        return Path(os.path.normcase(os.path.realpath(path)))
    except (OSError, ValueError) as fault:  # NUL in it
        raise error(f"{visible(str(path))}: cannot be written: {reason(fault)}") from None


def _is_one(path: str | Path, other: str | Path, same: bool) -> bool:
    """Tell whether two names lead to one place; a device, such as ``/dev/null``, takes anything."""
    if os.path.exists(path) and os.path.exists(other):
        return os.path.samefile(path, other) and (os.path.isfile(path) or os.path.isdir(path))
    return same
