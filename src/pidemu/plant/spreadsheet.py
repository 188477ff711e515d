"""Loop lists in workbooks: xlsx, xls and ods, by python-calamine."""

from __future__ import annotations

import datetime
import io
from typing import Any, Final

from pidemu.errors import ListError
from pidemu.plant.cells import CellValue, ListCell, ListLine, ListSheet, address, check_length
from pidemu.plant.delimited import decimal_comma
from pidemu.plant.packed import HiddenParts, hidden_parts

_ZIP: Final = b"PK\x03\x04"


def read_spreadsheet(data: bytes, file: str) -> list[ListSheet]:
    """Read the sheets of a workbook, the hidden ones as well.

    Parameters
    ----------
    data : bytes
        The file.
    file : str
        Its name, for messages.

    Raises
    ------
    ListError
        It is damaged or too large, needs a password, or python-calamine is not installed.
    """
    try:
        import python_calamine as calamine
    except ImportError:
        raise ListError(
            f"{file}: a workbook needs python-calamine, which is not installed; pip install 'pidemu[retrofit]' brings it, or "
            "save the list as CSV"
        ) from None
    packed = data.startswith(_ZIP)
    hidden = hidden_parts(data, file) if packed else {}
    notes = () if packed else ("hidden rows and columns cannot be told in this kind of file; save it as xlsx to have them flagged",)
    try:
        book: Any = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        return [
            _sheet(
                book, known, file, hidden.get(known.name, HiddenParts()), known.visible == calamine.SheetVisibleEnum.Visible, notes
            )
            for known in book.sheets_metadata
            if known.typ == calamine.SheetTypeEnum.WorkSheet
        ]
    except calamine.PasswordError:
        raise ListError(f"{file}: is protected by a password; save it without") from None
    except (calamine.CalamineError, OSError, ValueError) as error:
        raise ListError(f"{file}: a damaged workbook ({error}); open it and save it again") from None


def _sheet(book: Any, known: Any, file: str, hidden: HiddenParts, visible: bool, notes: tuple[str, ...]) -> ListSheet:
    sheet = book.get_sheet_by_name(known.name)
    if sheet.end is None:
        return ListSheet(file, known.name, (), 0, hidden=not visible, notes=notes)
    lines, texts = [], []
    for number, row in enumerate(sheet.iter_rows(), sheet.start[0] + 1):
        cells = {}
        for column, value in enumerate(row):
            if value in ("", None) or (isinstance(value, str) and not value.strip()):
                continue
            cells[column] = ListCell(_plain(value), address(number, column), hidden=column in hidden.columns)
            if isinstance(value, str):
                texts.append(value)
        if cells:
            lines.append(ListLine(number, cells, hidden=number in hidden.rows))
            check_length(len(lines), f"{file}, sheet {known.name}:{number}")
    merged = tuple((top + 1, bottom + 1, left, right) for (top, left), (bottom, right) in sheet.merged_cell_ranges or ())
    comma = decimal_comma(texts)
    return ListSheet(file, known.name, tuple(lines), sheet.end[0] + 1, not visible, merged, comma, notes)


def _plain(value: object) -> CellValue:
    """Return a cell's value as one of the kinds that are told apart."""
    if isinstance(value, bool | float | str | datetime.date | datetime.time | datetime.timedelta):
        return value
    return float(value) if isinstance(value, int) else str(value)
