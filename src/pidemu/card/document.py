"""A YAML file's values, each with its place in the file; of a compiled card the places are looked up when one is needed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pidemu.errors import CardError, Problem
from pidemu.excerpt import is_hidden
from pidemu.files.reading import Kind
from pidemu.part import part

Path_ = tuple[str | int, ...]
"""Keys and indices that lead to a value."""

_LONGEST_ID: Final = 200
CARD: Final = Kind("a card", "a card starts with 'card: 1'", limit=2**22, pipes=False)


def digest_of(text: str) -> str:
    """Return the SHA-256 of a file's text, in hexadecimal; that of the file where its lines end in a line feed alone."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()


def wrong_id(card_id: str) -> str | None:
    """Return what is wrong with a card's id, which are the names of its folder and file."""
    if any(is_hidden(c) for c in card_id):
        return "the name of the file or folder has characters that cannot be seen; rename it"
    if len(card_id) > _LONGEST_ID:
        return f"the names of folder and file have {len(card_id)} characters; at most {_LONGEST_ID} are allowed"
    return None


def card_id_of(path: Path) -> str:
    """Return the id of the card in a file, by the last two parts of its path."""
    return f"{path.parent.name}/{path.stem}"


@part(frozen=True, slots=True)
class Place:
    """Where a key or value stands: 1-based line and column, and its width on that line."""

    line: int
    column: int
    width: int


@dataclass
class Document:
    """A YAML file, read.

    Attributes
    ----------
    path : str
        The file as the user named it.
    lines : tuple of str
        Its text.
    value : object
        Plain dicts, lists and scalars.
    values, keys : dict
        Place of every value, and of every mapping key, by path.
    digest : str
        See `digest_of`.
    is_card : bool
        Whether the text is that of a card or a loop, be it a wrong one; an error shows nothing of any other file.
    unread : Path or None
        The file, where lines and places have still to be read from it: the card was compiled.
    """

    path: str
    lines: tuple[str, ...] = field(compare=False)
    value: Any = None
    values: dict[Path_, Place] = field(default_factory=dict, compare=False)
    keys: dict[Path_, Place] = field(default_factory=dict, compare=False)
    digest: str = ""
    is_card: bool = field(default=False, compare=False)
    unread: Path | None = field(default=None, compare=False)

    @property
    def shown(self) -> tuple[str, ...]:
        """The lines that an error may show."""
        return self.lines if self.is_card else ()

    def problem(self, path: Path_, message: str, *, at_key: bool = False) -> Problem:
        """Return a problem placed at `path`, or at the nearest enclosing thing that exists."""
        if self.unread is not None:
            self._read_places(self.unread)
        places = (self.keys, self.values) if at_key else (self.values, self.keys)
        for end in range(len(path), -1, -1):
            for table in places:
                place = table.get(path[:end])
                if place is not None:
                    return Problem(self.path, place.line, place.column, message, place.width, self.shown)
        return Problem(self.path, 1, 1, message, 1, self.shown)

    def _read_places(self, file: Path) -> None:
        """Read lines and places from the file; a file that is another one by now has none."""
        from pidemu.card.reading import parse_file

        self.unread = None
        try:
            found = parse_file(file, self.path)
        except CardError:
            return
        if found.digest == self.digest:
            self.lines, self.values, self.keys, self.is_card = found.lines, found.values, found.keys, found.is_card
