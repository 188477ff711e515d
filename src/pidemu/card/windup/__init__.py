"""Windup schemes, one file each: what it is, what data sheets and certificates say of it, and which cards may have it.

A new scheme is a file here and one of the same name in `pidemu.program.windup`, which says what it does; nothing else names it.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import TYPE_CHECKING, Annotated, Any, Final, Union

from pidemu.card.model.base import R
from pidemu.card.model.declared import ByScheme
from pidemu.card.windup.scheme import Scheme

__all__ = ["SCHEMES", "Scheme", "Windup"]


def _schemes() -> tuple[type[Scheme[Any]], ...]:
    found = []
    for file in pkgutil.iter_modules(__path__, f"{__name__}."):
        module = importlib.import_module(file.name)
        found += [
            kind for kind in vars(module).values()
            if isinstance(kind, type) and issubclass(kind, Scheme) and kind is not Scheme and kind.__module__ == file.name
        ]  # fmt: skip
    return tuple(found)


SCHEMES: Final = _schemes()
"""All schemes, by the names of their files."""

if TYPE_CHECKING:
    Windup = Scheme
else:
    Windup = Annotated[Union[tuple(scheme[R] for scheme in SCHEMES)], ByScheme()]  # noqa: UP007
