"""What an error shows of a file."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pidemu.errors import MOST_PROBLEMS, CardError, Problem, capped
from pidemu.excerpt import excerpt, shortened, visible
from tests.hostile import hostile_text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain text, é 漢 µ", "plain text, é 漢 µ"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("a\nb\r\tc", "a\\nb\\r\\tc"),
        ("\u202eleft", "\\u202eleft"),
        ("\x9b2J", "\\x9b2J"),
        ("\U000e0041", "\\U000e0041"),
        ("\ud800", "\\ud800"),
        ("f\udcff.yaml", "f\\xff.yaml"),
    ],
)
def test_what_is_not_seen_is_written_out(text: str, shown: str) -> None:
    assert shown == visible(text)


@given(hostile_text)
def test_nothing_that_is_shown_is_obeyed_by_a_terminal(text: str) -> None:
    shown = visible(text)
    assert {unicodedata.category(c) for c in shown} & {"Cc", "Cf", "Cs", "Zl", "Zp"} == set()
    shown.encode()


@given(st.text(), st.integers(3, 50))
def test_a_shortened_text_has_both_ends_and_its_length(text: str, most: int) -> None:
    found = shortened(text, most)
    assert len(found) <= most + 1
    assert found == text if len(text) <= most else "…" in found


def test_a_long_line_is_cut_around_the_column_and_so_are_those_around_it() -> None:
    long = "x" * 2_499_999 + "HERE" + "y" * 2_499_997
    above, line, marks, below = excerpt(["short", long, long], 2, 2_500_000, 4)
    assert above == "  1 | …"
    assert line == f"  2 | …{'x' * 50}HERE{'y' * 46}…"
    assert marks == f"    | {' ' * 51}^^^^"
    assert below == f"  3 | …{'x' * 50}HERE{'y' * 46}…"


def test_a_line_of_usual_length_is_shown_whole() -> None:
    line = "a" * 160
    assert excerpt([line], 1, 3, 500) == [f"  1 | {line}", f"    |   {'^' * 50}"]


def test_marks_stand_under_the_token_behind_what_is_written_out() -> None:
    assert excerpt(["a: \x1b[2J word"], 1, 9, 4) == ["  1 | a: \\x1b[2J word", "    |            ^^^^"]


@given(st.lists(hostile_text, min_size=1, max_size=3), st.integers(1, 3), st.integers(1, 60), st.integers(0, 10**6))
@example(["x" * 10**6], 1, 10**6, 1)
def test_an_excerpt_is_small_and_plain_whatever_the_lines(lines: list[str], line: int, column: int, width: int) -> None:
    shown = excerpt(lines, min(line, len(lines)), column, width)
    assert 2 <= len(shown) <= 4
    assert all(len(x) < 11 * 170 for x in shown)
    assert {unicodedata.category(c) for x in shown for c in x} & {"Cc", "Cf", "Cs", "Zl", "Zp"} == set()


def test_a_problem_cannot_hold_what_a_terminal_obeys() -> None:
    problem = Problem("\x1b[2J.yaml", 1, 1, "unknown key '\x1b[2J\u202e'")
    assert problem.headline() == "\\x1b[2J.yaml:1:1: unknown key '\\x1b[2J\\u202e'"
    assert len(Problem("p" * 10**6, 1, 1, "m" * 10**6).headline()) < 1500


def test_of_very_many_problems_the_first_are_told_and_how_many_more_there_are() -> None:
    many = [Problem("a.yaml", line, 1, f"fault {line}") for line in range(1000, 0, -1)]
    found = capped(many)
    assert [p.headline() for p in found] == [
        *(f"a.yaml:{n}:1: fault {n}" for n in range(1, MOST_PROBLEMS + 1)),
        f"a.yaml:51:1: and {1000 - MOST_PROBLEMS} more problems, from here on",
    ]
    assert sum(p.stands_for for p in found) == 1000
    assert capped(found) == found
    assert len(str(CardError(found)).splitlines()) == MOST_PROBLEMS + 1


@pytest.mark.parametrize("count", [1, MOST_PROBLEMS, MOST_PROBLEMS + 1])
def test_a_few_problems_are_all_told(count: int) -> None:
    many = [Problem("a.yaml", line, 1, "fault") for line in range(1, count + 1)]
    assert many == capped(reversed(many))
