"""The picture of responses: setpoint and measurement, and the output below; several loops in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.report.plots import COLOURS, check_picture, panels, picture_style, save
from pidemu.simulation.simulate import Simulation

_DASHES: Final = ("-", (0, (6, 2)), (0, (2, 1)), (0, (6, 2, 1, 2)), (0, (1, 1)), (0, (4, 1, 1, 1, 1, 1)))
_LARGEST: Final = 1e6
"""No larger value is drawn [%]."""


def plot_responses(path: str | Path, runs: Sequence[tuple[str, Simulation]], title: str) -> None:
    """Draw closed loops that ran: the measurements with the setpoint of the first, and the outputs below.

    Lines differ in colour and dash, so that they are told apart in black and white.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    runs : sequence of (str, Simulation)
        The loops, each with its name in the legend; loops may share one.
    title : str
        Heading.

    Raises
    ------
    PidemuError
        The ending is neither, matplotlib is not installed, or the file cannot be written.
    """
    check_picture(path)
    with picture_style():
        figure, (upper, lower) = panels((3, 2), title)
        first = runs[0][1]
        upper.plot(first.times, first.setpoint, drawstyle="steps-post", color="#444444", linewidth=1.0, label="setpoint")
        for i, (name, run) in enumerate(runs):
            looks = {"color": COLOURS[i % len(COLOURS)], "linestyle": _DASHES[i % len(_DASHES)]}
            upper.plot(run.times, _drawn(run.measurement), label=name, **looks)  # type: ignore[arg-type]
            lower.plot(run.times, _drawn(run.output), drawstyle="steps-post", **looks)  # type: ignore[arg-type]
        upper.set_ylabel("measurement [%]")
        upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2, fontsize=8)
        lower.set_ylabel("output [%]")
        lower.set_xlabel("time [s]")
        lower.set_xlim(0.0, max(float(run.times[-1]) for _, run in runs))
        save(figure, path)


def _drawn(values: Floats) -> Floats:
    return np.clip(np.where(np.isnan(values), np.inf, values), -_LARGEST, _LARGEST)
