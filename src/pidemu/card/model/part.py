"""Parts of cards and algorithms: frozen dataclasses whose methods are made when the first one is called.

A dataclass makes its methods from text when its module is imported, which for all parts takes longer than most commands run. Here
the import makes fields and slots, and `dataclasses` makes the rest for those parts that are really used.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NoReturn

__all__ = ["part"]

_LATER: Final = ("__init__", "__repr__", "__eq__", "__hash__")

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
                setattr(kind, name, method)
            kind.__setattr__ = kind.__delattr__ = _refuse
            kind.__getstate__, kind.__setstate__ = _state, _set_state
            return kind

        return made


def _first(name: str) -> Callable[..., Any]:
    """Return a method that makes all methods of its class, and then is the one that was made."""

    def method(self: Any, *given: Any, **named: Any) -> Any:
        _complete(next(kind for kind in type(self).__mro__ if kind.__dict__.get(name) is method))
        return getattr(type(self), name)(self, *given, **named)

    method.__name__ = name
    return method


_FIRST: Final = {name: _first(name) for name in _LATER}


def _complete(kind: type[Any]) -> None:
    """Make the methods of a part, by a dataclass with the same fields."""
    body: dict[str, Any] = {"__annotations__": {}, "__qualname__": kind.__qualname__}
    for field in dataclasses.fields(kind):
        body["__annotations__"][field.name] = Any
        body[field.name] = dataclasses.field(default=field.default, default_factory=field.default_factory, kw_only=field.kw_only)
    made: type[Any] = dataclasses.dataclass(frozen=True)(type(kind.__name__, (), body))
    for name in _LATER:
        setattr(kind, name, made.__dict__[name])


def _refuse(self: Any, name: str, *_: Any) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r} of {type(self).__name__}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
