"""A new behaviour is two files of one name: a made-up windup scheme and a made-up transfer start, each in a copy of the package."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.checks.bench import ALPHA, VALID, WINDUP, edited
from tests.program.made_up import copy_of_the_package, with_transfer, with_windup

RUN = """
import json, sys
import pidemu
controller = pidemu.Controller(pidemu.load_card(sys.argv[1]).settings(GAIN=1, RESET=2), initial_output=80)
by_hand = controller.run(50.0, [50.0, 50.0], auto=False, manual=80.0)
automatic = controller.run([50.0, 60.0, 60.0, 60.0, 60.0, 60.0], [50.0] * 6)
print(json.dumps([pidemu.__file__, by_hand.tolist(), automatic.tolist()]))
"""


def card(folder: Path, name: str, *edits: tuple[str, str]) -> str:
    """Write a card into a copy, and return its id."""
    path = folder / "vendors" / "nobody" / f"{name}.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(edited(VALID, *edits), encoding="utf-8")
    return f"nobody/{name}"


def ran(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a copy."""
    known = {k: v for k, v in os.environ.items() if k != "PIDEMU_VENDORS"}
    known |= {"PYTHONPATH": str(folder / "src"), "PIDEMU_CACHE": str(folder / "code"), "PYTHONUTF8": "1"}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=known, capture_output=True, text=True, encoding="utf-8", check=False
    )


def said(folder: Path, *words: str) -> str:
    """Return what Python prints in a copy, where nothing is wrong."""
    result = ran(folder, *words)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


def run(folder: Path, card_id: str) -> tuple[list[float], list[float]]:
    """Return the outputs in manual and in automatic after it, which are of that copy."""
    where, by_hand, automatic = json.loads(said(folder, "-c", RUN, card_id))
    assert Path(where).is_relative_to(folder)
    return by_hand, automatic


@pytest.fixture(scope="module")
def with_scheme(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_windup(copy_of_the_package(tmp_path_factory.mktemp("scheme")))


@pytest.fixture(scope="module")
def with_start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_transfer(copy_of_the_package(tmp_path_factory.mktemp("start")))


SHARE = (ALPHA, ALPHA + '  SHARE: {sets: gap-gain, unit: "1", range: [0, 1]}\n')
GIVEN = ("{GAIN: 2, RESET: 60, RATE: 16}", "{GAIN: 2, RESET: 60, RATE: 16, SHARE: 0.5}")


def test_a_card_with_the_new_scheme_is_checked_and_shown(with_scheme: Path) -> None:
    name = card(with_scheme, "by-name", (WINDUP, "{scheme: made-up, share: SHARE}"), SHARE, GIVEN)
    assert said(with_scheme, "-m", "pidemu", "check", "vendors/nobody/by-name.yaml") == "1 card, 0 problems\n"
    shown = said(with_scheme, "-m", "pidemu", "show", name)
    assert "the integral keeps SHARE [1] of itself" in " ".join(shown.split())


def test_the_new_scheme_has_rules_of_its_own_for_cards(with_scheme: Path) -> None:
    card(with_scheme, "idle", (WINDUP, "{scheme: made-up, share: 1}"))
    result = ran(with_scheme, "-m", "pidemu", "check", "vendors/nobody/idle.yaml")
    assert (result.returncode, result.stdout) == (1, "1 card, 1 problem\n")
    assert result.stderr.splitlines()[0].endswith("idle.yaml:10:39: a share of 1 keeps everything: write 'scheme: none'")


def test_a_program_does_at_a_limit_what_the_new_scheme_says(with_scheme: Path) -> None:
    """I is 80 at the transfer and grows by 5 in a scan; P is 10: the sum is 95, 100, 105, which leaves 47.5 of 95, 62.5, 67.5."""
    by_hand, automatic = run(with_scheme, card(with_scheme, "halving", (WINDUP, "{scheme: made-up, share: 0.5}")))
    assert by_hand == [80, 80]
    assert automatic == [80, 95, 100, 100, 62.5, 67.5]
    assert run(with_scheme, card(with_scheme, "always", (WINDUP, "{scheme: none}")))[1] == [80, 95, 100, 100, 100, 100]


def test_a_conversion_states_what_the_new_scheme_changes_at_a_limit(with_scheme: Path) -> None:
    source = card(with_scheme, "from", (WINDUP, "{scheme: none}"))
    target = card(with_scheme, "to", (WINDUP, "{scheme: made-up, share: 0.5}"))
    words = ("-m", "pidemu", "convert", source, "GAIN=2", "RESET=60", "RATE=16", "--to", target, "--json")
    plain: Any = json.loads(said(with_scheme, *words))
    assert plain["verdict"] == "exact"
    assert [difference["aspect"] for difference in plain["certificate"]["nonlinear"]] == ["windup"]


def test_a_card_with_the_new_start_is_checked_shown_and_does_what_it_says(with_start: Path) -> None:
    """I is half of 80 at the transfer, and grows by 5 in a scan; P is 10."""
    name = card(with_start, "half", ("{start: bumpless}", "{start: made-up}"))
    assert said(with_start, "-m", "pidemu", "check", "vendors/nobody/half.yaml") == "1 card, 0 problems\n"
    shown = said(with_start, "-m", "pidemu", "show", name)
    assert "the integral starts with half of what the last output leaves for it" in " ".join(shown.split())
    by_hand, automatic = run(with_start, name)
    assert by_hand == [80, 80]
    assert automatic == [40, 55, 60, 65, 70, 75]
    assert run(with_start, card(with_start, "bumpless"))[1][0] == 80
