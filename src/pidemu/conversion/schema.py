"""The form of a conversion in ``pidemu convert --json``, as models: what `pidemu.verify` reads certificates with.

``python -m tools.regenerate`` in the repository makes ``specs/conversion.schema.json`` from them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from pidemu.certificate.models import Verdict
from pidemu.conversion.beside import Kind as BesideKind
from pidemu.conversion.match_method import Match
from pidemu.files.documents import DocumentPart, Number

Name = Annotated[str, Field(max_length=200)]
Line = Annotated[str, Field(max_length=2000)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Day = Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class Range(DocumentPart):
    """The range of a signal, and what a raw scale stands for."""

    low: float
    high: float
    unit: str
    meaning: Range | None = None


class Dial(DocumentPart):
    """A dial and its value."""

    value: Number = Field(description="The value, as it is printed.")
    unit: str = Field(description="The card's unit; 1 for a plain ratio.")


class TargetDial(Dial):
    """A dial of the target."""

    unrounded: Number = Field(description="The value before rounding.")


class Side(DocumentPart):
    """The settings of one controller."""

    card: Name = Field(description="The card's id.")
    settings: dict[Name, Dial] = Field(description="The dials in use, by name.")
    options: dict[Name, str] = Field(description="Choice by option, all options.")
    pv_range: Range | None = Field(default=None, description="Measurement range, where it was given.")
    op_range: Range | None = Field(default=None, description="Output range, where it was given.")


class TargetSide(Side):
    """The settings that were found."""

    settings: dict[Name, TargetDial] = Field(description="The dials in use, by name.")  # type: ignore[assignment]
    lag_on_pv: Number = Field(description="A first-order lag on the measurement that has to stand in front of the block [s].")


class AsGiven(DocumentPart):
    """The source as it was given: what it takes to make its settings again."""

    card: Name = Field(description="The card's id.")
    settings: dict[Name, Line | float] = Field(description="What was given, a number in the card's unit or a text with a unit.")
    options: dict[Name, Line] = Field(description="Options that were stated.")
    pv_range: Line | None = Field(description="Measurement range, as `--pv-range` takes it.")
    op_range: Line | None = Field(description="Output range.")
    lag_on_pv: float = Field(ge=0, allow_inf_nan=False, description="A lag on the measurement in front of the block [s].")


class Asked(DocumentPart):
    """Everything that was asked for, by the names of the arguments of `pidemu.convert`."""

    source: AsGiven = Field(alias="from")
    to: Name = Field(description="The target's card.")
    options: dict[Name, Line] = Field(description="Options of the target that were stated.")
    given: dict[Name, Line | float] = Field(description="Dials of the target that were given.")
    scan: Pair | None = Field(description="Intervals that source and target compute with [s].")
    runs_every: Pair | None = Field(description="Intervals at which they are really executed, where these are others [s].")
    mode: Literal["auto", "cascade", "both"]
    action: Literal["reverse", "direct"] | None
    to_pv_range: Line | None = Field(description="Measurement range of the target, where it is not the source's.")
    to_op_range: Line | None = Field(description="Output range of the target, where it is not the source's.")
    match: Line | None
    process: Line | None = Field(description="The process, as `--process` takes it.")
    compensate: bool
    digits: int | None
    bias: float | None = Field(description="Output at SP = PV of a loop without integral action [%].")
    limits: Pair | None = Field(description="Output limits of the source [%, or the units that its card computes in].")
    allow_approximate: bool
    assume: bool
    tag: Line


class ConditionPart(DocumentPart):
    """An unverified fact that the verdict rests on."""

    card: Name
    path: Name = Field(description="The field of the card.")
    status: Literal["assumed", "inferred"]
    text: str
    why: str = Field(description="What the card says of it.")
    spread: str = Field(description="What else the result would be, over the usual values.")
    headline: bool = Field(description="Whether the verdict itself rests on it.")


class BesidePart(DocumentPart):
    """Other settings of the target, beside the answer."""

    kind: BesideKind
    text: str
    to: Side
    how: str = Field(description="Words of the command line that give them.")


class Ranked(DocumentPart):
    """One choice of the target's options."""

    changed: dict[Name, str] = Field(description="Options that are not as the card delivers them.")
    verdict: Verdict
    settings: dict[Name, Dial] = Field(default={}, description="The dials; none where the target refuses.")
    feedback: Number | None = Field(default=None, description="Largest deviation in the loop band.")
    setpoint: Number | None = Field(default=None, description="The same of the setpoint path.")


class TextbookPart(DocumentPart):
    """What the rule in manuals gives."""

    to: Side | None
    certificate: Any
    reason: str


class FilterPart(DocumentPart):
    """A setpoint filter, by ascending powers of s."""

    numerator: list[Number]
    denominator: list[Number]
    text: str


class ActionPart(DocumentPart):
    """The loop's action."""

    action: Literal["reverse", "direct"] | None = Field(description="Null where it is not known.")
    text: str = Field(description="What to set on the target, with the error formula.")


class BenchCheckPart(DocumentPart):
    """A check at the controller before the cut-over; signs as they are seen."""

    text: str
    step: float = Field(description="Step of the measurement, up; of the error where the action is not known [% of span].")
    jump: float = Field(description="What the output has moved by once the derivative has died out [% of span].")
    kick: float = Field(description="What it moves by at most before that [% of span].")
    settles: float = Field(description="Time after which less than 1 % of the kick is left [s].")
    ramp_per_minute: float = Field(description="How fast it goes on [% of span per minute].")
    action: Literal["reverse", "direct"] | None


class PlanStep(DocumentPart):
    """One step of a cut-over."""

    do: str
    set: dict[Name, Any]


class Plan(DocumentPart):
    """How to change over without a bump."""

    at: Annotated[list[float], Field(min_length=3, max_length=3)] = Field(
        description="Setpoint, measurement and output at the cut-over, as the old controller shows them."
    )
    steps: list[PlanStep]
    bump: Number
    without_plan: Number
    is_bumpless: bool
    resolution: Number
    action: Literal["reverse", "direct"] | None
    action_text: str
    notes: list[str]


class ConversionPart(DocumentPart):
    """A conversion with its certificate."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: Name = Field(description="Version of pidemu.")
    date: Day = Field(description="Date of the certificate.")
    cards: dict[Name, Sha256] = Field(description="SHA-256 of the file of each card, by id.")
    verification: dict[Name, Literal["V1", "V2", "V3"]] = Field(description="How each card's emulation was verified, by id.")
    request: Asked
    source: Side = Field(alias="from")
    to: TargetSide
    match: Match
    verdict: Literal["exact", "exact-feedback", "approximate"]
    verdicts: dict[Literal["auto", "cascade", "both"], Literal["exact", "exact-feedback", "approximate"]]
    refusal: str = Field(description="Why the target refuses, where these are only the nearest settings.")
    sentence: str
    conditions: list[ConditionPart]
    chosen: dict[Name, str] = Field(description="Options that were chosen automatically and are not as the card delivers them.")
    runner_up: BesidePart | None
    beside: list[BesidePart]
    ranking: list[Ranked]
    certificate: Any
    textbook: TextbookPart
    scan: Pair | None = Field(description="Intervals at which source and target are executed [s].")
    gain_factor: float = Field(description="What the source's gain was multiplied by for new ranges; negative: the action turns.")
    process: str | None
    setpoint_filter: FilterPart | None
    warnings: list[str]
    notes: list[str] = Field(description="How the numbers were read.")
    assumptions: list[str]
    action: ActionPart
    bench_check: BenchCheckPart | None
    at_the_loop: list[str]
    command: str = Field(description="The command that makes the conversion again.")
    transfer_plan: Plan | None = Field(default=None, description="With `--cut-over`.")
