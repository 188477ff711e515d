"""What docs/certificate.md shows is run; ``python -m tests.test_docs_certificate`` writes the output."""

from __future__ import annotations

import contextlib
import re
import shlex
import tempfile
from pathlib import Path
from typing import Any

import pytest

import pidemu
from pidemu.cli.convert import command as convert_command
from tests.cli.helpers import said, with_another_filter
from tests.readme import ROOT
from tests.test_docs_fleet import CONSOLE, printed_by, run

PAGE = ROOT / "docs" / "certificate.md"
TEXT = PAGE.read_text(encoding="utf-8")
PYTHON = re.findall(r"^```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
COMMAND = re.findall(r"^    pidemu (.*)$", TEXT, re.MULTILINE)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    prepare(tmp_path)


def prepare(folder: Path) -> None:
    """Put the signed certificate and the corrected card of the page into a folder."""
    signed = said("convert", *shlex.split(COMMAND[0])[1:-2], "--date", "2026-07-01", "--json").out
    (folder / "TIC-101.json").write_text(signed, encoding="utf-8")
    (folder / "cards" / "fisher").mkdir(parents=True)
    card = Path(pidemu.load_card("fisher/provox").document.path).read_text(encoding="utf-8")
    (folder / "cards" / "fisher" / "provox.yaml").write_text(with_another_filter(card), encoding="utf-8")


@pytest.mark.parametrize(("command", "printed"), CONSOLE.findall(TEXT))
def test_a_command_prints_what_the_page_shows(command: str, printed: str) -> None:
    assert printed_by(command) == printed


def test_the_command_writes_a_page() -> None:
    (command,) = COMMAND
    assert said(*shlex.split(command)).status == 0
    assert Path("TIC-101.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_the_code_of_the_page_gives_what_its_comments_say(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    assert [run(block, names) for block in PYTHON] == [4, 2, 1]
    assert capsys.readouterr().out == "dial RATE: 6 s on the certificate, 5.25 s now\n"


def test_the_options_of_the_page_are_those_of_the_command() -> None:
    known = {name for option in convert_command.params for name in option.opts}
    assert set(re.findall(r"`?(--[a-z-]+)", TEXT)) <= known


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#]+)\)", TEXT))
def test_every_link_of_the_page_leads_somewhere(target: str) -> None:
    assert (PAGE.parent / target).exists()


def main() -> None:
    """Write what the commands print today into the page."""

    def renewed(match: re.Match[str]) -> str:
        return f"```console\n$ pidemu {match[1]}\n{printed_by(match[1])}```"

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        prepare(Path(folder))
        PAGE.write_text(CONSOLE.sub(renewed, TEXT), encoding="utf-8")


if __name__ == "__main__":
    main()
