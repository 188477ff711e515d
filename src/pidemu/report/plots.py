"""Pictures of runs and comparisons. Matplotlib is imported when one is drawn: it is an extra, ``pip install 'pidemu[plot]'``."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.errors import PidemuError
from pidemu.excerpt import visible
from pidemu.files.writing import beside
from pidemu.records.compare import Comparison
from pidemu.records.files import Record
from pidemu.records.playback import Playback, modes, spells
from pidemu.records.side_by_side import dials
from pidemu.records.standard import StandardRecord
from pidemu.settings.ranges import is_limit
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ENDINGS: Final = (".png", ".svg")
COLOURS: Final = ("#0b6bb8", "#d1571c", "#3a8f3d", "#8a4fa3", "#a07a12", "#c2407a")
_SETPOINT, _PV, _QUIET = "#444444", "#0b6bb8", "#777777"
_MANY: Final = 20_000
"""Samples from which a line becomes an image within an SVG."""
_LARGEST: Final = 1e100
"""No larger value is drawn: the ends of an axis, and what lies between them, are to be numbers."""
_SHADES: Final[Mapping[str, str]] = {"manual": "#f0e6c8", "tracking": "#dcebdc", "hold": "#e4e4e4"}
_STYLE: Final = {
    "svg.hashsalt": "pidemu",  # the same picture gives the same file
    "text.parse_math": False,  # a dollar sign is one
    "text.usetex": False,
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
}


Curve = tuple[str, Floats, dict[str, Any]]
"""Name, values and looks of a line."""


def check_picture(path: str | Path) -> None:
    """Refuse a picture that cannot be drawn, before anything is computed for it.

    Raises
    ------
    PidemuError
        The file's ending is neither ``.png`` nor ``.svg``, or matplotlib is not installed.
    """
    if Path(path).suffix.lower() not in ENDINGS:
        raise PidemuError(f"{visible(str(path))}: pictures are written as .png or .svg; give the file such an ending")
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise PidemuError("pictures need matplotlib, which is not installed; pip install 'pidemu[plot]'") from None


def plot_run(path: str | Path, settings: Settings, record: Record, playback: Playback, limits: tuple[float, float]) -> None:
    """Draw a run: setpoint and measurement above, outputs below, and their difference where an output was recorded.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    settings : Settings
        The settings that ran; their summary is the title.
    record : Record
        The record.
    playback : Playback
        What the controller did with it.
    limits : tuple of float
        Output limits.

    Raises
    ------
    PidemuError
        As `check_picture`, or the file cannot be written.

    Notes
    -----
    Where a signal is no number, or larger than 1e100, there is a gap.
    """
    check_picture(path)
    t, unit = playback.times, "%" if settings.equation.signals == "percent" else "units"
    recorded = record.output is not None and np.isfinite(record.output).any()
    with picture_style():
        figure, axes = panels((3, 3, 1.2) if recorded else (3, 3), f"{settings.card.id}: {dials(settings)}")
        _signals(axes[0], t, record, unit)
        outputs: list[Curve] = [("emulated", playback.outputs, {"color": COLOURS[1]})]
        if recorded and record.output is not None:
            outputs.insert(0, ("recorded", record.output, {"color": "#222222", "linewidth": 2.4, "alpha": 0.35}))
            difference = _less(playback.outputs, record.output)
            _line(axes[2], t, difference, color=COLOURS[1])
            axes[2].set_ylabel(f"emulated −\nrecorded [{unit}]")
            _window(axes[2], [difference], (), least=0.1)
        for label, values, look in outputs:
            _line(axes[1], t, values, label=label, **look)
        axes[1].set_ylabel(f"output [{unit}]")
        _window(axes[1], [values for _, values, _ in outputs], limits)
        _finish(figure, axes, t, record, path)


def plot_comparison(path: str | Path, comparison: Comparison) -> None:
    """Draw a comparison: the signals above, the outputs of all controllers, and their differences from the first one's.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    comparison : Comparison
        What to draw.

    Raises
    ------
    PidemuError
        As `check_picture`, or the file cannot be written.
    """
    check_picture(path)
    t, outputs = comparison.times, {visible(label): values for label, values in comparison.outputs.items()}
    first, *others = outputs
    with picture_style():
        figure, axes = panels((2.4, 3, 2), "\n".join(f"{run.label}: {dials(run.settings)}" for run in comparison.runs))
        _signals(axes[0], t, comparison.record, "%")
        for i, (label, values) in enumerate(outputs.items()):
            look = {"linewidth": 1.2} if i else {"linewidth": 2.6, "alpha": 0.45}
            _line(axes[1], t, values, label=label, color=COLOURS[i % len(COLOURS)], **look)
            if i:
                _line(axes[2], t, _less(values, outputs[first]), label=label, color=COLOURS[i % len(COLOURS)], linewidth=1.2)
        axes[1].set_ylabel("output [%]")
        _window(axes[1], list(outputs.values()), comparison.runs[0].limits)
        axes[2].set_ylabel(f"difference from\n{first} [%]")
        _window(axes[2], [_less(outputs[label], outputs[first]) for label in others], (), least=0.1)
        _segments(axes, comparison)
        _finish(figure, axes, t, comparison.record, path)


def picture_style() -> Any:
    """Return the style that all pictures share, to be entered with ``with``."""
    from matplotlib import rc_context

    return rc_context(_STYLE)  # type: ignore[arg-type]


def panels(heights: Sequence[float], title: str) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels above each other, of these heights, under a title of a few lines."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lines = [part for line in map(visible, title.split("\n")) for part in textwrap.wrap(line, 118, subsequent_indent="    ")]
    figure = Figure(figsize=(9, 0.9 * sum(heights) + 0.2 * len(lines) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=list(heights), squeeze=False)[:, 0]
    figure.suptitle("\n".join(lines), fontsize=9, x=0.01, ha="left")
    figure.align_ylabels(list(axes))
    return figure, list(axes)


def _signals(axis: Axes, t: Floats, record: Record, unit: str) -> None:
    """Draw setpoint, cascade setpoint and measurement."""
    shown: list[Curve] = [("setpoint", record.sp, {"color": _SETPOINT, "linewidth": 1.1})]
    if "cascade" in record.signals:
        shown.append(("cascade setpoint", record.signals["cascade"], {"color": COLOURS[3], "linewidth": 1.1}))
    shown.append(("measurement (PV)", record.pv, {"color": _PV}))
    for label, values, look in shown:
        _line(axis, t, values, label=label, **look)
    axis.set_ylabel(f"setpoint, PV [{unit}]")
    _window(axis, [values for _, values, _ in shown], (), least=1.0)


def _line(axis: Axes, t: Floats, values: Floats, **look: Any) -> None:
    """Draw values that hold from scan to scan; the last one to the end of its scan."""
    finite = _drawn(values)
    axis.plot(np.append(t, _end(t)), np.append(finite, finite[-1]), drawstyle="steps-post", rasterized=t.size > _MANY, **look)


def _drawn(values: Floats) -> Floats:
    """Return values, NaN for what cannot be drawn."""
    return np.where(np.isfinite(values) & (np.abs(values) <= _LARGEST), values, np.nan)


def _less(values: Floats, others: Floats) -> Floats:
    with np.errstate(over="ignore", invalid="ignore"):
        return values - others


def _end(t: Floats) -> float:
    """Return when the last scan ends [s]: it lasts as long as the one before."""
    return float(t[-1] + (t[-1] - t[-2] if t.size > 1 else 1.0))


def _window(axis: Axes, curves: Iterable[Floats], limits: Sequence[float], least: float = 0.1) -> None:
    """Show what the curves cover, with some room; output limits, dashed, where the curves come near."""
    found = np.concatenate([c[np.isfinite(c)] for c in map(_drawn, curves)])
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    room = max(high - low, least)
    margin = max(0.07 * (high - low), 0.5 * least)
    near = [x for x in limits if is_limit(x) and low - 0.25 * room <= x <= high + 0.25 * room]
    for i, x in enumerate(near):
        axis.axhline(x, color=_QUIET, linestyle=(0, (5, 4)), linewidth=0.9, label="" if i else "output limit")
    low, high = min([low, *near]), max([high, *near])
    axis.set_ylim(low - margin, high + margin)


def _segments(axes: Sequence[Axes], comparison: Comparison) -> None:
    """Name the segments of the standard record above the first panel."""
    if not isinstance(comparison.record, StandardRecord):
        return
    for segment in comparison.segments:
        for axis in axes:
            axis.axvline(segment.start, color="#c8c8c8", linewidth=0.7, zorder=0.5)
        where = ("data", "axes fraction")
        axes[0].annotate(
            segment.name, (segment.start, 1.0), (2, 2), where, "offset points", fontsize=7, color=_QUIET, rotation=33, va="bottom"
        )


def _finish(figure: Figure, axes: Sequence[Axes], t: Floats, record: Record, path: str | Path) -> None:
    """Shade what is not automatic, put the legends beside the panels, and write the file."""
    seen = modes(record)
    for mode, colour in _SHADES.items():
        for n, (first, last) in enumerate(spells(seen == mode)):
            end = float(t[last + 1]) if last + 1 < t.size else _end(t)
            for axis in axes:
                axis.axvspan(float(t[first]), end, color=colour, linewidth=0, zorder=0, label="" if n else mode)
    for axis in axes:
        handles, names = axis.get_legend_handles_labels()
        if axis is not axes[0]:
            pairs = [(h, n) for h, n in zip(handles, names, strict=True) if n not in _SHADES]
            handles, names = [h for h, _ in pairs], [n for _, n in pairs]
        if len(names) > (axis is axes[-1]):
            axis.legend(handles, names, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4, fontsize=8)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(float(t[0]), _end(t))
    save(figure, path)


def save(figure: Figure, path: str | Path) -> None:
    """Write a picture; the same one gives the same file.

    Raises
    ------
    PidemuError
        The file cannot be written.
    """
    svg = Path(path).suffix.lower() == ".svg"
    with beside(path, PidemuError, binary=True) as stream:
        figure.savefig(stream, format="svg" if svg else "png", dpi=150, metadata={"Date": None} if svg else None)
