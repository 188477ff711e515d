"""A difference in words: the record, both outputs, and what pidemu computed in each scan."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isnan, nan
from typing import Final

import numpy as np

from pidemu.backends.choice import runner
from pidemu.backends.python import starting
from pidemu.controller.controller import Controller
from pidemu.formatting import number
from pidemu.program.ir import Assign, Program
from pidemu.settings.settings import Settings
from pidemu.testing.adapter import MadeFor, differs
from pidemu.testing.record import SignalRecord

_MOST: Final = 12
"""Scans that are shown: those before the difference, and it."""
_DULL: Final = ("kept for the next scan", "no denormal numbers", "mode, kept", "there has been a scan", "no derivative of the step")
"""Beginnings of the texts of assignments that explain nothing."""


def report(
    settings: Settings | None,
    asked: MadeFor | None,
    record: SignalRecord,
    outputs: tuple[Sequence[float], Sequence[float]],
    names: tuple[str, str],
    tolerance: float,
    raised: BaseException | None,
) -> str:
    """Return what differs, scan by scan.

    Parameters
    ----------
    settings : Settings or None
        The settings of both.
    asked : MadeFor or None
        How the first was made where it is pidemu's, so that its terms are told; else ``None``.
    record : SignalRecord
        The scans.
    outputs : tuple of sequence of float
        What both made of them; the second is empty where it raised an error.
    names : tuple of str
        What both are called.
    tolerance : float
        How far they may be apart.
    raised : BaseException or None
        The error of the second one.
    """
    return "\n".join(_lines(settings, asked, record, outputs, names, tolerance, raised))


def _lines(
    settings: Settings | None,
    asked: MadeFor | None,
    record: SignalRecord,
    outputs: tuple[Sequence[float], Sequence[float]],
    names: tuple[str, str],
    tolerance: float,
    raised: BaseException | None,
) -> Iterator[str]:
    ours, theirs = outputs
    apart = [n for n, (a, b) in enumerate(zip(ours, theirs, strict=False)) if differs(a, b, tolerance)]
    if raised is not None:
        yield f"{names[1]} raised {type(raised).__name__}: {raised}"
    else:
        by = abs(ours[apart[0]] - theirs[apart[0]])
        yield f"{names[1]} differs from {names[0]} by {number(by)} in scan {apart[0]}; {number(tolerance)} is allowed"
    if settings is not None:
        scan = "" if asked is None or asked.scan is None else f"; scan {number(asked.scan)} s"
        yield f"  {settings.summary}{scan}"
    yield "  The shortest record found that shows it:"
    first = max(0, (apart[0] if apart else len(record.scans) - 1) - _MOST + 1)
    shown = slice(first, first + _MOST)
    rows = [
        ("scan", [str(n) for n in range(len(record.scans))]),
        ("sp", [number(x) for x in record.sp]),
        ("pv", [number(x) for x in record.pv]),
    ]
    if not all(record.auto):
        rows.append(("mode", ["auto" if auto else "manual" for auto in record.auto]))
        rows.append(("operator's output", ["-" if x is None else number(x) for x in record.manual]))
    rows.append((names[0], [_digits(x) for x in ours]))
    if theirs:
        rows.append((names[1], [_digits(x) for x in theirs]))
        rows.append(("difference", [_digits(b - a) if differs(a, b, tolerance) else "" for a, b in zip(ours, theirs, strict=True)]))
    terms = [] if asked is None or settings is None or record.changes else list(_terms(settings, asked, record))
    yield from _table([(name, cells[shown]) for name, cells in rows])
    for n, new in record.changes.items():
        yield f"  before scan {n} the settings change to {new.summary}"
    if terms:
        yield "  What pidemu computed:"
        yield from _table([(f"{name}  {text}", [_digits(x) for x in values][shown]) for name, text, values in terms])


def _terms(settings: Settings, asked: MadeFor, record: SignalRecord) -> Iterator[tuple[str, str, list[float]]]:
    """Yield what the program assigns in each scan: name, text and values."""
    program = Controller(settings, asked.scan, asked.action, asked.limits, initial_output=asked.initial_output).program
    told = _told(program)
    traced = replace(program, also=tuple(told))
    manual = [nan if x is None else x for x in record.manual]
    signals = [np.array(column, dtype=np.float64) for column in (record.sp, record.pv, record.auto, manual)]
    state = [*starting(traced), *(deque([0.0] * length) for length in traced.lengths)]
    with np.errstate(all="ignore"):
        _, *values = runner(traced, "python").run(state, signals, len(record.scans))
    for name, column in zip(told, values, strict=True):
        yield name, told[name], column.tolist()


def _told(program: Program) -> dict[str, str]:
    """Return the names that explain a scan, with their texts."""
    found: dict[str, str] = {}
    for assign in program.body:
        if _explains(assign):
            found.setdefault(assign.name, assign.text)
    return {name: text for name, text in found.items() if name != program.output}


def _explains(assign: Assign) -> bool:
    return not assign.text.startswith(_DULL)


def _digits(x: float) -> str:
    return "nan" if isnan(x) else number(x, 7)


def _table(rows: Sequence[tuple[str, Sequence[str]]]) -> Iterator[str]:
    """Yield rows of equal columns, each with its name in front."""
    first = max(len(name) for name, _ in rows)
    width = max((len(cell) for _, cells in rows for cell in cells), default=0)
    for name, cells in rows:
        yield f"    {name:<{first}}  {'  '.join(f'{cell:>{width}}' for cell in cells)}".rstrip()
