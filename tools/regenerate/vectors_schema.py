"""The JSON Schema of ``vectors.json``, which ``pidemu vectors`` writes: ``specs/vectors.schema.json``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pidemu.conversion.schema import Dial, Line, Name, Range
from pidemu.files.documents import DocumentPart, Number
from pidemu.vector_sets.vector_set import INPUTS, SCHEMA
from tools.regenerate.loop_schemas import form

InputName = Literal["sp", "pv", "auto", "manual", "cascade", "track", "external_reset", "feedforward", "hold", "interval"]
assert InputName.__args__ == INPUTS  # type: ignore[attr-defined]


class ChangePart(DocumentPart):
    """Settings that change before a scan."""

    scan: int = Field(description="Before which scan, counted from 0.")
    settings: dict[Name, float] = Field(description="New values, in the units of the dials.")


class EventPart(DocumentPart):
    """Something that happened."""

    scan: int = Field(description="Which scan, counted from 0.")
    kind: Literal["transfer", "settings", "signal", "interval", "state"]
    text: Line
    bump: Number = Field(description="What the output moved by in this scan.")
    scans: int = Field(description="For how many scans in a row.")


class CasePart(DocumentPart):
    """A record with what the controller makes of it; every list has one entry per scan."""

    name: Name
    about: Line
    inputs: dict[InputName, list[Number | None]] = Field(description="Signals; null where there is none.")
    outputs: list[Number]
    changes: list[ChangePart]
    states: dict[Name, list[Number]] = Field(description="What is kept after every scan.")
    events: list[EventPart]


class VectorsPart(DocumentPart):
    """Test vectors of a controller."""

    schema_: Literal["pidemu-vectors-1"] = Field(alias="schema", description="Name and version of this form.")
    pidemu: Name = Field(description="Version of pidemu.")
    hash: str = Field(pattern="^[0-9a-f]{64}$", description="SHA-256 of settings, inputs and outputs.")
    version: Literal[1] = Field(description="Version of the standard cases.")
    card: Name
    settings: dict[Name, Dial]
    options: dict[Name, str]
    pv_range: Range | None = None
    op_range: Range | None = None
    scan: float = Field(description="Scan interval [s].")
    action: Literal["reverse", "direct"]
    limits: list[float | None] = Field(description="Output limits; null where there is none.", min_length=2, max_length=2)
    precision: Literal["float64", "float32"]
    seed: int = Field(description="Seed of the noise.")
    cases: list[CasePart]
    left_out: dict[Name, Line] = Field(description="Why other cases are not there.")


def text() -> str:
    """Return the schema's file."""
    return form(SCHEMA, VectorsPart)
