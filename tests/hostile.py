"""Text that a stranger could put into a card, a tag or a file: what ends comments and strings, moves cursors, turns writing."""

from __future__ import annotations

from typing import Final

from hypothesis import strategies as st

CONTROLS: Final = (
    "\x00", "\x07", "\x08", "\t", "\n", "\x0b", "\x0c", "\r", "\r\n", "\x1b[2J", "\x1b]0;title\x07", "\x7f", "\x85", "\x9b31m",
    "\u2028", "\u2029", "\ud800", "\udcff",
)  # fmt: skip
"""What a terminal obeys, what ends a line, and half a pair."""
BIDI: Final = ("\u200e", "\u200f", "\u202a", "\u202d", "\u202e", "\u2066", "\u2069", "\u200b", "\u00ad", "\ufeff")
"""What turns the direction of writing, or cannot be seen."""
MARKS: Final = (
    "*/", "/*", "//", "*", "/", "(*", "*)", "\\", "\\\n", "??/", "??/\n", "#", "\n#", '"', '"""', "'''", "'", "`", "{", "}", "${",
    "%s", "\\N{DEL}", "\\x", "\\u", "\nimport os\nos.abort()\n", "\n#error\n", '");abort();("', "#include <none>",
    "]]>", "<!--", "-->",
    "<script>", "=1+1", "@", "$x^2$",
)  # fmt: skip
"""What means something in a language that texts are printed in."""
ENCODINGS: Final = (
    "coding: unicode_escape",
    "coding=utf-7",
    "-*- coding: latin-1 -*-",
    "encoding: nonsense",
    "vim: set fileencoding=cp037 :",
)
"""What declares the encoding of a Python module, in its first two lines."""
PRINTABLE: Final = "".join(chr(c) for c in range(0x20, 0x7F))

hostile_text: st.SearchStrategy[str] = (
    st.text(max_size=40)
    | st.text(PRINTABLE + "é°·√…漢")
    | st.lists(st.sampled_from(CONTROLS + BIDI + MARKS + ENCODINGS) | st.text(max_size=3), max_size=8).map("".join)
)
"""Any text, with those that break something at least one time in three; half a pair too."""
hostile_names: st.SearchStrategy[str] = (
    st.text(PRINTABLE + "é°·漢", min_size=1, max_size=40)
    | st.lists(st.sampled_from(tuple(m for m in MARKS + ENCODINGS if "\n" not in m)), min_size=1, max_size=6).map(" ".join)
).filter(lambda text: text == text.strip() and bool(text))  # fmt: skip
"""Text in one line that can be seen: what a card may call an option's choice."""
