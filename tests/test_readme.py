"""What the README shows is true today."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.readme import README, ROOT, blocks, printed_by, python_block

TEXT = README.read_text(encoding="utf-8")


@pytest.mark.parametrize(("command", "printed"), blocks(TEXT), ids=[c for c, _ in blocks(TEXT)])
def test_a_command_prints_what_the_readme_shows(command: str, printed: str, tmp_path: Path) -> None:
    assert printed == printed_by(command, tmp_path)


def test_the_readme_shows_commands() -> None:
    assert len(blocks(TEXT)) >= 6


def test_the_python_example_gives_what_its_comments_say() -> None:
    names: dict[str, Any] = {}
    checked = 0
    for line in python_block(TEXT).splitlines():
        code, _, comment = line.partition("  #")
        expected = comment.strip()
        if expected and re.match(r"^([\d.'\"(\[]|True|False)", expected):
            assert eval(code, names) == eval(expected), line
            checked += 1
        elif code.strip():
            exec(code, names)
    assert checked >= 5


def test_the_set_up_commands_are_the_ones_that_continuous_integration_runs() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    shown = re.findall(r"^```sh\n(.*?)\n```$", TEXT, re.DOTALL | re.MULTILINE)
    assert len(shown) == 2
    for command in shown:
        assert command in script


def test_the_part_of_a_card_that_the_readme_shows_stands_in_the_card() -> None:
    (shown,) = re.findall(r"^```yaml\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
    card = (ROOT / "vendors" / "fisher" / "provox.yaml").read_text(encoding="utf-8")
    assert shown in card


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#]+)\)", TEXT))
def test_every_link_of_the_readme_leads_somewhere(target: str) -> None:
    assert (ROOT / target).exists()
