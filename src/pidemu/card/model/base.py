"""What every part of a card is made of: the base of the parts, kinds of values, rules, evidence."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import fields
from datetime import date
from enum import StrEnum
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar, cast

from pidemu.card.model.declared import Means, Only, refusal
from pidemu.part import part

SMALLEST: Final = 1e-40
LARGEST: Final = 1e40
"""Sizes between which finite numbers of cards lie, other than 0: those of float32 do, and all of engineering."""


def hyphenated(name: str) -> str:
    """Return the key of a card that a field's name in Python stands for."""
    return name.rstrip("_").replace("_", "-")


def _infinity(value: Any) -> Any:
    return float(value) if value in ("inf", "-inf") else value


def _plausible(value: float) -> float:
    if math.isnan(value):
        raise refusal("not_a_number", "nan is not a number; give one")
    if value and math.isfinite(value) and not SMALLEST <= abs(value) <= LARGEST:
        raise refusal("implausible", f"{value:g} is not a plausible number")
    return value


def _day(value: Any) -> Any:
    if not (isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value)):  # 2026 and 0 are no days
        raise refusal("date_type", "not a date")
    return value


def _line(value: str) -> str:
    if "\n" in value or "\t" in value:
        raise refusal("one_line", "more than one line; a name is one line, without tabs")
    return value


CONFIG: Final = {
    "extra": "forbid",
    "frozen": True,
    "alias_generator": hyphenated,
    "populate_by_name": False,
    "str_strip_whitespace": True,
    "defer_build": True,  # parts are built within the whole; by themselves only where they are used
}
"""How pydantic takes what a card says: nothing but the documented keys, blanks around texts cut off."""


class Part:
    """Base of all that a card is made of: frozen dataclasses, which `pidemu.card.validation` has checked by pydantic.

    An algorithm has many of them in common with the card. Where a card has a number or the name of a setting, the algorithm has the
    number: such a part is generic over `R`, and is ``Setpoint[Reference]`` in a card, ``Setpoint[float]`` in an algorithm.
    """

    __slots__ = ()
    __pydantic_config__: ClassVar[Mapping[str, Any]] = CONFIG


def as_written(value: Any) -> Any:
    """Return a part, or what holds parts, as a card writes it: plain values by the keys of the language, nothing that is absent."""
    if isinstance(value, Part):
        there = {f.name: getattr(value, f.name) for f in fields(cast(Any, value))}
        return {hyphenated(name): as_written(inner) for name, inner in there.items() if inner is not None}
    if isinstance(value, dict):
        return {key: as_written(inner) for key, inner in value.items()}
    return [as_written(inner) for inner in value] if isinstance(value, list | tuple) else value


R = TypeVar("R")
"""What stands for a number: in a card a `Reference`, in an algorithm a number."""


def means(text: str) -> Means:
    """Return what describes a field of a part: the reference of the language is made of it."""
    return Means(text)


Text = Annotated[str, Only(min_length=1, max_length=10_000)]
"""Sentences, in one line or several; `pidemu.card.reading` lets nothing in that cannot be seen."""


Name = Annotated[str, Only(min_length=1, max_length=200, after=_line)]
"""What a thing is called, or where it stands: one line."""


Number = Annotated[
    float,
    Only(strict=True, before=_infinity, after=_plausible, schema={"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf"]}]}),
]


Size = Annotated[float, Only(gt=0, strict=True, allow_inf_nan=False, after=_plausible)]
"""A number above zero."""


Count = Annotated[int, Only(gt=0, le=10**9, strict=True)]


Day = Annotated[date, Only(before=_day)]


Flag = Annotated[bool, Only(strict=True)]


SettingName = Annotated[str, Only(max_length=64, pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


class Form(StrEnum):
    """How the terms are put together."""

    PARALLEL = "parallel"
    STANDARD = "standard"
    SERIES = "series"
    DAHLIN = "dahlin"


class Rule(StrEnum):
    """What replaces ``s`` when the equation is computed scan by scan; the last three are rules of the derivative only."""

    BACKWARD = "backward"
    FORWARD = "forward"
    TRAPEZOIDAL = "trapezoidal"
    EXACT = "exact"
    LAGGED_DIFFERENCE = "lagged-difference"
    FOUR_POINT = "four-point"


GENERAL_RULES: Final = (Rule.BACKWARD, Rule.FORWARD, Rule.TRAPEZOIDAL)
"""Rules of everything that is integrated or filtered."""


GeneralRule = Literal[Rule.BACKWARD, Rule.FORWARD, Rule.TRAPEZOIDAL]


class Status(StrEnum):
    """How sure a statement is."""

    DOCUMENTED = "documented"
    MEASURED = "measured"
    INFERRED = "inferred"
    ASSUMED = "assumed"


@part(frozen=True, slots=True, kw_only=True)
class Source(Part):
    """A document or program that the card rests on."""

    title: Annotated[Text, means("Title of the document, with number and edition; or name and version of the program.")]
    address: Annotated[Text | None, means("Where it can be read: address, document number or repository path.")] = None
    read: Annotated[Day, means("The day it was read.")]
    product: Annotated[
        Text | None,
        means(
            "The product that it is about, where that is another one than the card's. Such a source cannot document or "
            "measure anything of this card; what follows from it is `inferred`."
        ),
    ] = None
    note: Annotated[Text | None, means("What kind of witness it is, where that matters (a forum post, third-party code).")] = None


@part(frozen=True, slots=True, kw_only=True)
class Evidence(Part):
    """Where a statement of the card comes from, and how sure it is."""

    status: Annotated[
        Status,
        means(
            "`documented` (the source says so), `measured` (an output of the real thing shows it), `inferred` (it follows "
            "from something documented) or `assumed` (no source says so; shown wherever a result rests on it)."
        ),
    ]
    source: Annotated[Name | None, means("Key of an entry under `sources`. Required unless `assumed`.")] = None
    at: Annotated[Text | None, means("Place in the source: page, section, function. Required for `documented` and `measured`.")] = (
        None
    )
    note: Annotated[Text | None, means("Why: required for `inferred` and `assumed`.")] = None


Reference = SettingName | Number
"""A number, or the name of the setting that holds it."""


Given = str | float | None
"""A number, the name of the setting that holds it, or nothing."""


def short(given: Given) -> str:
    """Return a number, or the name of a dial, as a data sheet has it."""
    return given if isinstance(given, str) else "-" if given is None else f"{given:g}"
