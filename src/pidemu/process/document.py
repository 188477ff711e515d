"""The form of a process in JSON, as a model: what the documents of fits and relay experiments share."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from pidemu.files.documents import DocumentPart
from pidemu.process.process import Process
from pidemu.process.text import written


class ProcessPart(DocumentPart):
    """A process."""

    gain: float = Field(description="Gain [unit], per second too for an integrator.")
    unit: str = Field(description="Unit of the gain: of the measurement per unit of the output.")
    lags: list[float] = Field(description="Time constants [s], the largest first.")
    integrators: int
    delay: float = Field(description="Dead time [s].")
    text: str = Field(description="The process as `--process` takes it.")


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
