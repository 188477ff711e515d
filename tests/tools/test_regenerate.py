"""``python -m tools.regenerate``: writes what is generated, names what is stale, and leaves alone what is not generated."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.checks.bench import VALID, written
from tools.regenerate import RENEW, files
from tools.regenerate.cli import command
from tools.regenerate.files import first_difference, generated
from tools.regenerate.pages import ROOT

QUICK = ("specs", "docs/emulation.md")
"""Generated files that take no conversions."""


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder that stands for the repository, with copies of the quick files."""
    (tmp_path / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "emulation.md", tmp_path / "docs")
    shutil.copytree(ROOT / "specs", tmp_path / "specs")
    monkeypatch.setattr(files, "ROOT", tmp_path)
    return tmp_path


def regenerate(*words: str) -> Result:
    return CliRunner().invoke(command, [*words, *QUICK])


def edit(file: Path, old: str, new: str) -> str:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8", newline="\n")
    return text


@pytest.mark.usefixtures("repository")
def test_what_is_current_is_not_written_again() -> None:
    found = regenerate()
    assert (found.exit_code, found.output) == (0, "12 generated files, 0 written\n")


def test_a_check_names_each_stale_file_with_its_first_difference_and_writes_nothing(repository: Path) -> None:
    edit(repository / "specs" / "card.schema.json", '"title": "CardFile"', '"title": "Card"')
    edit(repository / "docs" / "emulation.md", "# How the emulations were verified", "# Emulations")
    before = {file: file.read_bytes() for file in repository.rglob("*.*") if file.is_file()}
    found = regenerate("--check")
    assert found.exit_code == 1
    assert found.output.splitlines() == [
        "specs/card.schema.json: line 3",
        '  there:   "title": "Card",',
        '  today:   "title": "CardFile",',
        "docs/emulation.md: line 1",
        "  there: # Emulations",
        "  today: # How the emulations were verified",
        "12 generated files, 2 stale",
    ]
    assert before == {file: file.read_bytes() for file in repository.rglob("*.*") if file.is_file()}


def test_a_stale_file_is_written_and_what_is_not_generated_in_it_stays(repository: Path) -> None:
    language = repository / "specs" / "card-language.md"
    current = edit(language, "### Windup Clamp", "### Clamp")
    edit(language, "# The card language, version 1", "# In my own words")
    assert regenerate().output.splitlines()[-1] == "12 generated files, 1 written"
    assert language.read_text(encoding="utf-8") == current.replace("# The card language, version 1", "# In my own words")


def test_a_file_that_is_missing_is_written(repository: Path) -> None:
    (repository / "docs" / "emulation.md").unlink()
    assert regenerate().exit_code == 0
    assert (repository / "docs" / "emulation.md").read_bytes() == (ROOT / "docs" / "emulation.md").read_bytes()


def test_a_name_that_is_not_generated_is_refused_with_those_that_are() -> None:
    found = CliRunner().invoke(command, ["docs/matrix.html"])
    assert found.exit_code == 2
    assert "'docs/matrix.html' is not generated; generated are specs/card.schema.json, " in found.output


@pytest.mark.usefixtures("repository")
def test_cards_of_the_user_s_own_do_not_enter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_VENDORS", str(written(tmp_path / "own", VALID).parents[1]))
    assert regenerate("--check").output == "12 generated files, 0 stale\n"


def test_every_page_and_every_file_that_says_it_is_generated_is_in_the_list() -> None:
    names = [file.name for file in generated()]
    assert len(names) == len(set(names))
    assert {"README.md", "docs/matrix.csv", "docs/matrix.md", *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md"))} <= set(
        names
    )
    for folder in ("docs", "specs"):
        for file in (ROOT / folder).glob("*.md"):
            if re.search(r"^Generated |<!-- generated", file.read_text(encoding="utf-8"), re.MULTILINE):
                assert f"{folder}/{file.name}" in names


@pytest.mark.parametrize(
    ("there", "today", "difference"),
    [
        ("a\nb\n", "a\nb\n", ""),
        ("a\nb\n", "a\nc\n", "line 2\n  there: b\n  today: c"),
        ("a\n", "a\nb\n", "line 2\n  there: (no such line)\n  today: b"),
        ("", "a\n", "line 1\n  there: (no such line)\n  today: a"),
        ("a", "a\n", "the end of the last line"),
        ("x" * 200, "y", f"line 1\n  there: {'x' * 160} ...\n  today: y"),
    ],
)
def test_the_first_difference_is_the_line_with_both_versions(there: str, today: str, difference: str) -> None:
    assert first_difference(there, today) == difference


def test_what_tests_say_of_a_stale_file_is_a_command_that_contributing_names() -> None:
    (named,) = re.findall(r"python -m [\w.]+", RENEW)
    assert f"`{named}`" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
