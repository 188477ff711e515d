"""The loop over frequency: Bode, Nyquist and the gang of four, in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pidemu.analysis.figures import loop_figures
from pidemu.analysis.loop_figures import LoopFigures
from pidemu.analysis.open_loop import OpenLoop
from pidemu.analysis.robustness import refuse_positive_feedback
from pidemu.errors import ProcessError
from pidemu.formatting import json_safe
from pidemu.law.rational import Response
from pidemu.process.process import Process
from pidemu.settings.settings import Settings

Floats = npt.NDArray[np.float64]

SCHEMA: Final = "pidemu-bode-1"
"""Name and version of the form of ``pidemu bode --json``; a change that breaks a reader counts the version up."""
_AROUND: Final = (300.0, 100.0)
"""The default range goes so far below and above the crossover."""
_POINTS: Final = 600


@dataclass(frozen=True)
class LoopResponse:
    """A loop over frequency.

    Attributes
    ----------
    w : ndarray, shape (n,)
        Angular frequencies [rad/s]; of a sampled loop up to ``pi/scan``.
    controller, process : ndarray of complex, shape (n,)
        Responses; of a sampled loop at the scans, the process behind the hold. The controller's sign is that of negative feedback.
    figures : LoopFigures
        Margins, Ms and Mt.
    scan : float or None
        Scan interval [s]; ``None`` for the continuous loop.
    """

    w: Floats
    controller: Response
    process: Response
    figures: LoopFigures
    scan: float | None

    @cached_property
    def loop(self) -> Response:
        """The open loop, ``L = P C``."""
        return np.asarray(self.process * self.controller, dtype=np.complex128)

    @cached_property
    def gang(self) -> dict[str, Response]:
        """The gang of four: ``S``, ``PS``, ``CS`` and ``T``."""
        S = 1 / (1 + self.loop)
        return {"S": S, "PS": self.process * S, "CS": self.controller * S, "T": self.loop * S}

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, the form of ``--json`` (``specs/bode.schema.json``)."""
        parts = {"controller": self.controller, "process": self.process, "loop": self.loop}
        plain: dict[str, Any] = json_safe(
            {
                "schema": SCHEMA,
                "w": self.w.tolist(),
                **{name: {"gain": np.abs(x).tolist(), "phase": degrees(x).tolist()} for name, x in parts.items()},
                "gang_of_four": {name: np.abs(x).tolist() for name, x in self.gang.items()},
                "figures": {
                    name: getattr(self.figures, name)
                    for name in ("stable", "gain_margin", "phase_margin", "delay_margin", "crossover", "Ms", "Mt")
                },
                "scan": self.scan,
            }
        )
        return plain


def degrees(response: Response) -> Floats:
    """Return the phase of a response along the frequencies, without jumps [deg]."""
    return np.asarray(np.degrees(np.unwrap(np.angle(response))), dtype=np.float64)


def loop_response(
    settings: Settings, process: Process, scan: float | None = None, band: tuple[float | None, float | None] = (None, None)
) -> LoopResponse:
    """Return a loop over frequency.

    Parameters
    ----------
    settings : Settings
        Card and settings; the action is that of negative feedback.
    process : Process
        The process.
    scan : float, optional
        Scan interval [s]: the loop at the scans. Without it, the continuous one.
    band : tuple of float, optional
        Lowest and highest frequency [rad/s]; by default far enough around the crossover.

    Raises
    ------
    ProcessError
        The range of frequencies is not one, or the sign of the gain is the action and the wrong one, or the
        process has its gain in other units than %/%.
    """
    law = settings.law(scan)
    process.check_percent()
    refuse_positive_feedback(settings, process)
    figures, loop = loop_figures(law, process), OpenLoop(law, process)
    middle = figures.crossover if math.isfinite(figures.crossover) else 1 / (process.time or 1.0)
    low = middle / _AROUND[0] if band[0] is None else band[0]
    high = max(middle * _AROUND[1], 10 * low if band[0] is not None else 0.0) if band[1] is None else band[1]
    if law.scan is not None:
        high = min(high, math.pi / law.scan)
    if not 0 < low < high < math.inf:
        raise ProcessError(f"frequencies from {low:g} to {high:g} rad/s are not a range; give the lower one first, such as 0.01,10")
    w = np.geomspace(low, high, _POINTS)
    if process.delay and high * process.delay < 60:
        w = np.union1d(w, np.linspace(low, high, _POINTS))  # a dead time turns evenly
    held = process.response(w) if law.scan is None else process.sampled(law.scan).response(w)
    return LoopResponse(w, np.asarray(loop.gain * law.response(w), dtype=np.complex128), held, figures, law.scan)
