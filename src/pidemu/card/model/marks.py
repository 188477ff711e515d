"""What a field of the card language says of itself, besides its type and its meaning; and walks over cards that look for it.

Whoever needs "all fields that the linear law leaves out" asks for the fields with that mark. There is no list beside the language
that has to agree with it.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Callable, Iterator
from typing import Annotated, Any, TypeVar

from pidemu.card.model.declared import Means
from pidemu.part import part


@part(frozen=True, slots=True)
class Names:
    """The field holds a number, or names the setting that holds it.

    Attributes
    ----------
    sets : str
        What that setting has to set.
    words : tuple of str
        Words that may stand there, and are not a setting's name.
    """

    sets: str
    words: tuple[str, ...] = ()


@part(frozen=True, slots=True)
class Beyond:
    """The linear law leaves the field out (specs/equations.md, section 9).

    Attributes
    ----------
    neutral : object
        Its value where it does nothing.
    words : callable, optional
        From the part of the card that has the field to what is at work there; ``None`` where nothing is.
    """

    neutral: Any
    words: Callable[[Any], str | None] | None = None


@part(frozen=True, slots=True)
class AtRest:
    """The field decides about the first scan or a transfer.

    Attributes
    ----------
    neutral : object
        The value with which neither moves anything.
    """

    neutral: Any


@part(frozen=True, slots=True)
class PerScan:
    """The field says how the law is computed scan by scan, or what happens at limits and transfers: the law is the same without."""


@part(frozen=True, slots=True)
class LanguageField:
    """A field of the card language, or of an algorithm.

    Attributes
    ----------
    annotation : object
        Its type.
    metadata : tuple
        What it is marked with.
    default : object
        What it is where the card says nothing; `dataclasses.MISSING` where the card has to say it.
    """

    annotation: Any
    metadata: tuple[Any, ...]
    default: Any

    @property
    def is_required(self) -> bool:
        """Whether a card has to say it."""
        return self.default is dataclasses.MISSING

    @property
    def meaning(self) -> str:
        """What it means, in sentences."""
        return next((mark.text for mark in self.metadata if isinstance(mark, Means)), "")


Mark = TypeVar("Mark", bound=Names | Beyond | AtRest | PerScan)
Tree = TypeVar("Tree")
_fields: dict[type[Any], dict[str, LanguageField]] = {}
_marks: dict[tuple[type[Any], type[Any]], dict[str, Any]] = {}
_ways: dict[tuple[type[Any], type[Any]], tuple[tuple[str, Any, bool], ...]] = {}


def fields_of(part: type[Any]) -> dict[str, LanguageField]:
    """Return the fields of a part of the card language by their names in Python, in order."""
    if part not in _fields:
        hints = typing.get_type_hints(part, include_extras=True)
        _fields[part] = {f.name: _field(hints[f.name], f) for f in dataclasses.fields(part)}
    return _fields[part]


def _field(annotation: Any, field: dataclasses.Field[Any]) -> LanguageField:
    default = field.default if field.default_factory is dataclasses.MISSING else field.default_factory()
    if typing.get_origin(annotation) is not Annotated:
        return LanguageField(annotation, (), default)
    return LanguageField(annotation.__origin__, annotation.__metadata__, default)


def parts_in(annotation: Any) -> list[type[Any]]:
    """Return the parts of the card language that a type names, as in ``SignalFilter[R] | None``."""
    named = typing.get_origin(annotation) or annotation
    if isinstance(named, type) and dataclasses.is_dataclass(named):
        return [named]
    return [part for argument in typing.get_args(annotation) for part in parts_in(argument)]


def marked(part: type[Any], kind: type[Mark]) -> dict[str, Mark]:
    """Return the fields of a part that bear a mark of that kind, and the mark.

    Parameters
    ----------
    part : type
        A class of the card language.
    kind : type
        `Names`, `Beyond`, `AtRest` or `PerScan`.
    """
    if (part, kind) not in _marks:
        found = {name: [m for m in field.metadata if isinstance(m, kind)] for name, field in fields_of(part).items()}
        _marks[part, kind] = {name: marks[0] for name, marks in found.items() if marks}
    return _marks[part, kind]


def walk(tree: Any, kind: type[Mark]) -> Iterator[tuple[tuple[str, ...], Any, Mark]]:
    """Yield path, owner and mark of every field with a mark of that kind that is there, in the order of the language.

    Parameters
    ----------
    tree : object
        A card's equation, an algorithm, or a part of one.
    kind : type
        `Names`, `Beyond`, `AtRest` or `PerScan`.
    """
    for name, mark, is_above in _way(type(tree), kind):
        if mark is not None:
            yield (name,), tree, mark
        value = getattr(tree, name) if is_above else None
        if value is not None:
            for inner, owner, found in walk(value, kind):
                yield (name, *inner), owner, found


def without(tree: Tree, kind: type[Beyond] | type[AtRest]) -> Tree:
    """Return an algorithm, or a part of one, with all fields of that mark at their neutral values; itself where they are.

    Parameters
    ----------
    tree : object
        The algorithm, or the part.
    kind : type
        `Beyond` or `AtRest`.
    """
    changed: dict[str, Any] = {}
    for name, mark, _ in _way(type(tree), kind):
        value = getattr(tree, name)
        new = mark.neutral if mark is not None else None if value is None else without(value, kind)
        if new is not value and new != value:
            changed[name] = new
    return dataclasses.replace(tree, **changed) if changed else tree  # type: ignore[type-var]


def beyond_scans(tree: Any) -> Any:
    """Return the fields of a part, and of those below, that are not about single scans; a value that is no part as it is."""
    part = type(tree)
    if not dataclasses.is_dataclass(part):
        return tree
    per_scan = marked(part, PerScan)
    return {f.name: beyond_scans(getattr(tree, f.name)) for f in dataclasses.fields(part) if f.name not in per_scan}


def _way(part: type[Any], kind: type[Any]) -> tuple[tuple[str, Any, bool], ...]:
    """Return the fields that have a mark of a kind or are above one: name, mark, and whether there can be some below."""
    if (part, kind) not in _ways:
        marks = marked(part, kind)
        found = []
        for name, field in fields_of(part).items():
            is_above = any(_way(inner, kind) for inner in parts_in(field.annotation))
            if is_above or name in marks:
                found.append((name, marks.get(name), is_above))
        _ways[part, kind] = tuple(found)
    return _ways[part, kind]
