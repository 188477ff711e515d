"""The folder for generated code: where it is, whom it trusts, what is done where it cannot be written, and what is in its files."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import platformdirs
import pytest

import pidemu
from pidemu.backends import native
from pidemu.files import cache


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
            "import pidemu.files.cache as c; p = c.keep('a', '.b', b'x'); assert p.exists(); print(p)",
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


def test_what_is_kept_is_loaded_and_no_reader_sees_half_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    data, seen = b"x = 1\n" * 200_000, set()
    writers = [threading.Thread(target=cache.keep, args=("scan_1", ".so", data)) for _ in range(8)]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        found = cache.load("scan_1", ".so")
        if found is not None:
            seen.add(found[1])
    assert seen <= {data}
    (path,) = cache.folder().iterdir()
    assert cache.load("scan_1", ".so") == (path, data)
    assert path.name == f"scan_1-{hashlib.sha256(data).hexdigest()}.so"
    assert (cache.load("scan_2", ".so"), cache.load("scan_1", ".dll")) == (None, None)
    assert (cache.is_kept("scan_1", ".so"), cache.is_kept("scan_*", ".so"), cache.is_kept("scan_2", ".so")) == (True, True, False)


@pytest.mark.parametrize("damage", ["emptied", "cut short", "one bit turned", "a folder", "unreadable"])
def test_a_file_that_is_damaged_is_not_loaded_and_goes(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    path = cache.keep("scan_1", ".so", b"machine code")
    if damage == "a folder":
        path.unlink()
        path.mkdir()
    elif damage == "unreadable":
        monkeypatch.setattr(Path, "read_bytes", lambda self: refused())
    else:
        path.write_bytes({"emptied": b"", "cut short": b"machine", "one bit turned": b"machine bode"}[damage])
    assert cache.load("scan_1", ".so") is None
    assert path.exists() == (damage == "a folder")
    monkeypatch.undo()
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    if damage != "a folder":
        assert cache.load("scan_1", ".so") is None
        assert cache.keep("scan_1", ".so", b"machine code") == path
        assert cache.load("scan_1", ".so") == (path, b"machine code")


def refused(*args: object, **named: object) -> bytes:
    raise PermissionError(13, "Permission denied")


def test_what_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    there = cache.folder()
    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(PermissionError):
        cache.keep("scan_1", ".so", b"machine code")
    assert list(there.iterdir()) == []


# --- whom it trusts ---------------------------------------------------------------------------------------------------------------

POSIX = pytest.mark.skipif(os.name != "posix", reason="who may write is said otherwise there")
ROOT = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only the superuser gives files away")


def not_used(named: Path, why: str, caplog: pytest.LogCaptureFixture) -> bool:
    """Tell whether another folder is used, and one line says why."""
    cache.warn.cache_clear()
    caplog.clear()
    used = cache.folder()
    assert used.name.startswith("pidemu-")
    assert used.stat().st_mode & 0o777 == 0o700
    message = f"note: {named}: not used for compiled code, as {why}; name a folder of your own in PIDEMU_CACHE"
    return caplog.messages == [message]


@POSIX
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o702])
@pytest.mark.parametrize("which", ["the folder", "the one named", "one above"])
def test_a_folder_that_others_can_write_to_is_not_used(
    which: str, mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    named = tmp_path / "above" / "code"
    inside = named / pidemu.__version__
    inside.mkdir(parents=True)
    place = {"the folder": inside, "the one named": named, "one above": named.parent}[which]
    place.chmod(mode)
    monkeypatch.setenv("PIDEMU_CACHE", str(named))
    if which == "one above" and mode == 0o1777:  # as /tmp: nobody moves there what belongs to another
        assert cache.folder() == inside
    else:
        assert not_used(named, f"others can write to {place}", caplog)
        assert list(inside.iterdir()) == []


@POSIX
def test_a_folder_that_a_group_of_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    named = tmp_path / "code"
    named.mkdir()
    named.chmod(0o770)
    monkeypatch.setenv("PIDEMU_CACHE", str(named))
    monkeypatch.setattr(cache, "_is_private", lambda gid: False)
    assert not_used(named, f"others can write to {named}", caplog)
    cache.folder.cache_clear()
    monkeypatch.setattr(cache, "_is_private", lambda gid: True)  # where every user has a group of his own
    assert cache.folder() == named / pidemu.__version__


@ROOT
@pytest.mark.parametrize("which", ["the folder", "the one named", "one above"])
def test_a_folder_of_another_user_is_not_used(
    which: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    named = tmp_path / "above" / "code"
    inside = named / pidemu.__version__
    inside.mkdir(parents=True)
    place = {"the folder": inside, "the one named": named, "one above": named.parent}[which]
    os.chown(place, 12345, 12345)
    monkeypatch.setenv("PIDEMU_CACHE", str(named))
    assert not_used(named, f"{place} belongs to another user", caplog)


@ROOT
def test_a_file_of_another_user_is_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    path = cache.keep("scan_1", ".so", b"machine code")
    os.chown(path, 12345, 12345)
    assert cache.load("scan_1", ".so") is None


@POSIX
def test_a_file_that_others_can_write_to_or_a_link_is_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path))
    path = cache.keep("scan_1", ".so", b"machine code")
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(0o602)
    assert cache.load("scan_1", ".so") is None
    other = tmp_path / "other"
    other.write_bytes(b"machine code")
    path.symlink_to(other)
    assert cache.load("scan_1", ".so") is None
    assert other.read_bytes() == b"machine code"  # the link has gone, not what it led to


@POSIX
def test_a_link_to_a_folder_is_that_folder_and_is_trusted_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    monkeypatch.setenv("PIDEMU_CACHE", str(link))
    assert cache.folder() == real / pidemu.__version__
    cache.folder.cache_clear()
    real.chmod(0o777)
    assert not_used(link, f"others can write to {real}", caplog)


@POSIX
def test_folders_that_are_made_are_for_this_user_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "deep" / "code"))
    before = os.umask(0)
    try:
        assert cache.folder() == tmp_path / "deep" / "code" / pidemu.__version__
    finally:
        os.umask(before)
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "deep").rglob("*")} == {0o700}


@POSIX
def test_a_shared_object_of_another_in_a_shared_folder_is_never_loaded(tmp_path: Path) -> None:
    """It would write a file when it is loaded."""
    bait, shared = tmp_path / "loaded", tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    folder = shared / pidemu.__version__
    folder.mkdir()
    source = tmp_path / "bait.c"
    source.write_text(
        f'#include <stdio.h>\n__attribute__((constructor)) void run(void) {{ fclose(fopen("{bait}", "w")); }}\n', encoding="utf-8"
    )
    if not native.available():
        pytest.skip("no C compiler on this machine")
    subprocess.run([*native.compiler(), "-shared", "-fPIC", "-o", str(folder / "bait.so"), str(source)], check=True)
    data = (folder / "bait.so").read_bytes()
    code = (
        "import hashlib, pathlib, pidemu\n"
        "from pidemu.backends import native\n"
        "real = native.load\n"
        f"data = pathlib.Path({str(folder / 'bait.so')!r}).read_bytes()\n"
        "def load(stem, suffix):\n"  # whoever puts the file there knows what it is to be called
        f"    pathlib.Path({str(folder)!r}, f'{{stem}}-{{hashlib.sha256(data).hexdigest()}}{{suffix}}').write_bytes(data)\n"
        "    return real(stem, suffix)\n"
        "native.load = load\n"
        "s = pidemu.load_card('generic/standard').settings(K=1, Ti=10, Td=0)\n"
        "print(pidemu.Controller(s, 1.0, engine='c').run(50.0, [49.0] * 3).size)\n"
    )
    environment = {**os.environ, "PIDEMU_CACHE": str(shared), "PYTHONPATH": str(Path(pidemu.__file__).parent.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout) == (0, "3\n")
    assert done.stderr == (
        f"note: {shared}: not used for compiled code, as others can write to {shared}; name a folder of your own in PIDEMU_CACHE\n"
    )
    assert not bait.exists()
    assert data.startswith(b"\x7fELF") or sys.platform != "linux"


def test_the_tests_keep_their_code_apart_from_the_users() -> None:
    assert not cache.folder().is_relative_to(platformdirs.user_cache_dir("pidemu", appauthor=False))


@POSIX
def test_nothing_is_made_in_a_folder_that_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    for named in (shared, shared / "code"):
        monkeypatch.setenv("PIDEMU_CACHE", str(named))
        cache.folder.cache_clear()
        assert cache.folder().name.startswith("pidemu-")
    assert list(shared.iterdir()) == []


@POSIX
def test_a_temporary_folder_is_trusted_no_more_than_the_one_that_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was compiled went there, and was loaded from it."""
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("PIDEMU_CACHE", str(shared))
    monkeypatch.setattr("tempfile.tempdir", str(shared))
    with pytest.raises(PermissionError, match=f"others can write to {shared}, where temporary files go"):
        cache.folder()
    assert cache.load("scan_1", ".so") is None
    assert list(shared.iterdir()) == []
    shared.chmod(0o1777)  # as /tmp
    assert cache.folder().parent == shared
