"""``pidemu fleet``."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import click

from pidemu.cli import interrupts
from pidemu.cli.common import (
    OutputArgument,
    TimeArgument,
    asked_for,
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
from pidemu.errors import FleetError
from pidemu.excerpt import quoted
from pidemu.files.outputs import refuse_overlap
from pidemu.files.writing import check
from pidemu.fleet.fleet import Fleet
from pidemu.fleet.judgement import MARGINS, RAN
from pidemu.fleet.result import FleetResult
from pidemu.fleet.table import LoopTable, read_loops
from pidemu.fleet.writing import instead_of, with_parts
from pidemu.formatting import json_safe

_ROWS: Final = 20
"""Loops that are shown; a plant has thousands."""
_COLUMNS: Final = ("tag", "card", "scan", "IAE [% s]", "peak [%]", "travel [%]", "at limits [s]", "error [%]")
_MARGINS: Final = ("GM", "PM [deg]", "Ms")


@click.command("fleet", short_help="Run a file of closed loops, on all cores or on a cluster.")
@click.argument("file", metavar="LOOPS.csv")
@click.option(
    "--time",
    type=TimeArgument(positive=True),
    help="Length of the run, for loops that state none; by default until each has settled.",
)
@setpoint_option
@load_option
@engine_option
@click.option("--margins/--no-margins", default=True, help="Compute margins and stability, which takes about as long as the run.")
@click.option("--cores", type=click.IntRange(min=1), metavar="N", help="Threads on this machine; by default one per core.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster: its scheduler's address, such as tcp://HOST:8786.")
@click.option("--table", "target", type=OutputArgument(), metavar="FILE.csv", help="Write the table: a row per loop.")
@click.option(
    "--signals", type=OutputArgument("folder"), metavar="FOLDER", help="Write measurement and output of every scan, as NumPy files."
)
@click.option("--parquet", type=OutputArgument(), metavar="FILE", help="Write table and signals as a Parquet file.")
@click.option("--resume", is_flag=True, help="Go on with a run that did not end: with what it left in --signals and --parquet.")
@click.option(
    "--worker-timeout",
    type=TimeArgument(),
    default="60 s",
    show_default=True,
    help="How long to wait for a worker where the cluster has none; 0 for ever.",
)
@click.option("--progress/--no-progress", default=None, help="A progress bar; by default for large fleets on a terminal.")
@click.option("-v", "--verbose", is_flag=True, help="Say which engines ran, and how settings were read.")
@vendors_option
@json_option
def command(
    file: str,
    time: float | None,
    setpoint: float | tuple[float, float] | None,
    load: float | tuple[float, float] | None,
    engine: str | None,
    margins: bool,
    cores: int | None,
    scheduler: str | None,
    target: str | None,
    signals: str | None,
    parquet: str | None,
    resume: bool,
    worker_timeout: float,
    progress: bool | None,
    verbose: bool,
    vendors: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run the closed loops of a CSV file, each with its own card, settings, scan interval and process.

    Columns: tag, card, settings (GAIN=2; RESET=4; RATE=6 s), process (gain=1, lag=20, delay=3) and, where wanted, scan, action,
    limits, setpoint, load, time. What a row says goes before --setpoint, --load and --time. A row that is wrong does not stop the
    others: it is reported, and the exit status is 1.

    Shown are the largest absolute error (peak) and its integral (IAE), from the load step on or from the start where there is none;
    how far the output travelled, how long it was at its limits, the last error, and gain margin, phase margin and Ms of the sampled
    loop within its limits. A loop has settled where the error moves over less than 5 % of its peak in the last fifth of the run.

    Ctrl-C and SIGTERM end the run: what is done is shown and written, and the exit status is 130 or 143. Where --signals or
    --parquet are given, the same command with --resume goes on, also after a crash.
    """
    if scheduler is not None and cores is not None:
        raise click.UsageError("--cores is for this machine, and --scheduler runs the loops elsewhere; leave one of them out")
    loops = read_loops(file, vendors)
    if loops.skipped:
        echo(f"note: {file}: {loops.skipped}", err=True)
    refuse_overlap(with_parts({"--table": target, "--signals": signals, "--parquet": parquet}), FleetError)
    partly: dict[str, Path] = {}  # where what an interrupted run has done goes
    for path in (target, parquet):
        if path is not None:  # now, and not after the work
            check(path, FleetError, inputs(file))
            partly[path] = instead_of(path)
            check(partly[path], FleetError, inputs(file))
    result = None
    try:
        if loops.loops:
            result = Fleet(loops.loops).simulate(
                time=time, folder=signals, parquet=parquet, engine=asked_for(engine), margins=margins, cores=cores,
                cluster=scheduler, progress=progress, resume=resume, worker_timeout=worker_timeout,
                **given(setpoint=setpoint, load=load),
            )  # fmt: skip
    finally:  # what is wrong with rows is told whatever becomes of the others
        _tell_faults(loops, result, verbose)
    interrupted = result is not None and result.interrupted
    if target is not None and not interrupted:
        loops.write(target, result)
    elif target is not None and _done(result):
        loops.write(partly[target], result)
    rows = list(loops.rows(result))
    if as_json:
        print_json(_plain(loops, rows, result))
    else:
        _print(loops, rows, engines=verbose or engine is not None)
    if result is not None and result.resumed:
        echo(f"resumed: {result.resumed:,} of {len(loops):,} loops were done already", err=True)
    if interrupted:
        echo(f"interrupted: {_done(result):,} of {len(loops):,} loops are done{_where(partly, _done(result))}", err=True)
        raise SystemExit(interrupts.status())
    if result is None or any(row["status"] == "failed" for row in rows):
        raise SystemExit(1)


def _tell_faults(loops: LoopTable, result: FleetResult | None, verbose: bool) -> None:
    """Say on stderr, line by line, which rows and loops could not be run; with `verbose`, how their settings were read."""
    found = [(wrong.line, wrong.tag, wrong.reason) for wrong in loops.wrong]
    if result is not None:
        for i, (tag, line, reason) in enumerate(zip(loops.loops.tags, loops.lines, result.reasons, strict=True)):
            notes = [f"note: {note}" for note in loops.loops[i].settings.notes] if verbose else []
            found += [(line, tag, message) for message in (*notes, *([reason] if reason else []))]
    for line, tag, message in sorted(found, key=lambda one: one[0]):
        echo(loops.located(line, tag, message), err=True)


def _done(result: FleetResult | None) -> int:
    """Return how many loops ran."""
    return 0 if result is None else sum(result.counts[status] for status in RAN)


def _where(partly: Mapping[str, Path], done: int) -> str:
    """Say where what is done stands, where that is not where the whole would."""
    kept = {path: other for path, other in partly.items() if Path(path) != other and os.path.lexists(path)}
    if not kept:
        return ""
    stay = f"{' and '.join(map(quoted, kept))} {'is as it was' if len(kept) == 1 else 'are as they were'}"
    return f"; {stay}" + (f", what is done is in {' and '.join(map(quoted, kept.values()))}" if done else "")


def _plain(loops: LoopTable, rows: Sequence[Mapping[str, Any]], result: FleetResult | None) -> dict[str, Any]:
    """Return everything as plain values."""
    plain = {
        "file": loops.path,
        "counts": Counter(row["status"] for row in rows),
        "not_settled": _not_settled(rows),
        "engines": _engines(rows),
        "interrupted": result is not None and result.interrupted,
        "resumed": 0 if result is None else result.resumed,
        "loops": rows,
    }
    safe: dict[str, Any] = json_safe(plain)
    return safe


def _not_settled(rows: Sequence[Mapping[str, Any]]) -> int:
    """Return how many loops ran and had not settled at the end."""
    return sum(row["settled"] is False for row in rows)


def _engines(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Return how many loops each engine ran."""
    return dict(Counter(row["engine"] for row in rows if row["engine"]).most_common())


def _print(loops: LoopTable, rows: Sequence[Mapping[str, Any]], *, engines: bool) -> None:
    counts = Counter(row["status"] for row in rows)
    said = ", ".join(f"{counts[status]:,} {status}" for status in (*RAN, "failed", "not run") if counts[status])
    moving = _not_settled(rows)
    heading(f"{loops.path}: {_loops(len(rows))}, {said}" + (f"; {moving:,} not settled at the end" if moving else ""))
    if engines:
        used = ", ".join(f"{name} ({_loops(count)})" for name, count in _engines(rows).items())
        echo(f"engine: {used or 'none, as nothing was run'}")
    ran = [row for row in rows if row["status"] in RAN]
    if ran:
        heading(f"\nThe {_ROWS} loops with the largest IAE" if len(ran) > _ROWS else "\nLoops, the largest IAE first")
        worst = sorted(ran, key=_badness, reverse=True)[:_ROWS]
        columns = [*_COLUMNS, *(_MARGINS if any(row["Ms"] is not None for row in worst) else ())]
        remarks = [_remark(row) for row in worst]
        last = [""] if any(remarks) else []
        cells = [[*_cells(row)[: len(columns)], said][: len(columns) + len(last)] for row, said in zip(worst, remarks, strict=True)]
        table([*columns, *last], cells, right=range(2, len(columns)))
    failed = [row for row in rows if row["status"] == "failed"]
    if failed:
        heading("\nFailed")
        table(["", "", ""], [[f"line {row['line']}", quoted(row["tag"]), quoted(row["card"])] for row in failed[:_ROWS]])
    if len(failed) > _ROWS:
        echo(f"  and {len(failed) - _ROWS:,} more; --table and --json list all")


def _cells(row: Mapping[str, Any]) -> list[str]:
    """Return a row of the table for people."""
    figures = (row["iae"], row["peak"], row["travel"], row["at_low"] + row["at_high"], row["error"])
    margins = (math.nan if row[name] is None else row[name] for name in MARGINS)
    return [quoted(row["tag"]), quoted(row["card"]), f"{number(row['scan'])} s", *map(_figure, (*figures, *margins))]


def _remark(row: Mapping[str, Any]) -> str:
    """Return what is wrong with a loop that ran."""
    if row["status"] != "done":
        return str(row["status"])
    return "" if row["settled"] else "not settled" if row["settled"] is False else "ends in the dead time"


def _loops(count: int) -> str:
    return "1 loop" if count == 1 else f"{count:,} loops"


def _badness(row: Mapping[str, Any]) -> float:
    """Return the IAE; a loop that is unstable or ran away is worse than any."""
    iae = float(row["iae"])
    return iae if math.isfinite(iae) and row["status"] == "done" else math.inf


def _figure(x: float) -> str:
    return "-" if math.isnan(x) else number(x, 3) if abs(x) < 1 else number(x, 4)
