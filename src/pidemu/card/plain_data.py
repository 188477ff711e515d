"""Parts of a card to plain data and back, for compiled cards: JSON, which makes nothing but the parts of the card language.

A list begins with what it stands for: the name of a part and its fields, of an enumeration and its word, ``list``, ``tuple`` or
``date``. All else stands for itself.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import fields
from datetime import date
from typing import Any, Final, cast

from pidemu.card.model.base import Form, Part, Rule, Status
from pidemu.part import part_of

_WORDS: Final = {kind.__name__: {word.value: word for word in kind} for kind in (Form, Rule, Status)}


def encoded(value: Any) -> Any:
    """Return plain data that `decoded` makes the same value of.

    Parameters
    ----------
    value : object
        A part of a card, or what its fields hold.

    Raises
    ------
    TypeError
        The card language has no such values.
    """
    if isinstance(value, Part):
        said = {f.name: encoded(getattr(value, f.name)) for f in fields(cast(Any, value)) if _is_said(value, f)}
        return [type(value).__name__, said]
    name = type(value).__name__
    if name in _WORDS:
        return [name, value.value]
    if isinstance(value, dict):
        return {key: encoded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [name, *map(encoded, value)]
    if isinstance(value, date):
        return [name, value.isoformat()]
    if value is None or type(value) in (str, float, int, bool):
        return value
    raise TypeError(f"a card holds no {name}")


def decoded(data: Any) -> Any:
    """Return what `encoded` made plain data of.

    Raises
    ------
    KeyError, TypeError, ValueError
        `encoded` did not make these data, or another version of the card language.
    """
    if type(data) is dict:
        return {key: decoded(inner) for key, inner in data.items()}
    if type(data) is not list:
        return data
    name, *rest = data
    if name == "list":
        return [decoded(inner) for inner in rest]
    if name == "tuple":
        return tuple(map(decoded, rest))
    (said,) = rest
    if name in _WORDS:
        return _WORDS[name][said]
    if name == "date":
        return date.fromisoformat(said)
    return part_of(_parts()[name], {key: decoded(inner) for key, inner in said.items()})


def _is_said(part: Part, field: Any) -> bool:
    return getattr(part, field.name) is not None or field.default is not None


@functools.cache
def _parts() -> dict[str, type[Part]]:
    """Return all parts of the card language by their names."""
    import pidemu.card.model.card_file  # noqa: F401  # which puts all of them together

    return {part.__name__: part for part in _below(Part) if part.__module__.startswith("pidemu.card.")}


def _below(part: type[Part]) -> Iterator[type[Part]]:
    for below in part.__subclasses__():
        yield below
        yield from _below(below)
