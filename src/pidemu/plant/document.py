"""The form of a job in ``pidemu retrofit --json``; ``python -m tools.regenerate`` makes ``specs/retrofit.schema.json``."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any, Final, Literal

from pydantic import Field

import pidemu
from pidemu.files.documents import DocumentPart, Number
from pidemu.formatting import json_safe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pidemu.plant.decisions import Decisions
    from pidemu.plant.job import RetrofitSummary
    from pidemu.plant.mapping import PlantWords
    from pidemu.plant.rows import RetrofitRow
    from pidemu.plant.rules import PlantRules

SCHEMA: Final = "pidemu-retrofit-1"
LoopClass = Literal["converted", "decision", "error", "skipped"]


class ChoicePart(DocumentPart):
    """A way to answer."""

    answer: str = Field(description="What states it in the decisions file.")
    says: str
    outcome: str = Field(description="What it leads to; empty where that was not worked out.")


class FindingPart(DocumentPart):
    """Something that was found about a loop."""

    code: str
    level: Literal["error", "decision", "flag"]
    text: str
    place: str = Field(description="The cell, or the line.")
    cell: str = Field(description="What it holds.")
    choices: list[ChoicePart]


class AnsweredPart(DocumentPart):
    """What a person decided."""

    tag: str
    rule: str
    answer: str
    name: str
    date: str
    reason: str
    place: str


class ListRange(DocumentPart):
    """A signal range."""

    low: float
    high: float
    unit: str
    meaning: ListRange | None = None


class SourceDial(DocumentPart):
    """A dial of the source: what was read, and from where."""

    value: Number
    unit: str
    place: str
    cell: str
    unit_read: str
    unit_from: str = Field(description="cell, unit column, header, mapping, card or decision.")


class SourcePart(DocumentPart):
    """The loop as it was read."""

    settings: dict[str, SourceDial]
    options: dict[str, str]
    stated: dict[str, str] = Field(description="Options that the list states; the others are the card's.")
    pv_range: ListRange | None
    new_range: ListRange | None
    limits: list[Number] | None
    action: str | None
    mode: str | None
    scan: float | None
    pv_filter: float


class ConversionFigures(DocumentPart):
    """How near the conversion is."""

    match: str
    deviation: Number = Field(description="Largest deviation in the loop band, of 1.")
    gain_db: Number
    phase_deg: Number
    kick_before: Number = Field(description="What a setpoint step of 1 % moves the output by at once, on the source [%].")
    kick_after: Number = Field(description="The same on the target [%].")
    gain_factor: Number = Field(description="What the gain was multiplied by for new ranges.")
    lag_on_pv: float = Field(description="A filter of the measurement that has to be put in front of the block [s].")


class LoopPart(DocumentPart):
    """A loop."""

    file: str
    sheet: str
    row: int = Field(description="Line in sheet or file, from 1.")
    tag: str
    service: str
    area: str
    system: str
    card: str | None
    class_: LoopClass = Field(alias="class")
    codes: list[str]
    findings: list[FindingPart]
    decided: list[AnsweredPart]
    source: SourcePart
    settings: dict[str, Number | str] = Field(description="Everything to set on the target: dials, then options.")
    options: dict[str, str] = Field(description="The options alone.")
    units: dict[str, str] = Field(description="Unit by dial.")
    verdict: str
    figures: ConversionFigures | None
    pasted: dict[str, Number] = Field(description="The target's dials if the source's numbers were carried over by units alone.")
    held: dict[str, str] = Field(description="Options that the rules fixed, with the line of the rules.")
    action: str | None = Field(description="The action in the target's words.")
    scan: list[float] | None = Field(description="Scan intervals of source and target [s].")
    conditions: list[str] = Field(description="Unverified facts of the cards that the verdict rests on.")
    facts: dict[str, Any]


class SkippedPart(DocumentPart):
    """A line that is no loop."""

    file: str
    sheet: str
    row: int
    kind: str
    text: str


class SummaryPart(DocumentPart):
    """The counts."""

    sentence: str
    lines: int
    counts: dict[LoopClass, int]
    verdicts: dict[str, int]
    codes: dict[str, int]
    cards: dict[str, dict[str, int]]
    areas: dict[str, dict[str, int]]


class RetrofitDocument(DocumentPart):
    """A job."""

    schema_: Literal["pidemu-retrofit-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: str
    date: str
    target: str
    cards: dict[str, str] = Field(description="SHA-256 of the file of each card.")
    files: dict[str, str] = Field(description="SHA-256 of each list.")
    made_with: dict[str, str] = Field(description="SHA-256 of mapping, rules and decisions; empty for what was not given.")
    levels: dict[str, str] = Field(description="Codes with another level, as the rules say.")
    notes: list[str]
    summary: SummaryPart
    rows: list[LoopPart]
    skipped: list[SkippedPart]


def job_document(
    rows: Sequence[RetrofitRow],
    summary: RetrofitSummary,
    rules: PlantRules,
    words: PlantWords,
    decisions: Decisions,
    date: datetime.date | None = None,
) -> dict[str, Any]:
    """Return a job as plain values.

    Parameters
    ----------
    rows, summary
        What `pidemu.retrofit` returns.
    rules, words, decisions
        What it was made with.
    date : datetime.date, optional
        The date of the job; by default today.
    """
    used = {row.reading.card.id: row.reading.card.digest for row in rows if row.reading.card is not None}
    plain = {
        "schema": SCHEMA,
        "pidemu": pidemu.__version__,
        "date": (date or datetime.date.today()).isoformat(),
        "target": rules.target.id,
        "cards": {**dict(sorted(used.items())), rules.target.id: rules.target.digest},
        "files": summary.files,
        "made_with": {"mapping": words.digest, "rules": rules.digest, "decisions": decisions.digest},
        "levels": dict(rules.levels),
        "notes": list(summary.notes),
        "summary": {
            "sentence": summary.sentence,
            **{name: getattr(summary, name) for name in ("lines", "counts", "verdicts", "codes", "cards", "areas")},
        },
        "rows": [row.to_dict() for row in rows],
        "skipped": [{"file": s.file, "sheet": s.sheet, "row": s.line, "kind": s.kind, "text": s.text} for s in summary.skipped],
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe
