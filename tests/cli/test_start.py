"""Starting pidemu: what is imported, and what is sent into a pipe."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pidemu.card.library import builtin_folder
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


_LISTED = """
import sys, json, contextlib
from pidemu.cli import main
with contextlib.suppress(SystemExit): main(sys.argv[1:])
print(json.dumps(sorted({m.split('.')[0] for m in sys.modules})), file=sys.stderr)
"""
_CONVERT = ("convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")
_CARD = str(builtin_folder() / "fisher" / "provox.yaml")


@pytest.mark.parametrize(
    ("words", "unwanted"),
    [
        (("--help",), {"numpy", "pydantic", "yaml"}),
        (("cards",), {"numpy", "pydantic", "yaml"}),
        (("show", "fisher/provox"), {"numpy", "pydantic", "yaml"}),
        (("check", _CARD), {"numpy", "pydantic", "yaml"}),
        (_CONVERT, {"pydantic", "yaml"}),
        ((*_CONVERT, "--json"), {"pydantic", "yaml"}),
        ((*_CONVERT, "--scan", "1,0.5", "--process", "gain=1,lag=10,delay=2"), {"pydantic", "yaml"}),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else "",
)
def test_with_compiled_cards_a_command_imports_what_it_needs(words: tuple[str, ...], unwanted: set[str], tmp_path: Path) -> None:
    for _ in range(2):  # the first time they are compiled
        result = _run("-c", _LISTED, *words, PIDEMU_CACHE=str(tmp_path))
        assert result.returncode == 0, result.stderr
    assert set() == (_HEAVY | unwanted) & set(strict_json(result.stderr))


def test_a_list_of_cards_imports_few_modules_of_pidemu_and_compiles_no_card(tmp_path: Path) -> None:
    count = _LISTED.replace("m.split('.')[0] for m in sys.modules", "m for m in sys.modules if m.startswith('pidemu.')")
    for _ in range(2):
        result = _run("-c", count, "cards", PIDEMU_CACHE=str(tmp_path))
    found = strict_json(result.stderr)
    assert {"pidemu.card.load", "pidemu.card.model.card_file", "pidemu.card.plain_data"} & set(found) == set()
    assert len(found) < 40


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
