"""Compiled cards: the same objects as those read from YAML, by text and language, and never from a file that is wrong."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import pidemu
from pidemu import checks
from pidemu.card import library, store
from pidemu.card.document import CARD, card_id_of, digest_of
from pidemu.card.library import builtin_folder, card_entry, card_files, load_card
from pidemu.card.load import Card, card_from, compiled, load_file, status_counts, variants
from pidemu.card.plain_data import decoded, encoded
from pidemu.card.reading import parse_file
from pidemu.card.wheel import compile_builtin_cards
from pidemu.cli import cli
from pidemu.errors import CardError
from pidemu.files.reading import read_text
from tests.helpers import copied

on_every_card = pytest.mark.parametrize("name", pidemu.cards())
GOOD = builtin_folder() / "generic" / "standard.yaml"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder that is empty, and a process that has loaded no card yet."""
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(library, "_loaded", {})
    return tmp_path / "cache" / "cards" / pidemu.__version__


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A card of the user's own."""
    file = tmp_path / "mine" / "generic" / "own.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(copied(GOOD), encoding="utf-8")
    return file


def fresh(file: Path) -> Card:
    return card_from(parse_file(file), card_id_of(file))


def stored(card: Card) -> Card:
    """The card, compiled, written, and read again."""
    contents, short = compiled(card)
    assert store.find(card.digest) is None
    store.keep(card.digest, contents, short)
    return load_file(Path(card.document.path))


def kept(cache: Path, kind: str = "card") -> list[Path]:
    return sorted(cache.glob(f"{kind}-*"))


def output(*words: str) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        cli.main(list(words), standalone_mode=False)
    return said.getvalue()


# --- the same objects -------------------------------------------------------------------------------------------------


@on_every_card
def test_a_compiled_card_is_the_card(name: str, cache: Path) -> None:
    card = fresh(card_files()[name])
    again = stored(card)
    assert (card.compiled, again.compiled is None) == (None, False)
    assert again == card
    assert repr(again.data) == repr(card.data)
    assert (again.digest, again.title, again.options) == (card.digest, card.title, card.options)
    assert (again.document.value, again.document.path) == (card.document.value, card.document.path)
    assert repr(again.all_settings()) == repr(card.all_settings())
    for old, new in zip(variants(card), variants(again), strict=True):
        assert (new.chosen, new.equation, new.raw) == (old.chosen, old.equation, old.raw)
        assert repr(new.equation) == repr(old.equation)
        assert list(map(repr, new.statements)) == list(map(repr, old.statements))
        assert list(map(str, new.assumptions())) == list(map(str, old.assumptions()))


@on_every_card
def test_the_list_of_cards_and_the_data_sheet_are_the_same(name: str, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = card_files()[name]
    first, sheet, plain = card_entry(file, name), output("show", name), output("show", name, "--json")
    monkeypatch.setattr(library, "_loaded", {})
    assert load_card(name).compiled is not None
    assert (card_entry(file, name), output("show", name), output("show", name, "--json")) == (first, sheet, plain)
    assert first.status == status_counts(fresh(file))


def test_a_problem_of_a_compiled_card_has_its_place(cache: Path) -> None:
    card = fresh(GOOD)
    again = stored(card)
    for path in (("settings", "K", "unit"), ("sources",), ("options", "nobody"), ()):
        for at_key in (False, True):
            old, new = (c.document.problem(path, "wrong", at_key=at_key) for c in (card, again))
            assert (new, new.source, new.width, new.render()) == (old, old.source, old.width, old.render())


def test_a_problem_of_a_file_that_has_changed_since_has_no_place(cache: Path, own: Path) -> None:
    stored(fresh(own))
    again = load_file(own)
    own.write_text("card: 1\nvendor: other\n", encoding="utf-8")
    problem = again.document.problem(("vendor",), "wrong")
    assert (problem.line, problem.column, problem.source) == (1, 1, ())


def test_a_compiled_card_can_be_copied_and_sent_to_another_process(cache: Path) -> None:
    card = stored(fresh(GOOD))
    for other in (pickle.loads(pickle.dumps(card)), copy.deepcopy(card)):
        assert other == card
        assert [v.equation for v in variants(other)] == [v.equation for v in variants(card)]


@on_every_card
def test_plain_data_are_json_and_come_back_as_they_were(name: str) -> None:
    data = fresh(card_files()[name]).data
    assert decoded(json.loads(json.dumps(encoded(data)))) == data


def test_what_no_card_holds_is_not_encoded() -> None:
    @dataclass
    class Other:
        x: int

    with pytest.raises(TypeError, match="a card holds no Other"):
        encoded({"x": [Other(1)]})


@pytest.mark.parametrize("data", [["os", {"x": 1}], ["Setting", {}, 1], ["CardFile"], ["Rule", "sideways"], ["Part", {}], []])
def test_nothing_but_parts_of_the_language_is_made(data: list[object]) -> None:
    with pytest.raises((KeyError, ValueError)):
        decoded(data)


# --- by text and language -----------------------------------------------------------------------------------------------


def test_a_built_in_card_is_compiled_when_it_is_first_loaded_and_then_read(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert load_card("generic/series").compiled is None
    (file,) = kept(cache)
    assert file.stat().st_mode & 0o777 == 0o600 or os.name == "nt"
    monkeypatch.setattr(library, "_loaded", {})
    assert load_card("generic/series").compiled is not None


def test_a_card_of_the_users_own_is_compiled_after_its_check(cache: Path, own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_file(own)
    assert kept(cache) == []  # read, and not checked
    load_card(own)
    assert (len(kept(cache)), len(kept(cache, "checked"))) == (1, 1)
    monkeypatch.setattr(library, "_loaded", {})
    monkeypatch.setattr(checks, "check", lambda card: pytest.fail(f"{card.id} is checked again"))
    assert load_card(own).compiled is not None


def test_a_wrong_card_is_never_compiled_and_always_says_where(cache: Path, own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own.write_text(own.read_text(encoding="utf-8").replace("tracking-time: Ti", "tracking-time: nobody"), encoding="utf-8")
    said = []
    for _ in range(2):
        monkeypatch.setattr(library, "_loaded", {})
        with pytest.raises(CardError) as error:
            load_card(own)
        said.append(str(error.value))
        assert [p.render() for p in checks.check_file(own)] == [p.render() for p in error.value.problems]
    assert (said[0], kept(cache), kept(cache, "checked")) == (said[1], [], [])
    assert "no setting 'nobody'" in said[0]


def test_a_card_that_is_changed_is_read_and_checked_anew(cache: Path, own: Path) -> None:
    assert checks.check_file(own) == []
    own.write_text(own.read_text(encoding="utf-8").replace("form: standard", "form: serial"), encoding="utf-8")
    (problem,) = checks.check_file(own)
    assert problem.message.startswith("'serial' is not one of")


def test_another_language_has_no_compiled_cards(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    card = fresh(GOOD)
    stored(card)
    assert store.find(card.digest) is not None
    monkeypatch.setattr(store, "language", lambda: "another")
    assert store.find(card.digest) is None
    assert store.summary(card.digest) is None


def test_a_check_by_other_code_does_not_count(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert checks.check_file(GOOD) == []
    assert library.is_known_good(GOOD)
    monkeypatch.setattr(store, "_code", lambda: "another")
    assert not library.is_known_good(GOOD)


def test_a_check_counts_for_the_id_that_was_checked(cache: Path) -> None:
    assert checks.check_file(GOOD) == []
    assert not library.is_known_good(GOOD, "other/standard")


# --- damaged, foreign, nowhere ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damage", ["empty", "cut", "a letter", "a folder"])
def test_a_damaged_file_counts_as_none_and_is_made_anew(damage: str, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_card("generic/series")
    (file,) = kept(cache)
    data = file.read_bytes()
    wrong = {"empty": b"", "cut": data[:-9], "a letter": data.replace(b"Tracks", b"Tricks").replace(b"kp", b"kq")}.get(damage)
    file.unlink()
    if wrong is None:
        file.mkdir()
    else:
        file.write_bytes(wrong)
        file.chmod(0o600)
    monkeypatch.setattr(library, "_loaded", {})
    card = load_card("generic/series")
    assert (card.compiled, card) == (None, fresh(card_files()["generic/series"]))
    if wrong is not None:
        assert file.read_bytes() == data


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="others cannot write there on Windows")
def test_what_others_can_write_is_not_looked_into(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_card("generic/series")
    (file,) = kept(cache)
    for place, mode in ((file, 0o666), (cache, 0o777)):
        old = place.stat().st_mode
        place.chmod(mode)
        assert store.find(fresh(card_files()["generic/series"]).digest) is None
        place.chmod(old)
    assert store.find(fresh(card_files()["generic/series"]).digest) is not None


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have owners on POSIX only")
def test_a_file_of_another_user_is_not_looked_into(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_card("generic/series")
    digest = fresh(card_files()["generic/series"]).digest
    assert store.find(digest) is not None
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert store.find(digest) is None


def test_without_a_cache_folder_all_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    known = {k: v for k, v in os.environ.items() if k != "PIDEMU_VENDORS"} | {"PIDEMU_CACHE": str(tmp_path / "file" / "below")}
    words = [sys.executable, "-m", "pidemu", "show", "generic/series"]
    done = subprocess.run(words, env=known, capture_output=True, text=True, encoding="utf-8", check=False)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", output("show", "generic/series"))


def test_the_oldest_files_go(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "_MOST", 3)
    for n, name in enumerate(("parallel", "series", "standard", "dahlin")):
        load_card(f"generic/{name}")
        for file in kept(cache):
            os.utime(file, (n, n)) if file.stat().st_mtime > 1000 else None
    assert len(kept(cache)) == 3
    assert store.find(load_card("generic/parallel").digest) is None


# --- the wheel ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: Path) -> Iterator[Path]:
    """The folder that the wheel has, and no cache folder."""
    folder = tmp_path / "compiled"
    folder.mkdir()
    compile_builtin_cards(folder)
    monkeypatch.setattr(store, "BUILT_IN", folder)
    yield folder
    assert not cache.exists()


def test_the_wheel_has_all_built_in_cards_and_nothing_is_kept_besides(built: Path) -> None:
    assert len(list(built.iterdir())) == len(card_files())
    for name, file in card_files().items():
        assert load_card(name).compiled is not None
        assert card_entry(file, name).title == load_card(name).title


def test_two_builds_are_the_same(built: Path, tmp_path: Path) -> None:
    (tmp_path / "again").mkdir()
    compile_builtin_cards(tmp_path / "again")
    assert {f.name: f.read_bytes() for f in (tmp_path / "again").iterdir()} == {f.name: f.read_bytes() for f in built.iterdir()}


def test_a_built_in_card_that_was_edited_is_read_from_its_file(built: Path, own: Path) -> None:
    text = GOOD.read_text(encoding="utf-8")
    assert store.find(digest_of(text)) is not None
    own.write_text(f"{text}\n# a remark\n", encoding="utf-8")
    assert store.find(digest_of(read_text(own, CardError, CARD))) is None
    assert load_file(own).compiled is None
