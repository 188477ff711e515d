"""The folder for generated code: where it is, what is done where it cannot be written, and files that appear at once."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import platformdirs
import pytest

import pidemu
from pidemu import cache


@pytest.fixture(autouse=True)
def asked_anew() -> Iterator[None]:
    cache.folder.cache_clear()
    yield
    cache.folder.cache_clear()


def test_the_environment_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "deep" / "code"))
    assert cache.folder() == tmp_path / "deep" / "code" / pidemu.__version__
    assert cache.folder().is_dir()
    assert list(cache.folder().iterdir()) == []


def test_a_relative_folder_stays_where_it_is_when_the_process_moves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PIDEMU_CACHE", "code")
    assert cache.folder() == tmp_path / "code" / pidemu.__version__


@pytest.mark.parametrize("named", [None, ""])
def test_without_one_it_is_the_users_cache_folder(named: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if named is None:
        monkeypatch.delenv("PIDEMU_CACHE", raising=False)
    else:
        monkeypatch.setenv("PIDEMU_CACHE", named)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert cache.folder() == Path(platformdirs.user_cache_dir("pidemu", appauthor=False)) / pidemu.__version__
    assert cache.folder().is_relative_to(tmp_path)


def in_another_process(**environment: str) -> Path:
    done = subprocess.run(
        [
            sys.executable,
            "-W",
            "error",
            "-c",
            "import pidemu.cache as c; p = c.written('a.py', 'x = 1'); assert p.exists(); print(p)",
        ],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(pidemu.__file__).parent.parent,
        env={**os.environ, **environment},
    )
    return Path(done.stdout.strip())


@pytest.mark.parametrize("what", ["below a file", "of no user"])
def test_where_it_cannot_be_made_a_temporary_folder_serves_and_goes(what: str, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    named = {"below a file": str(taken / "code"), "of no user": "~nobody-of-that-name/code"}[what]
    found = in_another_process(PIDEMU_CACHE=named, TMPDIR=str(tmp_path), TEMP=str(tmp_path))
    assert found.parent.parent == tmp_path
    assert found.parent.name.startswith("pidemu-")
    assert list(tmp_path.iterdir()) == [taken]


def test_a_folder_that_refuses_files_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: object, **named: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "code"))
    monkeypatch.setattr("tempfile.TemporaryFile", refused)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert cache.folder().parent == tmp_path
    assert cache.folder().name.startswith("pidemu-")


def test_a_text_is_written_once_and_no_reader_sees_half_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    text, seen = "x = 1\n" * 200_000, set()
    path = cache.folder() / "scan_1.py"
    writers = [threading.Thread(target=cache.written, args=("scan_1.py", text)) for _ in range(8)]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        if path.exists():
            seen.add(len(path.read_text(encoding="utf-8")))
    assert seen <= {len(text)}
    assert path.read_text(encoding="utf-8") == text
    assert [p.name for p in cache.folder().iterdir()] == ["scan_1.py"]
    before = path.stat().st_mtime_ns
    assert cache.written("scan_1.py", "something else") == path
    assert (path.stat().st_mtime_ns, path.read_text(encoding="utf-8")) == (before, text)


def test_the_tests_keep_their_code_apart_from_the_users() -> None:
    assert not cache.folder().is_relative_to(platformdirs.user_cache_dir("pidemu", appauthor=False))
