"""Frozen dataclasses whose methods are made later: they do what a dataclass does."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, is_dataclass, replace
from typing import Any, ClassVar

import pytest

from pidemu.part import part, part_of


@part(frozen=True, slots=True, kw_only=True)
class Late:
    a: int
    b: str = "b"
    c: list[int] = field(default_factory=list)
    kind: ClassVar[str] = "late"


@part(frozen=True, slots=True, kw_only=True)
class LateBelow(Late):
    d: float = 0.5


@part(frozen=True, slots=True)
class Named:
    name: str
    note: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("no name")


@dataclass(frozen=True, slots=True, kw_only=True)
class Plain:
    a: int
    b: str = "b"
    c: list[int] = field(default_factory=list)
    kind: ClassVar[str] = "late"


def test_it_is_a_dataclass_with_fields_slots_and_defaults() -> None:
    made = Late(a=1)
    assert is_dataclass(Late)
    assert [f.name for f in fields(Late)] == [f.name for f in fields(Plain)] == ["a", "b", "c"]
    assert (made.a, made.b, made.c, made.kind) == (1, "b", [], "late")
    assert not hasattr(made, "__dict__")
    assert Late(a=1).c is not made.c
    assert repr(made) == repr(Plain(a=1)).replace("Plain", "Late")


def test_equal_are_parts_of_one_class_with_equal_values() -> None:
    assert Late(a=1) == Late(a=1)
    assert Late(a=1) != Late(a=2)
    assert Late(a=1) != LateBelow(a=1)
    assert LateBelow(a=1, d=2.0) != LateBelow(a=1)
    assert Named("x", "one") == Named("x", "two")
    assert {Named("x", "one"), Named("x", "two")} == {Named("x")}
    assert repr(Named("x", "one")) == "Named(name='x')"


def test_a_class_below_has_methods_of_its_own_whichever_is_used_first() -> None:
    assert repr(Late(a=1)) == "Late(a=1, b='b', c=[])"
    assert repr(LateBelow(a=1)) == "LateBelow(a=1, b='b', c=[], d=0.5)"


def test_nothing_of_it_can_be_changed() -> None:
    made: Any = Late(a=1)
    with pytest.raises(FrozenInstanceError):
        made.a = 2
    with pytest.raises(FrozenInstanceError):
        del made.a
    assert replace(made, a=2) == Late(a=2)


@pytest.mark.parametrize("given", [{}, {"a": 1, "x": 2}])
def test_a_wrong_call_is_an_error(given: dict[str, Any]) -> None:
    with pytest.raises(TypeError):
        Late(**given)


def test_what_a_class_looks_at_after_it_is_made_is_looked_at() -> None:
    with pytest.raises(ValueError, match="no name"):
        Named("")


def test_it_can_be_copied_and_sent_to_another_process() -> None:
    made = LateBelow(a=1, c=[2])
    assert pickle.loads(pickle.dumps(made)) == made
    assert copy.deepcopy(made) == made
    assert copy.deepcopy(made).c is not made.c


def test_a_part_of_values_is_the_part_and_what_is_not_given_is_none() -> None:
    assert part_of(Late, {"a": 1, "b": "b", "c": []}) == Late(a=1)
    assert part_of(Late, {"a": 1}).b is None


@part(frozen=True, slots=True)
class WithItsOwn:
    x: float

    def __eq__(self, other: object) -> bool:
        return isinstance(other, WithItsOwn)

    def __hash__(self) -> int:
        return 7

    def __repr__(self) -> str:
        return "own"


def test_methods_of_its_own_stay() -> None:
    assert (WithItsOwn(1.0) == WithItsOwn(2.0), hash(WithItsOwn(1.0)), repr(WithItsOwn(1.0))) == (True, 7, "own")
