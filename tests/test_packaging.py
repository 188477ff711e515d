"""The wheel works where the repository is not, and the source archive holds what a wheel is built from."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import pidemu

ROOT = Path(__file__).resolve().parent.parent
CARDS = sorted(f.relative_to(ROOT / "vendors").as_posix() for f in (ROOT / "vendors").glob("*/*.yaml"))


def _run(words: list[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    known = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PIDEMU_VENDORS", "VIRTUAL_ENV")}
    result = subprocess.run(words, cwd=folder, env=known, capture_output=True, text=True, encoding="utf-8", check=False)
    assert result.returncode == 0, f"{words}\n{result.stdout}\n{result.stderr}"
    return result


def _copy_of_the_repository(target: Path) -> Path:
    """Copy what git tracks or would track."""
    names = _run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], ROOT).stdout.split("\0")
    for name in names:
        if name and (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    return target


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the source archive, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("build")
    tree = _copy_of_the_repository(folder / "tree")
    build: list[str | Path] = [sys.executable, "-m", "hatchling", "build"]
    _run([*build, "--target", "sdist", "--directory", folder / "dist"], tree)
    [sdist] = (folder / "dist").glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    [unpacked] = (folder / "unpacked").iterdir()
    _run([*build, "--target", "wheel", "--directory", folder / "dist"], unpacked)
    [wheel] = (folder / "dist").glob("*.whl")
    return sdist, wheel


def test_the_archives_hold_every_card(archives: tuple[Path, Path]) -> None:
    sdist, wheel = archives
    packed = set(zipfile.ZipFile(wheel).namelist())
    assert sorted(n.removeprefix("pidemu/vendors/") for n in packed if n.startswith("pidemu/vendors/")) == CARDS
    assert {"pidemu/py.typed", "pidemu/__main__.py"} <= packed
    assert len([n for n in packed if n.startswith("pidemu/compiled/card-")]) == len(CARDS)
    assert {"pidemu"} == {n.split("/")[0] for n in packed if ".dist-info/" not in n}
    with tarfile.open(sdist) as archive:
        names = {n.split("/", 1)[1] for n in archive.getnames() if "/" in n}
    assert {f"vendors/{card}" for card in CARDS} <= names
    specs = {f.relative_to(ROOT).as_posix() for f in (ROOT / "specs").rglob("*") if f.is_file()}
    assert specs
    assert specs | {"pyproject.toml", "LICENSE", "README.md", "tests/conftest.py"} <= names


def test_what_developers_run_is_in_the_source_archive_and_not_in_the_wheel(archives: tuple[Path, Path]) -> None:
    sdist, wheel = archives
    tools = {f.relative_to(ROOT).as_posix() for f in (ROOT / "tools").rglob("*.py")}
    assert {"tools/regenerate/__main__.py", "tools/fuzz/__main__.py"} <= tools
    with tarfile.open(sdist) as archive:
        assert tools <= {n.split("/", 1)[1] for n in archive.getnames() if "/" in n}
    packed = {n: zipfile.ZipFile(wheel).read(n) for n in zipfile.ZipFile(wheel).namelist()}
    assert [n for n in packed if "tools" in n.split("/") or "tests" in n.split("/")] == []
    assert [n for n, text in packed.items() if n.endswith(".py") and b"\nif __name__ ==" in text] == ["pidemu/__main__.py"]


COMPILED = """
import os, pidemu, sys
os.environ["PIDEMU_CACHE"] = os.devnull
for card in pidemu.cards():
    was_read = pidemu.load_card(card).compiled is None or {"yaml", "pydantic"} & set(sys.modules)
    print(card, "read" if was_read else "compiled")
"""
"""Whether all cards come compiled."""

EVERY_MODULE = """
import importlib, pkgutil, pidemu
names = [m.name for m in pkgutil.walk_packages(pidemu.__path__, "pidemu.") if not m.name.endswith("__main__")]
extras = "numba jinja2 matplotlib scipy pyarrow distributed hypothesis pytest".split()
for name in names:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        assert error.name in extras, (name, error)
print(len(names))
"""
"""Imports all modules; those that need an extra may say so."""


def test_the_installed_wheel_converts_and_checks_far_from_the_repository(archives: tuple[Path, Path], tmp_path: Path) -> None:
    environment, elsewhere = tmp_path / "environment", tmp_path / "elsewhere"
    elsewhere.mkdir()
    _run([sys.executable, "-m", "venv", environment], elsewhere)
    scripts = environment / ("Scripts" if os.name == "nt" else "bin")
    _run([scripts / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", archives[1]], elsewhere)
    words = ["convert", "fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav", "--json"]
    found = json.loads(_run([scripts / "pidemu", *words], elsewhere).stdout)
    here = pidemu.convert(
        pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1), "emerson/deltav", digits=5
    ).to_dict()
    assert {k: here[k] for k in ("from", "to", "verdict")} == {k: found[k] for k in ("from", "to", "verdict")}
    assert _run([scripts / "pidemu", "check"], elsewhere).stdout == f"{len(CARDS)} cards, 0 problems\n"
    listed = _run([scripts / "python", "-c", COMPILED], elsewhere).stdout.splitlines()
    assert listed == [f"{card} compiled" for card in pidemu.cards()]
    assert _run([scripts / "pidemu", "--version"], elsewhere).stdout == f"pidemu {pidemu.__version__}\n"
    there = {f.relative_to(ROOT / "src").as_posix() for f in (ROOT / "src").rglob("*.py")} - {
        "pidemu/__init__.py",
        "pidemu/__main__.py",
    }
    assert _run([scripts / "python", "-c", EVERY_MODULE], elsewhere).stdout == f"{len(there)}\n"
