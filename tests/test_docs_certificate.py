"""What docs/certificate.md says of the page and of a certificate that was edited; test_docs.py runs its commands and code."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from tests.cli.helpers import said
from tests.page_code import python_blocks, run
from tools.regenerate.pages import ROOT, prepare, read

PAGE = ROOT / "docs" / "certificate.md"
TEXT = read(PAGE)
COMMAND = re.findall(r"^    pidemu (.*)$", TEXT, re.MULTILINE)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    prepare(PAGE, tmp_path)


def test_the_command_writes_a_page() -> None:
    (command,) = COMMAND
    assert said(*shlex.split(command)).status == 0
    assert Path("TIC-101.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_the_code_prints_the_dial_that_was_edited(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    assert [run(block, names) for block in python_blocks(PAGE)] == [4, 2, 1]
    assert capsys.readouterr().out == "dial RATE: 6 s on the certificate, 5.25 s now\n"
