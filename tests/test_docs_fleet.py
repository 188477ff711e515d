"""What docs/fleet.md shows is run: its commands, its code, and a cluster; ``python -m tests.test_docs_fleet`` writes the output."""

from __future__ import annotations

import ast
import contextlib
import re
import shlex
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import pidemu
from pidemu.cli import cli
from pidemu.engines import ENGINES
from pidemu.fleet.result import HEADER
from tests.readme import ROOT
from tests.test_docs_conversion import statements

PAGE = ROOT / "docs" / "fleet.md"
TEXT = PAGE.read_text(encoding="utf-8")
CONSOLE = re.compile(r"^```console\n\$ pidemu (.*?)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PYTHON = re.findall(r"^```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
SHELL = re.findall(r"^```sh\n(.*?)\n```$", TEXT, re.DOTALL | re.MULTILINE)
LOOPS = re.findall(r"^```csv\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    prepare(tmp_path)


def prepare(folder: Path) -> None:
    """Put the file that the page shows into a folder."""
    (loops,) = LOOPS
    (folder / "loops.csv").write_text(loops, encoding="utf-8")


def printed_by(command: str) -> str:
    """Return what a command prints on screen."""
    return CliRunner().invoke(cli, shlex.split(command), prog_name="pidemu").output


def run(block: str, names: dict[str, Any]) -> int:
    """Run a block of code and hold what its comments say against it; return how many there are."""
    checked = 0
    for code, expected, is_expression in statements(block):
        if not expected:
            exec(code, names)
            continue
        assert is_expression, code
        assert eval(code.partition("  # ")[0], names) == ast.literal_eval(expected), code
        checked += 1
    return checked


@pytest.mark.parametrize(("command", "printed"), CONSOLE.findall(TEXT))
def test_a_command_prints_what_the_page_shows(command: str, printed: str) -> None:
    assert printed_by(command) == printed


def test_the_code_of_the_page_gives_what_its_comments_say() -> None:
    pytest.importorskip("pyarrow")
    names: dict[str, Any] = {}
    assert sum(run(block, names) for block in PYTHON if "HOST" not in block) > 8


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


@pytest.mark.parametrize("target", re.findall(r"\]\(([^)#]+)\)", TEXT))
def test_every_link_of_the_page_leads_somewhere(target: str) -> None:
    assert (PAGE.parent / target).exists()


def main() -> None:
    """Write what the commands print today into the page."""

    def renewed(match: re.Match[str]) -> str:
        return f"```console\n$ pidemu {match[1]}\n{printed_by(match[1])}```"

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        prepare(Path(folder))
        PAGE.write_text(CONSOLE.sub(renewed, TEXT), encoding="utf-8")


if __name__ == "__main__":
    main()
