"""What has to be known of a packed workbook (xlsx, ods) before it is opened: its size unpacked, its cells, what is hidden.

A small file can unpack to gigabytes, and a single cell in the last row and column makes a table of 17 thousand million. So all
parts
are unpacked once, a piece at a time, and the sheets are looked through by a parser that knows no entities.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final
from xml.parsers import expat

from pidemu.errors import ListError

_MOST_BYTES: Final = 2**28
"""Of all parts, unpacked."""
_MOST_CELLS: Final = 20_000_000
"""Cells of the rectangle that a sheet fills: 250,000 rows of 80 columns."""
_PIECE: Final = 2**20
_ADDRESS: Final = re.compile(r"([A-Z]{1,3})([0-9]{1,7})")


@dataclass
class HiddenParts:
    """What of a sheet is hidden.

    Attributes
    ----------
    rows : set of int
        From 1.
    columns : set of int
        From 0.
    """

    rows: set[int] = field(default_factory=set)
    columns: set[int] = field(default_factory=set)


def hidden_parts(data: bytes, file: str) -> dict[str, HiddenParts]:
    """Return what is hidden, by sheet, of a workbook that is safe to open.

    Parameters
    ----------
    data : bytes
        The file.
    file : str
        Its name, for messages.

    Raises
    ------
    ListError
        It is damaged, unpacks to too much, or declares entities.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_size(archive, file)
            names = set(archive.namelist())
            if "content.xml" in names:
                return _of_ods(archive, file)
            if "xl/workbook.xml" in names:
                return {sheet: _of_sheet(archive, part, file) for sheet, part in _sheet_parts(archive, file) if part in names}
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError, OSError, zlib.error) as error:
        raise ListError(f"{file}: a damaged workbook ({error}); open it and save it again") from None
    raise ListError(f"{file}: a zip archive without a workbook in it; give the list as CSV, xlsx, xls, ods or L5X")


def _check_size(archive: zipfile.ZipFile, file: str) -> None:
    """Unpack every part, and keep none; what an archive says of its size can be wrong."""
    unpacked = 0
    for part in archive.infolist():
        for piece in _pieces(archive, part):
            unpacked += len(piece)
            if unpacked > _MOST_BYTES:
                raise ListError(
                    f"{file}: unpacks to more than {_MOST_BYTES // 2**20} MB (in {part.filename}), which is too much for a "
                    f"loop list"
                )


def _pieces(archive: zipfile.ZipFile, part: zipfile.ZipInfo | str) -> Iterator[bytes]:
    with archive.open(part) as stream:
        while piece := stream.read(_PIECE):
            yield piece


def _parsed(archive: zipfile.ZipFile, part: str, file: str, start: Callable[[str, dict[str, str]], None], end: Any = None) -> None:
    """Parse a part without entities; `start` gets each element."""
    parser = safe_parser(f"{file} ({part})")
    parser.StartElementHandler = lambda name, attributes: start(name.rpartition(":")[2], attributes)
    parser.EndElementHandler = end
    try:
        for piece in _pieces(archive, part):
            parser.Parse(piece, False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        raise ListError(f"{file} ({part}):{error.lineno}: damaged ({expat.errors.messages[error.code]}); save it again") from None
    except LookupError as error:  # an encoding that there is not
        raise ListError(f"{file} ({part}): {error}; save it again") from None


def safe_parser(name: str, encoding: str | None = None) -> Any:
    """Return a parser of XML that refuses entities and a document type before anything is made of them.

    Parameters
    ----------
    name : str
        The file, for messages.
    encoding : str, optional
        The encoding, where it is known otherwise than by the file.
    """
    parser: Any = expat.ParserCreate(encoding)
    parser.buffer_text = True

    def refuse(*_: object) -> None:
        raise ListError(f"{name}:{parser.CurrentLineNumber}: declares a document type or entities, which no list needs; not read")

    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    return parser


def _sheet_parts(archive: zipfile.ZipFile, file: str) -> list[tuple[str, str]]:
    """Return the sheets of an xlsx file with the parts that hold them."""
    targets: dict[str, str] = {}
    sheets: list[tuple[str, str]] = []

    def relation(name: str, attributes: dict[str, str]) -> None:
        if name == "Relationship":
            target = attributes.get("Target", "")
            targets[attributes.get("Id", "")] = target.removeprefix("/") if target.startswith("/") else f"xl/{target}"

    def sheet(name: str, attributes: dict[str, str]) -> None:
        if name == "sheet":
            key = next((value for key, value in attributes.items() if key.endswith(":id")), "")
            sheets.append((attributes.get("name", ""), key))

    if "xl/_rels/workbook.xml.rels" in archive.namelist():
        _parsed(archive, "xl/_rels/workbook.xml.rels", file, relation)
    _parsed(archive, "xl/workbook.xml", file, sheet)
    return [(name, targets.get(key, "")) for name, key in sheets]


def _of_sheet(archive: zipfile.ZipFile, part: str, file: str) -> HiddenParts:
    """Look through a sheet of an xlsx file."""
    found = HiddenParts()
    far = [1, 1, 0]  # last row, last column, the row that is being read

    def element(name: str, attributes: dict[str, str]) -> None:
        if name == "c":
            match = _ADDRESS.fullmatch(attributes.get("r", ""))
            if match is not None:
                column = 0
                for letter in match[1]:
                    column = 26 * column + ord(letter) - 64
                far[0], far[1] = max(far[0], int(match[2])), max(far[1], column)
                _check_cells(far[0], far[1], f"{file} ({part})")
        elif name == "row":
            far[2] = int(attributes.get("r", far[2] + 1))
            if attributes.get("hidden") in ("1", "true"):
                found.rows.add(far[2])
        elif name == "col" and attributes.get("hidden") in ("1", "true"):
            first, last = int(attributes.get("min", 1)), int(attributes.get("max", 1))
            found.columns.update(range(first - 1, min(last, 16_384)))

    _parsed(archive, part, file, element)
    return found


def _check_cells(rows: int, columns: int, place: str) -> None:
    if rows * columns > _MOST_CELLS:
        raise ListError(
            f"{place}: {rows:,} rows and {columns:,} columns are more than a loop list has; delete what stands far out, and "
            f"save it again"
        )


def _of_ods(archive: zipfile.ZipFile, file: str) -> dict[str, HiddenParts]:
    """Look through an ods file; rows and cells that are repeated count as often as they say."""
    sheets: dict[str, HiddenParts] = {}
    at = {"row": 0, "column": 0, "cell": 0, "wide": 1, "tall": 1, "repeat": 1}
    sheet = HiddenParts()

    def element(name: str, attributes: dict[str, str]) -> None:
        nonlocal sheet
        plain = {key.rpartition(":")[2]: value for key, value in attributes.items()}
        hidden = plain.get("visibility") in ("collapse", "filter")
        if name == "table":
            sheet = sheets.setdefault(plain.get("name", ""), HiddenParts())
            at.update(row=0, column=0, wide=1, tall=1)
        elif name == "table-column":
            count = int(plain.get("number-columns-repeated", 1))
            sheet.columns.update(range(at["column"], min(at["column"] + count, 16_384)) if hidden else ())
            at["column"] += count
        elif name == "table-row":
            at["repeat"], at["cell"] = int(plain.get("number-rows-repeated", 1)), 0
            sheet.rows.update(range(at["row"] + 1, at["row"] + min(at["repeat"], 2**20) + 1) if hidden else ())
            at["row"] += at["repeat"]
        elif name in ("table-cell", "covered-table-cell"):
            at["cell"] += int(plain.get("number-columns-repeated", 1))
            if any(key.endswith("value") or key == "value-type" for key in plain):
                at["wide"], at["tall"] = max(at["wide"], at["cell"]), max(at["tall"], at["row"])
                _check_cells(at["tall"], at["wide"], f"{file} (content.xml)")

    _parsed(archive, "content.xml", file, element)
    return sheets
