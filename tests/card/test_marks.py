"""Marks on fields of the card language: what bears them, and trees without what they speak of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
import pytest
from pydantic import ConfigDict, TypeAdapter

import pidemu
from pidemu.algorithm.model import Algorithm
from pidemu.card.load import variants
from pidemu.card.model.base import Rule
from pidemu.card.model.integral import IntegralLimits
from pidemu.card.model.marks import AtRest, Beyond, Names, PerScan, fields_of, marked, parts_in, walk, without
from pidemu.card.model.signals import ErrorShape, Setpoint, SignalFilter
from pidemu.card.transfer import Transfer
from pidemu.card.windup.external_reset import FastReturn, WindupExternalReset
from pidemu.checks.runs import plausible
from pidemu.errors import UndefinedError
from pidemu.program.builder import build
from tests.algorithms import EXTERNAL_RESET, algorithm, changed
from tests.helpers import WIDE, outputs

on_every_card = pytest.mark.parametrize("name", pidemu.cards())

FAST = WindupExternalReset(scheme="external-reset", fast_return=FastReturn(factor=4.0, low=10.0, high=90.0))
NOT_LINEAR: dict[str, tuple[dict[str, Any], list[str]]] = {
    "error": ({"error": ErrorShape(shape="gap", band=3.0, gain=0.5)}, ["error: gap of 3"]),
    "error, a deadband": ({"error": ErrorShape(shape="gap", band=3.0)}, ["error: deadband of 3"]),
    "error, squared": ({"error": ErrorShape(shape="squared")}, ["error: squared"]),
    "integral deadband": ({"integral__deadband": 0.5}, ["integral deadband of 0.5"]),
    "integral limits": ({"integral__limits": IntegralLimits(low=-50.0, high="output")}, []),
    "fast return": ({"integral__windup": FAST}, ["integral 4 times as fast on the way back from below 10 or above 90"]),
    "setpoint rate": ({"setpoint__rate": 2.0}, ["setpoint rate limit of 2 per s"]),
    "setpoint rate, both": (
        {"setpoint__rate": 2.0, "setpoint__rate_down": 1.0},
        ["setpoint rate limit of 2 per s", "setpoint rate limit of 1 per s downwards"],
    ),
    "output rate": ({"output__rate": 2.0}, ["output rate limit of 2 per s"]),
    "output deadband": ({"output__deadband": 2.0}, ["output deadband of 2"]),
    "resolution": ({"output__resolution": 0.1}, ["output in steps of 0.1"]),
    "arithmetic": ({"arithmetic__type": "float32"}, ["float32 arithmetic"]),
    "bias": ({"bias": 40.0}, []),
}
"""What makes an algorithm that is not linear, and what is said of it; bias and limits of the integral are no surprise."""


def parts() -> list[type[Any]]:
    """All parts that an algorithm can be made of, of every scheme."""
    found: dict[type[Any], None] = {}
    waiting: list[type[Any]] = [Algorithm]
    while waiting:
        part = waiting.pop(0)
        if part not in found:
            found[part] = None
            waiting += [inner for field in fields_of(part).values() for inner in parts_in(field.annotation)]
    return list(found)


def neutral_fields() -> list[tuple[type[Any], str, Any]]:
    """Part, name and neutral value of every field that has one."""
    beyond = [(part, name, mark.neutral) for part in parts() for name, mark in marked(part, Beyond).items()]
    return beyond + [(part, name, mark.neutral) for part in parts() for name, mark in marked(part, AtRest).items()]


def of_floats(annotation: Any) -> Any:
    """A type with floats in place of what stands for a number."""
    if isinstance(annotation, TypeVar):
        return float
    free = getattr(annotation, "__parameters__", ())
    return annotation[(float,) * len(free)] if free else annotation


def algorithms(name: str) -> Iterator[Algorithm]:
    """A card's algorithms, with every choice of its options that is defined, and every term at work."""
    for variant in variants(pidemu.load_card(name)):
        try:
            yield plausible(variant).algorithm(own_units=True)
        except UndefinedError:
            continue


# --- the fields ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("part", "name", "neutral"), neutral_fields(), ids=[f"{part.__name__}.{name}" for part, name, _ in neutral_fields()]
)
def test_every_neutral_value_is_one_that_its_field_admits(part: type[Any], name: str, neutral: Any) -> None:
    admitted = TypeAdapter(of_floats(fields_of(part)[name].annotation), config=ConfigDict(arbitrary_types_allowed=True))
    assert admitted.validate_python(neutral, strict=True) == neutral


def test_the_fields_with_a_neutral_value_are_those_of_all_parts() -> None:
    found = {(part.__name__, name) for part, name, _ in neutral_fields()}
    assert {
        ("Algorithm", "bias"), ("Arithmetic", "type"), ("ErrorShape", "shape"), ("Setpoint", "rate"), ("Setpoint", "starts"),
        ("Integral", "limits"), ("Integral", "starts"), ("Derivative", "starts"), ("Output", "rate"), ("Transfer", "start"),
        ("WindupExternalReset", "fast_return"),
    } <= found  # fmt: skip


def test_what_is_neutral_is_what_a_card_has_that_says_nothing_of_it() -> None:
    """But for what every card says: how the integral starts, and the arithmetic where it has that section."""
    said = {("Transfer", "start"), ("Arithmetic", "type")}
    fields = [f for f in neutral_fields() if f[0] is not Algorithm and (f[0].__name__, f[1]) not in said]
    assert {(p.__name__, n): neutral for p, n, neutral in fields} == {
        (p.__name__, n): fields_of(p)[n].default for p, n, _ in fields
    }


# --- walk and marked -------------------------------------------------------------------------------------------------


def test_a_walk_yields_path_owner_and_mark_of_every_marked_field_that_is_there() -> None:
    a = algorithm(kp=1.0, windup=FAST)
    found = {path: owner for path, owner, _ in walk(a, Beyond)}
    assert found["bias",] is a
    assert found["setpoint", "rate"] is a.setpoint
    assert found["integral", "windup", "fast_return"] is a.integral.windup
    assert ("integral", "windup", "fast_return") not in {path for path, _, _ in walk(algorithm(kp=1.0), Beyond)}
    for path, owner, mark in walk(a, Beyond):
        assert marked(type(owner), Beyond)[path[-1]] is mark


def test_a_walk_goes_in_the_order_of_the_language() -> None:
    tree = Setpoint(filter=SignalFilter(time="Tf"), rate="RATE")
    assert [path for path, _, _ in walk(tree, Names)] == [("filter", "time"), ("filter", "factor"), ("rate",), ("rate_down",)]


def test_what_names_settings_in_a_card_is_found_by_its_mark() -> None:
    card = pidemu.load_card("generic/standard")
    equation = card.variant({}).equation
    given = {value for path, owner, mark in walk(equation, Names) if (value := getattr(owner, path[-1])) not in mark.words}
    assert {name for name in given if isinstance(name, str)} == {"Tf", "b", "c"}  # the tracking time is Ti by that word


def test_a_mark_that_nothing_bears_marks_nothing() -> None:
    @dataclass(frozen=True)
    class Unknown:
        pass

    kind: Any = Unknown
    a = algorithm(kp=1.0, ki=0.1)
    assert [marked(part, kind) for part in parts()] == [{}] * len(parts())
    assert list(walk(a, kind)) == []
    assert without(a, kind) is a


def test_a_part_has_the_marks_that_its_fields_bear() -> None:
    assert list(marked(SignalFilter, Names)) == ["time", "factor"]
    assert list(marked(SignalFilter, PerScan)) == ["rule"]
    assert list(marked(SignalFilter, Beyond)) == []
    assert marked(Transfer, AtRest)["start"] == AtRest("bumpless")


# --- without what is not linear --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NOT_LINEAR)
def test_what_is_not_linear_is_said_and_left_out_and_nothing_else(name: str) -> None:
    changes, said = NOT_LINEAR[name]
    plain = algorithm(kp=2.0, ki=0.1, kd=1.0, windup=EXTERNAL_RESET, integral__rule=Rule.FORWARD)
    a = changed(plain, **changes)
    assert a.beyond_the_law == said
    assert a.linear.beyond_the_law == []
    linear = changed(a.linear, error=ErrorShape()) if "error" in changes else a.linear  # the idle band and gain may stay
    assert linear == plain


@on_every_card
def test_a_linear_algorithm_of_any_card_has_nothing_beyond_the_law(name: str) -> None:
    for a in algorithms(name):
        linear = a.linear
        assert linear.beyond_the_law == []
        assert [path for path, owner, mark in walk(linear, Beyond) if getattr(owner, path[-1]) != mark.neutral] == []
        assert linear.linear is linear
        assert (linear.kp, linear.ki, linear.kd, linear.Tf) == (a.kp, a.ki, a.kd, a.Tf)


def test_what_is_neutral_already_stays_the_same_object() -> None:
    a = algorithm(kp=1.0, ki=0.1)
    assert without(a, Beyond) is a
    assert without(a, AtRest) is a
    moved = changed(a, setpoint__rate=1.0)
    assert without(moved, Beyond).integral is a.integral


# --- at rest ---------------------------------------------------------------------------------------------------------


def first(a: Algorithm, h: float) -> float:
    """The output of the very first scan, with an error, after an output of 50."""
    program = build(a, h, limits=WIDE, initial_output=50.0)
    return float(outputs(program, np.array([60.0]), np.array([50.0]))[0])


@on_every_card
def test_at_rest_no_cards_algorithm_moves_the_output_in_its_first_scan(name: str) -> None:
    for a in algorithms(name):
        if not (a.ki or a.velocity or a.dahlin is not None):
            continue  # P alone is what it is
        still = changed(a.at_rest, integral__limits=None)  # an integral that may not be as large as it takes
        assert first(still, 0.5) == pytest.approx(50.0, abs=1e-4)  # whole counts, 24 bits


BUMPS: list[tuple[str, Any, dict[str, Any]]] = [
    ("transfer__start", "load-output", {}),
    ("transfer__start", "zero", {}),
    ("transfer__power_up", "zero", {}),
    ("transfer__first_output", "zero", {}),
    ("transfer__first_scan", "holds", {"transfer__start": "load-output"}),
    ("derivative__starts", "zero", {"transfer__start": "load-output"}),
    ("integral__starts", "zero", {"transfer__start": "load-output", "integral__rule": Rule.TRAPEZOIDAL}),
    ("setpoint__starts", "zero", {"transfer__start": "load-output", "setpoint__rate": 1.0}),
]
"""Fields that decide about the first output, a value that moves it, and what else it takes for that."""


@pytest.mark.parametrize(("field", "value", "more"), BUMPS, ids=[f"{field}={value}" for field, value, _ in BUMPS])
def test_what_decides_about_the_first_output_is_left_out_at_rest(field: str, value: Any, more: dict[str, Any]) -> None:
    plain = algorithm(kp=2.0, ki=0.1, kd=1.0, **more)
    moved = changed(plain, **{field: value})
    assert abs(first(moved, 0.5) - first(plain, 0.5)) > 0.1
    assert first(moved.at_rest, 0.5) == pytest.approx(50.0, rel=1e-12)


@on_every_card
def test_at_rest_and_linear_algorithms_differ_in_marked_fields_only(name: str) -> None:
    for a in algorithms(name):
        for kind, other in ((AtRest, a.at_rest), (Beyond, a.linear)):
            before, after = leaves(a), leaves(other)
            allowed = {path for path, _, _ in walk(a, kind)}
            different = {path for path in before.keys() | after.keys() if before.get(path) != after.get(path)}
            assert {path for path in different if not any(path[: len(a)] == a for a in allowed)} == set()
            assert without(other, kind) is other


def leaves(tree: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    """What stands in a tree, by its path."""
    if not is_dataclass(tree):
        return {path: tree}
    return {p: leaf for f in fields(tree) for p, leaf in leaves(getattr(tree, f.name), (*path, f.name)).items()}
