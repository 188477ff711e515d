"""The README itself; what it shows is run by test_docs.py."""

from __future__ import annotations

import re

import pidemu
from tools.regenerate.pages import README, ROOT, commands, read
from tools.regenerate.picture import PICTURE, PICTURED

TEXT = read(README)


def test_the_readme_is_at_most_180_lines() -> None:
    assert len(TEXT.splitlines()) <= 180


def test_the_readme_shows_a_conversion_of_two_terms_one_of_three_a_question_and_a_refusal() -> None:
    shown = commands(README)
    assert [s.command.partition(" ")[0] for s in shown] == ["convert", "convert", "show", "convert", "convert"]
    assert [s.printed.partition(":")[0] for s in shown if ": " in s.printed.partition("\n")[0]] == ["question", "error"]


def test_the_set_up_commands_are_the_ones_that_continuous_integration_runs() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    shown = re.findall(r"^```sh\n(.*?)\n```$", TEXT, re.DOTALL | re.MULTILINE)
    assert len(shown) == 2
    for command in shown:
        assert command in script


def test_the_picture_is_that_of_a_conversion_that_the_readme_shows() -> None:
    assert PICTURED in [s.command for s in commands(README)]
    data = PICTURE.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = (int.from_bytes(data[at : at + 4]) for at in (16, 20))
    assert width == 1000
    assert 500 < height < 2000


def test_the_page_of_emulations_counts_the_cards_that_were_verified_against_the_real_program() -> None:
    first = sum(pidemu.load_card(name).verification.class_ == "V1" for name in pidemu.cards())
    assert f"{first} cards against the real implementation" in TEXT
    assert f"cards {first} are V1" in read(ROOT / "docs" / "emulation.md")
    assert first >= 24
