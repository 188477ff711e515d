"""Text files: what they may be, and what is said of the others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pidemu.errors import CardError, RecordError
from pidemu.files.reading import Kind, control, is_file, is_folder, read_text

KIND = Kind("a record", "save it as CSV text")


def read(folder: Path, data: bytes) -> str:
    (folder / "x.csv").write_bytes(data)
    return read_text(folder / "x.csv", RecordError, KIND)


def message(folder: Path, data: bytes) -> str:
    with pytest.raises(RecordError) as caught:
        read(folder, data)
    return str(caught.value).removeprefix(str(folder / "x.csv"))


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", ""),
        (b"sp,pv\n1,2\n", "sp,pv\n1,2\n"),
        (b"\xef\xbb\xbfsp,pv", "sp,pv"),
        (b"sp,pv\r\n1,2\r\r\n", "sp,pv\n1,2\n"),
        (b"sp,pv\r1,2\r", "sp,pv\n1,2\n"),
        ("Kühler\t℃ עברית 😀".encode(), "Kühler\t℃ עברית 😀"),
    ],
)
def test_utf_8_is_read_with_or_without_mark_whatever_ends_its_lines(tmp_path: Path, data: bytes, text: str) -> None:
    assert read(tmp_path, data) == text


@pytest.mark.parametrize("name", ["utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_text_of_two_or_four_bytes_a_character_is_known_with_or_without_mark(tmp_path: Path, name: str, mark: str) -> None:
    width, end = name.split("-")[1:]
    expected = f": text in UTF-{width}, {'little' if end == 'le' else 'big'}-endian; save the file as UTF-8"
    assert message(tmp_path, f"{mark}sp,pv\n50,49.5\n".encode(name)) == expected


def test_what_is_not_utf_8_is_said_with_its_place(tmp_path: Path) -> None:
    assert message(tmp_path, "sp,pv\r\n1,Störung".encode("latin-1")) == (":2:5: not UTF-8 text (byte 0xF6); save the file as UTF-8")


@pytest.mark.parametrize(
    ("data", "place"),
    [
        (b"\xef\xbb\xbf\xef\xbb\xbfsp,pv", "1:1: U+FEFF, a byte order mark that is not the first"),
        (b"sp,pv\n1,\x002", "2:3: U+0000, NUL"),
        (b"sp,pv\n1,2\x0b3,4", "2:4: U+000B, a vertical tab"),
        (b"sp,pv\n1\x0c", "2:2: U+000C, a form feed"),
        (b"sp,pv\n1,2\r3,4\n", "2:4: U+000D, a carriage return within a line"),
        ("sp,pv\n1,2\x853".encode(), "2:4: U+0085, a next-line character"),
        ("sp,pv\n1,2\u20283".encode(), "2:4: U+2028, a line separator"),
        ("sp,pv\n1,2\u20293".encode(), "2:4: U+2029, a paragraph separator"),
        (b"sp,pv\n\x1b[2J", "2:1: U+001B, an escape"),
        (b"sp,pv\n1,2\n\x1a", "3:1: U+001A, an end of file of DOS"),
        (b"sp,pv\n1,2\x7f", "2:4: U+007F, a control character"),
    ],
)
def test_control_characters_are_refused_with_their_place(tmp_path: Path, data: bytes, place: str) -> None:
    assert message(tmp_path, data) == f":{place}, stands in the text; remove it"


def test_control_characters_of_a_line_are_found_by_itself(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(b"a\nb\x00\n")
    text = read_text(tmp_path / "x.csv", RecordError, KIND, controls=False)
    assert [control(line) for line in text.split("\n")] == [
        None,
        "character 2: U+0000, NUL, stands in the text; remove it",
        None,
    ]


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (b"PK\x03\x04\x14\x00", "an Excel workbook (.xlsx) or another zip archive"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (.xls) or another Office file"),
        (b"%PDF-1.7\n%\xe2\xe3", "a PDF file"),
        (b"\x1f\x8b\x08", "a gzip archive"),
        (b"\n<!DOCTYPE html><html>", "a web page (HTML)"),
        (b"<?xml version='1.0'?>\n<RSLogix5000Content>", "an L5X file (XML that Logix Designer exports)"),
        (b"\xef\xbb\xbf<?xml version='1.0'?>", "an XML file"),
        (b"PAR1\x15\x04", "a Parquet file"),
    ],
)
def test_files_that_are_no_text_are_called_by_their_name(tmp_path: Path, data: bytes, name: str) -> None:
    assert message(tmp_path, data) == f": {name}, not a record; save it as CSV text"


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(b"x" * (2**20 + 1))
    with pytest.raises(RecordError, match=r"larger than 1 MB, which is too much for a record; save it as CSV text$"):
        read_text(tmp_path / "x.csv", RecordError, Kind("a record", "save it as CSV text", limit=2**20))


def test_what_is_no_file_is_said_in_one_line(tmp_path: Path) -> None:
    paths: dict[Path | str, str] = {
        tmp_path: "it is a folder",
        tmp_path / "none": "No such file or directory",
        "a\0b": "no file can have this name",
        "a\ud800": "no file can have this name",
        "x" * 5000: "File name too long",
    }
    if os.name == "posix":
        (tmp_path / "loop").symlink_to(tmp_path / "loop")
        paths |= {tmp_path / "loop": "Too many levels of symbolic links", "/dev/zero": "it is a device or a pipe, and not a file"}
    for path, why in paths.items():
        with pytest.raises(RecordError, match=f": cannot be read: {why}$"):
            read_text(path, RecordError, KIND)
        assert not is_file(path)
        assert is_folder(path) == (path == tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="pipes with names")
def test_a_pipe_is_no_card_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.yaml")
    with pytest.raises(CardError) as caught:
        read_text(tmp_path / "x.yaml", CardError, Kind("a card", "", pipes=False), shown="x.yaml")
    assert str(caught.value) == "x.yaml:1:1: cannot be read: it is a device or a pipe, and not a file"


def test_a_card_error_has_a_problem_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_bytes(b"card: 1\n\x00")
    with pytest.raises(CardError) as caught:
        read_text(tmp_path / "x.yaml", CardError, KIND, shown="x.yaml")
    (problem,) = caught.value.problems
    assert (problem.path, problem.line, problem.column, problem.source) == ("x.yaml", 2, 1, ())


NOBODY = "cannot be read: a pipe to which nothing is written; start what writes to it first, or give a file"


@pytest.mark.skipif(os.name != "posix", reason="pipes with names")
@pytest.mark.parametrize(
    "words",
    [
        ("convert", "--loop", "pipe"),
        ("run", "fisher/provox", "GAIN=2", "RESET=4", "--record", "pipe"),
        ("fleet", "pipe"),
        ("verify", "pipe"),
    ],
)
def test_a_pipe_without_a_writer_is_not_waited_for(words: tuple[str, ...], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    run = subprocess.run(
        [sys.executable, "-m", "pidemu", *words], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert (run.stdout, run.returncode) == ("", 1 if "--loop" in words else 2)
    assert run.stderr.endswith(f"{NOBODY}\n")


@pytest.mark.skipif(os.name != "posix", reason="pipes with names")
def test_a_pipe_with_a_slow_writer_is_read_to_its_end(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    writer = subprocess.Popen(["sh", "-c", "exec > pipe; sleep 0.3; echo sp,pv; sleep 0.3; echo 1,2"], cwd=tmp_path)
    while True:  # as long as the shell has not opened it
        try:
            text = read_text(tmp_path / "pipe", RecordError, KIND)
        except RecordError:
            continue
        break
    assert (text, writer.wait(10)) == ("sp,pv\n1,2\n", 0)


@pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="/dev/stdin")
def test_the_standard_input_is_waited_for() -> None:
    program = (
        "from pidemu.errors import RecordError; from pidemu.files.reading import Kind, read_text\n"
        "print(read_text('/dev/stdin', RecordError, Kind('a record', '')))"
    )
    line = f"(sleep 0.3; echo sp,pv; sleep 0.3; echo 1,2) | '{sys.executable}' -c \"{program}\""
    assert subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=True, timeout=60).stdout == "sp,pv\n1,2\n\n"
