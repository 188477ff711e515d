"""Where every file leaves: written beside, then renamed, so that the old one is there until the new one is whole."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO, Any, BinaryIO, Final, Literal, NoReturn, TextIO, overload

from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.leftovers import UNFINISHED, is_own, remove_leftovers
from pidemu.files.reading import is_file, is_folder, reason

_FULL: Final = {getattr(errno, name, None) for name in ("ENOSPC", "EDQUOT", "EFBIG")} - {None}
_FLAGS: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
_NO_READER: Final = "nothing reads this pipe; start the reader first, such as 'cat {} > FILE &', or give a file"
_NO_ROOM: Final = (
    "no file can be made in its folder, and a new one is made there before it takes the place of the old one; "
    "give a file in another folder"
)
_PIPES: Final[dict[tuple[int, int], int]] = {}
"""Pipes that were looked at, open since then: to its reader, one that is closed again has ended."""


@overload
def beside(
    path: str | Path, error: type[PidemuError], inputs: Iterable[str | Path] = (), binary: Literal[False] = False
) -> AbstractContextManager[TextIO]: ...


@overload
def beside(
    path: str | Path, error: type[PidemuError], inputs: Iterable[str | Path] = (), *, binary: Literal[True]
) -> AbstractContextManager[BinaryIO]: ...


def beside(
    path: str | Path, error: type[PidemuError], inputs: Iterable[str | Path] = (), binary: bool = False
) -> AbstractContextManager[Any]:
    """Open a file to write; it takes the place of `path` when all is written, and else nothing has happened.

    The new file is written in the folder of the old one, flushed to the disk, gets the old one's mode, and is renamed. Of a link
    it is the target that is replaced. What is not a regular file, such as a pipe or ``/dev/stdout``, is written straight. What a
    killed process left beside is removed.

    Parameters
    ----------
    path : str or Path
        The file.
    error : class
        What is raised.
    inputs : iterable of path
        Files that are read, and must not be written.
    binary : bool
        Whether bytes are written; else text in UTF-8, with the ends of lines as they are given.

    Raises
    ------
    PidemuError
        Of the class `error`, in one line: the file cannot be written, or is one of the inputs.
    """
    return _beside(path, error, tuple(inputs), binary)


def check(path: str | Path, error: type[PidemuError], inputs: Iterable[str | Path] = ()) -> None:
    """Refuse a file that cannot be written, before the work whose result goes there; nothing of it is changed.

    Parameters
    ----------
    path, error, inputs
        As for `beside`.

    Raises
    ------
    PidemuError
        Of the class `error`.
    """
    name = visible(str(path))
    with _told(name, error):
        target = _target(path, name, error, tuple(inputs))
        if target is not None:
            number, unfinished = _unfinished(target, name, error)
            os.close(number)
            unfinished.unlink(missing_ok=True)
            return
        found = os.stat(path)
        if stat.S_ISFIFO(found.st_mode) and _standard(found) is None:
            number = _pipe(path)
            _close(found)
            _PIPES[found.st_dev, found.st_ino] = number


def is_replaced(path: str | Path) -> bool:
    """Tell whether a file stands there that a new one would replace."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return False
    return stat.S_ISREG(found.st_mode) and _standard(found) is None


@contextlib.contextmanager
def _beside(path: str | Path, error: type[PidemuError], inputs: tuple[str | Path, ...], binary: bool) -> Iterator[IO[Any]]:
    name = visible(str(path))
    with _told(name, error):
        target = _target(path, name, error, inputs)
        if target is None:
            with _stream(_straight(path), binary) as stream:
                yield stream
            return
        number, unfinished = _unfinished(target, name, error)
        held = os.dup(number) if os.name == "posix" else None  # its lock, until it has its name
        try:
            with _stream(number, binary) as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            _like(unfinished, target)
        except BaseException:
            with contextlib.suppress(OSError):
                unfinished.unlink()
            if held is not None:
                os.close(held)
            raise
    try:
        os.replace(unfinished, target)
    except OSError as fault:  # the work is not lost: it is there under the other name
        raise error(f"{name}: cannot be replaced: {reason(fault)}; the result is in {visible(str(unfinished))}") from None
    finally:
        if held is not None:
            os.close(held)
    _settle(target.parent)


@contextlib.contextmanager
def _told(name: str, error: type[PidemuError]) -> Iterator[None]:
    """Make an error in one line of what goes wrong with the file."""
    try:
        yield
    except BrokenPipeError:  # who reads has had enough, which is no fault
        raise
    except OSError as fault:
        if fault.errno == errno.ENXIO:
            raise error(f"{name}: cannot be written: {_NO_READER.format(name)}") from None
        _fail(name, error, fault)


def _fail(name: str, error: type[PidemuError], fault: OSError | ValueError) -> NoReturn:
    full = isinstance(fault, OSError) and fault.errno in _FULL
    raise error(f"{name}: cannot be written: {'the disk is full' if full else reason(fault)}") from None


def _target(path: str | Path, name: str, error: type[PidemuError], inputs: tuple[str | Path, ...]) -> Path | None:
    """Return the file that is to be replaced, the one at the end of all links; ``None`` for what is written straight."""
    if not name:
        raise error("no name of a file to write; give a file name")
    try:
        found = os.stat(path)
    except FileNotFoundError:
        target = Path(os.path.realpath(path))
        if is_folder(target):  # as none/.. is
            raise error(f"{name}: cannot be written: it is a folder") from None
        return target
    except ValueError as fault:
        _fail(name, error, fault)
    if stat.S_ISDIR(found.st_mode):
        raise error(f"{name}: cannot be written: it is a folder")
    if not stat.S_ISREG(found.st_mode):
        return None
    for one in inputs:
        with contextlib.suppress(OSError, ValueError):
            if os.path.samestat(found, os.stat(one)):
                raise error(f"{name}: is read, too, as {visible(str(one))}; give another file for the result")
    if _standard(found) is not None:
        return None
    with open(path, "r+b"):  # the file itself is protected, or another program keeps it
        pass
    return Path(os.path.realpath(path))


def _standard(found: os.stat_result) -> int | None:
    """Return the standard output or the standard error, where one of them is this file."""
    for number in (1, 2):
        with contextlib.suppress(OSError):
            if os.path.samestat(found, os.fstat(number)):
                return number
    return None


def _straight(path: str | Path) -> int:
    """Open what is not replaced; a standard stream goes on where it is."""
    found = os.stat(path)
    standard = _standard(found)
    if standard is None:
        if not stat.S_ISFIFO(found.st_mode):
            return os.open(path, os.O_WRONLY | getattr(os, "O_BINARY", 0))
        number = _PIPES.pop((found.st_dev, found.st_ino), None)
        return _pipe(path) if number is None else number
    stream = sys.stdout if standard == 1 else sys.stderr
    if stream is not None:
        stream.flush()
    return os.dup(standard)


def _pipe(path: str | Path) -> int:
    """Open a pipe that somebody reads; where nobody does, there is an `OSError` at once, and no waiting for one."""
    number = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    os.set_blocking(number, True)
    return number


def _close(found: os.stat_result) -> None:
    """Close a pipe that was looked at before."""
    number = _PIPES.pop((found.st_dev, found.st_ino), None)
    if number is not None:
        os.close(number)


def _unfinished(target: Path, name: str, error: type[PidemuError]) -> tuple[int, Path]:
    """Make a new file beside the target, and return its number and name."""
    short = target.name.encode(errors="surrogateescape")[:80].decode(errors="ignore")
    remove_leftovers(target.parent, short)
    while True:
        unfinished = target.with_name(f".{short}.{secrets.token_hex(4)}{UNFINISHED}")
        try:
            number = os.open(unfinished, _FLAGS, 0o666)
        except PermissionError:
            if is_file(target):  # which can be written itself
                raise error(f"{name}: cannot be written: {_NO_ROOM}") from None
            raise
        if is_own(number):
            return number, unfinished
        os.close(number)


@contextlib.contextmanager
def _stream(number: int, binary: bool) -> Iterator[IO[Any]]:
    """Open a file by its number; where something fails, what is not written yet is dropped."""
    if binary:
        stream: IO[Any] = os.fdopen(number, "wb")
    else:
        stream = os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace", newline="")
    try:
        yield stream
    except BaseException:
        with contextlib.suppress(OSError, ValueError):
            stream.close()
        raise
    stream.close()


def _like(unfinished: Path, target: Path) -> None:
    """Give the new file the owner and the mode of the old one, where there is one."""
    try:
        old = os.stat(target)
    except FileNotFoundError:
        return
    if hasattr(os, "chown"):
        with contextlib.suppress(OSError):  # only the owner may, and only root may for another
            os.chown(unfinished, old.st_uid, old.st_gid)
    with contextlib.suppress(OSError):
        os.chmod(unfinished, stat.S_IMODE(old.st_mode))


def _settle(folder: Path) -> None:
    """Write the renaming to the disk, where the system has folders to open."""
    if hasattr(os, "O_DIRECTORY"):
        with contextlib.suppress(OSError):
            number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(number)
            finally:
                os.close(number)
