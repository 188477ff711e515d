"""What a file is that is not the text it should be, judged by its first bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_MAGIC: Final[Mapping[bytes, str]] = {
    b"PK\x03\x04": "an Excel workbook (.xlsx) or another zip archive",
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": "an old Excel workbook (.xls) or another Office file",
    b"%PDF-": "a PDF file",
    b"\x1f\x8b": "a gzip archive",
    b"\x89PNG": "a picture (PNG)",
    b"\xff\xd8\xff": "a picture (JPEG)",
    b"PAR1": "a Parquet file",
    b"\x93NUMPY": "a NumPy file",
    b"SQLite format 3\x00": "an SQLite database",
    b"\x7fELF": "a program",
    b"MZ\x90": "a program",
    b"{\\rtf": "a document (RTF)",
}
_SAMPLE: Final = 4096
"""First bytes that are looked at."""
_BOMS: Final[Mapping[bytes, str]] = {  # that of UTF-32 begins like that of UTF-16
    b"\xff\xfe\x00\x00": "UTF-32, little-endian",
    b"\x00\x00\xfe\xff": "UTF-32, big-endian",
    b"\xff\xfe": "UTF-16, little-endian",
    b"\xfe\xff": "UTF-16, big-endian",
}


def other_kind(data: bytes) -> str | None:
    """Return what a file is that is no plain text, such as ``a PDF file``; ``None`` for what may be.

    Parameters
    ----------
    data : bytes
        The file, or its beginning.
    """
    for magic, name in _MAGIC.items():
        if data.startswith(magic):
            return name
    head = data[:_SAMPLE].removeprefix(b"\xef\xbb\xbf").lstrip()
    if not head.startswith(b"<"):
        return None
    lower = head.lower()
    if b"<rslogix5000content" in lower:
        return "an L5X file (XML that Logix Designer exports)"
    if lower.startswith((b"<!doctype html", b"<html")):
        return "a web page (HTML)"
    return "an XML file" if lower.startswith(b"<?xml") else None


def other_encoding(data: bytes) -> str | None:
    """Return the encoding of text with two or four bytes per character; ``None`` where a character has not that many.

    Parameters
    ----------
    data : bytes
        The file, or its beginning.
    """
    for mark, name in _BOMS.items():
        if data.startswith(mark):
            return name
    head = data[: min(len(data), _SAMPLE) // 4 * 4]
    zeros = [head[i::4].count(0) / max(1, len(head) // 4) > 0.7 for i in range(4)]  # most characters are of one byte
    patterns = {
        (False, True, True, True): "UTF-32, little-endian",
        (True, True, True, False): "UTF-32, big-endian",
        (False, True, False, True): "UTF-16, little-endian",
        (True, False, True, False): "UTF-16, big-endian",
    }
    return patterns.get((zeros[0], zeros[1], zeros[2], zeros[3]))
