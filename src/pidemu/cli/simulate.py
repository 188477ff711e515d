"""``pidemu simulate``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any, Final

import click

from pidemu.analysis.loop_figures import LoopFigures
from pidemu.backends.choice import Choice, checked
from pidemu.backends.engine_names import Engine
from pidemu.card.library import load_card
from pidemu.certificate.figures import other_units, unit_of
from pidemu.cli.common import (
    OutputArgument,
    PairArgument,
    TimeArgument,
    asked_for,
    assignments,
    echo,
    engine_option,
    given,
    heading,
    json_option,
    load_option,
    number,
    print_json,
    setpoint_option,
    table,
    vendors_option,
)
from pidemu.cli.inputs import inputs
from pidemu.cli.loop import check_plot, plot_option
from pidemu.cli.responses import controller_in_words, name_of, plain_responses, print_responses, short, step_text
from pidemu.errors import RecordError
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import counted
from pidemu.files.writing import beside
from pidemu.fleet.blocks import COLUMNS, figures_of
from pidemu.formatting import json_safe
from pidemu.process.process import parse_process
from pidemu.records.files import Record, write_record
from pidemu.settings.action import Action
from pidemu.settings.settings import Settings
from pidemu.simulation.noise import Noise
from pidemu.simulation.outcome import margins_of, settled_by, stability_of
from pidemu.simulation.response import ResponseFigures, response_figures
from pidemu.simulation.simulate import Simulation, run_trial
from pidemu.simulation.surroundings import Surroundings
from pidemu.simulation.trial import Trial, trial
from pidemu.simulation.valve import read_valve

_ACTIONS: Final[Mapping[str | None, Action | None]] = {None: None, "reverse": "reverse", "direct": "direct"}
_NAMES: Final = {
    "iae": "IAE",
    "peak": "largest error",
    "travel": "travel of the output",
    "at_low": "at the low limit",
    "at_high": "at the high limit",
    "swing": "range of the error at the end",
    "error": "last error",
}
_SETTLED: Final = {True: "yes", False: "NO", None: "not known"}
_MARGINS: Final = {
    "gain margin": "gain_margin",
    "phase margin [deg]": "phase_margin",
    "delay margin [s]": "delay_margin",
    "crossover [rad/s]": "crossover",
    "Ms": "Ms",
    "Mt": "Mt",
}


@click.command("simulate", short_help="Run a card in a closed loop with a process.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option(
    "--process",
    "model",
    required=True,
    metavar="gain=...,lag=...,delay=...",
    help="The process, from output to measurement (times in s, or with a unit).",
)
@click.option(
    "--scan",
    type=TimeArgument(),
    help="Scan interval [s]; by default the card's, or a twentieth of the time in which the loop moves where that is shorter.",
)
@setpoint_option
@load_option
@click.option("--time", type=TimeArgument(), help="Length of the run; by default long enough for both responses to settle.")
@click.option("--action", type=click.Choice(["reverse", "direct"]), help="By default that of negative feedback.")
@click.option("--limits", type=PairArgument(), help="Output limits [%]; by default the card's, 0 to 100 where it has none.")
@click.option("--setpoint-ramp", type=TimeArgument(), help="How long the setpoint takes to move; by default it steps.")
@click.option("--load-ramp", type=TimeArgument(), help="How long the load takes to move; by default it steps.")
@click.option(
    "--load-process",
    metavar="gain=...,lag=...",
    help="The load's own way to the measurement, gain=1 for a load at the measurement; by default it adds to the output.",
)
@click.option("--noise", type=float, metavar="SIZE", help="Standard deviation of noise on the measurement [%].")
@click.option("--noise-lag", type=TimeArgument(), help="Time constant of a lag that the noise went through; else it is white.")
@click.option("--seed", type=int, default=0, show_default=True, help="Which noise.")
@click.option(
    "--valve",
    metavar="deadband=...,stiction=...,resolution=...,rate=...",
    help="A valve between output and process [%, %, %, %/s]; --out then has its position, too.",
)
@engine_option
@click.option(
    "-o",
    "--out",
    "target",
    type=OutputArgument(),
    metavar="FILE.csv",
    help="Write time, setpoint, measurement and output of every scan.",
)
@plot_option
@click.option(
    "--beside",
    "others",
    multiple=True,
    metavar='"CARD NAME=VALUE..."',
    help="Another controller in the same loop, with the same steps: in the picture, and its responses in the table. Repeatable.",
)
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    model: str,
    scan: float | None,
    setpoint: float | tuple[float, float] | None,
    load: float | tuple[float, float] | None,
    time: float | None,
    action: str | None,
    limits: tuple[float, float] | None,
    setpoint_ramp: float | None,
    load_ramp: float | None,
    load_process: str | None,
    noise: float | None,
    noise_lag: float | None,
    seed: int,
    valve: str | None,
    engine: str | None,
    target: str | None,
    picture: str | None,
    others: tuple[str, ...],
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run CARD with the settings NAME=VALUE in a closed loop with a process, from rest at 50 %, and print its figures.

    Errors count from the load step on, or from the start where there is none. The measurement has settled where the error moves
    over less than 5 % of its largest value in the last fifth of the run. The margins are those of the sampled loop within limits.
    """
    settings, process = load_card(card, vendors).settings(assignments(values)), parse_process(model)
    read = inputs()
    check_outputs({"--out": target}, RecordError, read)  # now, and not after the work
    check_plot(picture)
    further = [controller_in_words("--beside", words, vendors) for words in others]
    forced, kind = checked(asked_for(engine)), _ACTIONS[action]
    if noise is None and noise_lag is not None:
        raise click.UsageError("--noise-lag without --noise: give the standard deviation of the noise, such as --noise 0.5")
    made = trial(
        settings,
        process,
        scan,
        time=time,
        action=kind,
        output_limits=limits,
        noise=None if noise is None else Noise(noise, noise_lag or 0.0, seed),
        valve=None if valve is None else read_valve(valve),
        load_process=None if load_process is None else parse_process(load_process),
        durations=(setpoint_ramp or 0.0, load_ramp or 0.0),
        **given(setpoint=setpoint, load=load),
    )
    run = run_trial(made, forced)
    runs = [run, *(_in_the_same_loop(s, run, scan, forced) for s in further)]
    if picture is not None:
        from pidemu.report.response_plot import plot_responses

        plot_responses(picture, [(name_of(r.settings), r) for r in runs], process.text)
    pv, out, choice = run.measurement, run.output, run.engine
    if target is not None:
        columns = {"time": made.times, "setpoint": made.setpoint, "measurement": pv, "output": out}
        columns |= {} if run.valve is None else {"valve": run.valve}
        with beside(target, RecordError, read) as stream:
            write_record(Record(made.setpoint, pv, rows=((),) * made.scans), columns, stream)
    figures, responses = figures_of(made, pv, out), response_figures(run)
    margins = margins_of(made)
    if as_json:
        beside_it = [{**r.settings.to_dict(), "responses": plain_responses(response_figures(r))} for r in runs[1:]]
        print_json(_plain(made, choice, figures, margins, responses) | ({"beside": beside_it} if beside_it else {}))
    else:
        _print(made, choice if engine else None, figures, margins, responses)
        for r in runs[1:]:
            print_responses(response_figures(r), f"\nResponses of {name_of(r.settings)}")
    for note in (*settings.notes, *_notes(made, kind, margins, settled_by(made, figures))):
        echo(f"note: {note}", err=True)


def _notes(made: Trial, action: Action | None, margins: LoopFigures | None, settled: bool | None) -> Iterator[str]:
    """Yield what should be known beside the figures."""
    if made.note:
        yield made.note
    if action == "direct" and made.settings.equation.action.fixed:
        yield f"{made.settings.card.id} has no choice of action: the sign of the gain decides"
    if margins is None:
        yield "the feedback is positive, so that the loop has no margins; leave --action out, or give the gain the other sign"
    elif not margins.stable:
        yield "the loop is unstable: the figures are those of this run only"
    elif settled is False:
        yield "the measurement had not settled at the end of the run; give a longer --time, or look at the margins"
    if settled is None:
        yield "the run ends before the dead time after the last step is over, and says nothing about settling; give a longer --time"
    for what in made.settings.algorithm(scan=made.scan).too_coarse(made.scan):
        yield f"a scan interval of {number(made.scan)} s is long for these settings: {what}"


def _plain(
    made: Trial, choice: Choice, figures: Mapping[str, float], margins: LoopFigures | None, responses: Sequence[ResponseFigures]
) -> dict[str, Any]:
    """Return everything as plain values, but for the signals."""
    plain = {
        **made.settings.to_dict(),
        "process": made.process.text,
        "scan": made.scan,
        "scans": made.scans,
        "action": made.action,
        "limits": made.limits,
        "setpoint": made.setpoint_step,
        "load": made.load_step,
        **_around_plain(made.around),
        "engine": {"name": choice.engine, "reason": choice.reason},
        "figures": dict(figures),
        "responses": plain_responses(responses),
        "settled": settled_by(made, figures),
        "stable": stability_of(made, margins),
        "margins": None if margins is None else {name: getattr(margins, name) for name in ("stable", *_MARGINS.values())},
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe


def _around_plain(around: Surroundings) -> dict[str, Any]:
    """Return what is around controller and process as plain values; nothing where there is nothing."""
    ramps = {"setpoint": around.setpoint_time, "load": around.load_time}
    load_process = around.load_process and around.load_process.text
    found = {"ramps": any(ramps.values()) and ramps, "load_process": load_process, "noise": around.noise, "valve": around.valve}
    return {name: asdict(x) if is_dataclass(x) else x for name, x in found.items() if x}


def _print(
    made: Trial,
    choice: Choice | None,
    figures: Mapping[str, float],
    margins: LoopFigures | None,
    responses: Sequence[ResponseFigures],
) -> None:
    s, low, high = made.settings, *made.limits
    heading(s.card.title + (f"  [{s.variant.choice_text}]" if s.options else ""))
    rows = [
        [name, number(v.value), unit_of(v), other_units(v), "" if v.given else "card's default"]
        for name, v in s.items()
        if v.active
    ]
    table([""] * 5, rows, right=(1,))
    heading("\nThe loop")
    rows = [
        ["process", made.process.text],
        ["scan", f"{number(made.scan)} s, {counted(made.scans, 'scan')}"],
        ["action", made.action],
        ["output limits", f"{number(low)} to {number(high)} %"],
        ["setpoint step", step_text(made.setpoint_step, made.around.setpoint_time)],
        ["load step", step_text(made.load_step, made.around.load_time)],
        *_around(made.around),
        *([] if choice is None else [["engine", str(choice)]]),
    ]
    table(["", ""], rows)
    heading(f"\nResult, errors from the {'start' if made.load_step is None else 'load step'} on")
    settled = _SETTLED[settled_by(made, figures)]
    rows = [[_NAMES[name], short(x), COLUMNS[name]] for name, x in figures.items()]
    table(["", "", ""], [*rows, ["settled at the end", settled, ""]], right=(1,))
    print_responses(responses, "\nResponses, from each step on")
    if margins is not None:
        heading("\nMargins, sampled and within the limits")
        rows = [[name, short(getattr(margins, attribute))] for name, attribute in _MARGINS.items()]
        table(["", ""], [*rows, ["stable", "yes" if margins.stable else "NO"]], right=(1,))


def _in_the_same_loop(settings: Settings, run: Simulation, scan: float | None, forced: Engine | None) -> Simulation:
    """Return another controller in the loop of a run, with its steps, for as long."""
    around = run.around
    made = trial(
        settings,
        run.process,
        scan,
        setpoint=run.setpoint_step or 0.0,
        load=run.load_step or 0.0,
        time=float(run.times[-1]),
        output_limits=run.limits,
        initial=run.initial,
        noise=around.noise,
        valve=around.valve,
        load_process=around.load_process,
        durations=(around.setpoint_time, around.load_time),
    )
    return run_trial(made, forced)


def _around(around: Surroundings) -> Iterator[list[str]]:
    """Yield a row for each thing that is around controller and process."""
    if around.load_process is not None:
        yield ["load to measurement", around.load_process.text]
    if (noise := around.noise) is not None:
        kind = f"lag {number(noise.lag)} s" if noise.lag else "white"
        yield ["noise", f"{number(noise.deviation)} %, {kind}, seed {noise.seed}"]
    if around.valve is not None:
        yield ["valve", around.valve.text]
