"""Numbers, words and texts: usual ones, and what nobody expects."""

from __future__ import annotations

from random import Random
from typing import Final

HOSTILE_NUMBERS: Final = (
    "0", "-0", "-1", "+5", "--5", ".5", "5.", "1e", "1e+", "1d5", "0x10", "0b1", "1_0", "1,5", "1.5.2", "1 2", "1'000", "1.000,5",
    "1e308", "-1e308", "1.7976931348623157e308", "1e309", "-1e309", "1e5000", "1e-5000", "5e-324", "2.2250738585072014e-308",
    "1e-300", "-1e-300", "1e300", "-1e300", "1e30", "1e31", "1e-9", "1e-30", "9007199254740993", "inf", "-inf", "nan", "NaN",
    "Infinity", ".inf", ".nan", "٣", "١٢", "１２", "½", "\N{MINUS SIGN}5", "1\u00a0000", "#REF!", "#DIV/0!", "#N/A", "TRUE", "",
    "-", "+", ".", "e5", "1e1e1", "0.1e", "1/scan", "1e3 s", "5 furlong", "null", "~", "9" * 60, "0." + "0" * 60 + "1",
)  # fmt: skip
HOSTILE_TEXTS: Final = (
    "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "\x00", "\r", "\x0b", "\x0c", "\x1c", "\x7f", "\x85", "\x9b31m", "\u2028", "\u2029",
    "\u202eevil", "\u2066x", "\ufeff", "\u200b", "💥", "Ünïcödé", "日本語", "a" * 300, "=1+1", "@SUM(1)", "+1", "-1", "'", '"',
    "`id`", "$(id)", "$x^2$", r"$\frac{1}$", "$", "%s", "%", "{0}", "{", "}", "\\", "\\n", "/", "..", ".", "coding: unicode_escape",
    r"\nfuzz_escape()\n#", '"""\nfuzz_escape()\n"""', "'''", "*/ fuzz_escape(); /*", "//", "/*", "# -*- coding: utf-7 -*-",
    "<script>alert(1)</script>", "&amp;", "#1 boiler", "#REF!", "# comment", "#", "null", "~", "yes", "on", "-", "--", "--help",
    "=", "a=b", "!!python/object/apply:os.system", "!x", "&a", "*a", "|", ">", "%TAG", "---", "...",
    "\t", " ", "", "con", "nul", "a\nb",
    "a,b", "a;b", "a:b", ": ", "[", "]", "[]", "{}", "import os", "lambda", "None", "x" * 20 + "-" + "y" * 20, "?", "__class__",
)  # fmt: skip
UNITS: Final = (
    "s", "min", "h", "ms", "us", "s/repeat", "min/repeat", "repeat/min", "repeat/s", "%", "%/%", "1", "1/s", "1/min", "1/scan",
    "scan", "%/s", "%/min", "%/scan", "eu", "eu/s", "degC", "degF", "K", "counts", "rad/s", "Hz", "furlong", "S", "MIN", "µs", "",
)  # fmt: skip


def plausible(rng: Random) -> str:
    """Return a number as one may stand on a controller."""
    value = 10 ** rng.uniform(-2.5, 2.8)
    return f"{value:.{rng.randint(1, 4)}g}" if rng.random() < 0.7 else str(rng.randint(0, 100))


def number(rng: Random, hostile: float = 0.3) -> str:
    """Return a number, or what stands in place of one."""
    dice = rng.random()
    if dice > hostile:
        return plausible(rng)
    if dice < hostile / 3:
        return f"{rng.choice(('', '-'))}{rng.uniform(1, 10):.{rng.randint(1, 17)}g}e{rng.randint(-330, 310)}"
    return rng.choice(HOSTILE_NUMBERS)


def text(rng: Random) -> str:
    """Return a text that nobody expects."""
    found = rng.choice(HOSTILE_TEXTS)
    return found + rng.choice(HOSTILE_TEXTS) if rng.random() < 0.15 else found


def anything(rng: Random) -> str:
    """Return a number or a text."""
    return number(rng, 0.7) if rng.random() < 0.5 else text(rng)


def quantity(rng: Random, hostile: float = 0.3) -> str:
    """Return a number, perhaps with a unit."""
    unit = f" {rng.choice(UNITS)}" if rng.random() < hostile else ""
    return number(rng, hostile) + unit


def misspelt(rng: Random, word: str) -> str:
    """Return a word with one character added, doubled, lost, exchanged, or in another case."""
    if not word:
        return text(rng)
    at, way = rng.randrange(len(word)), rng.randrange(5)
    if way == 0:
        return word[:at] + word[at + 1 :]
    if way == 1:
        return word[:at] + word[at] + word[at:]
    if way == 2:
        return word[:at] + rng.choice("aZ0_-. =:;,\t\x1bé") + word[at:]
    if way == 3:
        return word.swapcase()
    return word[:at] + rng.choice("aZ0_-. =:,") + word[at + 1 :]
