"""The form of a fit in ``pidemu fit --json``; ``python -m tools.regenerate`` makes ``specs/fit.schema.json``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from pidemu.files.documents import DocumentPart, Number
from pidemu.formatting import json_safe
from pidemu.process.document import ProcessPart, plain_process
from pidemu.process.fit.goodness import CONFIDENCE

if TYPE_CHECKING:
    from pidemu.process.fit.fit import ProcessFit

SCHEMA: Final = "pidemu-fit-1"
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FiguresPart(DocumentPart):
    """How the process was found, and how good the fit is."""

    model: Literal["fopdt", "sopdt", "ipdt"]
    method: Literal["least-squares", "tangent", "two-point"]
    start: float = Field(description="Measurement at the first sample without the moves of the output.")
    drift: float = Field(description="How fast it drifts besides [1/s].")
    rms: float = Field(description="Root mean square of the residuals, in units of the measurement.")
    r_squared: float = Field(description="Share of the measurement's variance that the model explains.")
    correlation: float = Field(description="Correlation of neighbouring residuals; noise has none.")
    confidence: float = Field(description="Probability that an interval holds the true number, if the model is true.")
    intervals: dict[str, Pair] = Field(
        description="Of gain, start, drift, lag (lag 1, lag 2) and delay; none of a curve that was read."
    )
    samples: int
    moves: int = Field(description="How often the output moves.")
    closed_loop: bool = Field(description="Whether the loop was closed, and moved by its setpoint.")
    notes: list[str]


class FitDocument(DocumentPart):
    """A fit."""

    schema_: Literal["pidemu-fit-1"] = Field(alias="schema", description="Name and version of this form.")
    process: ProcessPart
    percent: ProcessPart | None = Field(default=None, description="The process in %/%, where ranges were given.")
    fit: FiguresPart


class FitRefusal(DocumentPart):
    """Why nothing can be fitted."""

    schema_: Literal["pidemu-fit-1"] = Field(alias="schema")
    verdict: Literal["refused"]
    reason: str


def plain(found: ProcessFit) -> dict[str, Any]:
    """Return a fit as plain values; see `ProcessFit.to_dict`."""
    names = [name for name in FiguresPart.model_fields if name != "confidence"]
    figures = {name: getattr(found.fit, name) for name in names}
    fit = {**figures, "confidence": CONFIDENCE}
    document: dict[str, Any] = json_safe({"schema": SCHEMA, "process": plain_process(found.process), "fit": fit})
    return document


def plain_refusal(reason: str) -> dict[str, Any]:
    """Return a refusal as plain values."""
    return {"schema": SCHEMA, "verdict": "refused", "reason": reason}
