"""``pidemu fit``."""

from __future__ import annotations

from typing import Any

import click
import numpy as np

from pidemu.arrays import Floats
from pidemu.cli.common import OutputArgument, RangeArgument, TimeArgument, echo, heading, json_option, number, print_json, table
from pidemu.cli.inputs import inputs
from pidemu.errors import FitRefusedError, RecordError
from pidemu.excerpt import visible
from pidemu.files.outputs import check_outputs
from pidemu.files.tables import counted
from pidemu.process.document import plain_process
from pidemu.process.fit.document import plain_refusal
from pidemu.process.fit.fit import METHODS, MODELS, Method, Model, ProcessFit, fit_process
from pidemu.process.process import Process
from pidemu.process.text import written
from pidemu.records.files import Record, read_record
from pidemu.records.playback import times_of
from pidemu.settings.ranges import PERCENT, SignalRange


@click.command("fit", short_help="Fit a process to the record of a bump test.")
@click.argument("file", metavar="FILE.csv")
@click.option(
    "--model",
    type=click.Choice(MODELS),
    default="fopdt",
    show_default=True,
    help="First or second order plus dead time, or an integrator plus dead time.",
)
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="least-squares",
    show_default=True,
    help="Least squares of all samples; or the curve of one step, read by its tangent (Fit 1) or tangent and 63.2 % point (Fit 2).",
)
@click.option("--from", "begin", type=TimeArgument(), help="Leave out what is before this time.")
@click.option("--to", "end", type=TimeArgument(), help="Leave out what is after this time.")
@click.option(
    "--scan", type=TimeArgument(positive=True), metavar="H", help="Time between the samples of a record without a time column."
)
@click.option(
    "--drift/--no-drift",
    default=None,
    help="Fit an even drift of the measurement as well; by default where it plainly drifts before the output first moves.",
)
@click.option(
    "--pv-range",
    type=RangeArgument(),
    help="Range of the measurement, if it was recorded in its own units: the gain is given in %/%, too.",
)
@click.option("--op-range", type=RangeArgument(), help="Range of the output, if it is not 0 to 100 %.")
@click.option(
    "--plot", "picture", type=OutputArgument(), metavar="FILE.png|svg", help="Draw record, model and residuals; needs matplotlib."
)
@json_option
def command(
    file: str,
    model: Model,
    method: Method,
    begin: float | None,
    end: float | None,
    scan: float | None,
    drift: bool | None,
    pv_range: SignalRange | None,
    op_range: SignalRange | None,
    picture: str | None,
    as_json: bool,
) -> None:
    """Fit a process to FILE.csv, the record of a test in which the output moved and the measurement answered.

    The columns are those of other records: time, output (or op), pv; and sp and auto, where the loop was closed. A record of a
    closed loop is refused, unless a setpoint step moved it.
    """
    if picture is not None:
        from pidemu.report.plots import check_picture

        check_picture(picture)
    record = read_record(file, needed=("pv", "output"))
    check_outputs({"--plot": picture}, RecordError, inputs(file))
    ranges = None if pv_range is None and op_range is None else (pv_range or PERCENT, op_range or PERCENT)
    unit = "%/%" if ranges is None else "/".join(given.unit or "eu" for given in ranges)
    try:
        found = _fit(record, scan, (begin, end), model=model, method=method, drift=drift, unit=unit)
    except FitRefusedError as error:
        if as_json:
            print_json(plain_refusal(str(error)))
        echo(f"error: {visible(file)}: {error}", err=True)
        raise SystemExit(1) from None
    except RecordError as error:
        raise RecordError(f"{visible(file)}: {error}") from None
    percent = None if ranges is None else found.process.in_percent(*ranges)
    if as_json:
        more = {} if percent is None else {"percent": plain_process(percent)}
        print_json({**found.to_dict(), **more})
    else:
        _print(found, percent)
    for note in (*([f"{visible(file)}: {record.skipped}"] if record.skipped else []), *found.fit.notes):
        echo(f"note: {note}", err=True)
    if picture is not None:
        from pidemu.report.fit_plot import plot_fit

        plot_fit(picture, found)


def _fit(record: Record, scan: float | None, window: tuple[float | None, float | None], **how: Any) -> ProcessFit:
    if record.output is None:
        raise RecordError("no output; add the column output")
    times = _times(record, scan)
    begin, end = window
    inside = (times >= (-np.inf if begin is None else begin)) & (times <= (np.inf if end is None else end))
    if not inside.any():
        raise RecordError(f"no sample between --from and --to; the record is from {times[0]:g} s to {times[-1]:g} s")
    columns: dict[str, Any] = {}
    if "sp" in record.names:
        columns["setpoint"] = record.sp[inside]
    if record.auto is not None:
        columns["auto"] = record.auto[inside]
    return fit_process(times[inside], record.output[inside], record.pv[inside], **columns, **how)


def _times(record: Record, scan: float | None) -> Floats:
    """Return the times of the samples [s], from whichever column has them; `scan` fills what is missing."""
    if record.time is not None:
        return record.time
    if record.interval is None and scan is None:
        raise RecordError("no column 'time'; add one, or give the time between samples with --scan")
    usual = np.nan if scan is None else scan
    interval = None if record.interval is None else np.where(np.isnan(record.interval), usual, record.interval)
    if interval is not None and np.isnan(interval[1:]).any():
        raise RecordError("the column interval has empty cells; give the usual time between samples with --scan")
    return times_of(record, usual, interval)


def _print(found: ProcessFit, percent: Process | None) -> None:
    process, fit = found.process, found.fit
    heading(f"{process}  ({fit.model}, {fit.method})")
    lags = _lags(process)
    per = f"{process.unit}/s" if process.integrators else process.unit
    own = "" if process.unit == "%/%" else process.unit.rsplit("/", 1)[0]
    pv = own or "%"
    rows = [["gain", number(process.gain), per, _between(fit.intervals.get("gain"))]]
    for i, lag in enumerate(lags, 1):
        name = "lag" if len(lags) == 1 else f"lag {i}"
        rows.append([name, number(lag), "s", _between(fit.intervals.get(name))])
    rows.append(["dead time", number(process.delay), "s", _between(fit.intervals.get("delay"))])
    rows.append(["start", number(fit.start), pv, _between(fit.intervals.get("start"))])
    if fit.drift:
        rows.append(["drift", number(60 * fit.drift), f"{pv}/min", _between(fit.intervals.get("drift"), 60)])
    table(["", "", "", "95 % interval" if fit.intervals else ""], rows, right=(1,))
    heading("\nGoodness")
    rows = [
        ["record", f"{counted(fit.samples, 'sample')}, {counted(fit.moves, 'move')} of the output"],
        ["residuals", f"{number(fit.rms, 3)} {pv} rms, correlation of neighbours {fit.correlation:.2f}"],
        ["explained", f"{100 * fit.r_squared:.5g} % of the variance"],
    ]
    table(["", ""], rows)
    if percent is not None:
        echo(f"\nin percent of the ranges: {percent}")
    echo(f"\n--process '{written((percent or process).rounded())}'")


def _lags(process: Process) -> list[float]:
    return sorted((-1 / p.real for p in process.poles if p), reverse=True)


def _between(interval: tuple[float, float] | None, factor: float = 1.0) -> str:
    if interval is None:
        return ""
    low, high = (factor * end for end in interval)
    return f"{number(low, 4)} to {number(high, 4)}"
