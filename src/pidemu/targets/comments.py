"""Text of cards in the comments of printed programs: nothing in it ends a comment, begins one, or reads as anything else."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_MARKS: Final = re.compile(r"(?<=\*)(?=[/)])|(?<=[/(])(?=\*)")
"""Within the marks of C, C++ and JavaScript, and those of Structured Text."""
_TRIGRAPH: Final = re.compile(r"\?(?=\?/)")
"""Two question marks and a slash are a backslash in C99."""
_COOKIE: Final = re.compile(r"(?<=coding)(?=[:=])")
"""What declares the encoding of a Python module, in its first two lines."""


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


def python_comments(title: str, notes: Sequence[str]) -> list[str]:
    """Return title and notes as the first lines of a Python module, a note per line."""
    first = _COOKIE.sub(" ", comment_text(title))
    return [f"# {first}", *(["#"] if notes else []), *(f"# {comment_text(note)}" for note in notes)]
