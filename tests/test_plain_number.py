"""One number in a cell."""

from __future__ import annotations

import math
import re

import pytest

from pidemu.plausible import plain_number

_ONLY = "is not a number; write digits and a decimal point only, such as 10 or 1.5e-3"


_READ = {"0": 0, "-1.5": -1.5, "+2": 2, ".5": 0.5, "5.": 5, "1E+3": 1000, "0010": 10}


@pytest.mark.parametrize(("text", "value"), _READ.items())
def test_plain_decimal_notation_is_read(text: str, value: float) -> None:
    assert plain_number(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1_0", f"'1_0' {_ONLY}"),
        ("١٢", f"'١٢' {_ONLY}"),
        ("１", f"'１' {_ONLY}"),
        ("nan", f"'nan' {_ONLY}"),
        ("inf", f"'inf' {_ONLY}"),
        ("0x10", "'0x10' is not a number"),
        ("#REF!", "'#REF!' is not a number"),
        ("", "'' is not a number"),
        ("1,5", "'1,5' has a comma; write a decimal point"),
        ("1e999", "'1e999' is too large a number"),
        ("9" * 5000, f"'{40 * '9'}…{20 * '9'}' is too large a number"),
        ("\x1b[2J", "'\\x1b[2J' is not a number"),
    ],
)
def test_everything_else_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        plain_number(text)


def test_words_for_what_is_not_finite_are_read_where_they_may_be() -> None:
    assert [plain_number(word, words=True) for word in ("inf", "-INF", "Infinity")] == [math.inf, -math.inf, math.inf]
    assert math.isnan(plain_number("NaN", words=True))
    with pytest.raises(ValueError, match="is too large a number"):
        plain_number("1e999", words=True)
