"""Where a list enters: the file's content, not its name, says which reader it gets."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pidemu.errors import ListError
from pidemu.files.kinds import other_kind
from pidemu.files.reading import Kind, read_bytes
from pidemu.plant.cells import ListSheet

if TYPE_CHECKING:
    from pidemu.plant.l5x.loops import L5xExport

_KIND: Final = Kind("a loop list", "give the list as CSV, xlsx, xls, ods or L5X", limit=2**27)
_OLD_WORKBOOK: Final = b"\xd0\xcf\x11\xe0"
_EXPERIMENTAL: Final = {
    ".fhx": "DeltaV FHX is not read yet: no export with readable tuning has been seen; list the loops in a CSV file or workbook",
    ".eb": "Honeywell EB is not read yet: no such file has been seen; list the loops in a CSV file or workbook",
}


@dataclass(frozen=True)
class LoopSource:
    """A file with loops, as it was read.

    Attributes
    ----------
    file : str
        Its name, without folders.
    digest : str
        SHA-256 of its bytes, in hexadecimal.
    sheets : tuple of ListSheet
        Its sheets; none for an L5X file.
    export : L5xExport or None
        What an L5X file holds.
    """

    file: str
    digest: str
    sheets: tuple[ListSheet, ...] = ()
    export: L5xExport | None = None


def read_source(path: str | Path) -> LoopSource:
    """Read a loop list, whatever its kind.

    Parameters
    ----------
    path : str or Path
        The file.

    Raises
    ------
    ListError
        It cannot be read, is empty, damaged, hostile, or of a kind that holds no loops; with its place where there is one.
    """
    file = os.path.basename(os.fspath(path)) or str(path)
    remedy = _EXPERIMENTAL.get(Path(file).suffix.casefold())
    if remedy is not None:
        raise ListError(f"{file}: {remedy}")
    data = read_bytes(path, ListError, _KIND)
    digest = hashlib.sha256(data).hexdigest()
    if not data.strip():
        raise ListError(f"{file}: is empty; give a file with a loop list")
    if data.startswith((b"PK", _OLD_WORKBOOK)):
        from pidemu.plant.spreadsheet import read_spreadsheet

        return LoopSource(file, digest, tuple(read_spreadsheet(data, file)))
    if _is_xml(data) or file.casefold().endswith(".l5x"):
        from pidemu.plant.l5x.reader import read_l5x

        return LoopSource(file, digest, export=read_l5x(data, file))
    kind = other_kind(data)
    if kind is not None:
        raise ListError(f"{file}: {kind}, not a loop list; {_KIND.remedy}")
    from pidemu.plant.delimited import read_delimited

    return LoopSource(file, digest, (read_delimited(data, file),))


def read_sources(paths: Iterable[str | Path]) -> list[LoopSource]:
    """Read several files of one job; one that is given twice counts once."""
    found: dict[str, LoopSource] = {}
    for path in paths:
        source = read_source(path)
        found.setdefault(source.digest, source)
    return list(found.values())


def _is_xml(data: bytes) -> bool:
    """Whether the file begins like XML, in whatever encoding."""
    head = data[:512].replace(b"\x00", b"").removeprefix(b"\xef\xbb\xbf").removeprefix(b"\xff\xfe").removeprefix(b"\xfe\xff")
    return head.lstrip().startswith(b"<")
