"""Ctrl-C and SIGTERM end every command with a word and a status of their own; half a file is no Ctrl-D."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

import pytest

from pidemu.cli import cards, interrupts
from tests.cli.helpers import said

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals are another matter there")


def raising(number: int, times: int = 1) -> Any:
    """A command that is sent a signal."""

    def command(*args: Any, **named: Any) -> None:
        for _ in range(times):
            signal.raise_signal(number)

    return command


@POSIX
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_command_with_a_word_and_its_status(number: int, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cards.command, "callback", raising(number))
    assert said("cards") == (status, "", "interrupted\n")
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert said("cards", "--nothing").status == 2


@POSIX
def test_a_second_sigterm_does_not_stop_what_is_being_written(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[bool] = []

    def command(*args: Any, **named: Any) -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            written.append(True)

    monkeypatch.setattr(cards.command, "callback", command)
    assert said("cards").status == 143
    assert written == [True]


@POSIX
def test_a_program_that_sees_to_sigterm_itself_goes_on_doing_so() -> None:
    seen: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        with interrupts.terminable():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    assert seen == [signal.SIGTERM]


def test_a_command_runs_in_a_thread_too() -> None:
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(said("cards").status))
    thread.start()
    thread.join(60)
    assert found == [0]


def test_a_file_that_ends_too_early_is_not_taken_for_the_end_of_the_input(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was: status 130, and not a word."""

    def command(*args: Any, **named: Any) -> None:
        raise EOFError("Ran out of input")

    monkeypatch.setattr(cards.command, "callback", command)
    with pytest.raises(RuntimeError, match="a file or stream ended too early"):
        said("cards")


@POSIX
def test_ctrl_c_while_the_command_is_loaded_ends_it_with_a_word() -> None:
    code = (
        "import signal, sys\n"
        "class Interrupts:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'click':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupts())\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from pidemu.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_the_start_script_is_the_one_that_sees_to_ctrl_c() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["scripts"] == {"pidemu": "pidemu.__main__:main"}
