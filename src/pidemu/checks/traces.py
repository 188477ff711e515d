"""A card against recorded outputs: of the real program, or of a second reading of its equation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pidemu.arrays import Flags, Floats
from pidemu.card.library import is_builtin
from pidemu.card.load import Card
from pidemu.card.model.card_file import interval_of
from pidemu.card.model.verification import RecordedTrace
from pidemu.controller.controller import Controller
from pidemu.errors import PidemuError, Problem, RecordError, suggest
from pidemu.records.files import Record, read_record

_MOST: Final = 100_000
"""Scans of a trace; a check is done whenever the card is loaded."""
_LEAST: Final = 20
"""Scans that show a controller."""


@dataclass(frozen=True, slots=True)
class TraceComparison:
    """A card's outputs beside recorded ones.

    Attributes
    ----------
    found, recorded : ndarray of float
        The outputs, one entry per scan.
    compared : ndarray of bool
        Which scans are compared.
    difference : float
        Largest difference, as a share of the largest recorded output; infinite where one of the two is not a number.
    worst : int
        The scan with it.
    """

    found: Floats
    recorded: Floats
    compared: Flags
    difference: float
    worst: int


def compare_trace(card: Card, trace: RecordedTrace, folder: Path) -> TraceComparison:
    """Run a card on the signals of a recorded trace.

    Parameters
    ----------
    card : Card
        The card.
    trace : RecordedTrace
        One of its traces.
    folder : Path
        Where the files are.

    Raises
    ------
    PidemuError
        A file cannot be read, or the card cannot be run so.
    """
    own = _read(folder / trace.file, () if trace.inputs else ("sp", "pv"))
    inputs = own if trace.inputs is None else _read(folder / trace.inputs, ("sp", "pv"))
    recorded = _column(own, trace)
    if recorded.size > _MOST:
        raise RecordError(f"{trace.file} has {recorded.size:,} scans; at most {_MOST:,} are compared")
    if recorded.size != inputs.sp.size:
        raise RecordError(f"{trace.file} has {recorded.size} scans, its inputs {trace.inputs} have {inputs.sp.size}")
    ends = [0, *(c.at for c in trace.changes), recorded.size]
    if ends != sorted(set(ends)):
        raise RecordError(
            f"{trace.file}: changes at {', '.join(map(str, ends[1:-1]))} do not ascend within its {recorded.size} scans"
        )
    controller = Controller(
        card.settings(trace.given),
        scan=interval_of(trace.scan),
        action=trace.action,
        output_limits=trace.limits,
        initial_output=trace.initial_output,
        engine="python",
    )
    auto = np.ones(recorded.size) if trace.modes == "automatic" or inputs.auto is None else inputs.auto
    found = _outputs(controller, trace, inputs, auto)
    if controller.program.precision == "float32":
        recorded = recorded.astype(np.float32).astype(float)
    compared = auto > 0 if trace.rows == "automatic" else np.ones(recorded.size, dtype=bool)
    if compared.sum() < _LEAST or np.ptp(recorded[compared]) == 0:
        raise RecordError(f"{trace.file} shows nothing: at least {_LEAST} scans are compared, in which the output moves")
    return _compared(found, recorded, compared)


def _read(file: Path, needed: tuple[str, ...]) -> Record:
    """Return a trace; who writes a card shall not have other files read."""
    if file.is_symlink() or (file.exists() and not file.is_file()):
        raise RecordError(f"{file.name} is not a plain file; put the file itself beside the card")
    return read_record(file, needed=needed)


def _column(record: Record, trace: RecordedTrace) -> Floats:
    """Return the recorded outputs."""
    if trace.column == "output" and record.output is not None:
        return record.output
    if trace.column not in record.header:
        named = ", ".join(record.header)
        raise RecordError(f"{trace.file}: no column '{trace.column}' among {named}{suggest(trace.column, record.header)}")
    at = record.header.index(trace.column)
    try:
        return np.array([float(row[at]) for row in record.rows])
    except ValueError as error:
        raise RecordError(f"{trace.file}, column {trace.column}: {error}") from None


def _outputs(controller: Controller, trace: RecordedTrace, inputs: Record, auto: Floats) -> Floats:
    """Return what the card makes of the signals, with the changes of settings between stretches."""
    ends = [*(c.at for c in trace.changes), auto.size]
    found, start = [], 0
    for i, end in enumerate(ends):
        part = slice(start, end)
        extra = {name: x[part] for name, x in inputs.signals.items()}
        if inputs.interval is not None:
            extra["interval"] = inputs.interval[part]
        manual = None if inputs.manual is None else inputs.manual[part]
        found.append(controller.run(inputs.sp[part], inputs.pv[part], auto[part], manual, **extra))
        if i < len(trace.changes):
            controller.change(trace.changes[i].given)
        start = end
    return np.concatenate(found)


def _compared(found: Floats, recorded: Floats, compared: Flags) -> TraceComparison:
    same = (found == recorded) | (np.isnan(found) & np.isnan(recorded)) | ~compared
    finite = np.isfinite(recorded)
    size = max(np.abs(recorded[finite]).max(initial=0.0), 1e-300)
    off = np.where(finite & np.isfinite(found), np.abs(found - recorded) / size, np.inf)
    difference = np.where(same, 0.0, off)
    worst = int(np.argmax(difference))
    return TraceComparison(found, recorded, compared, float(difference[worst]), worst)


def reject_unreproduced_traces(card: Card) -> Iterator[Problem]:
    """What a card from outside says it was verified by, it shows: its traces are run. Those of pidemu's own cards its tests run."""
    file = Path(card.document.path)
    if is_builtin(file):
        return
    for i, trace in enumerate(card.verification.records):
        place = ("verification", "records", i)
        try:
            c = compare_trace(card, trace, file.parent)
        except PidemuError as error:
            yield card.document.problem((*place, "file"), " ".join(str(error).splitlines()))
            continue
        if not c.difference <= trace.tolerance:
            message = (
                f"the card does not reproduce {trace.file}: in scan {c.worst} it gives {c.found[c.worst]!r}, recorded is "
                f"{c.recorded[c.worst]!r}; that is {c.difference:.2g} of the largest output, stated is {trace.tolerance:g}"
            )
            yield card.document.problem(place, message)
