"""The form of a fit in ``pidemu fit --json``, as models; ``python -m tools.regenerate`` makes ``specs/fit.schema.json`` from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from pidemu.formatting import json_safe
from pidemu.process.fit.goodness import CONFIDENCE
from pidemu.process.text import written

if TYPE_CHECKING:
    from pidemu.process.fit.fit import ProcessFit
    from pidemu.process.process import Process

SCHEMA: Final = "pidemu-fit-1"
Number = float | Literal["inf", "-inf", "nan"]
"""JSON has no infinity: it is written as a word."""
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FitPart(BaseModel):
    """A part of the document; what it does not name is not in it."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


class ProcessPart(FitPart):
    """A process."""

    gain: float = Field(description="Gain [unit], per second too for an integrator.")
    unit: str = Field(description="Unit of the gain: of the measurement per unit of the output.")
    lags: list[float] = Field(description="Time constants [s], the largest first.")
    integrators: int
    delay: float = Field(description="Dead time [s].")
    text: str = Field(description="The process as `--process` takes it.")


class FiguresPart(FitPart):
    """How the process was found, and how good the fit is."""

    model: Literal["fopdt", "sopdt", "ipdt"]
    method: Literal["least-squares", "tangent", "two-point"]
    start: float = Field(description="Measurement at the first sample without the moves of the output.")
    drift: float = Field(description="How fast it drifts besides [1/s].")
    rms: float = Field(description="Root mean square of the residuals, in units of the measurement.")
    r_squared: float = Field(description="Share of the measurement's variance that the model explains.")
    correlation: float = Field(description="Correlation of neighbouring residuals; noise has none.")
    confidence: float = Field(description="Probability that an interval holds the true number, if the model is true.")
    intervals: dict[str, Pair] = Field(description="By number: gain, start, drift, lag (lag 1, lag 2), delay; none of a curve that was read.")
    samples: int
    moves: int = Field(description="How often the output moves.")
    closed_loop: bool = Field(description="Whether the loop was closed, and moved by its setpoint.")
    notes: list[str]


class FitDocument(FitPart):
    """A fit."""

    schema_: Literal["pidemu-fit-1"] = Field(alias="schema", description="Name and version of this form.")
    process: ProcessPart
    percent: ProcessPart | None = Field(default=None, description="The process in %/%, where ranges were given.")
    fit: FiguresPart


class FitRefusal(FitPart):
    """Why nothing can be fitted."""

    schema_: Literal["pidemu-fit-1"] = Field(alias="schema")
    verdict: Literal["refused"]
    reason: str


def plain_process(process: Process) -> dict[str, Any]:
    """Return a process with real lags as plain values."""
    return {
        "gain": process.gain,
        "unit": process.unit,
        "lags": sorted((-1 / p.real for p in process.poles if p), reverse=True),
        "integrators": process.integrators,
        "delay": process.delay,
        "text": written(process),
    }


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
