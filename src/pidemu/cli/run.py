"""``pidemu run``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from pidemu.card.library import load_card
from pidemu.cli.common import action_option, assignments, limits_option, number, vendors_option
from pidemu.emulator import Controller, Floats
from pidemu.errors import RecordError, ScanError
from pidemu.records import Record, interval, read_record, write_record


@click.command("run", short_help="Run a card on recorded signals.")
@click.argument("card")
@click.argument("values", nargs=-1, metavar="NAME=VALUE...")
@click.option(
    "--record",
    "file",
    required=True,
    metavar="FILE.csv",
    help="Recorded signals: columns sp, pv and, if there are, auto, manual, output.",
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
    "-o",
    "--output",
    "target",
    metavar="FILE.csv",
    help="Where to write the record with the new column; by default to the screen.",
)
@vendors_option
def command(
    card: str,
    values: tuple[str, ...],
    file: str,
    scan: float | None,
    action: str,
    limits: tuple[float, float] | None,
    bias: float,
    initial_output: float | None,
    target: str | None,
    vendors: tuple[str, ...],
) -> None:
    """Run CARD with the settings NAME=VALUE on a record, one scan per line, and write the record with the column 'emulated'.

    Where the file has a recorded output, the largest difference is stated. Without --scan the interval is that of a time column.
    """
    settings = load_card(card, vendors).settings(assignments(values))
    record = read_record(file)
    step = interval(record, file, scan)
    start = _initial(record) if initial_output is None else initial_output
    controller = Controller(settings, step, "direct" if action == "direct" else "reverse", limits, bias=bias, initial_output=start)
    manual = record.output if record.manual is None else record.manual
    try:
        emulated = controller.run(record.sp, record.pv, record.auto, manual)
    except ScanError as error:
        raise RecordError(f"{file}: {error}") from None
    _write(record, emulated, target)
    for note in (*settings.notes, *_notes(record, controller, step, bias, limits or settings.equation.output.limits)):
        click.echo(f"note: {note}", err=True)
    click.echo(f"{len(emulated)} scans of {number(controller.interval)} s, {action} acting", err=True)
    if record.output is not None:
        click.echo(_difference(record, emulated), err=True)


def _write(record: Record, emulated: Floats, target: str | None) -> None:
    if target is None:
        write_record(record, "emulated", emulated, sys.stdout)
        return
    try:
        with Path(target).open("w", encoding="utf-8", newline="") as stream:
            write_record(record, "emulated", emulated, stream)
    except OSError as error:
        raise RecordError(f"{target}: cannot be written: {error.strerror}") from None


def _notes(record: Record, controller: Controller, step: float | None, bias: float, limits: tuple[float, float]) -> Iterator[str]:
    """Yield what was taken for granted."""
    if step is None:
        default = f"{number(controller.interval)} s"
        yield f"the scan interval is the card's default, {default}: the record has no time column, and --scan is not given"
    by_hand = np.zeros(record.sp.size, dtype=bool) if record.auto is None else record.auto == 0
    manual = record.output if record.manual is None else record.manual
    if record.manual is None and by_hand.any() and manual is not None:
        yield "in manual the recorded output is taken for the operator's: the record has no column 'manual'"
    if manual is not None:
        outside = int(np.count_nonzero(by_hand & ((manual < limits[0]) | (manual > limits[1]))))
        if outside:
            yield f"in {outside} samples the manual output is outside the output limits; it is taken as it is"
    a = controller.settings.algorithm()
    if not (a.ki or a.velocity or a.start == "load-output" or bias):
        yield "there is no integral: in automatic the output is the terms alone, with a bias of 0; give --bias"


def _initial(record: Record) -> float:
    """Return the output before the first scan: what was recorded first, if anything was."""
    if record.output is not None and np.isfinite(record.output[0]):
        return float(record.output[0])
    return 0.0


def _difference(record: Record, emulated: Floats) -> str:
    assert record.output is not None
    difference = np.abs(emulated - record.output)
    if np.all(np.isnan(difference)):
        return "the recorded output is empty throughout"
    worst = int(np.nanargmax(difference))
    return (
        f"largest difference from the recorded output: {difference[worst]:.6g} in sample {worst} (counted from 0): "
        f"emulated {emulated[worst]:.8g}, recorded {record.output[worst]:.8g}"
    )
