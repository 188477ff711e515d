"""The card language, version 1: what a card may say.

Every field's description is its reference: ``specs/card-language.md`` and ``specs/card.schema.json`` are generated from here.
"""

from __future__ import annotations

import re
from datetime import date
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError


def _hyphen(name: str) -> str:
    return name.rstrip("_").replace("_", "-")


def _infinity(value: Any) -> Any:
    return float(value) if value in ("inf", "-inf") else value


def _day(value: Any) -> Any:
    if not (isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value)):  # 2026 and 0 are no days
        raise PydanticCustomError("date_type", "not a date")
    return value


class Model(BaseModel):
    """Base of every part of a card: frozen, and nothing but the documented keys."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        alias_generator=_hyphen,
        populate_by_name=False,
        str_strip_whitespace=True,
        defer_build=True,  # parts are built within the whole; by themselves only where they are used
    )


Text = Annotated[str, Field(min_length=1)]
Number = Annotated[
    float,
    Field(strict=True),
    BeforeValidator(_infinity),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf"]}]}),
]
Day = Annotated[date, BeforeValidator(_day)]
Flag = Annotated[bool, Field(strict=True)]
SettingName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]


class Form(StrEnum):
    """How the terms are put together."""

    PARALLEL = "parallel"
    STANDARD = "standard"
    SERIES = "series"


class Rule(StrEnum):
    """What replaces ``s`` when the equation is computed scan by scan."""

    BACKWARD = "backward"
    FORWARD = "forward"
    TRAPEZOIDAL = "trapezoidal"


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
    note: Text | None = Field(
        default=None, description="What kind of witness it is, where that matters (a forum post, third-party code)."
    )


class Evidence(Model):
    """Where a statement of the card comes from, and how sure it is."""

    status: Status = Field(
        description="`documented` (the source says so), `measured` (an output of the real thing shows it), `inferred` "
        "(it follows from something documented) or `assumed` (nobody says so; shown wherever a result rests on it)."
    )
    source: Text | None = Field(default=None, description="Key of an entry under `sources`. Required unless `assumed`.")
    at: Text | None = Field(
        default=None,
        description="Place in the source: page, section, function. Required for `documented` and `measured`.",
    )
    note: Text | None = Field(default=None, description="Why: required for `inferred` and `assumed`.")


class Proportional(Model):
    """The proportional term."""

    on: Literal["error", "pv", "weighted", "none"] = Field(
        description="What the term acts on: `error` (b = 1), `pv` (b = 0), `weighted` (b = `weight`), or `none`: no such term."
    )
    weight: SettingName | Number | None = Field(
        default=None,
        description="Setpoint weight b where `on: weighted`: a number, or the name of the setting that holds it.",
    )
    accumulated: Flag = Field(
        default=False,
        description="Whether a term on PV is accumulated from its value at the start, `P -= kp (y_n - y_{n-1})`, instead of being "
        "`-kp y_n`. With `windup.scheme: clamp-sum` it accumulates into the integral's own sum.",
    )


class WindupNone(Model):
    """The integral goes on whatever the output does."""

    scheme: Literal["none"] = Field(description="Integrate always.")


class WindupClamp(Model):
    """The integral sum is limited."""

    scheme: Literal["clamp", "clamp-sum"] = Field(
        description="`clamp`: limit the integral sum to the output limits, before it is used. `clamp-sum`: the same for "
        "an accumulator "
        "that also holds P on PV."
    )


class WindupGate(Model):
    """Integration stops at a limit."""

    scheme: Literal["freeze", "conditional"] = Field(
        description="`freeze`: no integration that pushes further while the last output is at a limit. `conditional`: no "
        "integration while the output is beyond a limit and the increment would push it further."
    )


class WindupBackCalculation(Model):
    """The integral is pulled back by the amount cut off."""

    scheme: Literal["back-calculation"] = Field(description="After the output: `I += (h/Tt) (u - v)`, v before limits, u after.")
    tracking_time: SettingName | Number | Literal["Ti", "sqrt(Ti Td)"] = Field(
        description="Tracking time Tt: seconds, the name of a setting, `Ti`, or `sqrt(Ti Td)` (`Ti` where there is no derivative)."
    )


class WindupExternalReset(Model):
    """Integral by positive feedback."""

    scheme: Literal["external-reset"] = Field(
        description="The integral is a first-order lag, of the integral time, fed with the limited output less the other terms: it "
        "stands still while the output stands at a limit. Backward and forward rules only."
    )


class WindupVelocity(Model):
    """What the incremental form does by itself."""

    scheme: Literal["velocity"] = Field(
        description="The increment is added to the last limited output; nothing else is done. Required, and only allowed, with "
        "`implementation: velocity`."
    )


Windup = Annotated[
    WindupNone | WindupClamp | WindupGate | WindupBackCalculation | WindupExternalReset | WindupVelocity,
    Field(discriminator="scheme"),
]


class Integral(Model):
    """The integral term."""

    on: Literal["error", "none"] = Field(default="error", description="`error`, or `none`: no such term.")
    rule: Rule = Field(
        description="Scan rule of the integral (specs/equations.md, section 4). `forward` adds this scan's error after the output."
    )
    windup: Windup = Field(description="What happens to the integral at an output limit (specs/equations.md, section 5).")


class Filter(Model):
    """The filter that goes with the derivative."""

    applies_to: Literal["term", "lead-lag", "measurement", "output"] = Field(
        description="`term`: the derivative term alone. `lead-lag` (series form): `(1 + Td s)/(1 + alpha Td s)`. "
        "`measurement`: the whole "
        "measurement path, P and I as well. `output`: the sum of the terms."
    )
    order: Literal[1, 2] = Field(
        default=1,
        description="1: `1/(1 + Tf s)`. 2: Butterworth, `1/(1 + Tf s + Tf^2 s^2/2)`, on the measurement only.",
    )
    ratio: SettingName | Number | None = Field(
        default=None,
        description="`Tf` as a multiple of the derivative dial's time: a number, or the name of a setting. Exactly one "
        "of `ratio`, `gain`, `time`.",
    )
    gain: SettingName | Number | None = Field(
        default=None, description="Derivative gain N, the inverse of `ratio`: a number, or the name of a setting."
    )
    time: SettingName | Number | None = Field(default=None, description="`Tf` itself: seconds, or the name of a setting.")
    of: Literal["derivative", "effective-derivative"] = Field(
        default="derivative",
        description="The time that `ratio` or `gain` refers to: the derivative setting, or `Ti Td/(Ti + Td)`, the "
        "derivative time of the "
        "equivalent standard form.",
    )
    rule: Rule | None = Field(
        default=None, description="Scan rule of a filter on measurement or output; by default the derivative's rule."
    )


class Derivative(Model):
    """The derivative term."""

    on: Literal["error", "pv", "weighted", "none"] = Field(
        description="What the term acts on: `error` (c = 1), `pv` (c = 0), `weighted` (c = `weight`), or `none`: no such term."
    )
    weight: SettingName | Number | None = Field(
        default=None,
        description="Setpoint weight c where `on: weighted`: a number, or the name of the setting that holds it.",
    )
    rule: Rule = Field(
        default=Rule.BACKWARD,
        description="Scan rule of the filtered derivative (specs/equations.md, section 4). Without a filter the "
        "derivative is the backward difference.",
    )
    filter: Filter | None = Field(default=None, description="The filter; none if absent.")


class Transfer(Model):
    """What happens when the controller is put into automatic."""

    start: Literal["bumpless", "load-output"] = Field(
        description="`bumpless`: the first automatic output equals the last output, `I = u - P - D`. `load-output`: the "
        "integral sum is "
        "loaded with the last output and the terms come on top, a bump of `P + D`."
    )
    derivative: Literal["running", "restarted"] = Field(
        default="running",
        description="`running`: filters and differences go on in manual. `restarted`: they start afresh at the transfer.",
    )


class Setting(Model):
    """A dial."""

    sets: Literal[
        "gain", "multiplier", "integral", "derivative", "filter-time", "filter-ratio", "filter-gain",
        "proportional-weight", "derivative-weight", "tracking-time",
    ] = Field(description="What the dial sets (specs/equations.md, section 1).")  # fmt: skip
    unit: Text = Field(
        description="Unit of a bare number, such as `%/%`, `%` (proportional band), `s/repeat`, `repeat/min`, `1/s`, `min`."
    )
    about: Text | None = Field(default=None, description="The vendor's own name or words for it.")
    default: Number | None = Field(
        default=None,
        description="Value taken when the setting is not given. Either the vendor's delivered value (then with "
        "evidence), or the value that "
        "switches the term off, or leaves it as it is.",
    )
    range: tuple[Number, Number] | None = Field(
        default=None, description="Smallest and largest value, in `unit`; off values may lie outside."
    )
    off: Number | list[Number] | None = Field(
        default=None, description="Value, or values, that switch the term off; the first is used in conversions."
    )
    scope: Literal["loop", "module"] = Field(
        default="loop",
        description="`module`: a setting that many loops share; conversions leave it at its default unless told otherwise.",
    )
    resolution: Annotated[float, Field(gt=0, strict=True)] | None = Field(
        default=None, description="Smallest step of the dial, in `unit`."
    )


class Option(Model):
    """Something the vendor lets you choose per loop."""

    about: Text | None = Field(default=None, description="The vendor's own name or words for it.")
    default: Text = Field(description="The choice taken when none is given.")
    choices: dict[Text, dict[str, Any]] = Field(
        min_length=1,
        description="What each choice changes: the fields of the algorithm that it overlays, as in the card itself. `filter` and "
        "`windup` are replaced whole; null removes a key.",
    )


class ActionExample(Model):
    """One scan that shows which way the output moves, since vendors disagree on the words."""

    name: Text = Field(description="The vendor's word, one of `names`.")
    sp: Number = Field(description="Setpoint; the measurement starts there.")
    pv: Number = Field(description="Measurement at the next scan.")
    output: Literal["rises", "falls"] = Field(description="Which way the output moves.")


class Action(Model):
    """Control action."""

    reverse: Literal["sp - pv", "pv - sp"] = Field(
        default="sp - pv",
        description="The error of a reverse-acting controller with positive gain, as the vendor writes it. `pv - sp` "
        "means the vendor writes the "
        "direct-acting equation and changes the sign elsewhere; the output falls when the measurement rises all the same.",
    )
    names: dict[Literal["reverse", "direct"], Text] = Field(
        description="The vendor's words for reverse acting (output falls when the measurement rises) and direct acting."
    )
    example: ActionExample = Field(description="One scan that shows the meaning of the words; a test runs it.")


class Scan(Model):
    """Scan interval."""

    default: Text = Field(description="Interval used when none is given, such as `1 s`.")


class Output(Model):
    """Output."""

    limits: tuple[Number, Number] = Field(
        description="Output limits used when none are given: % of span, or engineering units with `signals: engineering`."
    )


class Quirk(Model):
    """A fact worth knowing that the equation does not show."""

    text: Text = Field(description="The fact.")
    source: Text | None = Field(default=None, description="Key of an entry under `sources`.")
    at: Text | None = Field(default=None, description="Place in the source.")


class Canonical(Model):
    """Parallel gains and filter time of the feedback path (specs/equations.md, section 3, exact conversion to parallel)."""

    kp: Number = Field(description="Proportional gain [%/%].")
    ki: Number = Field(description="Integral gain [1/s].")
    kd: Number = Field(description="Derivative gain [s].")
    Tf: Number = Field(default=0.0, description="Filter time [s].", alias="Tf")


class Example(Model):
    """Settings and what they amount to; a test runs every one."""

    given: dict[str, str | Number] = Field(description="Settings and options by name.")
    canonical: Canonical = Field(description="The equivalent parallel gains of the feedback path, to six digits.")
    source: Text | None = Field(
        default=None,
        description="Key of an entry under `sources`, where the example is printed; absent if it is our own arithmetic.",
    )
    at: Text | None = Field(default=None, description="Place in the source.")
    note: Text | None = Field(default=None, description="What the example shows.")


class Equation(Model):
    """The fields of a card that make its equation; options overlay them."""

    signals: Literal["percent", "engineering"] = Field(
        default="percent",
        description="Whether the controller computes in percent of span or in engineering units, so that its gains carry them.",
    )
    form: Form = Field(
        description="`parallel`: `kp + ki/s + kd s`. `standard` (ideal, ISA): `K (1 + 1/(Ti s) + Td s)`. `series` (interacting): "
        "`K (1 + 1/(Ti s)) (1 + Td s)`."
    )
    implementation: Literal["positional", "velocity"] = Field(
        description="`positional`: the output is the sum of the terms. `velocity`: their increments are added to the "
        "last limited output."
    )
    proportional: Proportional = Field(description="The proportional term.")
    integral: Integral = Field(description="The integral term.")
    derivative: Derivative = Field(description="The derivative term.")
    transfer: Transfer = Field(description="What happens when the controller is put into automatic.")
    action: Action = Field(description="Control action.")
    scan: Scan = Field(description="Scan interval.")
    output: Output = Field(description="Output.")
    settings: dict[SettingName, Setting] = Field(min_length=1, description="The dials, by the vendor's own names.")


class CardFile(Equation):
    """One PID algorithm of one product."""

    card: Literal[1] = Field(description="Version of the card language.")
    vendor: Text = Field(description="Maker, or the community that keeps the program.")
    product: Text = Field(description="Product line.")
    algorithm: Text = Field(description="The algorithm within the product.")
    about: Text | None = Field(default=None, description="What a reader should know first, in a few sentences.")
    sources: dict[Text, Source] = Field(description="What the card rests on, by a short key.")
    options: dict[SettingName, Option] = Field(default={}, description="What the vendor lets you choose per loop.")
    evidence: dict[Text, Evidence] = Field(
        description="Where each statement comes from: a path in the card, such as `derivative.filter` or "
        "`options.FORM.choices.Series`, "
        "covers everything below it; the longest path wins."
    )
    quirks: list[Quirk] = Field(default=[], description="Facts worth knowing that the equation does not show.")
    examples: list[Example] = Field(min_length=1, description="Settings and what they amount to; every one is run.")
