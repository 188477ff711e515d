"""``pidemu cascade``."""

from __future__ import annotations

from typing import Any

import click

from pidemu.card.library import load_card
from pidemu.cli.common import (
    OutputArgument,
    PairArgument,
    ScanArgument,
    StepArgument,
    TimeArgument,
    assignments,
    echo,
    given,
    heading,
    json_option,
    number,
    print_json,
    setpoint_option,
    table,
    vendors_option,
)
from pidemu.cli.inputs import inputs
from pidemu.cli.loop import check_plot, plot_option
from pidemu.cli.responses import controller_in_words, name_of, plain_responses, print_responses, step_text
from pidemu.errors import RecordError
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import counted
from pidemu.files.writing import beside
from pidemu.formatting import json_safe
from pidemu.process.process import parse_process
from pidemu.records.files import Record, write_record
from pidemu.simulation.cascade import CascadeRun, simulate_cascade
from pidemu.simulation.response import response_figures
from pidemu.simulation.simulate import Simulation
from pidemu.simulation.valve import read_valve


@click.command("cascade", short_help="Run two cards in cascade.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option("--process", "model", required=True, metavar="gain=...,lag=...", help="From the inner measurement to the outer one.")
@click.option("--inner", "words", required=True, metavar='"CARD NAME=VALUE..."', help="The inner controller.")
@click.option(
    "--inner-process",
    "inner_model",
    required=True,
    metavar="gain=...,lag=...",
    help="From the output to the inner measurement.",
)
@click.option("--scan", type=ScanArgument(), help="Scan interval [s], or that of the outer and of the inner controller.")
@setpoint_option
@click.option("--load", type=StepArgument(), help="Step that adds to the inner output [%], or its time and size; by default 10.")
@click.option("--outer-load", type=StepArgument(), help="Step that adds to what enters the outer process [%]; by default none.")
@click.option("--time", type=TimeArgument(), help="Length of the run; by default long enough for both loops to settle.")
@click.option("--limits", type=PairArgument(), help="Limits of the inner output [%]; by default the card's.")
@click.option("--noise", type=float, metavar="SIZE", help="Standard deviation of white noise on the outer measurement [%].")
@click.option("--valve", metavar="deadband=...,rate=...", help="The valve behind the inner output, as of simulate.")
@click.option(
    "-o", "--out", "target", type=OutputArgument(), metavar="FILE.csv", help="Write the signals of every scan of the inner loop."
)
@plot_option
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    model: str,
    words: str,
    inner_model: str,
    scan: float | tuple[float, float] | None,
    setpoint: float | tuple[float, float] | None,
    load: float | tuple[float, float] | None,
    outer_load: float | tuple[float, float] | None,
    time: float | None,
    limits: tuple[float, float] | None,
    noise: float | None,
    valve: str | None,
    target: str | None,
    picture: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run CARD as the outer controller of a cascade: its output is the remote setpoint of the inner one.

    The inner controller is in cascade mode, as its card has it. Everything is in percent of the ranges, from rest at 50 %.
    """
    outer = load_card(card, vendors).settings(assignments(values))
    inner = controller_in_words("--inner", words, vendors)
    read = inputs()
    check_outputs({"--out": target}, RecordError, read)
    check_plot(picture)
    run = simulate_cascade(
        outer,
        inner,
        parse_process(model),
        parse_process(inner_model),
        scan,
        time=time,
        output_limits=limits,
        noise=noise,
        valve=None if valve is None else read_valve(valve),
        **given(setpoint=setpoint, load=load, outer_load=outer_load),
    )
    if picture is not None:
        from pidemu.report.response_plot import plot_responses

        loops = [(f"{name}: {name_of(loop.settings)}", loop) for name, loop in _loops(run)]
        plot_responses(picture, loops, f"{run.inner.process.text}, then {run.outer.process.text}")
    if target is not None:
        with beside(target, RecordError, read) as stream:
            _write(run, stream)
    if as_json:
        print_json({name: _plain(loop) for name, loop in _loops(run)})
    else:
        _print(run)
    for note in (*outer.notes, *inner.notes, run.outer.note, run.inner.note):
        if note:
            echo(f"note: {note}", err=True)


def _loops(run: CascadeRun) -> tuple[tuple[str, Simulation], ...]:
    return ("outer", run.outer), ("inner", run.inner)


def _plain(loop: Simulation) -> dict[str, Any]:
    plain = {
        **loop.settings.to_dict(),
        "process": loop.process.text,
        "scan": loop.scan,
        "action": loop.action,
        "limits": loop.limits,
        "load": loop.load_step,
        "responses": plain_responses(response_figures(loop)),
        "last_error": float(loop.error[-1]),
        "iae": loop.iae,
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe


def _print(run: CascadeRun) -> None:
    for name, loop in _loops(run):
        heading(f"{'' if name == 'outer' else chr(10)}The {name} loop: {name_of(loop.settings)}")
        rows = [
            ["process", loop.process.text],
            ["scan", f"{number(loop.scan)} s, {counted(loop.times.size, 'scan')}"],
            ["action", loop.action],
            ["output limits", f"{number(loop.limits[0])} to {number(loop.limits[1])} %"],
            ["setpoint step", step_text(loop.setpoint_step)] if name == "outer" else ["setpoint", "the output of the outer loop"],
            ["load step", step_text(loop.load_step)],
            *([] if loop.around.valve is None else [["valve", loop.around.valve.text]]),
        ]
        table(["", ""], rows)
        print_responses(response_figures(loop), "")


def _write(run: CascadeRun, stream: Any) -> None:
    """Write the signals at the scans of the inner loop; those of the outer one stand between its scans."""
    outer, inner = run.outer, run.inner
    last = [min(int(t / outer.scan + 1e-9), outer.times.size - 1) for t in inner.times.tolist()]
    columns = {
        "time": inner.times,
        "setpoint": outer.setpoint[last],
        "measurement": outer.measurement[last],
        "inner_setpoint": inner.setpoint,
        "inner_measurement": inner.measurement,
        "output": inner.output,
    }
    columns |= {} if inner.valve is None else {"valve": inner.valve}
    write_record(Record(columns["setpoint"], columns["measurement"], rows=((),) * inner.times.size), columns, stream)
