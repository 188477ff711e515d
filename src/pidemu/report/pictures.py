"""The pictures of a certificate, as SVG to stand inside a page. Matplotlib is imported when one is drawn."""

from __future__ import annotations

import io
import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.formatting import number
from pidemu.law.rational import Response
from pidemu.report.curves import Bode, ClosedLoops, StepResponses, Trace, Who

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_WIDTH: Final = 7.4
"""Width of all pictures [in]: that of the text on an A4 page."""
_STYLE: Final[dict[str, Any]] = {
    "svg.fonttype": "none",
    "text.parse_math": False,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 7.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e2e2e2",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 3.2,
    "path.simplify_threshold": 0.2,
}
_LOOKS: Final[Mapping[Who, dict[str, Any]]] = {
    "source": {"color": "#7fa8cf", "linewidth": 2.6},
    "target": {"color": "#a3290f", "linewidth": 1.2, "linestyle": (0, (5, 2))},
    "textbook": {"color": "#444444", "linewidth": 0.8, "linestyle": (0, (1, 1.5))},
}
"""Pale and thick, dark and dashed, thin and dotted: told apart without colours too, and where one lies on the other."""
_MANY: Final = 700
"""Samples from which the envelope of a signal is drawn."""
_ROOM: Final = 1.5
"""How far beyond the source's usual range a window goes, in such ranges: a spike of one scan is cut off there, its end written."""


def bode_picture(b: Bode, names: Mapping[Who, str]) -> str:
    """Return the picture of both feedback paths, and of the target's per the source's, as an SVG element.

    Parameters
    ----------
    b : Bode
        The responses.
    names : mapping
        What to call source and target.
    """
    with _style("bode"):
        figure, axes = _figure(2.75, 2, 2, sharex=True)
        left, right = axes[:, 0], axes[:, 1]
        sides: tuple[tuple[Who, Response], ...] = (("source", b.source), ("target", b.target))
        for who, response in sides:
            left[0].semilogx(b.w, _decibels(response), label=names[who], **_LOOKS[who])
            left[1].semilogx(b.w, _degrees(response), **_LOOKS[who])
        for axis, values, least in ((right[0], _decibels(b.ratio), 0.5), (right[1], _degrees(b.ratio), 5.0)):
            axis.semilogx(b.w, values, color="#222222", linewidth=1.2)
            axis.axhline(0.0, color="#222222", linewidth=0.5)
            _at_least(axis, values, least)
        for axis in axes.flat:
            axis.axvspan(*b.loop_band, color="#eeeeee", linewidth=0, zorder=0)
            for w in {w for w in b.nyquist if w <= b.w[-1] * (1 + 1e-9)}:
                axis.axvline(w, color="#555555", linewidth=0.8, linestyle=(0, (4, 2, 1, 2)))
            axis.set_xlim(b.w[0], b.w[-1] * (1.06 if b.nyquist else 1.0))
            axis.xaxis.set_major_formatter(lambda x, _: number(x))
            axis.minorticks_off()
        titles = ("gain [dB]", "phase [deg]", "gain, target per source [dB]", "phase, target less source [deg]")
        for axis, title in zip((*left, *right), titles, strict=True):
            axis.set_title(title)
        for axis in axes[1]:
            axis.set_xlabel("frequency [rad/s]")
        marks = [_patch("loop band")] + ([_mark("Nyquist: half the scan rate")] if b.nyquist else [])
        return _svg(figure, "bode", left[0], marks)


def responses_picture(r: StepResponses, names: Mapping[Who, str]) -> str:
    """Return the picture of the emulated controllers' outputs after two steps, as an SVG element.

    Parameters
    ----------
    r : StepResponses
        The outputs.
    names : mapping
        What to call source, target and textbook rule.
    """
    with _style("responses"):
        figure, axes = _figure(1.75, 1, 2)
        pairs = (("setpoint", r.setpoint), ("measurement", r.measurement))
        for axis, (moves, traces) in zip(axes[0], pairs, strict=True):
            _draw(axis, traces, names)
            axis.set_title(f"output [%] after a {moves} step of {number(r.size, 3)} %")
            axis.set_xlabel("time [s]")
        return _svg(figure, "responses", axes[0, 0])


def loops_picture(c: ClosedLoops, names: Mapping[Who, str]) -> str:
    """Return the picture of both closed loops, as an SVG element.

    Parameters
    ----------
    c : ClosedLoops
        The signals.
    names : mapping
        What to call source and target.
    """
    with _style("loops"):
        figure, axes = _figure(1.75, 1, 2)
        for axis, traces, what in zip(axes[0], (c.measurement, c.output), ("measurement (PV) [%]", "output [%]"), strict=True):
            _draw(axis, traces, names)
            axis.set_title(what)
            axis.set_xlabel("time [s]")
            low, high = axis.get_ylim()
            axis.set_ylim(low - 0.16 * (high - low), high)  # room for the words
            for at, word in ((c.setpoint_at, "setpoint"), (c.load_at, "load")):
                axis.axvline(at, color="#555555", linewidth=0.6, linestyle=(0, (2, 2)), zorder=0.5)
                axis.annotate(
                    f"{word} +{number(c.size)} %",
                    (at, 0),
                    (2, 2),
                    ("data", "axes fraction"),
                    "offset points",
                    fontsize=6.5,
                    color="#555555",
                )
        return _svg(figure, "loops", axes[0, 0])


def _style(name: str) -> Any:
    from matplotlib import rc_context

    return rc_context({**_STYLE, "svg.hashsalt": f"pidemu {name}"})  # type: ignore[dict-item]  # the same picture, the same bytes


def _figure(height: float, rows: int, columns: int, *, sharex: bool = False) -> tuple[Figure, Any]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure, figure.subplots(rows, columns, sharex=sharex, squeeze=False)


def _decibels(values: Response) -> Floats:
    with np.errstate(divide="ignore"):
        found: Floats = 20 * np.log10(np.abs(values))
    return np.where(np.isfinite(found), found, np.nan)


def _degrees(values: Response) -> Floats:
    found = np.full(values.size, np.nan)
    known = np.isfinite(values)
    found[known] = np.degrees(np.unwrap(np.angle(values[known])))
    return found


def _at_least(axis: Axes, values: Floats, least: float) -> None:
    """Show zero and what the values cover, or as much as is worth seeing: rounding shall look like nothing."""
    known = values[np.isfinite(values)]
    low, high = (min(float(known.min()), 0.0), max(float(known.max()), 0.0)) if known.size else (0.0, 0.0)
    margin = max(0.08 * (high - low), (least - (high - low)) / 2)
    axis.set_ylim(low - margin, high + margin)


def _draw(axis: Axes, traces: Sequence[Trace], names: Mapping[Who, str]) -> None:
    """Draw signals, in a window that the source's sets."""
    for trace in traces:
        times, values, look = *_envelope(trace), dict(_LOOKS[trace.who])
        axis.plot(
            times, values, drawstyle="steps-post" if times.size == trace.times.size else "default", label=names[trace.who], **look
        )
    axis.set_xlim(0.0, min(float(t.times[-1]) for t in traces))
    own = traces[0].values[np.isfinite(traces[0].values)]
    low, high = np.percentile(own, (1, 99)) if own.size else (0.0, 1.0)
    room = max(float(high - low), 0.02)
    bottom, top = _ends(t.values for t in traces)
    shown = max(bottom, float(low) - _ROOM * room), min(top, float(high) + _ROOM * room)
    margin = 0.06 * max(shown[1] - shown[0], 0.02)
    axis.set_ylim(shown[0] - margin, shown[1] + margin)
    for end, cut, where in ((bottom, bottom < shown[0] - margin, 0), (top, top > shown[1] + margin, 1)):
        if cut:
            words = "grows without end" if not math.isfinite(end) or abs(end) > 1e6 else f"reaches {number(end, 3)} %"
            axis.annotate(
                words,
                (0.99, 0.97 if where else 0.03),
                xycoords="axes fraction",
                ha="right",
                va="top" if where else "bottom",
                fontsize=6.5,
            )


def _ends(curves: Iterable[Floats]) -> tuple[float, float]:
    found = np.concatenate([np.nan_to_num(c, nan=math.inf, posinf=math.inf, neginf=-math.inf) for c in curves])
    return float(found.min()), float(found.max())


def _envelope(trace: Trace) -> tuple[Floats, Floats]:
    """Return a long signal's smallest and largest value from place to place, in their order; a short one as it is."""
    n = trace.times.size
    values = np.clip(np.nan_to_num(trace.values, nan=1e9), -1e9, 1e9)
    if n <= _MANY:
        return trace.times, values
    edges = np.linspace(0, n, _MANY // 2 + 1).astype(int)
    kept: list[int] = []
    for a, b in itertools.pairwise(edges.tolist()):
        part = values[a:b]
        kept += sorted({a, a + int(part.argmin()), a + int(part.argmax())})
    kept.append(n - 1)
    return trace.times[kept], values[kept]


def _patch(label: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(color="#e4e4e4", label=label)


def _mark(label: str) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color="#555555", linewidth=0.8, linestyle=(0, (4, 2, 1, 2)), label=label)


def _svg(figure: Figure, name: str, named: Axes, more: Sequence[Any] = ()) -> str:
    """Return the figure with its legend above, as an SVG element whose ids are no other picture's."""
    handles, _ = named.get_legend_handles_labels()
    figure.legend(handles=[*handles, *more], loc="outside upper left", ncols=5, borderaxespad=0.1)
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = file.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<style type=\"text/css\">.*?</style>|<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.S)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(?:xlink:)?href="#', f'href="#{name}-', text)
    text = text.replace("url(#", f"url(#{name}-").replace("'DejaVu Sans', sans-serif", "sans-serif")
    text = text.replace('xmlns:xlink="http://www.w3.org/1999/xlink" ', "")
    return re.sub(r"\s*\n\s*", "\n", text).strip()
