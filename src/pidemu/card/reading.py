"""YAML text to plain values, each with its place in the file.

YAML 1.2 core scalars (``1e-3`` is a number, ``off`` and ``no`` are words), no duplicate keys, no anchors, no aliases, no tags.
Whatever the text, the answer is a document or a list of located problems.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Final

import yaml

from pidemu.card.document import CARD, Document, Path_, Place, digest_of
from pidemu.errors import CardError, Problem, capped
from pidemu.excerpt import is_hidden, shortened, visible
from pidemu.files.reading import Kind, read_text

_Loader: Final[Any] = getattr(yaml, "CLoader", yaml.Loader)
_MAX_DEPTH: Final = 32
_MOST_CHARACTERS: Final = 1_000_000
"""The longest card that comes with pidemu has 15,000."""
_MOST_THINGS: Final = 4_000
"""Keys and values of a card; the largest that comes with pidemu has a thousand."""
_FIRST: Final = re.compile(
    r"(?:[ \t]*(?:#.*|---)?\r?\n)*(?:card:[ \t]+\S{1,200}[ \t]*(?:#.*)?\r?$|[ \t]*\{\s*[\"']?card[\"']?:)", re.MULTILINE
)
"""How a card begins, and a loop that names one."""
_BEGINNING: Final = 20_000
"""Characters within which it does, behind comments."""

_INT: Final = re.compile(r"[-+]?[0-9]+$")
_FLOAT: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")
_INF: Final = re.compile(r"([-+]?)\.(inf|Inf|INF)$")
_WORDS: Final = {"": None, "~": None, "null": None, "Null": None, "NULL": None} | {
    w: value for value in (True, False) for w in (str(value).lower(), str(value), str(value).upper())
}


def _scalar(text: str, plain: bool) -> Any:
    if not plain:
        return text
    if text in _WORDS:
        return _WORDS[text]
    if _INT.match(text):
        return int(text) if len(text) < 300 else float(text)
    if _FLOAT.match(text):
        return float(text)
    if match := _INF.match(text):
        return -math.inf if match[1] == "-" else math.inf
    return math.nan if text in (".nan", ".NaN", ".NAN") else text


class _Reader:
    """Builds the document from parser events, without recursion into the C parser's own composer."""

    def __init__(self, document: Document, kind: Kind) -> None:
        self.document = document
        self.kind = kind.name.removeprefix("a ")
        self.problems: list[Problem] = []
        self.events: Any = None
        self.things = 0

    def fail(self, mark: Any, message: str, width: int = 1) -> None:
        if mark.line >= len(self.document.lines):  # the parser's mark lies past the text
            line, column = max(1, len(self.document.lines)), 1
        else:
            line, column = mark.line + 1, mark.column + 1
        self.problems.append(Problem(self.document.path, line, column, message, width, self.document.shown))

    def place(self, event: Any) -> Place:
        start, end = event.start_mark, event.end_mark
        width = end.column - start.column if end.line == start.line else 1
        return Place(start.line + 1, start.column + 1, max(1, width))

    def named(self, kind: str, name: str) -> str:
        """Return what is told of a name: the name itself in a card only."""
        return f"{kind} '{shortened(name, 60)}'" if self.document.is_card else f"{'an' if kind[0] == 'a' else 'a'} {kind}"

    def count(self, event: Any) -> None:
        self.things += 1
        if self.things > _MOST_THINGS:
            self.fail(event.start_mark, f"more than {_MOST_THINGS:,} keys and values; no card is that long")
            raise CardError(capped(self.problems))

    def refuse_hidden(self, event: Any, allowed: str) -> None:
        """Refuse what is not seen as itself, or is obeyed by terminals: escape sequences, what turns the direction of writing."""
        if event.value.isprintable():
            return
        found = next((c for c in event.value if c not in allowed and is_hidden(c)), None)
        if found is not None:
            where = "a key" if not allowed else "a text"
            self.fail(
                event.start_mark, f"character U+{ord(found):04X} is not allowed in {where}; remove it", self.place(event).width
            )

    def refuse_anchor(self, event: Any) -> None:
        if event.anchor is not None and not isinstance(event, yaml.AliasEvent):
            anchor = self.named("anchor", f"&{event.anchor}")
            self.fail(event.start_mark, f"{anchor} is not used in {self.kind}s; remove it")

    def refuse_directives(self, event: Any) -> None:
        """Refuse another version of YAML, in which the same words are other values, and short forms of tags."""
        if event.version not in (None, (1, 2)):
            self.fail(event.start_mark, f"{self.kind}s are YAML 1.2; remove the line %YAML")
        if event.tags:
            self.fail(event.start_mark, f"tags are not used in {self.kind}s; remove the line %TAG")

    def read(self, event: Any, path: Path_) -> Any:
        self.count(event)
        self.document.values[path] = self.place(event)
        tag = getattr(event, "tag", None)
        if tag not in (None, "!"):
            self.fail(event.start_mark, f"{self.named('tag', tag)} is not used in {self.kind}s; remove it")
        self.refuse_anchor(event)
        if isinstance(event, yaml.AliasEvent):
            alias = self.named("alias", f"*{event.anchor}")
            self.fail(event.start_mark, f"{alias} is not used in {self.kind}s; write the value out")
            return None
        if isinstance(event, yaml.ScalarEvent):
            self.refuse_hidden(event, "\n\t")
            return _scalar(event.value, event.implicit[0])
        if len(path) > _MAX_DEPTH:
            self.fail(event.start_mark, f"nested more than {_MAX_DEPTH} levels deep")
            raise CardError(capped(self.problems))
        if isinstance(event, yaml.SequenceStartEvent):
            items: list[Any] = []
            while not isinstance(child := next(self.events), yaml.SequenceEndEvent):
                items.append(self.read(child, (*path, len(items))))
            return items
        return self.read_mapping(path)

    def read_mapping(self, path: Path_) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                self.fail(key.start_mark, "a key must be a plain word")
                name = f"?{len(mapping)}"
                self.read(key, (*path, name))
            else:
                name = self.key(key)
            here = (*path, name)
            if name in mapping:
                first = self.document.keys[here].line
                self.fail(key.start_mark, f"{self.named('duplicate key', name)} (first on line {first}); keep one", len(name))
                here = (*path, f"{name} ")
            self.document.keys[here] = self.place(key)
            value = self.read(next(self.events), here)
            mapping.setdefault(name, value)
        return mapping

    def key(self, event: Any) -> str:
        name: str = event.value
        self.count(event)
        self.refuse_anchor(event)
        self.refuse_hidden(event, "")
        if name != name.strip():
            self.fail(event.start_mark, "a key has blanks around it; remove them", self.place(event).width)
        return name


def parse(text: str, path: str, kind: Kind = CARD) -> Document:
    """Read one YAML document.

    Parameters
    ----------
    text : str
        The file's text.
    path : str
        The file's name, for messages.
    kind : Kind
        What the text should be.

    Returns
    -------
    Document
        Its values with their places.

    Raises
    ------
    CardError
        The text is not YAML, is empty, or uses what cards do not: every problem found, with its place.
    """
    document = Document(
        path, tuple(text.splitlines()), digest=digest_of(text), is_card=_FIRST.match(text, 0, _BEGINNING) is not None
    )
    if len(text) > _MOST_CHARACTERS:
        message = f"{len(text):,} characters; {kind.name} has at most {_MOST_CHARACTERS:,}"
        raise CardError([Problem(path, 1, 1, message, 1, document.shown)])
    reader = _Reader(document, kind)
    try:
        reader.events = iter(yaml.parse(text, Loader=_Loader))
        roots = 0
        for event in reader.events:
            if isinstance(event, yaml.DocumentStartEvent):
                reader.refuse_directives(event)
            if isinstance(event, yaml.NodeEvent):
                roots += 1
                if roots > 1:
                    reader.fail(event.start_mark, f"a second document; {kind.name} is one document, put it in a file of its own")
                    break
                document.value = reader.read(event, ())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        if line > len(document.lines):  # the parser's mark lies past the text
            line = max(1, len(document.lines))
            column = len(document.lines[-1]) + 1 if document.lines else 1
        message = f"not YAML: {error.problem or error.context}"
        reader.problems.append(Problem(path, line, column, message, 1, document.shown))
    except yaml.reader.ReaderError as error:
        before = text.encode(errors="surrogatepass")[: error.position].decode(errors="ignore")  # the parser counts bytes
        code = error.character if isinstance(error.character, int) else ord(error.character)
        line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
        message = f"character U+{code:04X} is not allowed in YAML; remove it"
        reader.problems.append(Problem(path, line, column, message, 1, document.shown))
    except UnicodeEncodeError as error:
        before = text[: error.start]
        line, column = before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1
        reader.problems.append(Problem(path, line, column, "half a Unicode pair; remove it", 1, document.shown))
    if not reader.problems and not isinstance(document.value, dict):
        what = "empty" if document.value is None else "not a mapping"
        reader.problems.append(Problem(path, 1, 1, f"the file is {what}; {kind.remedy}", 1, document.shown))
    document.is_card = document.is_card or (isinstance(document.value, dict) and isinstance(document.value.get("card"), int | str))
    if reader.problems:
        raise CardError(capped(reader.problems))
    return document


def parse_file(file: Path, shown: str | None = None, kind: Kind = CARD) -> Document:
    """Read one YAML file.

    Parameters
    ----------
    file : Path
        The file.
    shown : str, optional
        Its name in messages; by default `file` itself.
    kind : Kind
        What the file should be.

    Raises
    ------
    CardError
        It cannot be read, is not UTF-8, or is wrong (see `parse`).
    """
    name = visible(shown or str(file))
    return parse(read_text(file, CardError, kind, shown=name), name, kind)
