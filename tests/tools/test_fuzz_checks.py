"""What the fuzzer takes for a fault, and what not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.fuzz.case import Case, Said
from tools.fuzz.checks import files_are_whole, prints_no_control_characters
from tools.fuzz.failures import Breach

TURNED = "sp,pv\n1,\u202e2\n"


def compare(*words: str, terminal: bool = False) -> Case:
    return Case(("compare", "a/b", "c/d", *words), {"record.csv": b"sp,pv\n"}, terminal=terminal)


def written(folder: Path, case: Case, status: int = 0) -> None:
    (folder / "record.csv").write_bytes(b"something else")
    files_are_whole(case, Said(status, "", ""), folder)


def test_a_file_that_a_command_was_told_to_write_may_be_replaced(tmp_path: Path) -> None:
    written(tmp_path, compare("-o", "record.csv"))


@pytest.mark.parametrize("words", [("--record", "record.csv"), ("--record", "record.csv", "-o", "record.csv"), ()])
def test_a_file_that_is_read_or_not_named_may_not(words: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(Breach, match="bytes instead of"):
        written(tmp_path, compare(*words))


def test_nor_one_where_the_command_was_refused(tmp_path: Path) -> None:
    with pytest.raises(Breach, match="bytes instead of"):
        written(tmp_path, compare("-o", "record.csv"), status=2)


def test_letters_of_a_record_that_turn_the_order_are_data_in_a_pipe() -> None:
    prints_no_control_characters(compare(), Said(0, TURNED, ""))


@pytest.mark.parametrize("said", [Said(0, "", TURNED), Said(0, "sp\x1b[2J", "")])
def test_what_a_terminal_obeys_is_a_fault_everywhere(said: Said) -> None:
    with pytest.raises(Breach, match=r"U\+"):
        prints_no_control_characters(compare(), said)


def test_on_a_terminal_they_are_a_fault() -> None:
    with pytest.raises(Breach, match=r"U\+"):
        prints_no_control_characters(compare(terminal=True), Said(0, TURNED, ""))
