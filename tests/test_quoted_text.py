"""Text of strangers in messages, on a terminal and in JSON."""

from __future__ import annotations

import json

import pytest

from pidemu.excerpt import printable, printable_json, quoted


@pytest.mark.parametrize("text", ["FIC-1", "Kühler ℃ 温度 עברית 😀\nsecond line", ""])
def test_ordinary_text_is_printed_as_it_is(text: str) -> None:
    assert printable(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x1b[0m\n", "\\x1b[31mred\\x1b[0m\n"),
        ("\x9b2J", "\\x9b2J"),
        ("a\rb\x00\x7f", "a\\rb\\x00\\x7f"),
        ("abc\u202e cba", "abc\\u202e cba"),
        ("K\udcfchler", "K\\xfchler"),
        ("\u2028\ufeff", "\\u2028\\ufeff"),
    ],
)
def test_what_controls_a_terminal_is_written_out(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_within_json_the_escape_is_the_same_character() -> None:
    text = "\x1b\x9b\u202e\u2066 ü 😀\U000e0041"
    shown = printable_json(json.dumps(text, ensure_ascii=False, indent=2))
    assert json.loads(shown) == text
    assert all(c not in shown for c in text[:4])


def test_what_a_message_quotes_is_short_and_in_one_line() -> None:
    assert quoted("a\nb") == "a\\nb"
    assert quoted("x" * 60) == "x" * 60
    assert quoted("x" * 5_000_000) == f"{40 * 'x'}…{20 * 'x'}"
    assert quoted(12) == "12"


def test_a_delete_character_alone_is_an_escape_of_json() -> None:
    assert printable_json('"\x7f"') == '"\\u007f"'
