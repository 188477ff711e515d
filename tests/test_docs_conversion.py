"""Every figure on docs/conversion.md is recomputed: the tables are rebuilt, the text holds no other numbers."""

from __future__ import annotations

import re

import pytest

import pidemu
from pidemu.conversion.explain import explained as explained_choices
from tests.page_code import statements
from tools.regenerate import RENEW
from tools.regenerate.pages import CONSOLE, ROOT
from tools.regenerate.tables import REBUILT, TABLE

PAGE = ROOT / "docs" / "conversion.md"
TEXT = PAGE.read_text(encoding="utf-8")
SPEC = (ROOT / "specs" / "equations.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
HEADING = re.compile(r"^## \d+\.", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.^])\d+(?:\.\d+)?(?:e-?\d+)?(?!\w|\.\d)")
DIGITS = {float(i) for i in range(10)}
"""Bare digits are words of formulas: orders, squares, sections."""


def test_every_expression_of_the_page_says_what_it_gives() -> None:
    found = [statement for block in BLOCK.findall(TEXT) for statement in statements(block)]
    assert [code for code, comment, is_expression in found if is_expression and not comment] == []


def test_choices_that_are_refused_for_one_reason_are_one_line() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    found = explained_choices(pidemu.convert(source, "emerson/deltav", emulate=False))
    refused = [e for e in found if e.verdict == "refused"]
    assert len({e.why for e in refused}) == len(refused)
    assert [e.options for e in refused if "NL_GAP" in e.why] == ["FRSIPID_OPTS=nonlinear gain, and 15 more"]


def cells(table: str) -> list[list[str]]:
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines()]
    return [row for row in rows if not set("".join(row)) <= {"-"}]


@pytest.mark.parametrize("name", REBUILT)
def test_a_table_of_the_page_is_what_is_recomputed(name: str) -> None:
    assert cells(dict(TABLE.findall(TEXT))[name]) == REBUILT[name](), RENEW


def test_every_table_that_is_marked_so_is_recomputed() -> None:
    assert [name for name, _ in TABLE.findall(TEXT)] == list(REBUILT)


def test_the_table_of_the_two_rules_is_that_of_the_specification() -> None:
    assert dict(TABLE.findall(TEXT))["rules"] in SPEC


def test_every_figure_in_the_text_stands_in_the_code_or_in_a_table_that_is_recomputed() -> None:
    consoles = [match[0] for match in CONSOLE.finditer(TEXT)]
    shown = "\n".join([*BLOCK.findall(TEXT), *consoles, *(table for _, table in TABLE.findall(TEXT))])
    known = {float(x) for x in NUMBER.findall(shown)} | DIGITS
    text = HEADING.sub("", TABLE.sub("", CONSOLE.sub("", BLOCK.sub("", TEXT))))
    assert [x for x in NUMBER.findall(text) if float(x) not in known] == []


def table_of(text: str, header: str) -> list[list[str]]:
    """Return the body of the table whose header begins so."""
    found = re.search(rf"^{re.escape(header)}.*\n(?:\|.*\n)+", text, re.MULTILINE)
    assert found is not None
    return cells(found[0])[1:]


@pytest.mark.parametrize(
    ("page", "spec", "columns"),
    [
        ("| integral rule | s C(z)", "| integral rule | s C,", [0, 1, 3, 4]),
        ("| integral rule | q0", "| integral rule | q0", [0, 1, 2, 3]),
    ],
)
def test_the_formulas_of_the_scan_rules_are_those_of_the_specification_which_are_proven(
    page: str, spec: str, columns: list[int]
) -> None:
    mine, theirs = (table_of(text.replace("`", ""), header) for text, header in ((TEXT, page), (SPEC, spec)))
    assert mine == [[row[i] for i in columns] for row in theirs]
