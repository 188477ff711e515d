"""CONTRIBUTING.md states the order of the modules; imports keep it, and the commands it names are there."""

from __future__ import annotations

import ast
import importlib.util
import re

import pytest

from tools.regenerate.pages import ROOT, read

TEXT = read(ROOT / "CONTRIBUTING.md")
SOURCE = ROOT / "src" / "pidemu"
(_LIST,) = re.findall(r"^```text\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
ORDER = re.findall(r"\w+", _LIST)
"""The modules and packages, each above what it depends on."""
ROOMS = sorted(
    {path.stem for path in SOURCE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()} - {"__init__", "__main__"}
)


def imported(room: str) -> set[str]:
    """Return the modules and packages that one imports when it is imported, without those inside functions."""
    folder = SOURCE / room
    files = sorted(folder.rglob("*.py")) if folder.is_dir() else [SOURCE / f"{room}.py"]
    nodes = [
        node for file in files for node in ast.parse(file.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)
    ]
    inside = {(node.module or "").split(".")[1] for node in nodes if (node.module or "").startswith("pidemu.")}
    inside |= {alias.name for node in nodes if node.module == "pidemu" for alias in node.names}
    return inside & set(ROOMS) - {room}


def test_the_list_has_every_module_once() -> None:
    assert sorted(ORDER) == ROOMS


@pytest.mark.parametrize("room", ORDER)
def test_a_module_depends_on_those_below_it_in_the_list(room: str) -> None:
    assert imported(room) <= set(ORDER[ORDER.index(room) + 1 :])


@pytest.mark.parametrize("module", sorted(set(re.findall(r"`python -m ([\w.]+)", TEXT)) - {"pytest"}))
def test_a_command_that_is_to_be_run_is_there(module: str) -> None:
    assert importlib.util.find_spec(module) is not None
