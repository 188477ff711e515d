"""Starting pidemu: what is imported, and what is sent into a pipe."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.cli.helpers import strict_json

_HEAVY = {"matplotlib", "scipy", "numba", "rich"}
_LIST = "import sys, json; print(json.dumps(sorted({m.split('.')[0] for m in sys.modules})), file=sys.stderr)"
_HELP = f"import pidemu.cli, contextlib\nwith contextlib.suppress(SystemExit): pidemu.cli.main(['--help'])\n{_LIST}"


def _run(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    known = {k: v for k, v in os.environ.items() if k != "PIDEMU_VENDORS"}
    return subprocess.run(
        [sys.executable, *words], env=known | environment, capture_output=True, text=True, encoding="utf-8", check=False
    )


@pytest.mark.parametrize(
    ("code", "unwanted"),
    [
        pytest.param(f"import pidemu\n{_LIST}", _HEAVY, id="import pidemu"),
        pytest.param(_HELP, _HEAVY | {"numpy"}, id="pidemu --help"),
    ],
)
def test_a_quick_start_imports_no_heavy_package(code: str, unwanted: set[str]) -> None:
    result = _run("-c", code)
    assert result.returncode == 0, result.stderr
    assert set() == unwanted & set(strict_json(result.stderr))


@pytest.mark.parametrize(
    "words",
    [("show", "fisher/provox"), ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")],
    ids=["show", "convert"],
)
def test_what_goes_into_a_pipe_has_no_colours(words: tuple[str, ...]) -> None:
    result = _run("-m", "pidemu", *words, TERM="xterm-256color")
    assert (result.returncode, result.stderr) == (0, "")
    assert "\x1b" not in result.stdout


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (("show", "fisher/provx"), 2),
        (("convert", "fisher/provox", "GAIN=2", "RESET=4", "--to", "emerson/deltav", "--set", "STRUCTURE=4"), 1),
    ],
    ids=["usage", "refusal"],
)
def test_the_shell_sees_the_exit_status_and_no_traceback(words: tuple[str, ...], status: int) -> None:
    result = _run("-m", "pidemu", *words)
    assert (result.returncode, result.stdout) == (status, "")
    assert result.stderr.startswith("error: ")
    assert "Traceback" not in result.stderr


def test_a_reader_that_stops_early_is_no_error() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "pidemu", "show", "emerson/deltav"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    assert (process.wait(), err) == (0, "")
