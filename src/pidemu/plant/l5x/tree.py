"""The XML of an export as elements with their lines; no entities, bounded in size and depth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.parsers import expat

from pidemu.errors import ListError
from pidemu.excerpt import quoted
from pidemu.plant.packed import safe_parser

_MOST_ELEMENTS: Final = 2_000_000
_DEEPEST: Final = 200
_UNUSED: Final = frozenset(
    ("Modules", "Trends", "QuickWatchLists", "DataLogs", "RevisionNote", "AdditionalHelpText", "Security", "CST", "WallClockTime")
)
"""Parts that say nothing of loops, and are not kept."""
ROOT: Final = "RSLogix5000Content"


class L5xElement:
    """An element.

    Attributes
    ----------
    name : str
        Its name.
    attributes : dict
        Its attributes.
    children : list of L5xElement
        What stands in it.
    text : str
        Its text.
    line : int
        Its line in the file.
    """

    __slots__ = ("attributes", "children", "line", "name", "text")

    def __init__(self, name: str, attributes: dict[str, str], line: int) -> None:
        self.name = name
        self.attributes = attributes
        self.children: list[L5xElement] = []
        self.text = ""
        self.line = line

    def get(self, name: str, default: str = "") -> str:
        """Return an attribute."""
        return self.attributes.get(name, default)

    def all(self, *path: str) -> Iterator[L5xElement]:
        """Yield the elements that a path of names leads to."""
        first, rest = path[0], path[1:]
        for child in self.children:
            if child.name == first:
                if rest:
                    yield from child.all(*rest)
                else:
                    yield child


def read_tree(data: bytes, file: str) -> L5xElement:
    """Return the root of an export.

    Parameters
    ----------
    data : bytes
        The file.
    file : str
        Its name, for messages.

    Raises
    ------
    ListError
        It is no export, is damaged or too large, or declares a document type or entities; with its line.
    """
    builder = _Builder(file)
    parser = safe_parser(file)
    parser.StartElementHandler = lambda name, attributes: builder.start(name, attributes, parser.CurrentLineNumber)
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.characters
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        cut = " (the file is cut off, or was changed by hand)" if error.code in _CUT else ""
        raise ListError(f"{file}:{error.lineno}:{error.offset + 1}: {why}{cut}; export it again") from None
    except (LookupError, ValueError) as error:  # what expat has no table for
        raise ListError(f"{file}:1: {error}; export it again, in UTF-8") from None
    if builder.root is None:  # expat says so first
        raise ListError(f"{file}: holds no element; export it again")
    return builder.root


_CUT: Final = tuple(
    expat.errors.codes[text]
    for text in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    )
)


class _Builder:
    """Puts elements together."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.root: L5xElement | None = None
        self.stack: list[L5xElement] = []
        self.skipping = 0
        self.count = 0

    def start(self, name: str, attributes: dict[str, str], line: int) -> None:
        self.count += 1
        if self.count > _MOST_ELEMENTS or len(self.stack) + self.skipping > _DEEPEST:
            raise ListError(f"{self.file}:{line}: more elements, or deeper ones, than an export has; not read")
        if self.skipping or name in _UNUSED:
            self.skipping += 1
            return
        element = L5xElement(name, attributes, line)
        if self.stack:
            self.stack[-1].children.append(element)
        else:
            if name != ROOT:
                raise ListError(f"{self.file}:{line}: the root element is {quoted(name)}, not {ROOT}: this is no L5X export")
            self.root = element
        self.stack.append(element)

    def end(self, _name: str) -> None:
        if self.skipping:
            self.skipping -= 1
        else:
            self.stack.pop()

    def characters(self, text: str) -> None:
        if not self.skipping and self.stack and not text.isspace():
            self.stack[-1].text += text
