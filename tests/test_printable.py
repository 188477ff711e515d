"""Text of strangers, made safe to print."""

from __future__ import annotations

import json

import pytest

from pidemu.printable import printable, shortened


@pytest.mark.parametrize("text", ["FIC-1", "Kühler ℃ 温度 עברית 😀", "a\tb\nc", ""])
def test_ordinary_text_stays_as_it_is(text: str) -> None:
    assert printable(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x1b[0m", "\\u001b[31mred\\u001b[0m"),
        ("\x9b2J", "\\u009b2J"),
        ("a\rb\x00\x7f", "a\\u000db\\u0000\\u007f"),
        ("abc\u202e cba", "abc\\u202e cba"),
        ("K\udcfchler", "K\\udcfchler"),
        ("\u2028\ufeff", "\\u2028\\ufeff"),
    ],
)
def test_what_controls_a_terminal_is_an_escape(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_within_json_the_escape_is_the_same_character() -> None:
    text = "\x1b\x9b\u202e\u2066 ü"
    assert json.loads(printable(json.dumps(text, ensure_ascii=False))) == text


def test_what_a_message_quotes_is_cut_and_in_one_line() -> None:
    assert shortened("a\nb") == "a\\u000ab"
    assert shortened("x" * 60) == "x" * 60
    assert shortened("x" * 61) == "x" * 59 + "…"
    assert shortened("\x1b" * 5_000_000, most=10) == "\\u001b…"
    assert shortened(12) == "12"
