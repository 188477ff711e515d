"""The cache folder: what was compiled once, code or a card, is there the next time, and nothing else is ever loaded from it.

Compiled code runs when it is loaded. So the folder is one that nobody else can write to, its files are this user's own, and the
name of each holds the SHA-256 of what is in it: one that is damaged, cut short or put there by another is not loaded but made anew.
Compiled cards are data and lie in a folder of their own within it (`pidemu.card.store`).
"""

from __future__ import annotations

import errno
import functools
import hashlib
import os
import stat
from pathlib import Path

from pidemu import __version__


@functools.cache
def folder() -> Path:
    """Return the folder for generated code of this version of pidemu; it exists, can be written, and only by this user.

    It is that of the environment variable ``PIDEMU_CACHE``, or the user's cache folder where the system has one; where that cannot
    be written, or others can write to it, a folder among the temporary files, for this process alone and removed at its end.

    Raises
    ------
    OSError
        There is no room for a temporary folder either, or others could exchange it.
    """
    import atexit
    import shutil
    import tempfile

    try:
        chosen, place = _chosen()
        path = place / __version__
        fault = _fault(path) or _fault(_made(path))  # nothing is made where others could exchange it
        if fault:
            warn(f"{chosen}: not used for compiled code, as {fault}; name a folder of your own in PIDEMU_CACHE")
        else:
            with tempfile.TemporaryFile(dir=path):
                return path
    except (OSError, RuntimeError, ValueError):  # without a home it is a RuntimeError, with a NUL in the name a ValueError
        pass
    temporary = Path(os.path.realpath(tempfile.gettempdir()))
    fault = _fault(temporary / "pidemu-", own=1)
    if fault:
        raise PermissionError(errno.EACCES, f"{fault}, where temporary files go (TMPDIR)")
    path = Path(tempfile.mkdtemp(prefix="pidemu-", dir=temporary))
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def private(name: str, *, make: bool = False) -> Path | None:
    """Return a folder of this name for data, within the cache folder; ``None`` where there is none, or others can write to it.

    Unlike `folder` it says nothing and has no substitute: what would be kept there is computed again.

    Parameters
    ----------
    name : str
        Its name.
    make : bool
        Whether it is made where it is not there.
    """
    try:
        path = _chosen()[1] / name / __version__
        if _fault(path, own=3) or (make and _fault(_made(path), own=3)):
            return None
    except (OSError, RuntimeError, ValueError):  # see `folder`
        return None
    return path


def _chosen() -> tuple[str, Path]:
    """Return the cache folder as the user or the system names it, and where it is."""
    chosen = os.environ.get("PIDEMU_CACHE")
    if not chosen:
        import platformdirs

        chosen = platformdirs.user_cache_dir("pidemu", appauthor=False)
    return chosen, Path(os.path.realpath(Path(chosen).expanduser()))


def load(stem: str, suffix: str) -> tuple[Path, bytes] | None:
    """Return a file of the folder and what it holds, or ``None``; one that does not hold what its name says is removed.

    Parameters
    ----------
    stem, suffix : str
        What it was kept under.
    """
    for path in _candidates(stem, suffix):
        data = own(path)
        if data is not None and path.name == _name(stem, suffix, data):
            return path, data
        _remove(path)
    return None


def is_kept(stem: str, suffix: str) -> bool:
    """Tell whether there is a file of this name; what it holds is looked at when it is loaded.

    Parameters
    ----------
    stem, suffix : str
        What it was kept under; the stem may end in ``*``.
    """
    return bool(_candidates(stem, suffix))


def keep(stem: str, suffix: str, data: bytes) -> Path:
    """Keep something in the folder, and return its file, which appears at once: no process ever sees half of it.

    Parameters
    ----------
    stem, suffix : str
        How its name begins and ends; what stands between is made of what it holds.
    data : bytes
        What it holds.

    Raises
    ------
    OSError
        It cannot be written.
    """
    return put(folder() / _name(stem, suffix, data), data)


def put(path: Path, data: bytes) -> Path:
    """Write a file of a private folder beside its place and put it there at once.

    Raises
    ------
    OSError
        It cannot be written.
    """
    import tempfile  # which most commands, that only read, do without

    handle, unfinished = tempfile.mkstemp(dir=path.parent, suffix=".unfinished")  # nobody else may read or write it
    try:
        with open(handle, "wb") as file:
            file.write(data)
        os.replace(unfinished, path)
    except BaseException:
        _remove(Path(unfinished))
        raise
    return path


@functools.cache
def warn(message: str) -> None:
    """Say something on standard error that stops nothing, once; a program with a log of its own finds it there."""
    import logging

    logging.getLogger("pidemu").warning("note: %s", message)


def _name(stem: str, suffix: str, data: bytes) -> str:
    return f"{stem}-{hashlib.sha256(data).hexdigest()}{suffix}"


def _candidates(stem: str, suffix: str) -> list[Path]:
    try:
        return sorted(folder().glob(f"{stem}-*{suffix}"))
    except OSError:
        return []


def own(path: Path) -> bytes | None:
    """Return what a file holds; ``None`` where it cannot be read, or is not a file of this user's that only he can write."""
    try:
        found = path.lstat()
        return path.read_bytes() if stat.S_ISREG(found.st_mode) and _is_own(found) else None
    except OSError:
        return None


def _remove(path: Path) -> None:
    try:
        path.unlink()
    except OSError:
        return  # it stays, and is not loaded the next time either


def _made(path: Path) -> Path:
    """Make a folder, and those above it that are not there, for this user alone."""
    missing = [p for p in (path, *path.parents) if not p.exists()]
    for one in reversed(missing):
        one.mkdir(mode=0o700, exist_ok=True)
    return path


def _fault(path: Path, own: int = 2) -> str:
    """Return why others could put something into a folder, also by putting another one in its place; empty where they cannot.

    It need not be there yet. It and those above it, so many as `own` says, must be this user's; further up, sticky ones that others
    write to, as /tmp, are no danger: nobody moves there what is another's.
    """
    if not hasattr(os, "geteuid"):  # Windows: what others may do with the user's folders is said by its lists, and is nothing
        return ""
    for above, place in enumerate((path, *path.parents)):
        try:
            found = place.stat()
        except FileNotFoundError:
            continue
        if found.st_uid != os.geteuid() and (above < own or found.st_uid != 0):
            return f"{place} belongs to another user"
        if _others_write(found) and (above < own or not found.st_mode & stat.S_ISVTX):
            return f"others can write to {place}"
    return ""


def _is_own(found: os.stat_result) -> bool:
    return not hasattr(os, "geteuid") or (found.st_uid == os.geteuid() and not _others_write(found))


def _others_write(found: os.stat_result) -> bool:
    """Tell whether others can write; a group that has this user alone, as many Linux systems make one for each, is none."""
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_private(found.st_gid)


@functools.cache
def _is_private(gid: int) -> bool:
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(os.geteuid()), grp.getgrgid(gid)
    except KeyError:
        return False
    return group.gr_name == user.pw_name and user.pw_gid == gid and set(group.gr_mem) <= {user.pw_name}
