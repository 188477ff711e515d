"""What the commands on a loop share: a card with settings, and a process."""

from __future__ import annotations

from typing import Any

import click

from pidemu.card.library import load_card
from pidemu.cli.common import OutputArgument, RangeArgument, TimeArgument, assignments, given
from pidemu.cli.inputs import inputs
from pidemu.errors import PidemuError
from pidemu.files.outputs import check_outputs
from pidemu.settings.ranges import SignalRange
from pidemu.settings.settings import Settings

process_option = click.option(
    "--process",
    "model",
    required=True,
    metavar="gain=...,lag=...,delay=...",
    help="The process, from output to measurement (times in s, or with a unit).",
)
law_scan_option = click.option(
    "--scan", type=TimeArgument(positive=True), help="Scan interval [s]: the loop at the scans. Without it, the continuous loop."
)
pv_range_option = click.option("--pv-range", type=RangeArgument(), help='Range of the measurement, such as "0,400 degC".')
op_range_option = click.option("--op-range", type=RangeArgument(), help='Range of the output, such as "0,100 %".')
plot_option = click.option("--plot", "picture", type=OutputArgument(), metavar="FILE", help="Draw it, as .png or .svg.")


def settings_of(
    card: str,
    values: tuple[str, ...],
    vendors: tuple[str, ...],
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
) -> Settings:
    """Return the settings that are given on the command line."""
    named: dict[str, Any] = {**assignments(values), **given(pv_range=pv_range, op_range=op_range)}
    return load_card(card, vendors).settings(named)


def check_plot(picture: str | None) -> None:
    """Refuse a picture that cannot be drawn, before anything is computed."""
    if picture is not None:
        from pidemu.report.plots import check_picture

        check_picture(picture)
        check_outputs({"--plot": picture}, PidemuError, inputs())
