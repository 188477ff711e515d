"""pytest runs a stranger's project: the plugin finds the planted mistakes, and what is wrong with a marker is told."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.testing.installed import LOADED

HERE = Path(__file__).parent
PROJECT = """\
import pytest
from mine import Mine, StartsFromZero, WindsUp, WrongSignOfD

pytestmark = pytest.mark.pidemu("generic/standard", K=2, Ti=10, Td=1, scan=1.0)

@pytest.mark.parametrize("mine", [Mine, WrongSignOfD, WindsUp, StartsFromZero])
def test_mine(pidemu_equals, mine):
    pidemu_equals(mine)

def test_settings(pidemu_settings, pidemu_controller):
    assert pidemu_settings["K"].value == 2
    assert pidemu_controller.scan(50.0, 50.0) == 0.0
"""
WRONG = """\
import pytest

def test_no_marker(pidemu_equals):
    pass

@pytest.mark.pidemu("generic/standard")
def test_no_settings(pidemu_settings):
    pass

@pytest.mark.pidemu("generic/standart", K=1)
def test_no_card(pidemu_settings):
    pass
"""
pytestmark = pytest.mark.skipif(not LOADED, reason="pidemu is not installed with its entry points")


def run(folder: Path, text: str, *words: str) -> tuple[int, str]:
    (folder / "mine.py").write_text((HERE / "mine.py").read_text("utf-8"), "utf-8")
    (folder / "test_mine.py").write_text(text, "utf-8")
    (folder / "pytest.ini").write_text("[pytest]\naddopts = --strict-markers\nfilterwarnings = error\n", "utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False)
    return done.returncode, done.stdout + done.stderr


def test_three_mistakes_in_a_stranger_s_project_are_found_and_shrunk(tmp_path: Path) -> None:
    status, text = run(tmp_path, PROJECT, "--pidemu-examples", "150")
    assert status == 1
    assert "3 failed, 2 passed" in text
    for name in ("WrongSignOfD", "WindsUp", "StartsFromZero"):
        assert f"{name} differs from pidemu by" in text
    scans = [max(map(int, re.findall(r"\d+", row))) for row in re.findall(r"^E +scan( .*\d)$", text, re.MULTILINE)]
    assert len(scans) == 3
    assert max(scans) < 10


def test_a_marker_that_says_too_little_is_told(tmp_path: Path) -> None:
    status, text = run(tmp_path, WRONG)
    assert status != 0
    assert 'test_no_marker: name the card, such as @pytest.mark.pidemu("emerson/deltav", GAIN=2, scan=0.5)' in text
    assert 'the marker gives no settings; write @pytest.mark.pidemu("generic/standard", NAME=VALUE)' in text
    assert "did you mean 'generic/standard'" in text


def test_a_number_of_examples_below_one_is_refused(tmp_path: Path) -> None:
    status, text = run(tmp_path, PROJECT, "--pidemu-examples", "0")
    assert status == 4
    assert "--pidemu-examples 0: give a number of records from 1 on" in text
