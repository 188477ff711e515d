"""``pidemu bode``."""

from __future__ import annotations

import math

import click

from pidemu.analysis.frequency import LoopResponse, loop_response
from pidemu.cli.common import echo, heading, json_option, number, print_json, table, vendors_option
from pidemu.cli.loop import check_plot, law_scan_option, op_range_option, plot_option, process_option, pv_range_option, settings_of
from pidemu.process.process import parse_process
from pidemu.settings.ranges import SignalRange

_FIGURES = {
    "gain margin": "gain_margin",
    "phase margin [deg]": "phase_margin",
    "delay margin [s]": "delay_margin",
    "crossover [rad/s]": "crossover",
    "Ms": "Ms",
    "Mt": "Mt",
}


@click.command("bode", short_help="A loop over frequency: Bode, Nyquist, gang of four.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@process_option
@law_scan_option
@click.option("--low", type=click.FloatRange(min=0, min_open=True), help="Lowest frequency [rad/s].")
@click.option("--high", type=click.FloatRange(min=0, min_open=True), help="Highest frequency [rad/s].")
@pv_range_option
@op_range_option
@plot_option
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    model: str,
    scan: float | None,
    low: float | None,
    high: float | None,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    picture: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Show the loop of CARD with a process over frequency, and its margins.

    The picture has gain and phase of controller, process and loop (Bode), the loop around -1 with the circles of Ms and Mt
    (Nyquist), and the gang of four: S, PS, CS and T. --low and --high zoom.
    """
    check_plot(picture)
    settings, process = settings_of(card, values, vendors, pv_range, op_range), parse_process(model)
    found = loop_response(settings, process, scan, (low, high))
    if picture is not None:
        from pidemu.records.side_by_side import dials
        from pidemu.report.loop_plots import plot_loop

        at = "" if scan is None else f", scan {number(scan)} s"
        plot_loop(picture, found, f"{settings.card.id}: {dials(settings)}\n{process.text}{at}")
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found, settings.card.title, process.text)
    for note in settings.notes:
        echo(f"note: {note}", err=True)


def _print(found: LoopResponse, title: str, process: str) -> None:
    f = found.figures
    heading(title)
    rows = [["process", process], ["loop", "continuous" if found.scan is None else f"sampled every {number(found.scan)} s"]]
    rows += [[name, "-" if math.isnan(getattr(f, of)) else number(getattr(f, of), 4)] for name, of in _FIGURES.items()]
    table(["", ""], [*rows, ["stable", "yes" if f.stable else "NO"]])
    heading("\nLargest gain in this range")
    largest = [(name, abs(x), found.w) for name, x in found.gang.items()]
    table(
        ["", "", "at [rad/s]"],
        [[n, number(float(x.max()), 4), number(float(w[x.argmax()]), 4)] for n, x, w in largest],
        right=(1, 2),
    )
