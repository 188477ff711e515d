"""``pidemu robustness``."""

from __future__ import annotations

import math

import click

from pidemu.analysis.robustness import Robustness, robustness
from pidemu.cli.common import echo, heading, json_option, number, print_json, table, vendors_option
from pidemu.cli.loop import check_plot, law_scan_option, op_range_option, plot_option, process_option, pv_range_option, settings_of
from pidemu.process.process import parse_process
from pidemu.settings.ranges import SignalRange


@click.command("robustness", short_help="How far gain and dead time may change: the robustness plot.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@process_option
@law_scan_option
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
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    picture: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Tell how far gain and dead time of a process may change before its loop with CARD becomes unstable.

    The limit of stability is that of the exact characteristic equation, dead time and scans included. It is drawn over gain ratio
    and delay ratio, the process's values as multiples of those tuned for (Hansen's robustness plot); where it stays outside the
    dashed line, gain and dead time may be off by a factor of two together.
    """
    check_plot(picture)
    settings, process = settings_of(card, values, vendors, pv_range, op_range), parse_process(model)
    found = robustness(settings, process, scan)
    if picture is not None:
        from pidemu.records.side_by_side import dials
        from pidemu.report.loop_plots import plot_robustness

        at = "" if scan is None else f", scan {number(scan)} s"
        plot_robustness(picture, found, f"{settings.card.id}: {dials(settings)}\n{process.text}{at}")
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found, settings.card.title, process.text)
    for note in (*settings.notes, *_notes(found, bool(process.delay))):
        echo(f"note: {note}", err=True)


def _notes(found: Robustness, delayed: bool) -> list[str]:
    notes = [] if found.stable else ["the loop is unstable as it is; the gain limits are those of the nearest stable gains"]
    if not delayed:
        notes.append("the process has no dead time, so that no multiple of it counts; the delay margin says what may be added")
    return notes


def _print(found: Robustness, title: str, process: str) -> None:
    heading(title)
    rows = [
        ["process", process],
        ["loop", "continuous" if found.scan is None else f"sampled every {number(found.scan)} s"],
        ["stable", "yes" if found.stable else "NO"],
        ["the gain may rise to", number(found.gain_margin, 4)],
        ["the gain may fall to", number(found.lower_gain_limit, 4)],
        ["dead time that may be added [s]", number(found.delay_margin, 4)],
        ["Ms", number(found.Ms, 4)],
        ["Mt", number(found.Mt, 4)],
        ["a factor of two on gain and dead time together", "stable" if found.holds_the_aid else "NOT stable"],
    ]
    table(["", ""], rows)
    heading("\nLimit of stability")
    shown = [
        [number(g, 4), number(r, 4)]
        for g, r in zip(found.gain_ratio, found.delay_ratio, strict=True)
        if abs(2 * math.log2(g) - round(2 * math.log2(g))) < 1e-9
    ]
    table(["gain ratio", "delay ratio"], shown, right=(0, 1))
