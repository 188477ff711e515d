"""``pidemu run``."""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np

from pidemu.cli.common import action_option, assignments, find, limits_option, number, vendors_option
from pidemu.emulator import Controller
from pidemu.errors import RecordError, ScanError
from pidemu.records import Record, read_record, write_record


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

    Where the file has a recorded output, the largest difference is stated.
    """
    settings = find(card, vendors).settings(assignments(values))
    record = read_record(file)
    start = _initial(record) if initial_output is None else initial_output
    controller = Controller(settings, scan, "direct" if action == "direct" else "reverse", limits, bias=bias, initial_output=start)
    try:
        emulated = controller.run(record.sp, record.pv, record.auto, record.manual)
    except ScanError as error:
        raise RecordError(f"{file}: {error}") from None
    if target is None:
        write_record(record, "emulated", emulated, sys.stdout)
    else:
        try:
            with Path(target).open("w", encoding="utf-8", newline="") as stream:
                write_record(record, "emulated", emulated, stream)
        except OSError as error:
            raise RecordError(f"{target}: cannot be written: {error.strerror}") from None
    for note in settings.notes:
        click.echo(f"note: {note}", err=True)
    click.echo(f"{len(emulated)} scans of {number(controller.interval)} s, {action} acting", err=True)
    if record.output is not None:
        click.echo(_difference(record, emulated), err=True)


def _initial(record: Record) -> float:
    """Return the output before the first scan: what was recorded first, if anything was."""
    if record.output is not None and np.isfinite(record.output[0]):
        return float(record.output[0])
    return 0.0


def _difference(record: Record, emulated: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    assert record.output is not None
    difference = np.abs(emulated - record.output)
    if np.all(np.isnan(difference)):
        return "the recorded output is empty throughout"
    worst = int(np.nanargmax(difference))
    return (
        f"largest difference from the recorded output: {difference[worst]:.6g} in sample {worst} (counted from 0): "
        f"emulated {emulated[worst]:.8g}, recorded {record.output[worst]:.8g}"
    )
