"""Pictures of a loop: the robustness plot; Bode, Nyquist and the gang of four. One style with the pictures of runs."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pidemu.analysis.frequency import LoopResponse, degrees
from pidemu.analysis.robustness import AID, Robustness
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.writing import beside
from pidemu.report.plots import COLOURS, check_picture, picture_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_GREY: Final = "#777777"
_HIGHEST: Final = 6.0
"""Delay ratios beyond this are not shown."""


def plot_robustness(path: str | Path, found: Robustness, title: str) -> None:
    """Draw the robustness plot: the limit of stability over gain and delay ratio, the cross at 1, and the factor-of-two aid.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    found : Robustness
        What to draw.
    title : str
        Heading.

    Raises
    ------
    PidemuError
        The file cannot be written so, or matplotlib is not installed.
    """
    check_picture(path)
    with picture_style():
        figure = _figure((6.4, 5.4), title)
        axis = figure.subplots()
        g, r = found.gain_ratio, np.minimum(found.delay_ratio, 10 * _HIGHEST)
        axis.fill_between(g, 0, r, color=COLOURS[0], alpha=0.10, linewidth=0)
        axis.plot(g, r, color=COLOURS[0], linewidth=2, label="limit of stability")
        half = np.geomspace(1 / AID, AID, 101)
        upper = AID / np.maximum(half, 1 / half)
        axis.plot(
            np.r_[half, half[::-1]], np.r_[upper, 1 / upper[::-1]], color="#333333", linestyle=(0, (5, 3)), label="a factor of two"
        )
        axis.plot([1], [1], "x", color="black", markersize=9, markeredgewidth=2, label="tuned for")
        axis.set_xlim(float(g[0]), 4.0)
        near = r[(g >= 0.5) & (g <= axis.get_xlim()[1])]
        axis.set_ylim(0, float(np.clip(1.1 * near.max(initial=0.0), 2.5, _HIGHEST)))
        axis.set_xlabel("gain ratio: process gain per gain tuned for")
        axis.set_ylabel("delay ratio: dead time per dead time tuned for")
        axis.text(0.02, 0.02, "stable", transform=axis.transAxes, color=COLOURS[0])
        axis.legend(loc="upper right")
        _write(figure, path)


def plot_loop(path: str | Path, found: LoopResponse, title: str) -> None:
    """Draw a loop: Bode at the left, Nyquist with the circles of Ms and Mt and the gang of four at the right.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    found : LoopResponse
        What to draw.
    title : str
        Heading.

    Raises
    ------
    PidemuError
        As `plot_robustness`.
    """
    check_picture(path)
    with picture_style():
        figure = _figure((11, 7), title)
        (gain, nyquist), (phase, gang) = figure.subplots(2, 2)
        _bode(gain, phase, found)
        _nyquist(nyquist, found)
        for (name, x), dash in zip(found.gang.items(), _DASHES, strict=True):
            gang.plot(found.w, np.abs(x), label=name, linestyle=dash, color=COLOURS[list(found.gang).index(name)])
        _logarithmic(gang)
        gang.set_ylabel("gang of four, gain")
        gang.set_xlabel("frequency [rad/s]")
        gang.legend(loc="best")
        _write(figure, path)


_DASHES: Final[tuple[Any, ...]] = ("-", (0, (6, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))


def _bode(gain: Axes, phase: Axes, found: LoopResponse) -> None:
    parts = {"loop L": found.loop, "controller C": found.controller, "process P": found.process}
    for (name, x), dash, colour in zip(parts.items(), _DASHES[:3], COLOURS, strict=False):
        gain.plot(found.w, np.abs(x), label=name, linestyle=dash, color=colour)
        phase.plot(found.w, degrees(x), linestyle=dash, color=colour)
    _logarithmic(gain)
    _logarithmic(phase, both=False)
    gain.axhline(1, color=_GREY, linewidth=0.8)
    phase.axhline(-180, color=_GREY, linewidth=0.8)
    if found.w[0] < found.figures.crossover < found.w[-1]:
        for axis in (gain, phase):
            axis.axvline(found.figures.crossover, color=_GREY, linewidth=0.8, linestyle=(0, (2, 2)))
    phase.set_ylim(max(-540, float(min(degrees(x).min() for x in parts.values())) - 15), None)
    gain.set_ylabel("gain")
    phase.set_ylabel("phase [deg]")
    phase.set_xlabel("frequency [rad/s]")
    gain.legend(loc="best")


def _nyquist(axis: Axes, found: LoopResponse) -> None:
    """Draw the open loop around -1, with the circles that it touches."""
    L, turn = found.loop, np.linspace(0, 2 * math.pi, 361)
    axis.plot(L.real, L.imag, color=COLOURS[0], linewidth=1.8, label="loop L")
    Ms, Mt = found.figures.Ms, found.figures.Mt
    if math.isfinite(Ms):
        axis.plot(-1 + np.cos(turn) / Ms, np.sin(turn) / Ms, color=COLOURS[1], linestyle=_DASHES[1], label=f"Ms {Ms:.3g}")
    if 1.005 < Mt < math.inf:
        centre, radius = -(Mt**2) / (Mt**2 - 1), Mt / (Mt**2 - 1)
        axis.plot(
            centre + radius * np.cos(turn), radius * np.sin(turn), color=COLOURS[2], linestyle=_DASHES[2], label=f"Mt {Mt:.3g}"
        )
    axis.plot([-1], [0], "x", color="black", markersize=8, markeredgewidth=2)
    axis.axhline(0, color=_GREY, linewidth=0.8)
    axis.axvline(0, color=_GREY, linewidth=0.8)
    axis.set_aspect("equal", adjustable="box")
    axis.set_xlim(-3, 1.5)
    axis.set_ylim(-2.2, 1.2)
    axis.set_xlabel("real part")
    axis.set_ylabel("imaginary part")
    axis.legend(loc="lower right")


def _figure(size: tuple[float, float], title: str) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    width = round(12.5 * size[0])
    lines = [part for line in map(visible, title.split("\n")) for part in textwrap.wrap(line, width, subsequent_indent="    ")]
    figure.suptitle("\n".join(lines), fontsize=9, x=0.01, ha="left")
    return figure


def _logarithmic(axis: Axes, *, both: bool = True) -> None:
    """Scale an axis, or both, by powers of ten, written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_xscale("log")
    if both:
        axis.set_yscale("log")
    for scale in (axis.xaxis, axis.yaxis) if both else (axis.xaxis,):
        scale.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        scale.set_minor_formatter(NullFormatter())


def _write(figure: Figure, path: str | Path) -> None:
    svg = Path(path).suffix.lower() == ".svg"
    with beside(path, PidemuError, binary=True) as stream:
        figure.savefig(stream, format="svg" if svg else "png", dpi=150, metadata={"Date": None} if svg else None)
