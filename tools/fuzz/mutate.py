"""Changes to texts: values, keys, lines, blocks, bytes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

from tools.fuzz.vocabulary import anything, misspelt, number, text

_VALUE: Final = re.compile(r"(?<=[:,\[{] )[^,{}\[\]\n#\"]+|(?<=- )[^,{}\[\]\n#:\"]+")
_KEY: Final = re.compile(r"[\w./-]+(?=:( |$))")
_WORD: Final = re.compile(r"[A-Za-z][\w-]*")

Lines = list[str]


def mutated_yaml(rng: Random, source: str, others: Sequence[str]) -> bytes:
    """Return a YAML text with some changes, perhaps no longer YAML.

    Parameters
    ----------
    rng : Random
        The choices.
    source : str
        The text.
    others : sequence of str
        Texts from which blocks may come.
    """
    lines = source.split("\n")
    for _ in range(1 + (rng.random() < 0.4) + (rng.random() < 0.15)):
        lines = rng.choice(_CHANGES)(rng, lines, others) or ["x: 1"]
    content = "\n".join(lines).encode("utf-8", "surrogatepass")
    return mutated_bytes(rng, content) if rng.random() < 0.05 else content


def mutated_bytes(rng: Random, content: bytes) -> bytes:
    """Return bytes with some changed, lost, doubled or put between; or the text in another encoding."""
    at, way = rng.randrange(len(content) + 1), rng.randrange(9)
    if way == 0:
        return content[:at] + bytes([rng.randrange(256)]) + content[at + 1 :]
    if way == 1:
        return content[:at] + rng.choice((b"\x00", b"\xff", b"\xef\xbb\xbf", b"\x1b[2J", b"\xc3", b"\xed\xa0\x80")) + content[at:]
    if way == 2:
        return content[:at]
    if way == 3:
        return content[:at] + content[at : at + rng.randint(1, 40)] * 2 + content[at + 40 :]
    if way == 4:
        return b"\xef\xbb\xbf" * rng.randint(1, 2) + content
    if way == 5:
        return content.decode("utf-8", "replace").encode(rng.choice(("utf-16", "utf-16-be", "utf-16-le", "utf-32", "utf-7")))
    if way == 6:
        return content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b"\x0b\n", b"\xe2\x80\xa8", b"\xc2\x85")))
    if way == 7:
        return content.decode("utf-8", "replace").encode("latin-1", "replace") + b"\xe9"
    return content + rng.choice((b"\x1a", b"\x00" * 8, b"\n" * 50, b"\xff\xfe"))


def _in_a_line(rng: Random, lines: Lines, pattern: re.Pattern[str], new: Callable[[str], str]) -> Lines:
    """Replace one match of a pattern in one line."""
    for _ in range(8):
        at = rng.randrange(len(lines))
        found = list(pattern.finditer(lines[at]))
        if found:
            match = rng.choice(found)
            lines[at] = lines[at][: match.start()] + new(match[0]) + lines[at][match.end() :]
            break
    return lines


def _value(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    def new(_old: str) -> str:
        found = anything(rng)
        return json.dumps(found) if rng.random() < 0.5 else found

    return _in_a_line(rng, lines, _VALUE, new)


def _number(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    return _in_a_line(rng, lines, re.compile(r"(?<![\w.])-?\d+(\.\d+)?(?![\w.])"), lambda _old: number(rng, 0.8))


def _key(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    keys = [m[0] for line in lines for m in _KEY.finditer(line)] or ["x"]

    def new(old: str) -> str:
        way = rng.random()
        return misspelt(rng, old) if way < 0.4 else rng.choice(keys) if way < 0.7 else json.dumps(text(rng))

    return _in_a_line(rng, lines, _KEY, new)


def _reference(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    """Let one word stand where another stood, both from the text."""
    words = [m[0] for line in lines for m in _WORD.finditer(line)] or ["x"]
    return _in_a_line(rng, lines, _WORD, lambda _old: rng.choice(words))


def _block(lines: Lines, at: int) -> int:
    """Return where the block that begins at a line ends: the lines after it that are indented more."""
    indent = len(lines[at]) - len(lines[at].lstrip())
    end = at + 1
    while end < len(lines) and len(lines[end]) - len(lines[end].lstrip()) > indent:
        end += 1
    return end


def _without(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    at = rng.randrange(len(lines))
    return lines[:at] + lines[_block(lines, at) :]


def _doubled(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    at = rng.randrange(len(lines))
    end = _block(lines, at)
    return lines[:end] + lines[at:end] * rng.choice((1, 1, 2, 30)) + lines[end:]


def _moved(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    at = rng.randrange(len(lines))
    end = _block(lines, at)
    rest, to = lines[:at] + lines[end:], rng.randrange(len(lines) + 1)
    return rest[:to] + lines[at:end] + rest[to:]


def _indented(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    at = rng.randrange(len(lines))
    lines[at] = rng.choice((" ", "  ", "\t", "      ")) + lines[at] if rng.random() < 0.6 else lines[at].lstrip()
    return lines


def _spliced(rng: Random, lines: Lines, others: Sequence[str]) -> Lines:
    """Put a block of another text between."""
    other = rng.choice(others).split("\n")
    at, to = rng.randrange(len(other)), rng.randrange(len(lines) + 1)
    return lines[:to] + other[at : _block(other, at)] + lines[to:]


def _inserted(rng: Random, lines: Lines, _others: Sequence[str]) -> Lines:
    at = rng.randrange(len(lines) + 1)
    return [*lines[:at], rng.choice((text(rng), f"{text(rng)}: {anything(rng)}", f"  {anything(rng)}: {{}}")), *lines[at:]]


_CHANGES: Final = (
    _value, _value, _value, _number, _number, _key, _key, _reference, _reference, _reference, _without, _without, _without,
    _doubled, _moved, _indented, _spliced, _inserted,
)  # fmt: skip
