"""Compiled cards: what a card file says, checked once, as plain data that neither YAML nor pydantic is needed for.

The built-in cards are compiled when the wheel is built (``compiled`` beside ``vendors``), all others when they are first loaded, in
the user's cache folder. A compiled card goes by the SHA-256 of the card's text and of this folder's code, which is the card
language: a changed card, or another language, has none. What cannot be read, is damaged or is another user's counts as none. It is
JSON: loading it makes parts of the card language and nothing else.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pidemu import __version__
from pidemu.files import cache
from pidemu.part import part, part_of

if TYPE_CHECKING:
    from pidemu.card.model.card_file import CardFile, Equation

_PACKAGE: Final = Path(__file__).resolve().parent.parent
BUILT_IN: Final = _PACKAGE / "compiled"
"""Where the wheel has its compiled cards."""
_MOST: Final = 400
"""Files that are kept in the cache folder; beyond that the oldest go."""
_OTHERS: Final = ("numpy", "pydantic", "yaml")
"""What checking a card rests on besides pidemu and Python."""


@part(frozen=True, slots=True)
class CompiledCard:
    """A card as plain data.

    Attributes
    ----------
    value : object
        The values of the file.
    content : object
        What the card says, encoded.
    pieces : list
        The fields of its equations, encoded, each once.
    equations : dict
        By the choices of all options: which piece each field of the equation is.
    """

    value: Any
    content: Any
    pieces: list[Any]
    equations: Mapping[str, Mapping[str, int]]
    _made: dict[int, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, value: Any, data: CardFile, equations: Mapping[tuple[str, ...], Equation]) -> CompiledCard:
        """Compile a card.

        Parameters
        ----------
        value : object
            The values of the file.
        data : CardFile
            What the card says.
        equations : mapping
            Its equation by the choices of all options, for every combination.
        """
        from pidemu.card.plain_data import encoded

        pieces: dict[str, int] = {}
        by_choice: dict[str, dict[str, int]] = {}
        for chosen, equation in equations.items():
            _, said = encoded(equation)
            by_choice[_key(chosen)] = {name: pieces.setdefault(json.dumps(piece), len(pieces)) for name, piece in said.items()}
        return cls(value, encoded(data), [json.loads(piece) for piece in pieces], by_choice)

    @property
    def data(self) -> CardFile:
        """What the card says."""
        from pidemu.card.plain_data import decoded

        found: CardFile = decoded(self.content)
        return found

    def equation(self, chosen: tuple[str, ...]) -> Equation:
        """Return the equation for choices of all options."""
        from pidemu.card.model.card_file import Equation

        return part_of(Equation, {name: self._piece(i) for name, i in self.equations[_key(chosen)].items()})

    def _piece(self, i: int) -> Any:
        from pidemu.card.plain_data import decoded

        if i not in self._made:
            self._made[i] = decoded(self.pieces[i])
        return self._made[i]


def find(digest: str) -> CompiledCard | None:
    """Return the compiled card of a text, by the text's digest; ``None`` where there is none."""
    lines = _lines(digest)
    if lines is None:
        return None
    body = json.loads(lines[1])
    return CompiledCard(body["value"], body["content"], body["pieces"], body["equations"])


def summary(digest: str) -> dict[str, Any] | None:
    """Return what a compiled card says of itself in short; ``None`` where there is none."""
    lines = _lines(digest)
    return None if lines is None else json.loads(lines[0])


def keep(digest: str, compiled: CompiledCard, short: Mapping[str, Any]) -> None:
    """Keep a compiled card in the cache folder, where that can be written.

    Parameters
    ----------
    digest : str
        The digest of the card's text.
    compiled : CompiledCard
        The card.
    short : mapping
        What it says of itself in short, plain values.
    """
    _put(_name(digest), written(compiled, short))


def written(compiled: CompiledCard, short: Mapping[str, Any]) -> bytes:
    """Return a compiled card as it stands in a file: a digest of the rest, what it says in short, the rest."""
    body = {"value": compiled.value, "content": compiled.content, "pieces": compiled.pieces, "equations": compiled.equations}
    rest = "\n".join(json.dumps(part, separators=(",", ":")) for part in (dict(short), body)).encode()
    return hashlib.sha256(rest).hexdigest().encode() + b"\n" + rest


def file_in(folder: Path, digest: str) -> Path:
    """Return where a compiled card stands in a folder."""
    return folder / _name(digest)


def is_checked(digest: str, card_id: str) -> bool:
    """Tell whether ``pidemu check`` had nothing to say of a card with that text and id, by the code that is here now."""
    folder = cache.private("cards")
    return folder is not None and cache.own(folder / _name_of_check(digest, card_id)) is not None


def keep_checked(digest: str, card_id: str) -> None:
    """Remember that a check had nothing to say, where the cache folder can be written."""
    _put(_name_of_check(digest, card_id), b"")


def _key(chosen: tuple[str, ...]) -> str:
    return "\n".join(chosen)


def _lines(digest: str) -> list[bytes] | None:
    """Return what stands in the file of a compiled card, but for its digest; ``None`` where that is not the rest's."""
    for data in _files(_name(digest)):
        if data is not None:
            said, _, rest = data.partition(b"\n")
            if said == hashlib.sha256(rest).hexdigest().encode():
                return rest.split(b"\n")
    return None


def _files(name: str) -> Iterator[bytes | None]:
    with contextlib.suppress(OSError):
        yield (BUILT_IN / name).read_bytes()
    folder = cache.private("cards")
    yield None if folder is None else cache.own(folder / name)


def _put(name: str, data: bytes) -> None:
    folder = cache.private("cards", make=True)
    if folder is None:
        return
    with contextlib.suppress(OSError):
        cache.put(folder / name, data)
        files = [entry for entry in os.scandir(folder) if entry.is_file()]
        if len(files) > _MOST:
            for entry in sorted(files, key=lambda e: e.stat().st_mtime)[: len(files) - _MOST]:
                os.unlink(entry.path)


def _name(digest: str) -> str:
    return f"card-{hashlib.sha256(f'{digest} {language()}'.encode()).hexdigest()}.json"


def _name_of_check(digest: str, card_id: str) -> str:
    return f"checked-{hashlib.sha256(f'{digest} {card_id} {_code()}'.encode(errors='surrogatepass')).hexdigest()}"


@functools.cache
def language() -> str:
    """Return a digest of the card language: of the code of this folder."""
    found = hashlib.sha256(__version__.encode())
    for path in _sources(str(Path(__file__).resolve().parent)):
        with open(path, "rb") as file:
            found.update(file.read())
    return found.hexdigest()


@functools.cache
def _code() -> str:
    """Return a digest of all that checks a card: the code of pidemu, by size and time, Python, and what else has a part."""
    import importlib.util

    found = [__version__, sys.version]
    others = [importlib.util.find_spec(name) for name in _OTHERS]
    for path in [*_sources(str(_PACKAGE)), *(spec.origin for spec in others if spec is not None and spec.origin)]:
        state = os.stat(path)
        found.append(f"{path} {state.st_size} {state.st_mtime_ns}")
    return hashlib.sha256("\n".join(found).encode()).hexdigest()


def _sources(folder: str) -> Iterator[str]:
    """Yield the modules in a folder and below, in order."""
    for entry in sorted(os.scandir(folder), key=lambda e: e.name):
        if entry.is_dir():
            yield from _sources(entry.path)
        elif entry.name.endswith(".py"):
            yield entry.path
