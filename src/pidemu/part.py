"""Frozen dataclasses whose methods are made when they are first called: the parts of cards, and what else every command imports.

A dataclass makes its methods from text when its module is imported, which for all parts takes longer than most commands run. Here
the import makes fields and slots, and `dataclasses` makes each method for those parts that really use it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final, NoReturn, TypeVar, cast

__all__ = ["part", "part_of"]

_LATER: Final = {"__init__": "init", "__repr__": "repr", "__eq__": "eq", "__hash__": "eq"}
"""Methods that are made later, and the argument of `dataclasses.dataclass` that asks for them."""

if TYPE_CHECKING:
    from dataclasses import dataclass as part
else:

    def part(*, frozen: bool, slots: bool, kw_only: bool = False) -> Callable[[type], type]:
        """Make a class a part: what a dataclass with these arguments is, and to a type checker it is one."""
        assert frozen, "a part is frozen"
        assert slots, "a part has slots"

        def made(cls: type) -> type:
            kind = dataclasses.dataclass(init=False, repr=False, eq=False, slots=True, kw_only=kw_only)(cls)
            for name, method in _FIRST.items():
                if not _is_own(kind, name):
                    setattr(kind, name, method)
            kind.__setattr__ = kind.__delattr__ = _refuse
            kind.__getstate__, kind.__setstate__ = _state, _set_state
            return kind

        return made


_OF_A_FIELD: Final = ("default", "default_factory", "init", "repr", "hash", "compare", "kw_only")
T = TypeVar("T")


def part_of(kind: type[T], values: Mapping[str, Any]) -> T:
    """Return a part made of the values of its fields; those that are not given are ``None``.

    Unlike a call of the class it does not look whether they are the right ones: they come from such a part.
    """
    made = kind.__new__(kind)
    for field in dataclasses.fields(cast(Any, kind)):
        object.__setattr__(made, field.name, values.get(field.name))
    return made


def _first(name: str) -> Callable[..., Any]:
    """Return a method that first makes itself what it has to be for its class."""

    def method(self: Any, *given: Any, **named: Any) -> Any:
        _complete(next(kind for kind in type(self).__mro__ if kind.__dict__.get(name) is method), _LATER[name])
        return getattr(type(self), name)(self, *given, **named)

    method.__name__ = name
    return method


_ONLY: Final = {asked: {other: other == asked for other in ("init", "repr", "eq")} for asked in ("init", "repr", "eq")}
_FIRST: Final = {name: _first(name) for name in _LATER}


def _complete(kind: type[Any], asked: str) -> None:
    """Make methods of a part, by a dataclass with the same fields."""
    body: dict[str, Any] = {"__annotations__": {}, "__qualname__": kind.__qualname__}
    for field in dataclasses.fields(kind):
        body["__annotations__"][field.name] = Any
        said = {name: getattr(field, name) for name in _OF_A_FIELD}
        body[field.name] = dataclasses.field(**said)
    if hasattr(kind, "__post_init__"):
        body["__post_init__"] = kind.__post_init__
    made: type[Any] = dataclasses.dataclass(frozen=True, **_ONLY[asked])(type(kind.__name__, (), body))
    for name, argument in _LATER.items():
        if argument == asked and kind.__dict__[name] is _FIRST[name]:
            setattr(kind, name, made.__dict__[name])


def _is_own(kind: type[Any], name: str) -> bool:
    """Tell whether a class has a method of its own, which stays; that Python gives no hash to one with equality is none."""
    return name in kind.__dict__ and not (kind.__dict__[name] is None and "__eq__" in kind.__dict__)


def _refuse(self: Any, name: str, *_: Any) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r} of {type(self).__name__}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
