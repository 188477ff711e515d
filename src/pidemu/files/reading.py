"""Where every text file enters: its size, its encoding and its control characters are looked at, once."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NoReturn

from pidemu.errors import CardError, PidemuError, Problem
from pidemu.excerpt import visible
from pidemu.files.kinds import other_encoding, other_kind
from pidemu.part import part

_BOM: Final = "\ufeff"
_CONTROL: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")
"""What no text holds: control characters but tab and line feed, other ends of lines, a byte order mark, what is no character."""
_CONTROL_OR_BYTE: Final = re.compile(_CONTROL.pattern[:-1] + "\udc80-\udcff]")
"""The same, and bytes that are not UTF-8, as they are decoded."""
_NOT_UTF_8: Final = "not UTF-8 text (byte 0x{:02X}); save the file as UTF-8"
_NAMES: Final[Mapping[str, str]] = {
    "\x00": "NUL",
    "\x0b": "a vertical tab",
    "\x0c": "a form feed",
    "\x0d": "a carriage return within a line",
    "\x1a": "an end of file of DOS",
    "\x1b": "an escape",
    "\x85": "a next-line character",
    "\u2028": "a line separator",
    "\u2029": "a paragraph separator",
    _BOM: "a byte order mark that is not the first",
}


@part(frozen=True, slots=True)
class Kind:
    """What a file should be, for its messages.

    Attributes
    ----------
    name : str
        With its article: ``a record``.
    remedy : str
        What to do where it is something else: ``save it as CSV text in UTF-8``.
    limit : int
        Size beyond which it is not read [bytes].
    pipes : bool
        Whether it may be a pipe, such as ``/dev/stdin``.
    """

    name: str
    remedy: str
    limit: int = 2**28
    pipes: bool = True


def read_text(
    path: str | Path,
    error: type[PidemuError],
    kind: Kind,
    *,
    shown: str | None = None,
    controls: bool = True,
    by_line: bool = False,
) -> str:
    r"""Return the text of a file, whose lines end in ``\n`` alone.

    Parameters
    ----------
    path : str or Path
        The file.
    error : class
        What is raised; a `CardError` gets a located problem.
    kind : Kind
        What the file should be.
    shown : str, optional
        Its name in messages; by default `path`.
    controls : bool
        Whether control characters are refused here.
    by_line : bool
        Whether what is wrong costs a line only: neither control characters nor bytes that are not UTF-8 are refused here, and
        `control` finds them in their line.

    Raises
    ------
    PidemuError
        Of the class `error`, in one line: the file cannot be read, is too large, is no text, or not UTF-8, or holds a control
        character: with line and column.
    """
    name = visible(str(path) if shown is None else shown)
    data = read_bytes(path, error, kind, shown=name)
    other = other_kind(data)
    if other is not None:
        _refuse(error, name, f"{other}, not {kind.name}; {kind.remedy}")
    encoding = other_encoding(data)
    if encoding is not None:
        _refuse(error, name, f"text in {encoding}; save the file as UTF-8")
    try:
        text = data.decode("utf-8", "surrogateescape" if by_line else "strict").removeprefix(_BOM)
    except UnicodeDecodeError as fault:
        before = _normal(data[: fault.start].decode("utf-8"))
        byte = data[fault.start]
        _refuse(error, name, _NOT_UTF_8.format(byte), *_place(before, len(before)))
    text = _normal(text)
    found = _CONTROL.search(text) if controls and not by_line else None
    if found is not None:
        _refuse(error, name, _control_message(found[0]), *_place(text, found.start()))
    return text


def control(line: str) -> str | None:
    """Return where a control character, or a byte that is not UTF-8, stands in a line or cell, and which; ``None`` for none.

    Parameters
    ----------
    line : str
        The line, without its end, or a cell of it.
    """
    found = _CONTROL_OR_BYTE.search(line)
    if found is None:
        return None
    byte = ord(found[0]) - 0xDC00
    what = _NOT_UTF_8.format(byte) if 0x80 <= byte <= 0xFF else _control_message(found[0])
    return f"character {found.start() + 1}: {what}"


def is_file(path: str | Path) -> bool:
    """Return whether there is such a file; no name is an error, be it a loop of links, too long, or no name at all."""
    return os.path.isfile(path)  # unlike Path.is_file


def is_folder(path: str | Path) -> bool:
    """Return whether there is such a folder; no name is an error."""
    return os.path.isdir(path)  # unlike Path.is_dir


def reason(fault: OSError | ValueError) -> str:
    """Return why a file could not be opened, read or written, in words."""
    if isinstance(fault, OSError):
        return fault.strerror or str(fault)
    return "no file can have this name"  # NUL in it, or half a Unicode pair


def read_bytes(path: str | Path, error: type[PidemuError], kind: Kind, *, shown: str | None = None) -> bytes:
    """Return a file as it is; see `read_text` for the arguments.

    Raises
    ------
    PidemuError
        Of the class `error`: the file cannot be read, or is too large.
    """
    name = visible(str(path) if shown is None else shown)
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            _refuse(error, name, "cannot be read: it is a folder")
        if not (stat.S_ISREG(mode) or (kind.pipes and stat.S_ISFIFO(mode))):
            _refuse(error, name, "cannot be read: it is a device or a pipe, and not a file")
        with open(path, "rb", opener=_open) as file:
            data = file.read(kind.limit + 1)
    except (OSError, ValueError) as fault:
        _refuse(error, name, f"cannot be read: {reason(fault)}")
    if not data and stat.S_ISFIFO(mode):
        _refuse(error, name, "cannot be read: a pipe to which nothing is written; start what writes to it first, or give a file")
    if len(data) > kind.limit:
        _refuse(error, name, f"larger than {kind.limit / 2**20:g} MB, which is too much for {kind.name}; {kind.remedy}")
    return data


def _open(path: str, flags: int) -> int:
    """Open a file without waiting for somebody to write to it, should it be a pipe; what is read is waited for as ever."""
    if not hasattr(os, "O_NONBLOCK"):
        return os.open(path, flags)
    number = os.open(path, flags | os.O_NONBLOCK)
    os.set_blocking(number, True)
    return number


def _normal(text: str) -> str:
    r"""Return the text with ``\n`` at the end of each line; a carriage return alone ends one where there is no line feed."""
    if "\r" not in text:
        return text
    return re.sub("\r+\n", "\n", text) if "\n" in text else text.replace("\r", "\n")


def _place(text: str, at: int) -> tuple[int, int]:
    """Return line and column, counted from 1."""
    return text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)


def _control_message(character: str) -> str:
    name = _NAMES.get(character, "a control character")
    return f"U+{ord(character):04X}, {name}, stands in the text; remove it"


def _refuse(error: type[PidemuError], name: str, message: str, line: int | None = None, column: int | None = None) -> NoReturn:
    if issubclass(error, CardError):
        raise error([Problem(name, line or 1, column or 1, message)]) from None
    place = "" if line is None else f":{line}:{column}"
    raise error(f"{name}{place}: {message}") from None
