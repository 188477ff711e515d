"""docs/architecture.md draws the rooms in order; imports point downwards in it, those for types only and within functions, too."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "pidemu"
(_LIST,) = re.findall(r"^```text\n(cli/.*?)^```$", (ROOT / "docs" / "architecture.md").read_text("utf-8"), re.DOTALL | re.MULTILINE)
LAYERS = [re.findall(r"\b([a-z_]+)(?=/|\.py)", line) for line in _LIST.splitlines()]
"""The rooms, each line above those it may use; rooms of one line may use those that stand to the right."""
ORDER = [room for line in LAYERS for room in line]
FACES = {
    ("card", "settings"): {"Settings", "make_settings"},
    ("card", "checks"): {"remembered_check"},
    ("settings", "algorithm"): {"Algorithm", "algorithm_of"},
    ("settings", "law"): {"Law"},
}
"""What leads upwards when it is called: `Card.settings`, `Settings.algorithm`, `Settings.law`, and `load_card`, which checks cards
from outside. They are found where a user looks for them."""


def rooms() -> list[str]:
    found = {path.stem for path in SOURCE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    return sorted(found - {"__init__", "__main__"})


def files(room: str) -> list[Path]:
    folder = SOURCE / room
    return sorted(folder.rglob("*.py")) if folder.is_dir() else [SOURCE / f"{room}.py"]


def imports(file: Path) -> Iterator[tuple[str, str, bool]]:
    """Yield room, name and whether it is imported with the module, of all imports of a file, wherever they stand."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "pidemu":
            assert node.module is not None
            for alias in node.names:
                room = node.module.split(".")[1] if "." in node.module else alias.name
                yield room, alias.name, node in tree.body


def test_every_room_stands_in_the_list_once() -> None:
    assert sorted(ORDER) == rooms()


@pytest.mark.parametrize("room", ORDER)
def test_imports_point_downwards(room: str) -> None:
    below = {room, *ORDER[ORDER.index(room) + 1 :], "__version__"}
    upwards = [
        (str(file.relative_to(SOURCE)), other, name, at_once)
        for file in files(room)
        for other, name, at_once in imports(file)
        if other not in below and (at_once or name not in FACES.get((room, other), ()))
    ]
    assert upwards == []


def test_every_face_is_needed() -> None:
    used = {(room, other, name) for room in ORDER for file in files(room) for other, name, _ in imports(file)}
    assert {(*pair, name) for pair, names in FACES.items() for name in names} <= used


def test_no_room_bears_the_name_of_a_public_function() -> None:
    import pidemu

    assert [name for name in rooms() if name in pidemu.__all__] == []
