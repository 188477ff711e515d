"""The JSON Schemas of ``pidemu tune``, ``optimise``, ``robustness`` and ``bode`` with ``--json``."""

from __future__ import annotations

import json
from typing import Any, Literal

from pydantic import Field, RootModel

from pidemu.analysis import frequency, robustness
from pidemu.conversion.schema import Dial, Line, Name
from pidemu.files.documents import DocumentPart, Number
from pidemu.tuning import optimise, tune

Numbers = list[Number]


class Gains(DocumentPart):
    """Gains of the dials."""

    kp: Number = Field(description="Proportional gain; percent, where ranges are known.")
    ki: Number = Field(description="Integral gain [1/s].")
    kd: Number = Field(description="Derivative gain [s].")
    Tf: Number = Field(description="Filter time [s].")


class Margins(DocumentPart):
    """The loop in figures."""

    stable: bool
    gain_margin: Number
    phase_margin: Number = Field(description="[deg]")
    delay_margin: Number = Field(description="[s]")
    crossover: Number = Field(description="[rad/s]")
    Ms: Number
    Mt: Number


class Figures(Margins):
    """The sampled loop in figures."""

    iae: Number = Field(description="Integral of the absolute error after a load step of 1 % at the process input [% s].")
    scan: float = Field(description="Scan interval [s].")


class TuningPart(DocumentPart):
    """What a rule gives in the dials of a card."""

    schema_: Literal["pidemu-tuning-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: Name = Field(description="Version of pidemu.")
    card: Name
    settings: dict[Name, Dial]
    options: dict[Name, str]
    gains: Gains
    figures: Figures
    action: Literal["reverse", "direct"] = Field(description="The action that makes the feedback negative.")
    rule: Name
    source: Line
    standard: dict[Name, Number] = Field(description="What the rule says: K, Ti and Td of the standard form [s].")
    parameters: dict[Name, Number] = Field(description="Parameters of the rule [s].")
    process: Line
    verdict: Literal["exact", "exact-feedback", "approximate"] = Field(description="How near the dials are to the rule.")
    notes: list[str]


class AllRulesPart(DocumentPart):
    """With ``--all-rules``: what all rules give, sorted."""

    schema_: Literal["pidemu-tuning-1"] = Field(alias="schema")
    card: Name
    process: Line
    rules: list[TuningPart]
    refused: dict[Name, str] = Field(description="Why the other rules give nothing, by rule.")


class OptimalFigures(Figures):
    """The sampled loop in figures, and what was bounded."""

    overshoot: Number | None = None
    output_overshoot: Number | None = None
    decay_ratio: Number | None = None
    noise_gain: Number | None = None
    travel: Number | None = None


class CriterionPart(DocumentPart):
    """What the settings are best by."""

    name: Literal["iae", "ise", "itae", "ie"]
    disturbance: Literal["load", "setpoint"]
    value: Number = Field(description="Per step of 1 %; of several processes the worst.")


class AnswerPart(DocumentPart):
    """What a rule would have given."""

    rule: Name
    criterion: Number
    within_limits: bool
    card: Name
    settings: dict[Name, Dial]
    options: dict[Name, str]
    pv_range: Any = None
    op_range: Any = None


class OptimumPart(DocumentPart):
    """What ``pidemu optimise --json`` prints."""

    schema_: Literal["pidemu-optimum-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: Name = Field(description="Version of pidemu.")
    card: Name
    settings: dict[Name, Dial]
    options: dict[Name, str]
    gains: Gains
    figures: OptimalFigures
    criterion: CriterionPart
    limits: dict[Name, Number] = Field(description="What was not to be exceeded.")
    action: Literal["reverse", "direct"] = Field(description="The action that makes the feedback negative.")
    process: Line
    family: list[Line] = Field(description="Further processes that the settings serve.")
    rules: list[AnswerPart] = Field(description="What every rule that serves would have given, the best first.")


class TuneOutcome(RootModel[TuningPart | AllRulesPart]):
    """What ``pidemu tune --json`` prints."""


class RobustnessPart(DocumentPart):
    """What ``pidemu robustness --json`` prints."""

    schema_: Literal["pidemu-robustness-1"] = Field(alias="schema", description="Name and version of this form.")
    gain_ratio: Numbers = Field(description="Process gains, as multiples of the one tuned for.")
    delay_ratio: Numbers = Field(description="The dead time at which the loop becomes unstable with each, as a multiple.")
    gain_margin: Number = Field(description="The gain may rise to this multiple.")
    lower_gain_limit: Number = Field(description="The gain may fall to this multiple.")
    delay_margin: Number = Field(description="Dead time that may be added [s].")
    Ms: Number
    Mt: Number
    stable: bool
    scan: float | None = Field(description="Scan interval [s]; null for the continuous loop.")


class ResponsePart(DocumentPart):
    """A response over frequency."""

    gain: Numbers
    phase: Numbers = Field(description="[deg]")


class GangPart(DocumentPart):
    """Gains of the gang of four."""

    S: Numbers
    PS: Numbers
    CS: Numbers
    T: Numbers


class BodePart(DocumentPart):
    """What ``pidemu bode --json`` prints."""

    schema_: Literal["pidemu-bode-1"] = Field(alias="schema", description="Name and version of this form.")
    w: Numbers = Field(description="Frequencies [rad/s].")
    controller: ResponsePart
    process: ResponsePart
    loop: ResponsePart
    gang_of_four: GangPart
    figures: Margins
    scan: float | None = Field(description="Scan interval [s]; null for the continuous loop.")


_FORMS: dict[str, tuple[str, Any]] = {
    "tuning": (tune.SCHEMA, TuneOutcome),
    "optimum": (optimise.SCHEMA, OptimumPart),
    "robustness": (robustness.SCHEMA, RobustnessPart),
    "bode": (frequency.SCHEMA, BodePart),
}


def text(name: str) -> str:
    """Return the file of a schema: of ``tuning``, ``optimum``, ``robustness`` or ``bode``."""
    return form(*_FORMS[name])


def form(title: str, model: Any) -> str:
    """Return the file of a schema: its title, and what a model says."""
    plain = model.model_json_schema(by_alias=True, mode="serialization")
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    found = {**head, **{k: v for k, v in plain.items() if k != "title"}}
    return json.dumps(_without_titles(found, title), indent=2, ensure_ascii=False) + "\n"


def _without_titles(node: Any, kept: str) -> Any:
    if isinstance(node, dict):
        return {k: _without_titles(v, kept) for k, v in node.items() if k != "title" or v == kept or not isinstance(v, str)}
    return [_without_titles(v, kept) for v in node] if isinstance(node, list) else node
