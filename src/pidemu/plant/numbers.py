"""Numbers in cells: with decimal comma or point, with a unit behind, and never with a mark."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

from pidemu.plant.cells import ListCell

_NUMBER: Final = re.compile(r"([-+]?(?:\d{1,3}(?: \d{3})+|\d+)?(?:[.,]\d+)*[.,]?(?:[eE][-+]?\d+)?)\s*(.*)", re.DOTALL | re.ASCII)
_THOUSANDS: Final = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
_MONTHS: Final = "jan|feb|mar|mär|mrz|apr|may|mai|jun|jul|aug|sep|oct|okt|nov|dec|dez"
_DATE: Final = re.compile(
    rf"\d{{4}}-\d\d?-\d\d?.*|\d{{1,2}}[./]\d{{1,2}}[./]\d{{2,4}}|\d{{1,2}}[ .\-/]+({_MONTHS})\w*\.?([ .\-/]+\d{{2,4}})?"
    rf"|({_MONTHS})\w*\.?[ .\-/]+\d{{1,4}}|\d{{1,2}}:\d\d(:\d\d)?",
    re.IGNORECASE,
)
_NOT_A_UNIT: Final = re.compile(r"[?~*!<>≈=]|\.\.|^\s*[/\-]?\s*\d")


@dataclass(frozen=True, slots=True)
class CellNumber:
    """A number as it stands in a cell.

    Attributes
    ----------
    value : float
        The number.
    unit : str
        What stands behind it; empty where nothing does.
    """

    value: float
    unit: str = ""


class CellError(ValueError):
    """A cell does not hold the number it should.

    Attributes
    ----------
    code : str
        ``E-number`` or ``E-date``.
    """

    def __init__(self, code: Literal["E-number", "E-date"], message: str) -> None:
        super().__init__(message)
        self.code = code


def cell_number(cell: ListCell, comma: bool | None) -> CellNumber:
    """Return the number of a cell with the unit behind it.

    Parameters
    ----------
    cell : ListCell
        The cell.
    comma : bool or None
        Whether the file writes decimal commas; ``None`` where it does not tell.

    Raises
    ------
    CellError
        It is a date, no number, one with a mark, or can be read in two ways.
    """
    if cell.is_date or (isinstance(cell.value, str) and _DATE.fullmatch(cell.text)):
        raise CellError(
            "E-date",
            f"'{cell.text}' is a date: spreadsheets make dates of fractions, part numbers and decimals; type the number "
            f"again as text",
        )
    if isinstance(cell.value, float):
        return CellNumber(cell.value)
    text = cell.text
    match = _NUMBER.fullmatch(text)
    if match is None or not any(c.isdigit() for c in match[1]):
        raise CellError("E-number", f"'{text}' is not a number; write the number, and its unit behind it or in the unit column")
    if _NOT_A_UNIT.search(match[2]):
        raise CellError(
            "E-number", f"'{text}' is a number with a mark, so somebody doubted it; find out, and write the number alone"
        )
    return CellNumber(_value(match[1].replace(" ", ""), text, comma), match[2].strip())


def _value(digits: str, text: str, comma: bool | None) -> float:
    marks = [c for c in digits if c in ".,"]
    if len(marks) > 1:
        if len(set(marks)) == 1:  # 1.234.567
            digits = _without_thousands(digits, marks[0], text)
        else:  # 1.234,5
            digits = _without_thousands(digits.rpartition(marks[-1])[0], marks[0], text) + "." + digits.rpartition(marks[-1])[2]
    elif marks and _THOUSANDS.fullmatch(digits) and (marks[0] == ",") is not comma:
        one, other = digits.replace(",", "."), re.sub(r"[.,]", "", digits)
        raise CellError(
            "E-number",
            f"'{text}' can be {one} or {other}: nothing in the file says what the mark means; write it without thousands",
        )
    try:
        return float(digits.replace(",", "."))
    except ValueError:
        raise CellError("E-number", f"'{text}' is not a number; write digits and one decimal mark") from None


def _without_thousands(digits: str, mark: str, text: str) -> str:
    groups = digits.lstrip("+-").split(mark)
    if not all(len(group) == 3 for group in groups[1:]) or not 1 <= len(groups[0]) <= 3:
        raise CellError("E-number", f"'{text}' is not a number; write digits and one decimal mark")
    return digits.replace(mark, "")
