"""Where the header of a sheet stands, and what its columns hold."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from pidemu.errors import ListError, suggest
from pidemu.plant.cells import ListLine, ListSheet, address
from pidemu.plant.fields import FIELDS, Field, HeaderName, field_of, folded, header_names, unit_column_after
from pidemu.plant.unit_words import unit_of

_WITHIN: Final = 200
"""Lines among which a header is looked for."""
_ENDS: Final = {
    **dict.fromkeys(("low", "lo", "min", "from", "lower", "anfang", "von", "l", "0%"), "low"),
    **dict.fromkeys(("high", "hi", "max", "to", "upper", "ende", "bis", "h", "100%"), "high"),
}
_GROUPS: Final[tuple[tuple[str, tuple[Field, Field]], ...]] = (
    (r"new|neu", ("new_low", "new_high")),
    (r"out|op\b|cv\b|\by\b|valve|ausgang", ("out_limit_low", "out_limit_high")),
    (r"pv|range|transmitter|meas|mess", ("pv_low", "pv_high")),
)
_SIGNAL_UNITS: Final = re.compile(
    r"°?[CFK]|deg ?[CF]|%|bar[ga]?|[kMm]?Pa[ga]?|psi[ga]?|m|mm|m³/h|m3/h|t/h|kg/h|l/min|gpm|mA|V|EU|pH", re.I
)


@dataclass(frozen=True, slots=True)
class ListColumn:
    """A column of a list.

    Attributes
    ----------
    index : int
        From 0.
    header : str
        Its header as it stands there, with the group above.
    field : Field or None
        What it holds; ``None`` where that is not known.
    names : tuple of HeaderName
        The names in the header, each with its unit.
    why : str
        How the field was found: ``name``, ``group``, ``behind X``, ``mapping``.
    hidden : bool
        Whether it is hidden.
    """

    index: int
    header: str
    field: Field | None
    names: tuple[HeaderName, ...] = ()
    why: str = ""
    hidden: bool = False


@dataclass(frozen=True)
class ListLayout:
    """How a sheet is laid out.

    Attributes
    ----------
    sheet : ListSheet
        The sheet.
    header : int
        Line of the header.
    columns : tuple of ListColumn
        Its columns.
    above, below : tuple of int
        Lines of group headings above the header and of units below it.
    """

    sheet: ListSheet
    header: int
    columns: tuple[ListColumn, ...]
    above: tuple[int, ...] = ()
    below: tuple[int, ...] = ()

    def holding(self, field: Field) -> list[ListColumn]:
        """Return the columns that hold a field: the visible ones, or else the hidden ones."""
        found = [c for c in self.columns if c.field == field]
        return [c for c in found if not c.hidden] or found

    @property
    def texts(self) -> dict[int, str]:
        """Folded header by column, to know a repeated header by."""
        return {c.index: folded(c.header) for c in self.columns}


def find_layout(sheet: ListSheet, named: Mapping[str, str] | None = None, line: int | None = None) -> ListLayout | None:
    """Return the layout of a sheet; ``None`` where no line is a header of loops.

    Parameters
    ----------
    sheet : ListSheet
        The sheet.
    named : mapping, optional
        Field by header text, from the mapping file.
    line : int, optional
        The line of the header, from the mapping file.

    Raises
    ------
    ListError
        The mapping names a field or a line that there is not.
    """
    fields = _checked(named or {}, sheet)
    found = _header_line(sheet, fields, line)
    if found is None:
        return None
    at, header = found
    previous = sheet.lines[at - 1] if at else None
    groups = _groups(sheet, previous, header) if previous is not None and header.number - previous.number == 1 else {}
    following = sheet.lines[at + 1] if at + 1 < len(sheet.lines) else None
    below = following if following is not None and _is_units(following) else None
    columns = _columns(header, groups, below, fields)
    return ListLayout(
        sheet,
        header.number,
        columns,
        (previous.number,) if groups and previous is not None else (),
        (below.number,) if below is not None else (),
    )


def _checked(named: Mapping[str, str], sheet: ListSheet) -> dict[str, Field]:
    fields: dict[str, Field] = {}
    for header, word in named.items():
        field = next((f for f in FIELDS if f == word.replace("-", "_")), None)
        if field is None:
            known = [f.replace("_", "-") for f in FIELDS]
            raise ListError(
                f"{sheet.shown}: column '{header}': no field '{word}'{suggest(word, known)}; fields: {', '.join(known)}"
            )
        fields[folded(header)] = field
    return fields


def _header_line(sheet: ListSheet, fields: Mapping[str, Field], line: int | None) -> tuple[int, ListLine] | None:
    """Return the header: the first line that names a tag and a gain or an integral, with the most fields."""
    best: tuple[int, int, ListLine] | None = None
    for at, candidate in enumerate(sheet.lines[:_WITHIN]):
        if line is not None:
            if candidate.number == line:
                return at, candidate
            continue
        texts = [cell.text for cell in candidate.cells.values() if isinstance(cell.value, str)]
        if len(texts) * 2 < len(candidate.cells):
            continue
        known = {fields.get(folded(text)) or field_of(text) for text in texts} - {None}
        if "tag" in known and known & {"gain", "integral"} and len(known) >= 4 and (best is None or len(known) > best[0] + 1):
            best = (len(known), at, candidate)
    if line is not None:
        raise ListError(f"{sheet.shown}: the mapping says that line {line} is the header, which is empty or not there")
    return None if best is None else best[1:]


def _groups(sheet: ListSheet, line: ListLine, header: ListLine) -> dict[int, str]:
    """Return the heading above each column, where the line above is one of merged groups."""
    spans = {left: right for top, bottom, left, right in sheet.merged if top == line.number == bottom or bottom == header.number}
    if not spans or len(line.cells) < 2:
        return {}
    found = {}
    for column, cell in line.cells.items():
        for other in range(column, spans.get(column, column) + 1):
            found[other] = cell.text
    return found


def _is_units(line: ListLine) -> bool:
    """Whether a line under the header holds units and nothing else."""
    texts = [cell.text.strip("[]() ") for cell in line.cells.values()]
    settings = [t for t in texts if any(unit_of(s, t) for s in ("gain", "integral", "derivative"))]
    signals = [t for t in texts if _SIGNAL_UNITS.fullmatch(t)]
    return len(settings) >= 2 and len(set(settings) | set(signals)) == len(set(texts))


def _columns(
    header: ListLine, groups: Mapping[int, str], below: ListLine | None, fields: Mapping[str, Field]
) -> tuple[ListColumn, ...]:
    columns: list[ListColumn] = []
    before: Field | None = None
    for index in sorted({*header.cells, *groups}):
        cell = header.cells.get(index)
        own = cell.text if cell is not None else ""
        field, why = _field(own, groups.get(index, ""), fields)
        if field == "unit":
            field, why = unit_column_after(before), f"behind {before}"
        names = header_names(own)
        unit = below.cells[index].text.strip("[]() ") if below is not None and index in below.cells else ""
        if unit and not any(name.unit for name in names):
            names = tuple(HeaderName(name.word, unit) for name in names)
        text = own or groups.get(index, "")
        columns.append(ListColumn(index, text, field, names, why if field else "", cell is not None and cell.hidden))
        before = field if field not in (None, "unit") else before
    return tuple(columns)


def _field(own: str, group: str, fields: Mapping[str, Field]) -> tuple[Field | None, str]:
    mapped = fields.get(folded(own))
    if mapped is not None:
        return mapped, "mapping"
    end = _ENDS.get(folded(own))
    if end is not None and group:
        for pattern, pair in _GROUPS:
            if re.search(pattern, group, re.IGNORECASE):
                return pair[end == "high"], f"group '{group}'"
    found = field_of(own) if own else None
    if found is not None:
        return found, "name"
    both = field_of(f"{group} {own}".strip()) if group else None
    return both, f"group '{group}'"


def column_place(layout: ListLayout, column: ListColumn) -> str:
    """Return where the header of a column stands."""
    if layout.sheet.name:
        return address(layout.header, column.index)
    return f"line {layout.header}, column {column.index + 1}"
