"""What every part of a card is made of: the base model, kinds of values, rules, evidence."""

from __future__ import annotations

import math
import re
from datetime import date
from enum import StrEnum
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

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
        raise PydanticCustomError("not_a_number", "nan is not a number; give one")
    if value and math.isfinite(value) and not SMALLEST <= abs(value) <= LARGEST:
        raise PydanticCustomError("implausible", "{value} is not a plausible number", {"value": f"{value:g}"})
    return value


def _day(value: Any) -> Any:
    if not (isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value)):  # 2026 and 0 are no days
        raise PydanticCustomError("date_type", "not a date")
    return value


def _line(value: str) -> str:
    if "\n" in value or "\t" in value:
        raise PydanticCustomError("one_line", "more than one line; a name is one line, without tabs")
    return value


_CONFIG: Final = ConfigDict(
    extra="forbid",
    frozen=True,
    alias_generator=hyphenated,
    populate_by_name=False,
    str_strip_whitespace=True,
    defer_build=True,  # parts are built within the whole; by themselves only where they are used
)


class Model(BaseModel):
    """Base of what only a card has: frozen, and nothing but the documented keys."""

    model_config = _CONFIG


class Part:
    """Base of what a card and the algorithm that is made of it have alike: frozen dataclasses, and nothing but the documented keys.

    Where a card has a number or the name of a setting, the algorithm has the number: such a part is generic over `R`, and is
    ``Setpoint[Reference]`` in a card, ``Setpoint[float]`` in an algorithm.
    """

    __slots__ = ()
    __pydantic_config__: ClassVar[ConfigDict] = _CONFIG


R = TypeVar("R")
"""What stands for a number: in a card a `Reference`, in an algorithm a number."""


def means(text: str) -> Any:
    """Return what describes a field of a part: the reference of the language is made of it."""
    return Field(description=text)


Text = Annotated[str, Field(min_length=1, max_length=10_000)]
"""Sentences, in one line or several; `pidemu.card.document` lets nothing in that cannot be seen."""


Name = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_line)]
"""What a thing is called, or where it stands: one line."""


Number = Annotated[
    float,
    Field(strict=True),
    BeforeValidator(_infinity),
    AfterValidator(_plausible),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf"]}]}),
]


Size = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False), AfterValidator(_plausible)]
"""A number above zero."""


Count = Annotated[int, Field(gt=0, le=10**9, strict=True)]


Day = Annotated[date, BeforeValidator(_day)]


Flag = Annotated[bool, Field(strict=True)]


SettingName = Annotated[str, Field(max_length=64, pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


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


class Source(Model):
    """A document or program that the card rests on."""

    title: Text = Field(description="Title of the document, with number and edition; or name and version of the program.")
    address: Text | None = Field(default=None, description="Where it can be read: address, document number or repository path.")
    read: Day = Field(description="The day it was read.")
    product: Text | None = Field(
        default=None,
        description="The product that it is about, where that is another one than the card's. Such a source cannot document or "
        "measure anything of this card; what follows from it is `inferred`.",
    )
    note: Text | None = Field(
        default=None, description="What kind of witness it is, where that matters (a forum post, third-party code)."
    )


class Evidence(Model):
    """Where a statement of the card comes from, and how sure it is."""

    status: Status = Field(
        description="`documented` (the source says so), `measured` (an output of the real thing shows it), `inferred` (it follows "
        "from something documented) or `assumed` (no source says so; shown wherever a result rests on it)."
    )
    source: Name | None = Field(default=None, description="Key of an entry under `sources`. Required unless `assumed`.")
    at: Text | None = Field(
        default=None,
        description="Place in the source: page, section, function. Required for `documented` and `measured`.",
    )
    note: Text | None = Field(default=None, description="Why: required for `inferred` and `assumed`.")


Reference = SettingName | Number
"""A number, or the name of the setting that holds it."""


Given = str | float | None
"""A number, the name of the setting that holds it, or nothing."""


def short(given: Given) -> str:
    """Return a number, or the name of a dial, as a data sheet has it."""
    return given if isinstance(given, str) else "-" if given is None else f"{given:g}"
