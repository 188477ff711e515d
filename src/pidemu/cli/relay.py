"""``pidemu relay``."""

from __future__ import annotations

import math

import click

from pidemu.cli.common import (
    OutputArgument,
    PairArgument,
    TimeArgument,
    echo,
    given,
    heading,
    json_option,
    number,
    print_json,
    table,
)
from pidemu.errors import PidemuError
from pidemu.files.outputs import check_outputs
from pidemu.process.process import parse_process
from pidemu.process.relay import RelayTest, relay_test
from pidemu.process.text import written


@click.command("relay", short_help="Put a relay in place of the controller, and read the oscillation.")
@click.option(
    "--process",
    "model",
    required=True,
    metavar="gain=...,lag=...,delay=...",
    help="The process, from output to measurement (times in s, or with a unit; the gain, too, such as 2 degC/%).",
)
@click.option("--amplitude", type=float, required=True, metavar="D", help="By how much the relay moves the output up and down.")
@click.option("--hysteresis", type=float, metavar="E", help="Error at which it switches; by default three times the noise.")
@click.option("--noise", type=float, default=0.0, metavar="SIGMA", help="Standard deviation of the measurement's noise.")
@click.option("--gain", type=float, metavar="K", help="Static gain for the fitted process; by default the process's own.")
@click.option("--output", type=float, default=50.0, show_default=True, metavar="U", help="Output at rest.")
@click.option("--limits", type=PairArgument(), help="Output limits of the controller; by default none.")
@click.option("--scan", type=TimeArgument(positive=True), help="Interval at which the relay looks; by default it always does.")
@click.option("--plot", "picture", type=OutputArgument(), metavar="FILE.png|svg", help="Draw the oscillation; needs matplotlib.")
@json_option
def command(
    model: str,
    amplitude: float,
    hysteresis: float | None,
    noise: float,
    gain: float | None,
    output: float,
    limits: tuple[float, float] | None,
    scan: float | None,
    picture: str | None,
    as_json: bool,
) -> None:
    """Put a relay in place of the controller of a process, and print the ultimate point and the process that it shows.

    The relay moves the output to U + D and U - D, wherever the error leaves the hysteresis; the oscillation is exact.
    """
    if picture is not None:
        from pidemu.report.plots import check_picture

        check_picture(picture)
    check_outputs({"--plot": picture}, PidemuError)
    more = given(hysteresis=hysteresis, gain=gain, limits=limits, scan=scan)
    found = relay_test(parse_process(model, any_unit=True), amplitude, noise=noise, output=output, **more)
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found)
    for note in found.notes:
        echo(f"note: {note}", err=True)
    if picture is not None:
        from pidemu.report.relay_plot import plot_relay

        plot_relay(picture, found)


def _print(found: RelayTest) -> None:
    heading("The oscillation")
    rows = [
        ["period", number(found.ultimate_period), "s"],
        ["amplitude", number(found.amplitude), "half of the measurement's swing"],
        ["relay", f"{found.high:+.6g} / {found.low:+.6g}", f"hysteresis {number(found.hysteresis)}"],
    ]
    table(["", "", ""], rows)
    heading("\nUltimate point")
    rows = [
        ["by 4 d/(pi a)", number(found.ultimate_gain), number(found.ultimate_period)],
        *(
            []
            if math.isnan(found.fitted_gain)
            else [["of the process below", number(found.fitted_gain), number(found.fitted_period)]]
        ),
    ]
    table(["", "gain", "period [s]"], rows, right=(1, 2))
    if found.process is not None:
        heading(
            "\nProcess of first order that oscillates so" if not found.process.integrators else "\nIntegrator that oscillates so"
        )
        echo(f"  {found.process}")
        echo(f"\n--process '{written(found.process.rounded())}'")
