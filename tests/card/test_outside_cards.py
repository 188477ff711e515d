"""A card from outside the library is checked when it is loaded, by whatever loads it."""

from __future__ import annotations

from pathlib import Path

import pytest

import pidemu
from pidemu import checks
from pidemu.card.library import ENVIRONMENT, builtin_folder
from pidemu.errors import CardError, Problem
from tests.checks.bench import VALID, added, edited, written
from tests.cli.helpers import said, told

WRONG = edited(VALID, *added("signals", "engineering"))
"""A gain in percent per percent, of a controller that computes in engineering units."""
SAID = "bench.yaml:15:28: with 'signals: engineering' the gain's unit is 'eu/eu', '%/eu', or for a proportional band 'eu'"


@pytest.fixture
def wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a card that reads well and breaks a rule, as the working directory."""
    written(tmp_path, WRONG)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_card_given_by_its_path_is_checked(wrong: Path) -> None:
    with pytest.raises(CardError) as caught:
        pidemu.load_card("nobody/bench.yaml")
    assert [p.headline() for p in caught.value.problems] == [f"nobody/{SAID}"]
    assert "\n  15 |   GAIN: {sets: gain, unit:" in str(caught.value)


def test_a_card_in_a_folder_of_one_s_own_is_checked(wrong: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CardError, match="with 'signals: engineering'"):
        pidemu.load_card("nobody/bench", [wrong])
    monkeypatch.setenv(ENVIRONMENT, str(wrong))
    with pytest.raises(CardError, match="with 'signals: engineering'"):
        pidemu.load_card("nobody/bench")


def test_a_wrong_target_refuses_the_conversion(wrong: Path) -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60)
    with pytest.raises(CardError, match="with 'signals: engineering'"):
        pidemu.convert(source, Path("nobody/bench.yaml"))


@pytest.mark.parametrize(
    "words",
    [
        ("simulate", "nobody/bench", "GAIN=2", "RESET=60", "--process", "gain=1,lag=9,delay=1", "--vendors", "."),
        ("convert", "nobody/bench", "GAIN=2", "RESET=60", "--to", "generic/standard", "--vendors", "."),
        ("convert", "generic/standard", "K=2", "Ti=60", "--to", "nobody/bench.yaml"),
        ("show", "nobody/bench.yaml"),
        ("code", "nobody/bench", "GAIN=2", "RESET=60", "--vendors", "."),
    ],
    ids=" ".join,
)
def test_every_command_that_uses_a_wrong_card_refuses_it_with_its_place(words: tuple[str, ...], wrong: Path) -> None:
    status, out, err = said(*words)
    assert (status, out) == (1, "")
    assert f"nobody/{SAID}" in err


def test_check_and_the_list_of_cards_go_on_with_a_wrong_card(wrong: Path) -> None:
    status, out, err = said("check", "nobody/bench.yaml")
    assert (status, out) == (1, "1 card, 1 problem\n")
    assert err.startswith(f"nobody/{SAID}\n")
    assert "nobody/bench" in told("cards", "bench", "--vendors", ".")


def test_a_card_is_checked_once_as_long_as_its_file_does_not_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "cache"))
    seen: list[str] = []
    check = checks.check

    def counted(card: pidemu.Card) -> list[Problem]:
        seen.append(card.id)
        return check(card)

    monkeypatch.setattr(checks, "check", counted)
    good, bad = written(tmp_path, VALID), written(tmp_path / "other", WRONG)
    for _ in range(3):
        pidemu.load_card(good)
        with pytest.raises(CardError):
            pidemu.load_card(bad)
    assert seen == ["nobody/bench"] * 2
    bad.write_text(VALID + "\n", encoding="utf-8")
    assert pidemu.load_card(bad).id == "nobody/bench"
    assert len(seen) == 3


@pytest.mark.parametrize("name", ["fisher/provox", str(builtin_folder() / "fisher" / "provox.yaml")])
def test_a_built_in_card_is_not_checked_again(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "check", lambda card: pytest.fail(f"{card.id} was checked"))
    monkeypatch.setattr("pidemu.card.library._loaded", {})
    assert pidemu.load_card(name).id == "fisher/provox"
