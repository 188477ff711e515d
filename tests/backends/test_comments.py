"""Text of cards in comments."""

from __future__ import annotations

import ast
import io
import tokenize

import pytest

from pidemu.backends.comments import comment_text, python_head

HOSTILE = (
    "*/",
    "/*",
    "*/*",
    "/*/",
    "**//",
    "(*",
    "*)",
    "(*)",
    "??/",
    "a\nb",
    "a\rb",
    "a\u2028b",
    "a\x00b",
    "a\u202eb",
    '"""',
    "\\",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_ends_a_comment_or_begins_one_in_any_language(text: str) -> None:
    found = comment_text(text)
    assert [mark for mark in ("*/", "/*", "(*", "*)", "??/") if mark in found] == []
    assert found.isprintable()
    assert len(found.splitlines()) == 1


@pytest.mark.parametrize(
    "text", [*HOSTILE, "coding: latin-1", "xcoding=nonsense", 'a"', '"' * 4, 'a\\"', r"\N{DEL} \x", "\ud800", ""]
)
def test_python_reads_nothing_but_a_docstring_and_no_encoding(text: str) -> None:
    """PEP 263: a comment such as ``coding: latin-1`` in the first two lines declares the encoding."""
    lines = python_head(text, [text, text])
    module = "\n".join(lines)
    assert tokenize.detect_encoding(io.BytesIO(module.encode()).readline)[0] == "utf-8"
    tree = ast.parse(module.encode())
    assert [type(node) for node in tree.body] == [ast.Expr]
    told = comment_text(text)
    assert ast.get_docstring(tree, clean=False) == f"{told}\n\n{told}\n{told}\n"
    assert ast.get_docstring(ast.parse("\n".join(python_head(text, []))), clean=False) == told
    assert module.splitlines() == lines


def test_ordinary_text_stays_as_it_is() -> None:
    assert comment_text("filter time 2·Tf [s], 3 °C * 4 / 5, (see p. 7)") == "filter time 2·Tf [s], 3 °C * 4 / 5, (see p. 7)"
