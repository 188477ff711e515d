"""A class name has one meaning in the package: whoever reads it need not ask of which module."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

BY_CONVENTION = "Hooks"
"""What the files on windup schemes and transfers each hold, and are found by."""
SOURCE = Path(__file__).parents[1] / "src" / "pidemu"


def test_no_two_classes_have_the_same_name() -> None:
    homes: dict[str, list[str]] = defaultdict(list)
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(path.relative_to(SOURCE).as_posix())
    assert len(homes) > 100
    assert {name: places for name, places in homes.items() if len(places) > 1 and name != BY_CONVENTION} == {}
