"""Where loops stand within tags: in user types, in arrays of them, in the local tags of Add-On Instructions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pidemu.errors import ListError
from pidemu.plant.l5x.blocks import BLOCK_TYPES, Block, BlockValues, from_position, from_structure, is_pid_shaped
from pidemu.plant.l5x.literals import Positional, read_positional
from pidemu.plant.l5x.tree import L5xElement

_DEEPEST: Final = 16
_MOST: Final = 100_000
"""Loops of one tag."""


@dataclass(frozen=True)
class FoundBlock:
    """A block in a tag.

    Attributes
    ----------
    path : str
        Its path: ``PIC_Bank[0].Ctl``.
    block : str
        ``PID`` or ``PIDE``.
    values : BlockValues
        What it is set to.
    origin : str
        ``decorated``, ``L5K text`` or ``L5K text of the instance``.
    """

    path: str
    block: Block
    values: BlockValues
    origin: str


class TypeTable:
    """The user types and Add-On Instructions of a controller.

    Parameters
    ----------
    controller : L5xElement
        The controller.
    """

    def __init__(self, controller: L5xElement) -> None:
        self.user = {t.get("Name"): t for t in controller.all("DataTypes", "DataType")}
        self._holding: dict[str, bool] = {}
        self.instructions = {a.get("Name"): a for a in controller.all("AddOnInstructionDefinitions", "AddOnInstructionDefinition")}

    def blocks(self, tag: L5xElement) -> list[FoundBlock]:
        """Return the blocks of a tag, in the order of its type."""
        named = {path: (block, s) for path, block, s in self._decorated(tag)}
        expected = list(itertools.islice(self._expected(tag.get("DataType"), tag.get("Name"), tag.get("Dimensions"), 0), _MOST + 1))
        if len(expected) > _MOST:
            raise ListError(f"tag {tag.get('Name')} holds more than {_MOST:,} loops; not read")
        found = [FoundBlock(path, block, from_structure(block, s), "decorated") for path, (block, s) in named.items()]
        rest = [(path, block) for path, block, _ in expected if path not in named]
        if rest:
            found += self._positional(tag, expected, set(named))
        order = {path: at for at, (path, _, _) in enumerate(expected)}
        return sorted(found, key=lambda f: order.get(f.path, len(order)))

    def _decorated(self, tag: L5xElement) -> Iterator[tuple[str, Block, L5xElement]]:
        for data in tag.all("Data"):
            if data.get("Format") == "Decorated":
                for child in data.children:
                    yield from _blocks_in(child, tag.get("Name"))

    def _expected(self, kind: str, path: str, dimensions: str, depth: int) -> Iterator[tuple[str, Block, bool]]:
        """Yield the blocks that a type holds: path, block, and whether it is a local tag of an instruction."""
        if depth > _DEEPEST or not self._holds(kind, frozenset()):
            return
        for index in _indices(dimensions):
            at = f"{path}{index}"
            if kind in BLOCK_TYPES:
                yield at, BLOCK_TYPES[kind], False
            elif kind in self.user:
                for member in self.user[kind].all("Members", "Member"):
                    name, inner = member.get("Name"), member.get("DataType")
                    size = member.get("Dimension", "0")
                    yield from self._expected(inner, f"{at}.{name}", "" if size == "0" else size, depth + 1)
            elif kind in self.instructions:
                for local in self.instructions[kind].all("LocalTags", "LocalTag"):
                    path_of_it = f"{at}.{local.get('Name')}"
                    for p, b, _ in self._expected(local.get("DataType"), path_of_it, local.get("Dimensions"), depth + 1):
                        yield p, b, True

    def _holds(self, kind: str, above: frozenset[str]) -> bool:
        """Whether a type holds blocks, however deep; an array of what holds none need not be gone through."""
        if kind in BLOCK_TYPES:
            return True
        if kind not in self._holding and kind not in above:
            parts = [m.get("DataType") for m in self.user[kind].all("Members", "Member")] if kind in self.user else []
            if kind in self.instructions:
                parts = [t.get("DataType") for t in self.instructions[kind].all("LocalTags", "LocalTag")]
            self._holding[kind] = any(self._holds(part, above | {kind}) for part in parts)
        return self._holding.get(kind, False)

    def _positional(self, tag: L5xElement, expected: list[tuple[str, Block, bool]], named: set[str]) -> Iterator[FoundBlock]:
        """Yield blocks whose values stand in the L5K text alone: what has the shape of a PID tag, in the order of the type."""
        text = next((d.text for d in tag.all("Data") if d.get("Format") == "L5K"), "")
        shaped: list[list[Positional]] = []
        why = "no values in L5K text; export it again with decorated data"
        if text:
            try:
                shaped = list(_shaped(read_positional(text)))
            except ValueError as error:
                why = f"its L5K text cannot be read: {error}"
            else:
                why = "its L5K text does not fit its type; export it again with decorated data"
        pids = [path for path, block, _ in expected if block == "PID"]
        by_path = dict(zip(pids, shaped, strict=True)) if len(pids) == len(shaped) else {}
        for path, block, local in expected:
            if path in named:
                continue
            origin = "L5K text of the instance" if local else "L5K text"
            if path in by_path:
                yield FoundBlock(path, block, from_position(by_path[path]), origin)
            else:
                reason = "a PIDE in L5K text packs its bits in an order that is not published" if block == "PIDE" else why
                yield FoundBlock(path, block, BlockValues(fault="no-members", why=reason), origin)


def _blocks_in(element: L5xElement, path: str) -> Iterator[tuple[str, Block, L5xElement]]:
    """Yield the blocks of decorated data."""
    if element.name in ("Structure", "StructureMember"):
        kind = element.get("DataType")
        if kind in BLOCK_TYPES:
            yield path, BLOCK_TYPES[kind], element
            return
        for child in element.children:
            if child.name in ("StructureMember", "ArrayMember"):
                yield from _blocks_in(child, f"{path}.{child.get('Name')}")
    elif element.name in ("Array", "ArrayMember"):
        for child in element.all("Element"):
            for inner in child.children:
                yield from _blocks_in(inner, f"{path}{child.get('Index')}")


def _shaped(values: Positional) -> Iterator[list[Positional]]:
    """Yield what has the shape of a PID tag."""
    if not isinstance(values, list):
        return
    if is_pid_shaped(values):
        yield values
        return
    for value in values:
        yield from _shaped(value)


def _indices(dimensions: str) -> Iterator[str]:
    """Yield the indices of an array: ``[0]``, ``[1]``; one empty text for what is none."""
    sizes = [int(n) for n in dimensions.replace(",", " ").split() if n.isdigit()]
    if not sizes:
        yield ""
        return
    for index in _counted(sizes):
        yield f"[{','.join(map(str, index))}]"


def _counted(sizes: list[int]) -> Iterator[tuple[int, ...]]:
    """Yield the indices one after the other: nothing of an array that is said to be huge is kept."""
    if not sizes:
        yield ()
        return
    for first in range(sizes[0]):
        for rest in _counted(sizes[1:]):
            yield first, *rest
