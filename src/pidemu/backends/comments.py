"""Text of cards in the comments of printed programs: nothing in it ends a comment, begins one, or reads as anything else."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_MARKS: Final = re.compile(r"(?<=\*)(?=[/)])|(?<=[/(])(?=\*)")
"""Within the marks of C, C++ and JavaScript, and those of Structured Text."""
_TRIGRAPH: Final = re.compile(r"\?(?=\?/)")
"""Two question marks and a slash are a backslash in C99."""
_QUOTE: Final = re.compile(r'"(?="|$)')
"""Quotation marks that could end a string, by themselves or with what follows."""
_FIRST_LINE: Final = "# A PID controller, scan by scan; printed by pidemu."
"""Without a word of the card: the first two lines of a module may declare its encoding, in a comment (PEP 263)."""


def comment_text(text: str) -> str:
    """Return a text in one line, in which no target language sees the end or the beginning of a comment.

    Control characters, and those that turn the direction of writing, become question marks.

    Parameters
    ----------
    text : str
        Any text.

    Examples
    --------
    >>> comment_text("gain */ int x; /* (* by hand *)")
    'gain * / int x; / * ( * by hand * )'
    """
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return _TRIGRAPH.sub("? ", _MARKS.sub(" ", line))


def python_head(title: str, notes: Sequence[str]) -> list[str]:
    """Return the first lines of a Python module: one that is always the same, then title and notes as its docstring.

    Parameters
    ----------
    title : str
        Any text.
    notes : sequence of str
        Any texts, a line each.
    """
    first, *others = (_in_string(text) for text in (title, *notes))
    told = ["", *others, '"""'] if others else []
    return [_FIRST_LINE, f'"""{first}' + ("" if others else '"""'), *told]


def _in_string(text: str) -> str:
    """Return a text in one line, as it stands between three quotation marks."""
    return _QUOTE.sub(r'\\"', comment_text(text).replace("\\", r"\\"))
