"""docs/matrix.csv and docs/matrix.md: every ordered pair of cards is there, and a sample is computed again."""

from __future__ import annotations

import csv
import random

import pytest

import pidemu
from pidemu.matrix.cell import Work, cell
from pidemu.matrix.matrix import matrix
from tools.regenerate import RENEW
from tools.regenerate.matrix import summary
from tools.regenerate.pages import ROOT

DOCS = ROOT / "docs"
CARDS = [c for c in pidemu.cards() if c != "generic/dahlin"]


@pytest.fixture(scope="module")
def rows() -> list[dict[str, str]]:
    with (DOCS / "matrix.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def counted(text: str) -> dict[str, list[int]]:
    """Return the numbers of each card's row, empty cells as 0."""
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")]
    return {card: [int(n or 0) for n in numbers] for card, *numbers in table if "/" in card}


def test_the_summary_counts_every_conversion_once_from_and_once_to_each_card() -> None:
    four = matrix(("fisher/provox", "emerson/deltav", "generic/standard", "bailey/fc19"), emulate=False)
    assert [(sum(row[:5]), sum(row[5:])) for row in counted(summary(four)).values()] == [(4, 4)] * 4


def test_the_docs_list_every_ordered_pair_of_cards(rows: list[dict[str, str]]) -> None:
    assert [(r["source"], r["target"]) for r in rows] == [(a, b) for a in CARDS for b in CARDS], RENEW
    assert {r["verdict"] for r in rows if r["source"] == r["target"]} == {"exact"}
    assert not [r for r in rows if r["verdict"] == "failed"]


def test_the_docs_are_what_conversions_give_today(rows: list[dict[str, str]]) -> None:
    work = Work({c: c for c in CARDS}, (), derivative=True, emulate=True)
    for row in random.Random(1).sample(rows, 40):
        found = cell(work, row["source"], row["target"])
        pair = f"{row['source']} to {row['target']}: {RENEW}"
        assert (row["verdict"], row["match"], row["source_settings"], row["command"]) == (
            found.verdict, found.match, found.given, found.command
        ), pair  # fmt: skip
        names = ("feedback_deviation", "setpoint_deviation", "scan_by_scan_feedback", "scan_by_scan", "movement")
        for name, figure in zip(names, found.figures, strict=True):
            stated = float(row[name]) if row[name] else None
            expected = (
                figure if figure is None else pytest.approx(figure, rel=2e-3, abs=1e-8)
            )  # four digits, and rounding elsewhere
            assert stated == expected, f"{name} of {pair}"


def test_the_page_names_every_card_and_counts_what_the_data_hold(rows: list[dict[str, str]]) -> None:
    table = counted((DOCS / "matrix.md").read_text(encoding="utf-8"))
    assert list(table) == CARDS, RENEW
    for card, counts in table.items():
        for side, found in (("source", counts[:5]), ("target", counts[5:])):
            verdicts = [r["verdict"] for r in rows if r[side] == card]
            exact, feedback, close, more, refused = found
            expected = [verdicts.count(v) for v in ("exact", "exact-feedback", "approximate", "refused")]
            assert [exact, feedback, close + more, refused] == expected, RENEW
