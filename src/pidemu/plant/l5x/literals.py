"""Numbers of an export, and the bracketed text in which it states values by position."""

from __future__ import annotations

import math
import re
from typing import Final

import numpy as np

Positional = str | list["Positional"]
"""Values by position: a literal, or a list of more."""

_RADIX: Final = re.compile(r"(2|8|16)#([0-9A-Fa-f_]+)")
_TOKEN: Final = re.compile(r"\s*([\[\],]|'(?:[^'$]|\$.)*'|[^\[\],\s]+)")
_DEEPEST: Final = 100
_LARGEST: Final = float(np.finfo(np.float32).max)


def read_real(text: str) -> float:
    """Return a number, whatever its radix; NaN and infinity as editors write them, too.

    Raises
    ------
    ValueError
        It is none.

    Examples
    --------
    >>> read_real("-1.30853429e-003"), read_real("16#0000_00ff"), read_real("1.#QNAN")
    (-0.00130853429, 255.0, nan)
    """
    text = text.strip()
    match = _RADIX.fullmatch(text)
    if match is not None:
        return float(int(match[2].replace("_", ""), int(match[1])))
    marked = text.upper().lstrip("+-")
    if marked.startswith("1.#"):
        return math.inf if marked.startswith("1.#INF") and not text.startswith("-") else -math.inf if "INF" in marked else math.nan
    return float(text)


def shortest(x: float) -> float:
    """Return the shortest decimal that is the same number of 32 bits: 9.99999978e-003 is 0.01.

    Examples
    --------
    >>> shortest(9.99999978e-003)
    0.01
    """
    return x if abs(x) > _LARGEST else float(str(np.float32(x)))


def read_word(text: str) -> int:
    """Return a 32-bit word without sign, however it is written: -1978629632 is 16#8a10_8200.

    Raises
    ------
    ValueError
        It is no whole number of 32 bits.
    """
    match = _RADIX.fullmatch(text.strip())
    word = int(match[2].replace("_", ""), int(match[1])) if match is not None else int(text)
    if not -(2**31) <= word < 2**32:
        raise ValueError(f"{text} is no word of 32 bits")
    return word % 2**32


def read_positional(text: str) -> Positional:
    """Return the values of an L5K text.

    Raises
    ------
    ValueError
        Its brackets do not fit together.

    Examples
    --------
    >>> read_positional("[1,[2.0,3.0],4]")
    ['1', ['2.0', '3.0'], '4']
    """
    stack: list[list[Positional]] = [[]]
    at = 0
    text = text.strip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise ValueError(f"character {at + 1} is not a value")
        at, token = match.end(), match[1]
        if token == "[":
            inner: list[Positional] = []
            stack[-1].append(inner)
            stack.append(inner)
            if len(stack) > _DEEPEST:
                raise ValueError("the brackets are nested too deeply")
        elif token == "]":
            stack.pop()
            if not stack:
                raise ValueError("a bracket is closed that was not opened")
        elif token != ",":
            stack[-1].append(token)
    if len(stack) != 1 or len(stack[0]) != 1:
        raise ValueError("a bracket is not closed")
    return stack[0][0]
