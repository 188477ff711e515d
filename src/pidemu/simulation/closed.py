"""Closed loops as scan programs: the sampled process is appended to the controller's program (specs/equations.md, section 9).

In a scan the controller reads the measurement, and its output stands until the next scan. Setpoint, load, measurement and output
are in percent; where the controller computes in other units, the program converts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pidemu.process.hold import SampledProcess
from pidemu.program import blocks
from pidemu.program.ir import Expr, Line, Name, Program, Quantity, expr
from pidemu.settings.ranges import PERCENT, SignalRanges
from pidemu.simulation.parts import Parts
from pidemu.simulation.surroundings import NOTHING_ELSE, Surroundings
from pidemu.simulation.valve import valve_position

_IN_PERCENT: Final = SignalRanges(PERCENT, PERCENT)


def closed_loop(
    controller: Program,
    process: SampledProcess,
    rest: tuple[float, float],
    ranges: SignalRanges = _IN_PERCENT,
    around: Surroundings = NOTHING_ELSE,
) -> Program:
    """Return the program of a controller and a process that starts at rest; it reads setpoint and load, both in percent.

    It records the output, then the measurement, both in percent; then the position of the valve, where there is one. Where there is
    noise, it reads that after the load.

    Parameters
    ----------
    controller : Program
        The controller's program for scans in automatic (`pidemu.program.specialise.specialise`), its states those at rest.
    process : SampledProcess
        The process, sampled at the controller's scan interval.
    rest : tuple of float
        Measurement and output at which the process is at rest [%].
    ranges : SignalRanges
        What 0 and 100 % of the signals are in the controller's units.
    around : Surroundings
        Noise, valve, and the load's own way to the measurement.
    """
    p = Parts()
    own = controller.precision == "float64" and ranges.pv.ends == PERCENT.ends
    setpoint, y = ("sp", "pv") if own else ("setpoint", "measurement")
    where = "added to the output at the process" if around.load_process is None else "which has a way of its own"
    inputs = [Quantity(setpoint, "setpoint", "%"), Quantity("load", f"load, {where}", "%")]
    ways = [_Way(p, "process", process)]
    if around.load_process is not None:
        ways.append(_Way(p, "load_way", around.load_process.sampled(process.scan)))
    if around.noise is not None:
        inputs.append(Quantity("noise", "noise, added to the measurement", "%"))
    _measured(p, ways, y, rest[0], noisy=around.noise is not None)
    if not own:
        low = p.coefficient("span_low", ranges.pv.low, "0 % in the controller's units", "units")
        per = p.coefficient("span_per", ranges.pv.change_from_percent(1.0), "the controller's units per percent", "units/%")
        p.first("sp", low + Name(setpoint) * per, "setpoint in the controller's units", "units")
        p.first("pv", low + Name(y) * per, "measurement in the controller's units", "units")
    output = controller.output
    if ranges.op.ends != PERCENT.ends:
        bottom = p.coefficient("output_low", ranges.op.low, "0 % of the output in the controller's units", "units")
        per = p.coefficient("output_per", ranges.op.change_in_percent(1.0), "percent per unit of the output", "%/unit")
        output = p.then("output", (Name(controller.output) - bottom) * per, "output in percent").id
    at_rest = p.coefficient("process_rest", rest[1], "output at which the process is at rest")
    also, reaches = [y], Name(output)
    if around.valve is not None:
        reaches = valve_position(p, reaches, around.valve, at_rest, process.scan)
        also.append(reaches.id)
    if around.load_process is None:
        ways[0].move(reaches - at_rest + Name("load"))
    else:
        ways[0].move(reaches - at_rest)
        ways[1].move(Name("load"))
    lines = tuple(line for way in ways for line in way.lines)
    lengths = tuple(way.process.scans for way in ways if way.lines)
    program = replace(controller, inputs=(), lines=lines, lengths=lengths, output=output, also=tuple(also))
    wide = (*(q.name for q in inputs), *(f"{way.name}_late" for way in ways))
    return replace(p.added(program, wide), inputs=tuple(inputs))


class _Way:
    """A sampled process in a loop's program, under a name of its own."""

    def __init__(self, p: Parts, name: str, process: SampledProcess) -> None:
        self._p, self.name, self.process = p, name, process
        self._x = [p.state(f"{name}_x{i}", "state of the process") for i in range(1, process.row.size + 1)]
        self._uses_last = bool(process.through or process.early.any())
        text = "what reached the process in the last scan"
        self._was = p.state(f"{name}_was", text) if self._uses_last else Name(f"{name}_was")
        self.lines: tuple[Line, ...] = ()

    def measured(self) -> list[Expr]:
        """Return what its states make of the measurement, as a sum."""
        weights = [*self.process.row.tolist(), self.process.through]
        return [
            self._p.coefficient(f"{self.name}_c{i}", weight, "measurement per state", "-") * state
            for i, (weight, state) in enumerate(zip(weights, [*self._x, self._was], strict=True), 1)
            if weight
        ]

    def move(self, by: Expr) -> None:
        """Go on by a scan with what enters."""
        moved = self._p.then(f"{self.name}_in", by, "what enters the process, from rest on")
        if self.process.scans:
            self.lines = (Line(f"{self.name}_late", "what leaves the dead time", "%", moved.id),)
        late = Name(f"{self.name}_late") if self.process.scans else moved
        self._move_states(late)
        if self._uses_last:
            self._p.then(self._was.id, late, "kept for the next scan")

    def _move_states(self, late: Name) -> None:
        """Assign the states: in place, the last first, where none depends on a later one."""
        p, x, n = self._p, self._x, len(self._x)
        rows = np.column_stack([self.process.growth, self.process.early, self.process.late]).tolist()
        in_place = all(rows[i][j] == 0 for i in range(n) for j in range(i + 1, n))
        now = [*x, self._was, late]
        for i in reversed(range(n)):
            parts: list[Expr] = [
                p.coefficient(f"{self.name}_a{i + 1}_{j + 1}", weight, "what a scan adds, per state", "-") * state
                for j, (weight, state) in enumerate(zip(rows[i], now, strict=True))
                if weight
            ]
            name = x[i].id if in_place else f"{self.name}_n{i + 1}"
            p.then(name, x[i] + _sum(parts), "the process goes on (section 9)")
            if in_place:
                p.then(name, blocks.flushed(x[i]), "no denormal numbers (section 7)")
        for i in range(0 if in_place else n):
            p.then(x[i].id, blocks.flushed(Name(f"{self.name}_n{i + 1}")), "no denormal numbers (section 7)")


def _sum(parts: list[Expr]) -> Expr:
    return blocks.summed(parts) if parts else expr(0.0)


def _measured(p: Parts, ways: list[_Way], y: str, rest: float, *, noisy: bool) -> None:
    """Assign the measurement: where it rests, what comes by each way, and noise."""
    level = p.coefficient("measurement_rest", rest, "measurement at which the process is at rest")
    found = level + _sum(ways[0].measured())
    for way in ways[1:]:
        found = found + _sum(way.measured())
    p.first(y, found + Name("noise") if noisy else found, "measurement (section 9)")
