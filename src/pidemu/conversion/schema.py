"""The form of ``pidemu convert --json``, for programs that read it: models, and the JSON Schema made from them.

``python -m pidemu.conversion.schema`` in the repository writes ``specs/conversion.schema.json``; a test fails while it is not
current.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel, TypeAdapter

from pidemu.certificate import models
from pidemu.certificate.models import Certificate, Verdict
from pidemu.certificate.proof import Proof
from pidemu.conversion.aim import Match
from pidemu.conversion.beside import Kind as BesideKind
from pidemu.conversion.document import SCHEMA
from pidemu.conversion.questions import Kind

Number = float | Literal["inf", "-inf", "nan"]
"""JSON has no infinity: it is written as a word."""
Name = Annotated[str, Field(max_length=200)]
Line = Annotated[str, Field(max_length=2000)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Day = Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_CERTIFICATE: Final = "Certificate"
_LINES: Final = {"type": "array", "items": {"type": "string"}}


class Part(BaseModel):
    """A part of the document; what it does not name is not in it."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


class Range(Part):
    """The range of a signal, and what a raw scale stands for."""

    low: float
    high: float
    unit: str
    meaning: Range | None = None


class Dial(Part):
    """A dial and its value."""

    value: Number = Field(description="The value, as it is printed.")
    unit: str = Field(description="The card's unit; 1 for a plain ratio.")


class TargetDial(Dial):
    """A dial of the target."""

    unrounded: Number = Field(description="The value before rounding.")


class Side(Part):
    """The settings of one controller."""

    card: Name = Field(description="The card's id.")
    settings: dict[Name, Dial] = Field(description="The dials in use, by name.")
    options: dict[Name, str] = Field(description="Choice by option, all options.")
    pv_range: Range | None = Field(default=None, description="Measurement range, where it was given.")
    op_range: Range | None = Field(default=None, description="Output range, where it was given.")


class Target(Side):
    """The settings that were found."""

    settings: dict[Name, TargetDial] = Field(description="The dials in use, by name.")  # type: ignore[assignment]
    lag_on_pv: Number = Field(description="A first-order lag on the measurement that has to stand in front of the block [s].")


class Card(Part):
    """A target of which nothing but the card is known."""

    card: Name


class AsGiven(Part):
    """The source as it was given: what it takes to make its settings again."""

    card: Name = Field(description="The card's id.")
    settings: dict[Name, Line | float] = Field(description="What was given, a number in the card's unit or a text with a unit.")
    options: dict[Name, Line] = Field(description="Options that were stated.")
    pv_range: Line | None = Field(description="Measurement range, as `--pv-range` takes it.")
    op_range: Line | None = Field(description="Output range.")
    lag_on_pv: float = Field(ge=0, allow_inf_nan=False, description="A lag on the measurement in front of the block [s].")


class Asked(Part):
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


class ConditionPart(Part):
    """An unverified fact that the verdict rests on."""

    card: Name
    path: Name = Field(description="The field of the card.")
    status: Literal["assumed", "inferred"]
    text: str
    why: str = Field(description="What the card says of it.")
    spread: str = Field(description="What else the result would be, over the usual values.")
    headline: bool = Field(description="Whether the verdict itself rests on it.")


class BesidePart(Part):
    """Other settings of the target, beside the answer."""

    kind: BesideKind
    text: str
    to: Side
    how: str = Field(description="Words of the command line that give them.")


class Ranked(Part):
    """One choice of the target's options."""

    changed: dict[Name, str] = Field(description="Options that are not as the card delivers them.")
    verdict: Verdict
    settings: dict[Name, Dial] = Field(default={}, description="The dials; none where the target refuses.")
    feedback: Number | None = Field(default=None, description="Largest deviation in the loop band.")
    setpoint: Number | None = Field(default=None, description="The same of the setpoint path.")


class TextbookPart(Part):
    """What the rule in manuals gives."""

    to: Side | None
    certificate: Any
    reason: str


class FilterPart(Part):
    """A setpoint filter, by ascending powers of s."""

    numerator: list[Number]
    denominator: list[Number]
    text: str


class ActionPart(Part):
    """The loop's action."""

    action: Literal["reverse", "direct"] | None = Field(description="Null where it is not known.")
    text: str = Field(description="What to set on the target, with the error formula.")


class BenchCheckPart(Part):
    """A check at the controller before the cut-over; signs as they are seen."""

    text: str
    step: float = Field(description="Step of the measurement, up; of the error where the action is not known [% of span].")
    jump: float = Field(description="What the output has moved by once the derivative has died out [% of span].")
    kick: float = Field(description="What it moves by at most before that [% of span].")
    settles: float = Field(description="Time after which less than 1 % of the kick is left [s].")
    ramp_per_minute: float = Field(description="How fast it goes on [% of span per minute].")
    action: Literal["reverse", "direct"] | None


class PlanStep(Part):
    """One step of a cut-over."""

    do: str
    set: dict[Name, Any]


class Plan(Part):
    """How to change over without a bump."""

    steps: list[PlanStep]
    bump: Number
    without_plan: Number
    is_bumpless: bool
    resolution: Number
    action: Literal["reverse", "direct"] | None
    action_text: str
    notes: list[str]


class ConversionPart(Part):
    """A conversion with its certificate."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: Name = Field(description="Version of pidemu.")
    date: Day = Field(description="Date of the certificate.")
    cards: dict[Name, Sha256] = Field(description="SHA-256 of the file of each card, by id.")
    request: Asked
    source: Side = Field(alias="from")
    to: Target
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


class Reading(Part):
    """One way to answer a question."""

    value: str
    says: str
    settings: dict[Name, Dial] | None = Field(description="What it leads to; null where the target refuses or more is asked.")
    options: dict[Name, str] | None
    outcome: str = Field(description="Why there are no settings.")
    command: str = Field(description="The command that states it.")
    alike: list[str]


class QuestionPart(Part):
    """Something that only the user can know, and that changes the result."""

    kind: Kind
    about: str
    text: str
    readings: Annotated[list[Reading], Field(max_length=6)]


class QuestionsPart(Part):
    """Questions that have to be answered first."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema")
    source: Side | None = Field(default=None, alias="from")
    to: Card | None = None
    verdict: Literal["question"]
    questions: Annotated[list[QuestionPart], Field(min_length=1)]


class RefusalPart(Part):
    """Why the target cannot do what the source does."""

    schema_: Literal["pidemu-conversion-1"] = Field(alias="schema")
    source: Side | None = Field(default=None, alias="from")
    to: Card | None = None
    verdict: Literal["refused"]
    reason: str
    nearest: ConversionPart | None = Field(description="The nearest settings, as `--allow-approximate` gives them.")
    alternatives: list[str]


class Outcome(RootModel[ConversionPart | QuestionsPart | RefusalPart]):
    """What ``pidemu convert --json`` prints."""


def schema() -> dict[str, Any]:
    """Return the JSON Schema of what ``pidemu convert --json`` prints."""
    plain: dict[str, Any] = Outcome.model_json_schema(by_alias=True, mode="serialization")
    definitions: dict[str, Any] = plain.pop("$defs")
    certificate = TypeAdapter(Certificate)
    certificate.rebuild(_types_namespace={**vars(models), "Proof": Proof})
    figures = certificate.json_schema(mode="serialization")
    definitions |= {**figures.pop("$defs"), _CERTIFICATE: figures}
    definitions["Number"] = {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}
    for name in (*figures_of(figures, definitions), _CERTIFICATE):
        _close(definitions[name])
    definitions["Kick"]["properties"]["ratio"] = {"$ref": "#/$defs/Number", "description": "Target's kick per source's."}
    definitions["Kick"]["required"].append("ratio")
    more = {"feedback_equal": {"type": "boolean"}, "setpoint_equal": {"type": "boolean"}, "text": _LINES}
    definitions["Proof"]["properties"] |= more
    definitions["Proof"]["required"] += list(more)
    reference = {"$ref": f"#/$defs/{_CERTIFICATE}"}
    definitions["ConversionPart"]["properties"]["certificate"] = reference
    definitions["TextbookPart"]["properties"]["certificate"] = {"anyOf": [reference, {"type": "null"}]}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": SCHEMA}
    found: dict[str, Any] = _without_titles({**head, **{k: v for k, v in plain.items() if k != "title"}, "$defs": definitions})
    return found


def figures_of(figures: dict[str, Any], definitions: dict[str, Any]) -> set[str]:
    """Return the names of the definitions that the certificate's figures are made of."""
    found: set[str] = set()
    waiting: list[Any] = [figures]
    while waiting:
        node = waiting.pop()
        if isinstance(node, dict):
            name = str(node.get("$ref", "")).rpartition("/")[2]
            if name and name not in found:
                found.add(name)
                waiting.append(definitions[name])
            waiting += node.values()
        elif isinstance(node, list):
            waiting += node
    return found


def _close(definition: dict[str, Any]) -> None:
    """Require all properties of a dataclass, allow no others, and write infinite numbers as words."""
    definition["required"] = list(definition["properties"])
    definition["additionalProperties"] = False
    definition["description"] = definition.get("description", "").partition("\n")[0]
    definition["properties"] = {name: _numbers(p) for name, p in definition["properties"].items()}


def _numbers(node: Any) -> Any:
    if isinstance(node, dict):
        if node.get("type") == "number":
            return {"$ref": "#/$defs/Number"}
        return {k: _numbers(v) for k, v in node.items() if k != "default"}
    return [_numbers(v) for v in node] if isinstance(node, list) else node


def _without_titles(node: Any) -> Any:
    """Remove the titles that repeat a property's name."""
    if isinstance(node, dict):
        return {k: _without_titles(v) for k, v in node.items() if k != "title" or not isinstance(v, str) or v == SCHEMA}
    return [_without_titles(v) for v in node] if isinstance(node, list) else node


def text() -> str:
    """Return the schema's file."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the schema's file."""
    folder = Path(__file__).resolve().parents[3] / "specs"
    (folder / "conversion.schema.json").write_text(text(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
