"""Text of strangers on a terminal and in messages: nothing of it moves the cursor, turns the line round, or fills the screen."""

from __future__ import annotations

import re
from typing import Final

_CONTROL: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # C0 without tab and line feed, DEL, C1
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # what turns the direction of writing
    "\u2028\u2029\ufeff\ud800-\udfff\ufffe\uffff]"  # ends of lines that editors do not count, byte order mark, halves of pairs
)
_LINE: Final = re.compile("[\t\n]")


def printable(text: str) -> str:
    r"""Return text that is safe to print: what controls a terminal, or cannot be seen, as an escape such as ``\u001b``.

    Tabs and line feeds stay, and so does every letter of every language. Within a JSON string the escape means the same
    character.

    Parameters
    ----------
    text : str
        Any text.

    Examples
    --------
    >>> print(printable("FIC-1\x1b[2J Kühler"))
    FIC-1\u001b[2J Kühler
    """
    return _CONTROL.sub(_escape, text)


def shortened(text: object, most: int = 60) -> str:
    r"""Return text as a message can quote it: printable, in one line, and cut with an ellipsis.

    Parameters
    ----------
    text : object
        What is quoted.
    most : int
        Characters it may have.

    Examples
    --------
    >>> print(shortened("a\nb" + 100 * "c", most=9))
    a\u000ab…
    """
    whole = str(text)
    shown = _LINE.sub(_escape, printable(whole[:most]))
    return shown if len(whole) <= most and len(shown) <= most else f"{_cut(shown, most - 1)}…"


def masked(text: str) -> str:
    """Return text with a replacement character for each that controls a terminal, so that columns stay where they are."""
    return _CONTROL.sub("\ufffd", text)


def _escape(match: re.Match[str]) -> str:
    return f"\\u{ord(match[0]):04x}"


def _cut(shown: str, most: int) -> str:
    """Return the beginning of a text, without half an escape at its end."""
    return re.sub(r"\\(u[0-9a-f]{0,3})?$", "", shown[:most]) if len(shown) > most else shown
