"""Text that is not ours on a terminal: nothing in it moves the cursor, turns the writing or fills the screen."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import Final

_WHOLE: Final = 160
"""Characters of a line that is shown from its beginning."""
_AROUND: Final = 50
"""Characters shown before and after the place of a fault in a longer one."""
_HIDDEN: Final = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Categories of characters that a terminal obeys, or that cannot be seen."""
_PLAIN: Final = re.compile(r"[\x20-\x7e]*")
_ESCAPES: Final = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}
_BEYOND: Final = "…"


def is_hidden(character: str) -> bool:
    """Tell whether a character is not seen as itself: a control character, one that turns the writing, half a pair."""
    return unicodedata.category(character) in _HIDDEN


def visible(text: str) -> str:
    r"""Return a text in one line, with what is not seen, or is obeyed by terminals, written out.

    Parameters
    ----------
    text : str
        Any text.

    Examples
    --------
    >>> visible("red \x1b[31m")
    'red \\x1b[31m'
    """
    if _PLAIN.fullmatch(text):
        return text
    return "".join(_written_out(c) if is_hidden(c) else c for c in text)


def _written_out(c: str) -> str:
    code = ord(c)
    if c in _ESCAPES:
        return _ESCAPES[c]
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file's name that is not UTF-8
        return f"\\x{code - 0xDC00:02x}"
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def shortened(text: str, most: int = 2 * _AROUND) -> str:
    """Return a text with its middle left out where it is longer than `most` characters.

    Parameters
    ----------
    text : str
        Any text.
    most : int
        Characters that are kept.
    """
    return text if len(text) <= most else f"{text[: most - most // 3]}{_BEYOND}{text[-(most // 3) :]}"


def quoted(text: object, most: int = 60) -> str:
    r"""Return text as a message can quote it: visible, in one line, and shortened.

    Parameters
    ----------
    text : object
        What is quoted.
    most : int
        Characters of it that are kept.

    Examples
    --------
    >>> print(quoted("a\nb" + 100 * "c", most=9))
    a\nbccc…ccc
    """
    return visible(shortened(str(text), most))


def printable(text: str) -> str:
    r"""Return text of several lines, each with what is not seen, or is obeyed by terminals, written out.

    Examples
    --------
    >>> print(printable("FIC-1\x1b[2J\nFIC-2"))
    FIC-1\x1b[2J
    FIC-2
    """
    return "\n".join(map(visible, text.split("\n")))


def printable_json(text: str) -> str:
    r"""Return JSON that means the same, with what a terminal obeys, or does not show, as an escape of JSON.

    Examples
    --------
    >>> print(printable_json('"FIC-1\x9b2J"'))
    "FIC-1\u009b2J"
    """
    if text.isascii() and "\x7f" not in text:
        return text
    return "".join(f"\\u{ord(c):04x}" if is_hidden(c) and c != "\n" and ord(c) < 0x10000 else c for c in text)


def excerpt(lines: Sequence[str], line: int, column: int, width: int) -> list[str]:
    """Return a line of a file with those around it and marks under the token, each cut to what is near the column.

    Parameters
    ----------
    lines : sequence of str
        All lines of the file.
    line, column : int
        1-based place of the token.
    width : int
        Its length.
    """
    gutter = len(str(line + 1)) + 2
    long = len(lines[line - 1]) > _WHOLE
    start, end = (max(0, column - 1 - _AROUND), column - 1 + _AROUND) if long else (0, _WHOLE)
    out = []
    for number in range(max(1, line - 1), min(len(lines), line + 1) + 1):
        out.append(f"{number:>{gutter}} | {_cut(lines[number - 1], start, end)}".rstrip())
        if number == line:
            before = _BEYOND * (start > 0) + visible(lines[number - 1][start : column - 1].ljust(column - 1 - start))
            out.append(" " * gutter + " | " + " " * len(before) + "^" * min(max(1, width), _AROUND))
    return out


def _cut(line: str, start: int, end: int) -> str:
    return _BEYOND * (start > 0) + visible(line[start:end]) + _BEYOND * (len(line) > end)
