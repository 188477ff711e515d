"""The generated files, and how one that is stale differs from what it would be today."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Final

from tools.regenerate import (
    card_reference,
    card_schema,
    conversion_schema,
    emulation,
    loop_schemas,
    matrix,
    pages,
    process_schemas,
    retrofit_schema,
    tables,
    vectors_schema,
)
from tools.regenerate.pages import ROOT

_SHOWN: Final = 160
"""Characters of a line that are shown of a difference."""


@dataclass(frozen=True)
class Generated:
    """A file of the repository that is generated, in whole or in part.

    Attributes
    ----------
    name : str
        Path from the root of the repository, with slashes.
    make : callable
        Returns the file's text of today, from the text that is there: what is not generated in it stays.
    """

    name: str
    make: Callable[[str], str]

    def written(self) -> str:
        """Return the text that is there, empty where there is no file."""
        path = ROOT / self.name
        return path.read_text(encoding="utf-8") if path.exists() else ""

    def write(self, text: str) -> None:
        """Write the file, with the same bytes on every system."""
        (ROOT / self.name).write_text(text, encoding="utf-8", newline="\n")


def _schema(name: str, _there: str) -> str:
    return loop_schemas.text(name)


_WHOLE: Final[tuple[Generated, ...]] = (
    Generated("specs/card.schema.json", lambda _: card_schema.text()),
    Generated("specs/card-language.md", card_reference.updated),
    Generated("specs/conversion.schema.json", lambda _: conversion_schema.text()),
    Generated("specs/fit.schema.json", lambda _: process_schemas.fit_text()),
    Generated("specs/relay.schema.json", lambda _: process_schemas.relay_text()),
    *(Generated(f"specs/{name}.schema.json", partial(_schema, name)) for name in ("tuning", "optimum", "robustness", "bode")),
    Generated("specs/vectors.schema.json", lambda _: vectors_schema.text()),
    Generated("specs/retrofit.schema.json", lambda _: retrofit_schema.text()),
    Generated("docs/emulation.md", lambda _: emulation.text()),
    Generated("docs/matrix.csv", lambda _: matrix.table()),
    Generated("docs/matrix.md", lambda _: matrix.page()),
)


def generated() -> tuple[Generated, ...]:
    """Return all generated files: those with generators of their own, then the pages that show what commands print."""
    own = {file.name for file in _WHOLE}
    shown = ((page.relative_to(pages.ROOT).as_posix(), page) for page in pages.PAGES)
    return (*_WHOLE, *(Generated(name, partial(_renewed, page)) for name, page in shown if name not in own))


def _renewed(page: Path, text: str) -> str:
    return pages.renewed(page, tables.renewed(text))


def chosen(names: Sequence[str]) -> list[Generated]:
    """Return the generated files that are named, by their paths or those of their folders; all where no name is given.

    Raises
    ------
    LookupError
        A name is neither.
    """
    files = generated()
    wanted = [Path(name).as_posix().rstrip("/") for name in names]
    for name in wanted:
        if not any(_is_in(file, name) for file in files):
            raise LookupError(f"'{name}' is not generated; generated are {', '.join(file.name for file in files)}")
    return [file for file in files if not wanted or any(_is_in(file, name) for name in wanted)]


def _is_in(file: Generated, name: str) -> bool:
    return name in (file.name, ".") or file.name.startswith(f"{name}/")


def first_difference(there: str, today: str) -> str:
    """Return the number of the first line that differs, and both versions of it; empty where none does."""
    for number, (old, new) in enumerate(zip_longest(there.splitlines(), today.splitlines()), 1):
        if old != new:
            return f"line {number}\n  there: {_cut(old)}\n  today: {_cut(new)}"
    return "" if there == today else "the end of the last line"


def _cut(line: str | None) -> str:
    if line is None:
        return "(no such line)"
    return line if len(line) <= _SHOWN else f"{line[:_SHOWN]} ..."
