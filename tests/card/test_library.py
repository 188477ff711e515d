"""Which cards there are: built-in ones, folders of the user's own, and single files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import pidemu
from pidemu.card.library import ENVIRONMENT, builtin_folder, card_files, cards, folders, load_card
from pidemu.errors import CardError, CardNotFoundError
from tests.checks.bench import VALID, edited, written


@pytest.fixture(autouse=True)
def _no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(ENVIRONMENT, raising=False)


def card_of(folder: Path, algorithm: str) -> Path:
    """Write nobody/bench with another algorithm name below a folder, and return the folder."""
    written(folder, edited(VALID, ("algorithm: PID", f"algorithm: {algorithm}")))
    return folder


def test_the_built_in_cards_are_sorted_by_id() -> None:
    ids = pidemu.cards()
    assert sorted(ids) == ids
    assert {"fisher/provox", "emerson/deltav", "generic/standard"} <= set(ids)


def test_every_id_is_the_path_of_its_file() -> None:
    assert list(card_files()) == [f"{file.parent.name}/{file.stem}" for file in card_files().values()]
    assert {builtin_folder()} == {file.parent.parent for file in card_files().values()}


def test_a_folder_of_the_user_adds_cards(tmp_path: Path) -> None:
    card_of(tmp_path, "mine")
    assert set(cards([tmp_path])) - set(cards()) == {"nobody/bench"}


def test_a_folder_of_the_user_comes_before_the_built_in_cards(tmp_path: Path) -> None:
    file = tmp_path / "fisher" / "provox.yaml"
    file.parent.mkdir()
    file.write_text(edited(VALID, ("vendor: Nobody", "vendor: Fisher")), encoding="utf-8")
    assert load_card("fisher/provox", [tmp_path]).data.product == "test bench"
    assert file == card_files([tmp_path])["fisher/provox"]
    assert load_card("fisher/provox").data.product == "PROVOX"


def test_the_environment_names_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = card_of(tmp_path / "a", "first"), card_of(tmp_path / "b", "second")
    monkeypatch.setenv(ENVIRONMENT, os.pathsep.join(["", str(first), str(second)]))
    assert [first, second, builtin_folder()] == folders()
    assert load_card("nobody/bench").data.algorithm == "first"


def test_folders_given_come_before_those_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, str(card_of(tmp_path / "a", "environment")))
    given = [card_of(tmp_path / "b", "given"), card_of(tmp_path / "c", "given later")]
    assert load_card("nobody/bench", given).data.algorithm == "given"
    assert load_card("nobody/bench").data.algorithm == "environment"


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardNotFoundError) as caught:
        cards([tmp_path / "none"])
    assert f"no folder '{tmp_path / 'none'}'; a folder of cards holds <vendor>/<block>.yaml" == str(caught.value)


def test_a_missing_folder_in_the_environment_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENVIRONMENT, "no-such-folder")
    with pytest.raises(CardNotFoundError, match="no folder 'no-such-folder'"):
        load_card("fisher/provox")


def test_a_card_is_loaded_by_its_file(tmp_path: Path) -> None:
    file = written(tmp_path, VALID)
    card = load_card(str(file))
    assert ("nobody/bench", str(file)) == (card.id, card.document.path)


def test_a_card_by_file_needs_no_vendor_folder_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, VALID)
    monkeypatch.chdir(tmp_path / "nobody")
    assert load_card("bench.yaml").id == "nobody/bench"


def test_a_missing_file_is_refused() -> None:
    with pytest.raises(CardNotFoundError) as caught:
        load_card("nowhere/block.yaml")
    assert str(caught.value) == "no file 'nowhere/block.yaml'"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("fisher/provx", " (did you mean 'fisher/provox'?)"),
        ("Fisher/PROVOX", " (did you mean 'fisher/provox'?)"),
        ("provox", " (did you mean 'fisher/provox'?)"),
        ("PROVOX", " (did you mean 'fisher/provox'?)"),
        ("emerson/provox", " (did you mean 'fisher/provox'?)"),
        ("emerson", " (did you mean 'emerson/deltav'?)"),
        ("siemens/s7", ""),
        ("", ""),
        ("a/b/c", ""),
    ],
)
def test_an_unknown_card_is_refused_with_the_nearest_id(name: str, hint: str) -> None:
    with pytest.raises(CardNotFoundError) as caught:
        load_card(name)
    assert f"no card '{name}'{hint}; 'pidemu cards' lists them" == str(caught.value)


@pytest.mark.parametrize(
    "name", ["../nobody/bench", "nobody/..", "../bench", "./bench", "nobody/../nobody/bench", "..\\nobody/bench"]
)
def test_an_id_that_leaves_the_folder_is_refused(name: str, tmp_path: Path) -> None:
    card_of(tmp_path, "PID")
    (tmp_path / "deeper" / "inner").mkdir(parents=True)
    (tmp_path / "bench.yaml").write_text(VALID, encoding="utf-8")
    for folder in (tmp_path, tmp_path / "deeper"):
        with pytest.raises(CardNotFoundError, match="no card"):
            load_card(name, [folder])


def test_an_absolute_path_is_no_id(tmp_path: Path) -> None:
    file = written(tmp_path, VALID)
    with pytest.raises(CardNotFoundError, match="no card"):
        load_card(str(file.with_suffix("")))


def test_a_card_is_read_once(tmp_path: Path) -> None:
    card_of(tmp_path, "PID")
    assert load_card("nobody/bench", [tmp_path]) is load_card("nobody/bench", [tmp_path])


def test_a_card_is_read_again_when_its_file_changes(tmp_path: Path) -> None:
    old = load_card("nobody/bench", [card_of(tmp_path, "old")])
    file = written(tmp_path, edited(VALID, ("algorithm: PID", "algorithm: new")))
    os.utime(file, ns=(1, 1))
    assert (old.data.algorithm, load_card("nobody/bench", [tmp_path]).data.algorithm) == ("old", "new")


def test_a_wrong_card_is_an_error_with_its_place(tmp_path: Path) -> None:
    written(tmp_path, edited(VALID, ("form: standard", "form: serial")))
    with pytest.raises(CardError) as caught:
        load_card("nobody/bench", [tmp_path])
    assert not isinstance(caught.value, CardNotFoundError)
    assert [(p.line, p.column) for p in caught.value.problems] == [(7, 7)]


def test_files_that_are_no_cards_are_not_listed(tmp_path: Path) -> None:
    card_of(tmp_path, "PID")
    (tmp_path / "README.yaml").write_text("card: 1", encoding="utf-8")
    (tmp_path / "nobody" / "notes.txt").write_text("no card", encoding="utf-8")
    (tmp_path / "nobody" / "old").mkdir()
    (tmp_path / "nobody" / "old" / "bench.yaml").write_text(VALID, encoding="utf-8")
    assert [i for i in cards([tmp_path]) if i not in cards()] == ["nobody/bench"]


@pytest.mark.parametrize("name", ["C:/x", "x/C:", "../x", "x/..", "./x", "a\\b/x", "//x"])
def test_an_id_leads_to_no_other_drive_or_folder(name: str) -> None:
    with pytest.raises(CardNotFoundError, match="no card"):
        load_card(name)
