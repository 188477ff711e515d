"""What docs/fleet.md says of columns, engines, the example and a cluster; test_docs.py runs its commands and code."""

from __future__ import annotations

import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.backends.engine_names import ENGINES
from pidemu.fleet.result import HEADER
from tests.page_code import python_blocks, run
from tools.regenerate.pages import ROOT, prepare, printed_by, read

PAGE = ROOT / "docs" / "fleet.md"
TEXT = read(PAGE)
PYTHON = python_blocks(PAGE)
SHELL = re.findall(r"^```sh\n(.*?)\n```$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    prepare(PAGE, tmp_path)


def test_the_columns_and_engines_of_the_page_are_those_that_there_are() -> None:
    columns = TEXT[TEXT.index("Columns: `tag`") : TEXT.index("The status is")]
    assert set(re.findall(r"`(\w+)`", columns)) == set(HEADER)
    assert tuple(re.findall(r"^\| `(\w+)` \|", TEXT, re.MULTILINE)) == ENGINES


def test_the_example_of_a_plant_has_eight_controllers_of_seven_vendors_and_all_loops_settle() -> None:
    table = pidemu.read_loops(ROOT / "examples" / "fleet.csv")
    assert table.wrong == ()
    cards = {loop.settings.card.id for loop in table.loops}
    assert (len(cards), len({card.partition("/")[0] for card in cards})) == (8, 7)
    result = pidemu.Fleet(table.loops).simulate()
    assert result.counts == {"done": 8}
    assert (result.settled, result.stable) == ([True] * 8, [True] * 8)
    assert (np.abs(result.columns["error"]) < 0.1 * result.columns["peak"]).all()


@pytest.fixture
def scheduler() -> Iterator[str]:
    """Start the cluster of the page on this machine, on a port that is free, with one worker; return its address."""
    pytest.importorskip("distributed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    started = []
    for words, more in zip(SHELL[:2], (f"--host 127.0.0.1 --port {port} --no-dashboard", "--no-dashboard"), strict=True):
        assert words.startswith("dask ")
        here = words.replace("HOST:8786", f"127.0.0.1:{port}").replace("--nworkers 8", "--nworkers 1")
        command = [sys.executable, "-m", "dask", *shlex.split(here)[1:], *more.split()]
        started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
    yield f"127.0.0.1:{port}"
    for process in reversed(started):
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def test_a_cluster_that_is_started_as_the_page_says_gives_the_numbers_of_one_machine(scheduler: str) -> None:
    command = SHELL[2].removeprefix("pidemu ")
    assert printed_by(command.replace("HOST:8786", scheduler)) == printed_by(command.partition(" --scheduler")[0])
    names: dict[str, Any] = {}
    blocks = [block.replace("HOST:8786", scheduler) for block in (PYTHON[0], *(b for b in PYTHON if "HOST" in b))]
    assert [run(block, names) for block in blocks] == [5, 1]
