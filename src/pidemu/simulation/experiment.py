"""What is done to a closed loop, and what is measured on it, as parts of its program: nothing need be stored while it runs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.program.blocks import magnitude
from pidemu.program.ir import Expr, Name, Program, select
from pidemu.simulation.parts import Parts

FIGURES: Final = {"iae": "% s", "peak": "%", "travel": "%", "at_low": "s", "at_high": "s", "swing": "%"}
"""The states that hold what is measured, with their units.

``iae`` is the integral of the absolute error along straight lines between the scans, ``peak`` the largest absolute error, both from
a given scan on; ``travel`` is what the output moves by in all, ``at_low`` and ``at_high`` the time at the output limits, ``swing``
what the error moves over in the last part of the run, from its lowest to its highest value.
"""
_SCAN: Final = Name("scan_n")


@dataclass(frozen=True, slots=True)
class Steps:
    """A step of the setpoint and one of the load.

    Attributes
    ----------
    setpoint : float
        Setpoint before its step [%].
    setpoint_step, load_step : float
        Sizes [%].
    setpoint_scan, load_scan : int
        The scans in which they come.
    """

    setpoint: float
    setpoint_step: float
    setpoint_scan: int
    load_step: float
    load_scan: int


@dataclass(frozen=True, slots=True)
class Measuring:
    """What the `FIGURES` need to know.

    Attributes
    ----------
    scan : float
        Scan interval [s].
    start : int
        The scan from which the error counts.
    late : int
        The scan with which the last part of the run begins.
    output : float
        Output before the first scan [%].
    limits : tuple of float
        Output limits [%].
    """

    scan: float
    start: int
    late: int
    output: float
    limits: tuple[float, float]


def experiment(program: Program, steps: Steps, measuring: Measuring | None = None) -> Program:
    """Return a closed loop that makes its setpoint and its load itself, so that it reads nothing, and measures itself.

    Parameters
    ----------
    program : Program
        What `pidemu.simulation.closed.closed_loop` returns.
    steps : Steps
        When setpoint and load step, and how far.
    measuring : Measuring, optional
        Compute the `FIGURES`, as states of the program; without it nothing is measured.
    """
    p = Parts()
    n = p.state(_SCAN.id, "scans so far", "-")
    level = p.coefficient("sp_rest", steps.setpoint, "setpoint before its step")
    size = p.coefficient("sp_step", steps.setpoint_step, "setpoint step")
    setpoint = program.inputs[0].name
    at = p.coefficient("sp_at", steps.setpoint_scan, "scan of the setpoint step", "-")
    p.first(setpoint, level + select(n >= at, size, 0.0), "setpoint")
    size = p.coefficient("load_step", steps.load_step, "load step")
    at = p.coefficient("load_at", steps.load_scan, "scan of the load step", "-")
    p.first("load", select(n >= at, size, 0.0), "load")
    if measuring is not None:
        h = p.coefficient("scan_h", measuring.scan, "scan interval", "s")
        _errors(p, Name(setpoint) - Name(program.also[0]), measuring.start, h)
        _swing(p, Name("error"), measuring.late)
        _outputs(p, Name(program.output), measuring, h)
    p.then(n.id, n + 1.0, "scans so far", "-")
    return p.added(replace(program, inputs=()))


def integral_of_error(error: Floats, scan: float) -> float:
    """Return the integral of the absolute error along straight lines between the scans, from signals [% s].

    Parameters
    ----------
    error : ndarray, shape (scans,)
        The error at the scans [%].
    scan : float
        Scan interval [s].
    """
    a, b = error[:-1], error[1:]
    crosses = a * b < 0
    apart = np.where(crosses, np.abs(a - b), 1.0)
    return float(np.sum(np.where(crosses, (a * a + b * b) / (2 * apart), np.abs(a + b) / 2)) * scan)


def _errors(p: Parts, error: Expr, start: int, h: Name) -> None:
    first = p.coefficient("errors_from", start, "scan from which the error counts", "-")
    now, was = p.then("error", error, "error in percent"), p.state("error_was", "error of the last scan")
    straight = _size(p, "error_sum", was + now) / 2.0
    crossing = (was * was + now * now) / (2.0 * _size(p, "error_move", was - now))
    share = select(was * now < 0.0, crossing, straight)
    iae = p.state("iae", "integral of the absolute error", "% s")
    p.then(iae.id, iae + select(first < _SCAN, share * h, 0.0), "area along the straight line from the last scan", "% s")
    p.then(was.id, now, "kept for the next scan")
    size, peak = _size(p, "error", now), p.state("peak", "largest absolute error")
    p.then(peak.id, select((first <= _SCAN) & (size > peak), size, peak), "largest absolute error")


def _swing(p: Parts, error: Name, late: int) -> None:
    from_ = p.coefficient("late_from", late, "first scan of the last part of the run", "-")
    top, bottom = p.state("error_top", "highest error of the last part"), p.state("error_bottom", "lowest error of the last part")
    p.then(top.id, select((from_ < _SCAN) & (error < top), top, error), "highest error of the last part; before it, the error")
    p.then(bottom.id, select((from_ < _SCAN) & (error > bottom), bottom, error), "lowest error of the last part")
    swing = p.state("swing", "what the error moves over in the last part of the run")
    p.then(swing.id, top - bottom, "what the error moves over in the last part of the run")


def _outputs(p: Parts, u: Name, measuring: Measuring, h: Name) -> None:
    last = p.state("output_was", "output of the last scan", initial=measuring.output)
    travel = p.state("travel", "what the output moves by in all")
    p.then(travel.id, travel + _size(p, "output_move", u - last), "what the output moves by in all")
    p.then(last.id, u, "kept for the next scan")
    low, high = (
        p.coefficient(f"{name}_limit", limit, "output limit") for name, limit in zip(("low", "high"), measuring.limits, strict=True)
    )
    for name, reached in (("at_low", u <= low), ("at_high", u >= high)):
        time = p.state(name, "time at the output limit", "s")
        p.then(name, time + select(reached, h, 0.0), "time at the output limit", "s")


def _size(p: Parts, name: str, x: Expr) -> Expr:
    """Assign a value, and return its size."""
    return magnitude(p.then(name, x, "for its size"))
