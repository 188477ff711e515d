"""Text of strangers in a message, on a terminal and in JSON: it is seen, and does nothing."""

from __future__ import annotations

from pidemu.excerpt import is_hidden, shortened, visible


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
    if text.isascii():
        return text
    return "".join(f"\\u{ord(c):04x}" if is_hidden(c) and c != "\n" and ord(c) < 0x10000 else c for c in text)
