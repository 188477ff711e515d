"""One number in a cell: plain decimal notation, and nothing that only Python takes for a number."""

from __future__ import annotations

import math
import re
from typing import Final

from pidemu.files.quoting import quoted

_PLAIN: Final = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WITH_COMMA: Final = re.compile(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?")
_WORDS: Final = re.compile(r"nan|[+-]?inf(?:inity)?", re.IGNORECASE)


def plain_number(text: str, *, words: bool = False) -> float:
    """Read a number in plain decimal notation, such as ``-1.5`` or ``2e-3``.

    Parameters
    ----------
    text : str
        The number, without blanks around.
    words : bool
        Whether ``nan``, ``inf`` and ``-inf`` are numbers, too.

    Raises
    ------
    ValueError
        It is none, or is larger than any number a computer has; the message quotes it, with the remedy.

    Examples
    --------
    >>> plain_number("-1.5e3")
    -1500.0
    >>> plain_number("1_0")
    Traceback (most recent call last):
        ...
    ValueError: '1_0' is not a number; write digits and a decimal point only, such as 10 or 1.5e-3
    """
    if _PLAIN.fullmatch(text):
        value = float(text)
        if math.isinf(value):
            raise ValueError(f"'{quoted(text)}' is too large a number")
        return value
    if words and _WORDS.fullmatch(text):
        return float(text)
    if _WITH_COMMA.fullmatch(text):
        raise ValueError(f"'{quoted(text)}' has a comma; write a decimal point")
    try:
        float(text)
    except ValueError:
        raise ValueError(f"'{quoted(text)}' is not a number") from None
    raise ValueError(f"'{quoted(text)}' is not a number; write digits and a decimal point only, such as 10 or 1.5e-3")
