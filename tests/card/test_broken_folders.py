"""Folders of cards in which something is broken: the other cards go on, and what failed is named with its reason."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import pidemu
from pidemu.card.library import builtin_folder, card_files, unusable_files
from pidemu.errors import CardError, CardNotFoundError
from tests.checks.bench import VALID, written
from tests.cli.helpers import said

_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere not every name of bytes is that of a file")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of cards, the current one, with a good one and many that are none."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PIDEMU_VENDORS", raising=False)
    vendor = written(tmp_path, VALID).parent
    (vendor / "folder.yaml").mkdir()
    (vendor / "folder.yaml" / "inner.txt").write_text("", encoding="utf-8")
    os.mkfifo(vendor / "pipe.yaml")
    (vendor / "loop.yaml").symlink_to("loop.yaml")
    (vendor / "lost.yaml").symlink_to("nothing")
    (vendor / "zero.yaml").symlink_to("/dev/zero")
    (vendor / "words.yaml").write_text("just words", encoding="utf-8")
    (vendor / "secret.yaml").symlink_to(tmp_path / "shadow")
    (tmp_path / "shadow").write_text("root:$6$secret:19000::\nme: {key: hunter2, key: hunter3}\n", encoding="utf-8")
    (vendor / "huge.yaml").write_text(f"card: 1 # {'x' * 3_000_000}\n", encoding="utf-8")
    (vendor / "escape\x1b[2J.yaml").write_text(VALID, encoding="utf-8")
    Path(os.fsdecode(os.fsencode(vendor) + b"/latin\xe9.yaml")).write_text(VALID, encoding="utf-8")
    (tmp_path / "ring").symlink_to("ring")
    return tmp_path


_REASONS = {
    "nobody/escape\\x1b[2J.yaml": "the name of the file or folder has characters that cannot be seen; rename it",
    "nobody/folder.yaml": "a folder; a card is a file",
    "nobody/latin\\xe9.yaml": "the name of the file or folder has characters that cannot be seen; rename it",
    "nobody/loop.yaml": "cannot be read: Too many levels of symbolic links",
    "nobody/lost.yaml": "cannot be read: No such file or directory",
    "nobody/pipe.yaml": "a pipe or a device; a card is a plain file",
    "nobody/zero.yaml": "a pipe or a device; a card is a plain file",
}


@_LINUX
def test_what_cannot_be_a_card_is_named_with_its_reason(folder: Path) -> None:
    assert sorted(_REASONS.items()) == sorted((p.path, p.message) for p in unusable_files(["."]))
    assert [i for i in card_files(["."]) if i.startswith("nobody/")] == [
        f"nobody/{n}" for n in ("bench", "huge", "secret", "words")
    ]


@_LINUX
def test_cards_lists_the_others_and_names_each_that_failed(folder: Path) -> None:
    status, out, err = said("cards", "--vendors", ".")
    assert (status, len(out.splitlines())) == (1, 2 + len(pidemu.cards()))
    assert "nobody/bench" in out
    for path, reason in _REASONS.items():
        assert f"error: {path}:1:1: {reason}\n" in err
    assert len(err.splitlines()) == len(_REASONS) + 3
    assert "\x1b" not in err


@_LINUX
@pytest.mark.parametrize("words", [("check", "--vendors", "."), ("check", ".")], ids=" ".join)
def test_check_goes_on_and_names_each_that_failed(folder: Path, words: tuple[str, ...]) -> None:
    status, out, err = said(*words)
    built_in = len(pidemu.cards()) if len(words) == 3 else 0
    assert (status, out.splitlines()[-1].split(",")[0]) == (1, f"{built_in + 4 + len(_REASONS)} cards")
    for path, reason in _REASONS.items():
        if "name of the file" not in reason or len(words) == 3:
            assert f"{path}:1:1: {reason}\n" in err
    assert "bench.yaml" not in err
    assert max(map(len, err.splitlines())) < 300


@_LINUX
def test_an_error_shows_nothing_of_a_file_that_is_no_card(folder: Path) -> None:
    for words in (("check", "nobody/secret.yaml"), ("show", "nobody/secret", "--vendors", "."), ("cards", "--vendors", ".")):
        status, out, err = said(*words)
        assert status == 1
        assert "nobody/secret" in err
        assert [w for w in ("root", "$6$", "hunter2", "hunter3", "key:") if w in out + err] == []


@_LINUX
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("nobody/pipe", "nobody/pipe.yaml:1:1: a pipe or a device; a card is a plain file"),
        ("nobody/zero.yaml", "nobody/zero.yaml:1:1: a pipe or a device; a card is a plain file"),
        ("nobody/folder", "nobody/folder.yaml:1:1: a folder; a card is a file"),
        ("nobody/loop.yaml", "nobody/loop.yaml:1:1: cannot be read: Too many levels of symbolic links"),
    ],
)
def test_loading_one_that_failed_says_why(folder: Path, name: str, reason: str) -> None:
    with pytest.raises(CardError) as caught:
        pidemu.load_card(name, ["."])
    assert reason == str(caught.value)


@_LINUX
def test_a_card_beside_broken_ones_is_loaded(folder: Path) -> None:
    assert pidemu.load_card("nobody/bench", ["."]).id == "nobody/bench"


@_LINUX
@pytest.mark.parametrize("name", ["ring", "nobody/bench.yaml", "/nowhere"])
def test_a_folder_of_cards_that_is_none_is_refused(folder: Path, name: str) -> None:
    with pytest.raises(CardNotFoundError, match="no folder"):
        pidemu.cards([name])


@pytest.mark.parametrize("name", ["a\0b/c", "a/" + "b" * 5000, "a/b\0.yaml", "\ud800/x", "c" * 5000 + ".yaml"])
def test_a_name_that_no_file_can_have_is_refused(name: str) -> None:
    with pytest.raises(CardNotFoundError) as caught:
        pidemu.load_card(name)
    assert str(caught.value).startswith("no ")
    assert len(str(caught.value)) < 300
    str(caught.value).encode()


@_LINUX
@pytest.mark.skipif(sys.platform != "win32" and os.geteuid() == 0, reason="root may read everything")
def test_a_folder_that_may_not_be_read_is_named(folder: Path) -> None:
    (folder / "closed").mkdir(mode=0)
    assert "closed:1:1: cannot be read: Permission denied" in said("cards", "--vendors", ".").err


@_LINUX
def test_no_command_waits_for_a_pipe(folder: Path) -> None:
    pipe, here = str(folder / "nobody" / "pipe.yaml"), builtin_folder().parent
    for word in ("show", "check", "code"):
        command = [sys.executable, "-m", "pidemu", word, pipe]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, cwd=here)
        assert (done.returncode, "a pipe or a device" in done.stderr) == (1, True)


def test_the_built_in_folder_holds_nothing_else() -> None:
    assert unusable_files() == []
    assert builtin_folder().is_dir()
