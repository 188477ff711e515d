"""``pidemu run``."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from pidemu.arrays import Floats
from pidemu.card.library import load_card
from pidemu.cli.common import (
    OutputArgument,
    action_option,
    asked_for,
    assignments,
    echo,
    engine_option,
    json_option,
    limits_option,
    number,
    print_json,
    vendors_option,
)
from pidemu.cli.events import tell
from pidemu.cli.inputs import inputs
from pidemu.controller.controller import Controller
from pidemu.errors import RecordError, SettingError, suggest
from pidemu.excerpt import printable
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import counted
from pidemu.files.writing import beside
from pidemu.formatting import json_safe
from pidemu.plausible import LEVEL, plain_number, plausible
from pidemu.program.ir import StateRole
from pidemu.records.files import Record, read_record, write_record
from pidemu.records.playback import Playback, Timing, far_out, play, timing
from pidemu.settings.action import Action


@click.command("run", short_help="Run a card on recorded signals.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option(
    "--record",
    "file",
    required=True,
    metavar="FILE.csv",
    help="Recorded signals: columns sp, pv and optionally time, auto, manual, output, cascade, track, external_reset, "
    "feedforward, hold, interval.",
)
@click.option("--scan", type=float, metavar="H", help="Scan interval of record and controller [s]; by default the card's.")
@action_option
@limits_option
@click.option("--bias", type=float, default=0.0, help="Output at zero error of a positional controller without integral action.")
@click.option(
    "--initial-output",
    type=float,
    default=None,
    help="Output before the first scan; by default the first recorded one, else 0.",
)
@click.option(
    "--initial",
    multiple=True,
    metavar="NAME=VALUE",
    help="The controller's state before the first scan, by the names that 'pidemu code' shows, such as I=30. Repeatable.",
)
@click.option(
    "-o",
    "--output",
    "target",
    type=OutputArgument(),
    metavar="FILE.csv",
    help="Where to write the record with the new column; by default to the screen.",
)
@engine_option
@click.option(
    "--plot",
    "picture",
    type=OutputArgument(),
    metavar="FILE.png|svg",
    help="Draw setpoint, measurement and outputs; needs matplotlib.",
)
@vendors_option
@json_option
def command(
    card: str,
    values: tuple[str, ...],
    file: str,
    scan: float | None,
    action: str,
    limits: tuple[float, float] | None,
    bias: float,
    initial_output: float | None,
    initial: tuple[str, ...],
    target: str | None,
    engine: str | None,
    picture: str | None,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run CARD with the settings NAME=VALUE on a record, one scan per line, and write the record with the column 'emulated'.

    Then it is said what happened: transfers and their bumps, spells at a limit, and, where the file has a recorded output, the
    largest difference from it. Without --scan the interval is that of a time column; a card that measures the interval follows an
    uneven one.
    """
    if picture is not None:
        from pidemu.report.plots import check_picture

        check_picture(picture)
    settings = load_card(card, vendors).settings(assignments(values))
    record = read_record(file)
    read = inputs(file)
    check_outputs({"--output": target, "--plot": picture}, RecordError, read)  # now, and not after the work
    when = timing(record, file, scan, settings)
    start = _initial(record) if initial_output is None else initial_output
    kind: Action = "direct" if action == "direct" else "reverse"
    forced = asked_for(engine)
    controller = Controller(settings, when.scan, kind, limits, bias=bias, initial_output=start, engine=forced)
    left = _start(controller, initial, initial_output is not None)
    playback = play(controller, record, file, when.interval)
    emulated = playback.outputs
    if target is not None or not as_json:
        _write(record, emulated, target, read)
    if as_json:
        print_json(_plain(controller, record, playback))
    bounds = limits or settings.equation.output.limits
    skipped = [f"{file}: {record.skipped}"] if record.skipped else []
    for note in (*skipped, *settings.notes, *_notes(record, controller, when, bias, bounds, kind), *left):
        echo(f"note: {note}", err=True)
    uneven = "" if when.interval is None else ", as the intervals were recorded"
    echo(f"{counted(len(emulated), 'scan')} of {number(controller.interval)} s{uneven}, {action} acting", err=True)
    if engine is not None:
        echo(f"engine: {controller.engine}", err=True)
    if not as_json:
        tell(playback)
    if record.output is not None:
        echo(_difference(record, emulated), err=True)
    if picture is not None:
        from pidemu.report.plots import plot_run

        plot_run(picture, settings, record, playback, bounds)


def _start(controller: Controller, words: tuple[str, ...], has_output: bool) -> list[str]:
    """Set the initial states that are given, and return what is to be noted of the others."""
    given = assignments(words, "NAME=VALUE after --initial", "I=30")
    known = controller.state
    states: dict[str, float] = {}
    for word, text in given.items():
        name = StateRole.OUTPUT if word == "output" else word
        if name not in known:
            names = [*known, "output"]
            raise SettingError(f"--initial {word}: no such state{suggest(word, names)}; states: {', '.join(names)}")
        if name in states or (name == StateRole.OUTPUT and has_output):
            raise SettingError("the output before the first scan is given twice; give it once")
        states[name] = _number(word, str(text))
    if states:
        controller.start(**states)
    others = [
        n
        for n, x in controller.state.items()
        if n not in states and n not in (StateRole.OUTPUT, StateRole.MODE, StateRole.BEGUN) and x == 0
    ]
    if StateRole.INTEGRAL in states and others:
        return [f"with I given the controller goes on as if it had been running; what else it holds is 0: {', '.join(others)}"]
    return []


def _number(name: str, text: str) -> float:
    try:
        value = plain_number(text.strip(), words=True)
    except ValueError:
        raise SettingError(f"--initial {name}: '{text}' is not a number") from None
    return plausible(f"--initial {name}", value, LEVEL, SettingError)


def _plain(controller: Controller, record: Record, playback: Playback) -> dict[str, Any]:
    """Return everything as plain values."""
    found = None if record.output is None else _worst(record.output, playback.outputs)
    difference = None
    if record.output is not None and found is not None:
        largest, at, rms = found
        pair = {"emulated": float(playback.outputs[at]), "recorded": float(record.output[at])}
        difference = {"largest": largest, "scan": at, **pair, "rms": rms}
    plain = {
        **controller.settings.to_dict(),
        "scan": controller.interval,
        "engine": {"name": controller.engine.engine, "reason": controller.engine.reason},
        "outputs": playback.outputs.tolist(),
        **playback.to_dict(),
        "difference": difference,
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe


def _write(record: Record, emulated: Floats, target: str | None, read: Sequence[str | Path]) -> None:
    if target is None:
        shown = io.StringIO()
        write_record(record, {"emulated": emulated}, shown)
        text = shown.getvalue()
        sys.stdout.write(printable(text) if sys.stdout.isatty() else text)
        return
    with beside(target, RecordError, read) as stream:
        write_record(record, {"emulated": emulated}, stream)


def _notes(
    record: Record, controller: Controller, when: Timing, bias: float, limits: tuple[float, float], action: Action
) -> Iterator[str]:
    """Yield what was taken for granted, and what cannot be a signal."""
    yield from far_out(record)
    if when.scan is None:
        default = f"{number(controller.interval)} s"
        yield f"the scan interval is the card's default, {default}: the record has no time column, and --scan is not given"
    for name in ("cascade", "track"):
        signal = record.signals.get(name)
        if signal is not None and set(signal[~np.isnan(signal)].tolist()) <= {0.0, 1.0}:
            what = "the remote setpoint" if name == "cascade" else "the output to follow"
            yield f"column {record.names[name]} holds 0 and 1 only; it is taken for {what}, not for a mode"
    if action == "direct" and controller.settings.equation.action.fixed:
        yield f"{controller.settings.card.id} has no choice of action: the sign of the gain decides"
    by_hand = np.zeros(record.sp.size, dtype=bool) if record.auto is None else record.auto == 0
    if record.manual is None and by_hand.any() and record.output is not None:
        yield "in manual the recorded output is taken for the operator's: the record has no column 'manual'"
    manual = record.by_hand
    if manual is not None:
        outside = int(np.count_nonzero(by_hand & ((manual < limits[0]) | (manual > limits[1]))))
        if outside:
            yield f"in {outside} samples the manual output is outside the output limits; it is taken as it is"
    a = controller.settings.algorithm()
    for what in a.too_coarse(controller.interval):
        yield f"a scan interval of {number(controller.interval)} s is long for these settings: {what}"
    if not (a.ki or a.velocity or a.transfer.way.loads_output or bias):
        yield "without integral action the output in automatic is the terms alone, with a bias of 0; give --bias"


def _initial(record: Record) -> float:
    """Return the output before the first scan: what was recorded first, if anything was."""
    if record.output is not None and np.isfinite(record.output[0]):
        return float(record.output[0])
    return 0.0


def _worst(recorded: Floats, emulated: Floats) -> tuple[float, int, float] | None:
    """Return the largest difference, where it is, and the root mean square; ``None`` where nothing is recorded."""
    known = np.isfinite(recorded)
    if not known.any():
        return None
    difference = np.where(known, np.abs(emulated - recorded), -np.inf)
    difference[known & ~np.isfinite(emulated)] = np.inf  # no number where one was recorded
    at = int(np.argmax(difference))
    largest = float(difference[at])
    if not largest or np.isinf(largest):
        return largest, at, largest
    return largest, at, largest * float(np.sqrt(np.mean((difference[known] / largest) ** 2)))  # the squares may overflow


def _difference(record: Record, emulated: Floats) -> str:
    assert record.output is not None
    found = _worst(record.output, emulated)
    if found is None:
        return "the recorded output is empty throughout"
    largest, at, _ = found
    return (
        f"largest difference from the recorded output: {largest:.6g} in sample {at} (counted from 0): "
        f"emulated {emulated[at]:.8g}, recorded {record.output[at]:.8g}"
    )
