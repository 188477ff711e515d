"""YAML as cards use it, and the promise that no text breaks the reader."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.card.library import card_files
from pidemu.card.load import Card, card_from
from pidemu.card.reading import parse, parse_file
from pidemu.errors import CardError, Problem


def read(text: str) -> Any:
    return parse(text, "card.yaml").value


def problems_of(text: str) -> tuple[Problem, ...]:
    with pytest.raises(CardError) as caught:
        parse(text, "card.yaml")
    return caught.value.problems


def placed(text: str) -> list[tuple[int, int, str]]:
    return [(p.line, p.column, p.message) for p in problems_of(text)]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-3", 0.001),
        ("1E5", 100000.0),
        ("off", "off"),
        ("on", "on"),
        ("no", "no"),
        ("Yes", "Yes"),
        ("y", "y"),
        ("017", 17),
        ("12:30:45", "12:30:45"),
        ("1_000", "1_000"),
        ("2026-11-22", "2026-11-22"),
        ("-0.5", -0.5),
        (".5", 0.5),
        ("+3", 3),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("true", True),
        ("FALSE", False),
        ("~", None),
        ("null", None),
        ("", None),
        ("'1e-3'", "1e-3"),
        ('"true"', "true"),
        ("4 repeats", "4 repeats"),
    ],
)
def test_a_scalar_is_read_by_the_core_schema_of_yaml_1_2(written: str, value: object) -> None:
    got = read(f"key: {written}\n")["key"]
    assert (type(value), value) == (type(got), got)


def test_not_a_number_is_written_with_a_dot() -> None:
    assert math.isnan(read("key: .nan")["key"])
    assert read("key: nan")["key"] == "nan"


def test_an_integer_too_long_for_python_is_still_read() -> None:
    assert math.inf == read(f"key: {'9' * 5000}")["key"]


def test_mappings_and_lists_nest() -> None:
    assert read("a:\n  b: [1, {c: }]\nd: []\n") == {"a": {"b": [1, {"c": None}]}, "d": []}


def test_every_key_and_value_has_its_place() -> None:
    document = parse("form: series\nsettings:\n  GAIN: {sets: gain}\n", "card.yaml")
    key, value = document.keys["settings", "GAIN", "sets"], document.values["settings", "GAIN", "sets"]
    assert (key.line, key.column, key.width) == (3, 10, 4)
    assert (value.line, value.column, value.width) == (3, 16, 4)


def test_a_duplicate_key_is_refused_with_both_lines() -> None:
    text = "card: 1\nform: series\nscan: 1\nform: parallel\n"
    assert placed(text) == [(4, 1, "duplicate key 'form' (first on line 2); keep one")]


def test_each_further_duplicate_names_the_first_line() -> None:
    assert placed("card: 1\na: 1\na: 2\na: 3\n") == [
        (3, 1, "duplicate key 'a' (first on line 2); keep one"),
        (4, 1, "duplicate key 'a' (first on line 2); keep one"),
    ]


def test_a_duplicate_in_a_nested_mapping_is_refused() -> None:
    assert placed("card: 1\na:\n  x: 1\n  x: 2\n") == [(4, 3, "duplicate key 'x' (first on line 3); keep one")]


def test_aliases_are_refused() -> None:
    assert placed("card: 1\nb: *one\n") == [(2, 4, "alias '*one' is not used in cards; write the value out")]


@pytest.mark.parametrize("text", ["card: 1\na: &one 1\n", "card: 1\na: &one [1]\n", "card: 1\na: &one {b: 1}\n"])
def test_anchors_are_refused(text: str) -> None:
    assert placed(text) == [(2, 4, "anchor '&one' is not used in cards; remove it")]


def test_the_anchor_of_a_key_is_refused() -> None:
    assert placed("card: 1\n&one a: 1\n") == [(2, 1, "anchor '&one' is not used in cards; remove it")]


def test_directives_of_another_yaml_are_refused() -> None:
    assert parse("%YAML 1.2\n---\ncard: 1\n", "x.yaml").value == {"card": 1}
    assert [message for *_, message in placed("%YAML 1.1\n---\ncard: 1\n")] == ["cards are YAML 1.2; remove the line %YAML"]
    assert [message for *_, message in placed("%TAG ! tag:x,2000:\n---\ncard: 1\n")] == [
        "tags are not used in cards; remove the line %TAG"
    ]


@pytest.mark.parametrize("tag", ["!!python/object/apply:os.system", "!include", "!!float"])
def test_tags_are_refused(tag: str) -> None:
    ((line, column, message),) = placed(f"a: {tag} '1'\n")
    assert (line, column) == (1, 4)
    assert message.endswith("is not used in cards; remove it")


def test_a_second_document_is_refused_where_it_starts() -> None:
    assert placed("a: 1\n---\nb: 2\n") == [(3, 1, "a second document; a card is one document, put it in a file of its own")]


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n", "---\n", "~"])
def test_an_empty_file_is_refused(text: str) -> None:
    assert placed(text) == [(1, 1, "the file is empty; a card starts with 'card: 1'")]


@pytest.mark.parametrize("text", ["- 1\n- 2\n", "just words\n", "17"])
def test_a_file_that_is_no_mapping_is_refused(text: str) -> None:
    assert placed(text) == [(1, 1, "the file is not a mapping; a card starts with 'card: 1'")]


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("a: 1\nb: \x07x\n", 2, 4),
        ("\x00", 1, 1),
        ("a: \x1b[31m\n", 1, 4),
        ("a: é\nb: ü\x01\n", 2, 5),  # bytes and characters count differently
        ("ééééé\x01\n", 1, 6),
    ],
)
def test_a_control_character_is_refused_at_its_place(text: str, line: int, column: int) -> None:
    code = next(ord(c) for c in text if ord(c) < 32 and c != "\n")
    assert [(line, column, f"character U+{code:04X} is not allowed in YAML; remove it")] == placed(text)


def test_half_a_unicode_pair_is_refused_at_its_place() -> None:
    assert placed("a: 1\nb: \ud800\n") == [(2, 4, "half a Unicode pair; remove it")]


def test_a_tab_as_indentation_is_refused_on_its_line() -> None:
    problems = problems_of("a:\n\tb: 1\n")
    assert [p.line for p in problems] == [2]
    assert problems[0].message.startswith("not YAML: ")


@pytest.mark.parametrize("text", ["a: 1\n---", "a: 1\n---\n", "a: 1\n--- # nothing\n"])
def test_an_empty_second_document_is_refused_within_the_text(text: str) -> None:
    (problem,) = problems_of(text)
    assert problem.message.startswith("a second document")
    assert 1 <= problem.line <= 2


def test_an_unclosed_bracket_is_refused_within_the_text() -> None:
    (problem,) = problems_of("a: [1, 2\n")
    assert problem.message.startswith("not YAML: ")
    assert problem.line == 1


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_is_refused_and_breaks_nothing(opening: str) -> None:
    problems = problems_of(opening * 5000)
    assert any("nested more than 32 levels deep" in p.message or p.message.startswith("not YAML") for p in problems)


def test_nesting_as_deep_as_any_card_is_read() -> None:
    assert read("a: " + "[" * 20 + "]" * 20 + "\n")["a"] != []


def test_a_key_must_be_a_word() -> None:
    assert placed("[1, 2]: 3\n") == [(1, 1, "a key must be a plain word")]


def test_a_file_that_is_not_utf_8_is_refused_on_its_line(tmp_path: Path) -> None:
    file = tmp_path / "card.yaml"
    file.write_bytes("card: 1\nvendor: Müller\n".encode("latin-1"))
    with pytest.raises(CardError) as caught:
        parse_file(file, "shown.yaml")
    assert [p.headline() for p in caught.value.problems] == ["shown.yaml:2:10: not UTF-8 text (byte 0xFC); save the file as UTF-8"]


def test_a_byte_order_mark_is_no_part_of_the_card(tmp_path: Path) -> None:
    file = tmp_path / "card.yaml"
    file.write_bytes(b"\xef\xbb\xbfcard: 1\n")
    assert parse_file(file).value == {"card": 1}


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"none\.yaml:1:1: cannot be read: "):
        parse_file(tmp_path / "none.yaml")


def test_an_error_shows_the_lines_around_and_marks_the_token() -> None:
    with pytest.raises(CardError) as caught:
        parse("card: 1\nbc: 2\nbc: 3\nd: 4\n", "card.yaml")
    assert str(caught.value) == (
        "card.yaml:3:1: duplicate key 'bc' (first on line 2); keep one\n  2 | bc: 2\n  3 | bc: 3\n    | ^^\n  4 | d: 4"
    )


def answered(text: str) -> Card | CardError:
    try:
        return card_from(parse(text, "card.yaml"), "vendor/block")
    except CardError as error:
        return error


def check_answer(text: str) -> None:
    """A card, or problems that all lie in the text: nothing else, whatever the text."""
    answer = answered(text)
    if isinstance(answer, CardError):
        assert answer.problems
        assert tuple(sorted(answer.problems)) == answer.problems
        lines = max(1, len(text.splitlines()))
        for problem in answer.problems:
            assert 1 <= problem.line <= lines, problem.headline()
            assert problem.column >= 1, problem.headline()
            assert problem.message


REAL_CARDS = [file.read_text(encoding="utf-8") for file in card_files().values()]


YAML_BITS = st.sampled_from(
    ["a: ", "- ", "? ", ": ", "[", "]", "{", "}", "&x ", "*x", "!t ", "|", ">", "'", '"', "#", "\n", "\n  ", "\t", "---\n",
     "...\n", "%YAML 1.2\n", "\r", "\x85", "\u2028", "\ufeff", "\x00", "\x7f", "é", "1e400", "card: 1\n", "<<: ", ","]
)  # fmt: skip


@settings(max_examples=300)
@given(st.text(max_size=60) | st.lists(YAML_BITS, max_size=30).map("".join))
@example("\r\r\x00")
@example("é: \x01\n")
@example("a: 1\n\ud800")
def test_any_text_is_a_card_or_located_problems(text: str) -> None:
    check_answer(text)


@st.composite
def mutated_cards(draw: st.DrawFn) -> str:
    lines = draw(st.sampled_from(REAL_CARDS)).splitlines(keepends=True)
    for _ in range(draw(st.integers(1, 4))):
        where = draw(st.integers(0, max(0, len(lines) - 1)))
        other = draw(st.integers(0, max(0, len(lines) - 1)))
        match draw(st.sampled_from(["delete", "duplicate", "replace", "insert", "cut", "character", "word"])):
            case "delete":
                del lines[where : where + draw(st.integers(1, 3))]
            case "duplicate":
                lines[where:where] = lines[where : where + 1]
            case "replace":
                lines[where : where + 1] = lines[other : other + 1]
            case "insert":
                lines.insert(where, draw(st.text(max_size=10)) + "\n")
            case "cut":
                lines = lines[:where]
            case "character" if lines:
                line = lines[where]
                at = draw(st.integers(0, len(line)))
                lines[where] = line[:at] + draw(st.characters() | YAML_BITS) + line[at + draw(st.integers(0, 1)) :]
            case "word" if lines:
                words = lines[where].split(" ")
                words[draw(st.integers(0, len(words) - 1))] = draw(
                    st.sampled_from(["null", "[1]", "[1, 2, 3]", "{}", "-1", ".nan", "true", "''", "x", "[[]]", "{a: {b: 1}}"])
                )
                lines[where] = " ".join(words)
            case _:
                pass
        if not lines:
            lines = ["\n"]
    return "".join(lines)


@settings(max_examples=400)
@given(mutated_cards())
def test_any_damage_to_a_real_card_gives_a_card_or_located_problems(text: str) -> None:
    check_answer(text)


JUNK = st.sampled_from(
    ["null", "true", "-1", "0", '""', '" "', '"inf"', '".nan"', '"x"', '"off"', '"2026-13-45"', "[]", "[1]", "[1, 2, 3]", "[[]]",
     "{}", '{"a": 1}', '{"scheme": 3}', '{"scheme": "none"}', '{"scheme": []}']
)  # fmt: skip
"""Values as JSON, so that every draw is a fresh one."""


@st.composite
def misshapen_cards(draw: st.DrawFn) -> str:
    """A real card of which some values, at any depth, are replaced, removed or renamed; as JSON, which is YAML."""
    card = parse(draw(st.sampled_from(REAL_CARDS)), "card.yaml").value
    for _ in range(draw(st.integers(1, 3))):
        here: Any = card
        while True:
            keys: list[Any] = list(here) if isinstance(here, dict) else list(range(len(here)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if isinstance(here[key], dict | list) and draw(st.integers(0, 3)):
                here = here[key]
                continue
            what = draw(st.sampled_from(["replace", "replace", "remove", "rename"]))
            if what == "replace":
                here[key] = json.loads(draw(JUNK))
            elif what == "remove":
                del here[key]
            elif isinstance(here, dict):
                here[draw(st.sampled_from(["", "x", "1", "form", "windup", "GAIN", "a b"]))] = here.pop(key)
            break
    return json.dumps(card, indent=1)


@settings(max_examples=400)
@given(misshapen_cards())
def test_any_wrong_value_in_a_real_card_gives_a_card_or_located_problems(text: str) -> None:
    check_answer(text)


@pytest.mark.parametrize("value", ["[]", "[1]", "[1, 2, 3]", "[1, x]", "5", "{}", "null", "[null, 1]"])
@pytest.mark.parametrize("key", ["limits", "range"])
def test_a_pair_that_is_no_pair_is_a_located_problem(key: str, value: str) -> None:
    text = REAL_CARDS[0]
    lines = text.splitlines()
    if key == "limits":
        at = next(i for i, line in enumerate(lines) if line.startswith("output:"))
        lines[at] = f"output: {{limits: {value}}}"
    else:
        at = next(i for i, line in enumerate(lines) if line.startswith("settings:"))
        lines.insert(at + 1, f"  EXTRA: {{sets: gain, unit: '1', default: 1, range: {value}}}")
        at += 1
    if (key, value) == ("range", "null"):  # no range is a range of everything
        check_answer("\n".join(lines))
        return
    with pytest.raises(CardError) as caught:
        card_from(parse("\n".join(lines), "card.yaml"), "vendor/block")
    assert {at + 1} == {problem.line for problem in caught.value.problems}


def test_every_built_in_card_is_among_those_damaged() -> None:
    assert len(pidemu.cards()) == len(REAL_CARDS) > 0


@pytest.mark.parametrize(
    ("beginning", "is_shown"),
    [
        ("card: 1\n", True),
        ("# yaml-language-server: x\n\n---\ncard: 1 # version\n", True),
        ("card: fisher/provox\n", True),  # a loop
        ('{"card": 1,\n"a": 1}\n', True),
        ("card:x:1000:1000::/home/card:/bin/sh\n", False),
        ("vendor: Nobody\n", False),
        ("password: hunter2\n", False),
        ("discard: 1\n", False),
    ],
)
def test_an_error_shows_lines_of_what_begins_like_a_card_only(beginning: str, is_shown: bool) -> None:
    (first, *_) = problems_of(f"{beginning}a: \x01\n")
    assert is_shown == bool(first.source)
    assert is_shown == ("\n" in first.render())


@pytest.mark.parametrize("text", ["root: 1\nroot: 2\n", "a: !root 1\n", "a: &root 1\nb: *root\n"])
def test_an_error_names_nothing_of_a_file_that_is_no_card(text: str) -> None:
    assert [p.headline() for p in problems_of(text) if "root" in p.headline()] == []


@pytest.mark.parametrize(
    "text",
    [
        "\n" * 999_000,
        "#\n" * 490_000,
        "'" * 990_000,
        "card: 1\n" + "x: 1\n" * 190_000,
        "card: 1\na: x\n" + " y\n" * 300_000,
        "card: 1\na: " + "\U0001f600" * 490_000,
        "card: 1\n" + "".join(f"k{i}: 1\n" for i in range(20_000)),
    ],
    ids=["lines", "comments", "quotes", "duplicates", "words", "pictures", "keys"],
)
def test_the_work_for_a_text_grows_no_faster_than_the_text(text: str) -> None:
    """The most that is read has at most 4,000 keys and values, and an error is of limited length."""
    answer = answered(text)
    if isinstance(answer, CardError):
        assert len(str(answer)) < 50_000
        assert len(answer.problems) <= 51
