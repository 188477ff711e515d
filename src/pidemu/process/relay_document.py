"""The form of a relay experiment in ``pidemu relay --json``; ``python -m tools.regenerate`` makes ``specs/relay.schema.json``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Literal

from pydantic import Field

from pidemu.files.documents import DocumentPart, Number
from pidemu.formatting import json_safe
from pidemu.process.document import ProcessPart, plain_process

if TYPE_CHECKING:
    from pidemu.process.relay import RelayTest

SCHEMA: Final = "pidemu-relay-1"


class RelayDocument(DocumentPart):
    """A relay experiment."""

    schema_: Literal["pidemu-relay-1"] = Field(alias="schema", description="Name and version of this form.")
    ultimate_gain: float = Field(description="4 d/(pi a), output per measurement.")
    ultimate_period: float = Field(description="Period of the oscillation [s].")
    amplitude: float = Field(description="Half of the measurement's swing.")
    high: float = Field(description="What the relay adds to the output at rest.")
    low: float
    hysteresis: float = Field(description="Error at which the relay switches.")
    process: ProcessPart | None = Field(description="First order, or an integrator, with dead time; null where none oscillates so.")
    fitted_gain: Number = Field(description="Ultimate gain of that process.")
    fitted_period: Number = Field(description="Ultimate period of that process [s].")
    notes: list[str]


def plain(found: RelayTest) -> dict[str, Any]:
    """Return an experiment as plain values; see `pidemu.process.relay.RelayTest.to_dict`."""
    names = [name for name in RelayDocument.model_fields if name not in ("schema_", "process")]
    process = None if found.process is None else plain_process(found.process)
    document: dict[str, Any] = json_safe({"schema": SCHEMA, "process": process, **{name: getattr(found, name) for name in names}})
    return document
