"""The picture of a fit: record and model, the output below, and what the model leaves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pidemu.formatting import number
from pidemu.process.fit.fit import ProcessFit
from pidemu.report.plots import check_picture, panels, picture_style, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_RECORD, _MODEL, _OUTPUT = "#8a8a8a", "#0b6bb8", "#d1571c"
_POINTS: Final = 400
"""Samples from which they are drawn as a line instead of points."""


def plot_fit(path: str | Path, found: ProcessFit) -> None:
    """Draw a fit.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    found : ProcessFit
        The fit.

    Raises
    ------
    PidemuError
        The ending is neither, matplotlib is not installed, or the file cannot be written.
    """
    check_picture(path)
    fit, unit = found.fit, found.process.unit
    pv, op = ("%", "%") if unit == "%/%" else unit.rsplit("/", 1)
    with picture_style():
        title = f"{found.process}\n{fit.model}, {fit.method}: residuals {number(fit.rms, 3)} {pv} rms"
        figure, axes = panels((3.4, 1.4, 1.4), title)
        many = fit.time.size > _POINTS
        axes[0].plot(
            fit.time,
            fit.measurement,
            linestyle="-" if many else "none",
            marker="" if many else ".",
            markersize=4,
            linewidth=0.8,
            color=_RECORD,
            label="measurement (PV)",
            rasterized=many,
        )
        axes[0].plot(fit.time, fit.simulated, color=_MODEL, linewidth=1.6, label="model")
        axes[0].set_ylabel(f"PV [{pv}]")
        axes[0].legend(loc="best", fontsize=8)
        axes[1].plot(fit.time, fit.output, drawstyle="steps-post", color=_OUTPUT)
        axes[1].set_ylabel(f"output [{op}]")
        axes[2].plot(fit.time, fit.residuals, color=_RECORD, linewidth=0.8, rasterized=many)
        axes[2].axhline(0.0, color="#222222", linewidth=0.6)
        axes[2].set_ylabel(f"PV −\nmodel [{pv}]")
        for axis in axes[1:]:
            _room(axis)
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(float(fit.time[0]), float(fit.time[-1]))
        save(figure, path)


def _room(axis: Axes) -> None:
    """Give values that hardly differ some room, so that rounding is not drawn as large as noise."""
    low, high = axis.get_ylim()
    least = 1e-3 * max(1.0, float(np.abs([low, high]).max()))
    if high - low < least:
        axis.set_ylim((low + high - least) / 2, (low + high + least) / 2)
