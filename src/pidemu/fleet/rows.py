"""A row of a table of loops: its cells, and the loop that they make."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pidemu.card.library import load_card_by_id
from pidemu.card.load import Card
from pidemu.errors import FleetError, SettingError, suggest
from pidemu.excerpt import quoted
from pidemu.files.reading import control
from pidemu.files.tables import counted, shown_delimiter, split_row
from pidemu.fleet.loops import Loop
from pidemu.parsing import assignments, pair, seconds, step
from pidemu.process.process import parse_process
from pidemu.settings.action import Action

COLUMNS: Final = ("tag", "card", "settings", "process", "scan", "action", "limits", "setpoint", "load", "time")
"""Columns of a file of loops."""
REQUIRED: Final = COLUMNS[:4]
_ACTIONS: Final[Mapping[str, Action]] = {"reverse": "reverse", "direct": "direct"}
Row = dict[str, str]
"""What the cells of a row say, by column; an empty cell says nothing."""


@dataclass(frozen=True, slots=True)
class RowReader:
    """Reads the rows of a table.

    Attributes
    ----------
    header : tuple of str
        Its columns.
    delimiter : str
        What separates the cells.
    vendors : tuple of path
        Folders of the user's own cards.
    """

    header: tuple[str, ...]
    delimiter: str
    vendors: tuple[str | Path, ...] = ()
    _cards: dict[str, Card] = field(default_factory=dict, init=False, repr=False, compare=False)

    def row(self, line: str, into: Row) -> Row:
        """Return what the cells of a line say; also where it raises, `into` has what could be read.

        Raises
        ------
        FleetError
            The line is no row of the table.
        """
        found = cells(line, self.delimiter)
        into.update((name, cell.strip()) for name, cell in zip(self.header, found, strict=False) if cell.strip())
        refuse_hidden(self.header, found)
        if len(found) != len(self.header):
            remedy = f"put a cell that holds {shown_delimiter(self.delimiter)} in quotation marks"
            remedy = "comments stand above the header" if found[0].startswith("#") and len(found) == 1 else remedy
            raise FleetError(f"{counted(len(found), 'cell')}, the header has {len(self.header)}; {remedy}")
        return into

    def card(self, card_id: str) -> Card:
        """Return a card; it goes with the reader to wherever rows are read, where there may be no such file."""
        if card_id not in self._cards:
            self._cards[card_id] = load_card_by_id(card_id, self.vendors)
        return self._cards[card_id]

    def loop(self, row: Mapping[str, str]) -> Loop:
        """Return the loop of a row.

        Raises
        ------
        PidemuError
            It makes none.
        """
        words = (word for word in row.get("settings", "").split(";") if word.strip())
        given = assignments(words, such="GAIN=2; RESET=20 s/repeat", between="semicolons, such as GAIN=2; RESET=20")
        readers = {"scan": seconds, "time": seconds, "setpoint": step, "load": step, "limits": pair, "action": _action}
        found: dict[str, Any] = {}
        for name, read in readers.items():
            if name in row:
                try:
                    found["output_limits" if name == "limits" else name] = read(row[name])
                except SettingError as error:
                    raise SettingError(f"{name}: {error}") from None
        settings = self.card(row["card"]).settings(given)
        return Loop(row["tag"], settings, parse_process(row["process"]), **found)


def check_row(row: Mapping[str, str], line: int, seen: dict[str, int]) -> None:
    """Refuse a row that does not say what every loop needs, or has the tag of another; `seen` has the line of every tag.

    Raises
    ------
    FleetError
        It does not, or has.
    """
    for name in ("tag", "card", "process"):
        if name not in row:
            raise FleetError(f"no {name}; every loop needs one")
    first = seen.setdefault(row["tag"], line)
    if first != line:
        raise FleetError(f"line {first} has this tag already; give each loop its own")


def cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; what is not seen is still at their ends.

    Raises
    ------
    FleetError
        It is not a row of a CSV file.
    """
    try:
        return split_row(line, delimiter)
    except ValueError as error:
        raise FleetError(control(line) or str(error)) from None


def refuse_hidden(header: Sequence[str], found: Sequence[str]) -> None:
    """Refuse a control character, or a byte that is not UTF-8, in a cell; the column is the one that the header names."""
    for name, cell in itertools.zip_longest(header, found, fillvalue=""):
        fault = control(cell)
        if fault is not None:
            raise FleetError(f"column {name}: {fault}" if name else fault)


def _action(text: str) -> Action:
    action = _ACTIONS.get(text.casefold())
    if action is None:
        raise SettingError(
            f"'{quoted(text)}' is neither reverse nor direct{suggest(text, _ACTIONS)}; leave the cell empty for negative feedback"
        )
    return action
