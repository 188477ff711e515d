"""README and docs are true today: commands, code, quoted files, options, links. `python -m tools.regenerate` renews them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click
import pytest

from pidemu.cli import cli
from tests.page_code import python_blocks, quotations, run
from tools.regenerate import RENEW
from tools.regenerate.pages import CUT, PAGES, README, ROOT, Shown, commands, prepare, read, shortened

SHOWN = [shown for page in PAGES for shown in commands(page)]
WITH_CODE = [page for page in PAGES if python_blocks(page)]
LINKS = [(page, target) for page in (*PAGES, ROOT / "CONTRIBUTING.md") for target in re.findall(r"\]\(([^)#]+)", read(page))]


def name(value: object) -> str:
    return str(value.relative_to(ROOT)) if isinstance(value, Path) else str(value)


@pytest.fixture
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("_in_folder")
@pytest.mark.parametrize("shown", SHOWN, ids=[f"{s.page.name}: {s.command}" for s in SHOWN])
def test_a_command_prints_what_the_page_shows(shown: Shown, tmp_path: Path) -> None:
    prepare(shown.page, tmp_path)
    assert shown.printed == shown.today(), RENEW


@pytest.mark.usefixtures("_in_folder")
@pytest.mark.parametrize("page", WITH_CODE, ids=name)
def test_the_code_of_a_page_gives_what_its_comments_say(page: Path, tmp_path: Path) -> None:
    prepare(page, tmp_path)
    blocks = [block for block in python_blocks(page) if "HOST" not in block]  # a cluster: test_docs_fleet.py starts one
    if any("parquet" in block for block in blocks):
        pytest.importorskip("pyarrow")
    names: dict[str, Any] = {}
    assert sum(run(block, names) for block in blocks) >= len(blocks)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_what_a_page_quotes_stands_in_the_file(page: Path) -> None:
    for path, text in quotations(page):
        assert text in (ROOT / path).read_text(encoding="utf-8"), path


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_the_commands_and_options_that_a_page_names_are_there(page: Path) -> None:
    with click.Context(cli) as context:
        there = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    parameters = [parameter for command in (cli, *there.values()) if command for parameter in command.params]
    known = {"--pidemu-examples"} | {option for parameter in parameters for option in (*parameter.opts, *parameter.secondary_opts)}
    text = re.sub(r"^```(sh|python|py)\n.*?^```$", "", read(page), flags=re.DOTALL | re.MULTILINE)
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) <= known
    assert set(re.findall(r"`pidemu (\w+)", text)) <= set(there)


@pytest.mark.parametrize(("page", "target"), LINKS, ids=name)
def test_every_link_leads_somewhere(page: Path, target: str) -> None:
    assert target.startswith("https://") or (page.parent / target).exists()


def test_the_readme_leads_to_every_page() -> None:
    linked = {(README.parent / target).resolve() for page, target in LINKS if page == README}
    assert [page.name for page in PAGES[1:] if page not in linked] == []


PRINTED = """\
From: old
  GAIN  2
  RESET 4

To: new
  GAIN  2
  RESET 15
  RATE  0

Verdict
  exact

Figures
  none
"""


@pytest.mark.parametrize(
    ("parts", "shown"),
    [
        ("From", f"From: old\n  GAIN  2\n  RESET 4\n{CUT}\n"),
        ("To until RATE", f"{CUT}\nTo: new\n  GAIN  2\n  RESET 15\n{CUT}\n"),
        ("RESET until To; Verdict until Figures", f"{CUT}\n  RESET 4\n{CUT}\nVerdict\n  exact\n{CUT}\n"),
        ("To until Verdict; Verdict", f"{CUT}\nTo: new\n  GAIN  2\n  RESET 15\n  RATE  0\n\nVerdict\n  exact\n{CUT}\n"),
        (
            "To until Verdict; Verdict until Figures",
            f"{CUT}\nTo: new\n  GAIN  2\n  RESET 15\n  RATE  0\n\nVerdict\n  exact\n{CUT}\n",
        ),
        ("Figures", f"{CUT}\nFigures\n  none\n"),
    ],
)
def test_a_mark_stands_where_something_is_left_out_and_nowhere_else(parts: str, shown: str) -> None:
    assert shortened(PRINTED, parts) == shown


@pytest.mark.parametrize("parts", ["Watch for", "From until Watch for", "Verdict; To"])
def test_a_part_that_is_not_printed_any_more_is_a_fault(parts: str) -> None:
    with pytest.raises(AssertionError, match=r"no line begins with '(Watch for|To)'"):
        shortened(PRINTED, parts)
