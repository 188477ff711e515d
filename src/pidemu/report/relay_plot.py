"""The picture of a relay experiment: the measurement, and the output below."""

from __future__ import annotations

from pathlib import Path

from pidemu.formatting import number
from pidemu.process.relay import RelayTest
from pidemu.report.plots import check_picture, panels, picture_style, save


def plot_relay(path: str | Path, found: RelayTest) -> None:
    """Draw a relay experiment.

    Parameters
    ----------
    path : path
        The picture, ``.png`` or ``.svg``.
    found : RelayTest
        The experiment.

    Raises
    ------
    PidemuError
        The ending is neither, matplotlib is not installed, or the file cannot be written.
    """
    check_picture(path)
    with picture_style():
        title = f"period {number(found.ultimate_period, 4)} s, 4 d/(pi a) = {number(found.ultimate_gain, 4)}"
        figure, axes = panels((3, 1.6), title if found.process is None else f"{found.process}\n{title}")
        axes[0].plot(found.time, found.measurement, color="#0b6bb8", label="measurement (PV)")
        for i, level in enumerate({found.hysteresis, -found.hysteresis}):
            axes[0].axhline(level, color="#222222", linewidth=0.8, linestyle=(0, (5, 3)), label="" if i else "relay switches")
        axes[0].set_ylabel("PV, from rest")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4, fontsize=8)
        axes[1].plot(found.time, found.output, drawstyle="steps-post", color="#d1571c")
        axes[1].set_ylabel("output, from rest")
        axes[1].set_xlabel("time [s]")
        axes[1].set_xlim(float(found.time[0]), float(found.time[-1]))
        save(figure, path)
