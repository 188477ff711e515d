"""What developers rely on: the fast selection, tests that stand alone, versions that agree wherever they are written."""

from __future__ import annotations

import ast
import re
import tomllib

import pytest
import yaml

from tests.selection import FOLDER, SLOW, is_slow

ROOT = FOLDER.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", c)]
MODULES = sorted(f.relative_to(ROOT).as_posix() for f in FOLDER.rglob("*.py"))


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("entry", SLOW)
def test_what_is_listed_as_slow_is_there_and_holds_tests(entry: str) -> None:
    path = FOLDER / entry
    assert path.is_file() or list(path.glob("test_*.py"))


def test_a_file_is_slow_where_it_or_its_folder_is_listed() -> None:
    assert is_slow(FOLDER / "conversion" / "test_exact.py")
    assert is_slow(FOLDER / "test_docs.py")
    assert not is_slow(FOLDER / "test_units.py")


def test_this_file_is_in_the_fast_selection(request: pytest.FixtureRequest) -> None:
    assert request.node.get_closest_marker("fast") is not None


@pytest.mark.parametrize("module", MODULES)
def test_what_tests_share_stands_in_no_test_module(module: str) -> None:
    nodes = ast.walk(ast.parse(text(module)))
    imported = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    assert [name for name in imported if name.startswith("tests.") and name.rpartition(".")[2].startswith("test_")] == []


def test_the_version_is_the_same_wherever_it_is_written() -> None:
    citation = yaml.safe_load(text("CITATION.cff"))
    assert citation["version"] == PROJECT["version"]
    assert [author["name"] for author in citation["authors"]] == [author["name"] for author in PROJECT["authors"]]


def test_all_versions_of_python_that_are_promised_are_tested() -> None:
    (listed,) = re.findall(r"^PYTHONS = (.*)$", text("noxfile.py"), re.MULTILINE)
    assert ast.literal_eval(listed) == PYTHONS
    jobs = yaml.safe_load(text(".github/workflows/tests.yml"))["jobs"]
    assert jobs["tests"]["strategy"]["matrix"]["python"] == PYTHONS
    sessions = set(re.findall(r"^def (\w+)\(session", text("noxfile.py"), re.MULTILINE))
    assert {"tests", *jobs["habits"]["strategy"]["matrix"]["session"]} == sessions


def test_cards_are_checked_before_a_commit() -> None:
    hooks = yaml.safe_load(text(".pre-commit-config.yaml"))["repos"][0]["hooks"]
    (cards,) = [hook for hook in hooks if hook["entry"] == "pidemu check"]
    files = [f.relative_to(ROOT).as_posix() for f in (ROOT / "vendors").rglob("*.yaml")]
    assert [f for f in files if not re.search(cards["files"], f)] == []
