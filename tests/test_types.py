"""The type checker sees every field: what does not fit in a copy of the package is an error there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.program.made_up import ROOT, copy_of_the_package, with_transfer, with_windup

pytest.importorskip("mypy", reason="mypy comes with pidemu[dev] only")


@dataclass(frozen=True)
class Mutation:
    """A change in one file, and the error that it has to be: the file, and what is said there."""

    file: str
    old: str
    new: str
    place: str
    said: str


MUTATIONS = {
    "a gain of the algorithm, renamed in the resolver": Mutation(
        "algorithm/resolve.py", "kp=core.kp,", "gain=core.kp,",
        "algorithm/resolve.py", 'Unexpected keyword argument "gain" for "Algorithm"',
    ),
    "a part of the algorithm, renamed in the resolver": Mutation(
        "algorithm/resolve.py", "transfer=equation.transfer,", "transfers=equation.transfer,",
        "algorithm/resolve.py", 'Unexpected keyword argument "transfers" for "Algorithm"',
    ),
    "a field of a part, renamed in the resolver": Mutation(
        "algorithm/resolve.py", "edge=error.edge,", "open_edge=error.edge,",
        "algorithm/resolve.py", 'Unexpected keyword argument "open_edge" for "ErrorShape"',
    ),
    "a field of a part, renamed in the language": Mutation(
        "card/transfer/__init__.py", "    first_scan: Annotated[", "    first_scans: Annotated[",
        "program/transfer/keep.py", '"Transfer" has no attribute "first_scan"',
    ),
    "a field of a scheme, renamed in the language": Mutation(
        "card/windup/freeze.py", "    judged_on: Annotated[", "    judged: Annotated[",
        "program/windup/freeze.py", 'has no attribute "judged_on"',
    ),
    "an integer where a word belongs": Mutation(
        "algorithm/resolve.py", "Filter(applies_to=f.applies_to,", "Filter(applies_to=1,",
        "algorithm/resolve.py", 'Argument "applies_to" to "Filter" has incompatible type "Literal[1]"',
    ),
    "a word that is none of the choices": Mutation(
        "algorithm/resolve.py", "starts=i.starts,", 'starts="never",',
        "algorithm/resolve.py", 'Argument "starts" to "Integral" has incompatible type "Literal[\'never\']"',
    ),
    "a word of another field": Mutation(
        "algorithm/resolve.py", "rate_counts=sp.rate_counts,", "rate_counts=sp.starts,",
        "algorithm/resolve.py", 'Argument "rate_counts" to "Setpoint" has incompatible type',
    ),
    "a comparison with a word that there is not": Mutation(
        "program/windup/conditional.py", 'self.scheme.last_increment == "to-the-limit"', 'self.scheme.last_increment == "kept"',
        "program/windup/conditional.py", "Non-overlapping equality check",
    ),
}  # fmt: skip


def errors(folder: Path) -> list[str]:
    """Return what mypy says of a copy, one error a line; nothing where it is well typed."""
    words = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", "--cache-dir", "cache", "--no-pretty", "src"]
    known = {k: v for k, v in os.environ.items() if k not in ("MYPYPATH", "PYTHONPATH", "MYPY_CACHE_DIR")}
    result = subprocess.run(words, cwd=folder, env=known, capture_output=True, text=True, encoding="utf-8", check=False)
    assert (result.returncode, result.stderr) in ((0, ""), (1, "")), result.stdout + result.stderr
    found = [line.replace(os.sep, "/") for line in result.stdout.splitlines() if ": error: " in line]
    assert bool(found) == (result.returncode == 1)
    return found


def is_found(mutation: Mutation, lines: list[str]) -> bool:
    """Return whether the error is among those that are said, at its place."""
    return any(line.startswith(f"src/pidemu/{mutation.place}:") and mutation.said in line for line in lines)


def mutate(folder: Path, mutation: Mutation) -> None:
    file = folder / "src" / "pidemu" / mutation.file
    text = file.read_text(encoding="utf-8")
    assert text.count(mutation.old) == 1, f"{mutation.old!r} occurs {text.count(mutation.old)} times in {mutation.file}"
    file.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def test_a_field_that_is_renamed_and_a_value_that_does_not_fit_are_errors_of_the_type_checker(tmp_path: Path) -> None:
    """All mutations at once, each with an error of its own. Without them all is well, and so are the made-up behaviours."""
    folder = with_transfer(with_windup(copy_of_the_package(tmp_path)))
    shutil.copy2(ROOT / "pyproject.toml", folder)
    assert errors(folder) == []
    for mutation in MUTATIONS.values():
        mutate(folder, mutation)
    found = errors(folder)
    assert [name for name, mutation in MUTATIONS.items() if not is_found(mutation, found)] == [], "\n".join(found)
