"""Closed loops as scan programs: the sampled process is appended to the controller's program (specs/equations.md, section 9).

In a scan the controller reads the measurement, and its output stands until the next scan. Setpoint, load, measurement and output
are in percent; where the controller computes in other units, the program converts.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pidemu.process.hold import SampledProcess
from pidemu.program import blocks
from pidemu.program.ir import Assign, Expr, Line, Name, Operand, Program, Quantity, expr
from pidemu.settings.ranges import PERCENT, SignalRanges

_IN_PERCENT: Final = SignalRanges(PERCENT, PERCENT)


@dataclass
class Parts:
    """What is added around a program."""

    coefficients: list[tuple[Quantity, float]] = field(default_factory=list)
    states: list[tuple[Quantity, float]] = field(default_factory=list)
    before: list[Assign] = field(default_factory=list)
    after: list[Assign] = field(default_factory=list)

    def coefficient(self, name: str, value: float, text: str, unit: str = "%") -> Name:
        """Add a number."""
        self.coefficients.append((Quantity(name, text, unit), value))
        return Name(name)

    def state(self, name: str, text: str, unit: str = "%", initial: float = 0.0) -> Name:
        """Add something kept from scan to scan."""
        self.states.append((Quantity(name, text, unit), initial))
        return Name(name)

    def first(self, name: str, value: Operand, text: str, unit: str = "%") -> Name:
        """Assign at the start of the scan."""
        self.before.append(Assign(name, expr(value), text, unit))
        return Name(name)

    def then(self, name: str, value: Operand, text: str, unit: str = "%") -> Name:
        """Assign at the end of the scan."""
        self.after.append(Assign(name, expr(value), text, unit))
        return Name(name)

    def added(self, program: Program, wide: tuple[str, ...] = ()) -> Program:
        """Return the program with the parts, which are float64 whatever the controller computes in."""
        names = {q.name for q, _ in (*self.coefficients, *self.states)} | {a.name for a in (*self.before, *self.after)} | set(wide)
        return replace(
            program,
            coefficients=(*program.coefficients, *(q for q, _ in self.coefficients)),
            values=(*program.values, *(x for _, x in self.coefficients)),
            states=(*program.states, *(q for q, _ in self.states)),
            initial=(*program.initial, *(x for _, x in self.states)),
            body=(*self.before, *program.body, *self.after),
            wide=program.wide | (names - {"sp", "pv"}) if program.precision == "float32" else program.wide,
        )


def closed_loop(
    controller: Program, process: SampledProcess, rest: tuple[float, float], ranges: SignalRanges = _IN_PERCENT
) -> Program:
    """Return the program of a controller and a process that starts at rest; it reads setpoint and load, both in percent.

    It records the output, then the measurement, both in percent.

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
    """
    p = Parts()
    own = controller.precision == "float64" and ranges.pv.ends == PERCENT.ends
    setpoint, y = ("sp", "pv") if own else ("setpoint", "measurement")
    x = [p.state(f"process_x{i}", "state of the process") for i in range(1, process.row.size + 1)]
    uses_last = bool(process.through or process.early.any())
    was = p.state("process_was", "what reached the process in the last scan") if uses_last else Name("process_was")
    _measured(p, process, [*x, was], y, rest[0])
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
    moved = p.then("process_in", Name(output) - at_rest + Name("load"), "what enters the process, from rest on")
    lines = (Line("process_late", "what leaves the dead time", "%", moved.id),) if process.scans else ()
    late = Name("process_late") if process.scans else moved
    _moved(p, process, x, was, late)
    if uses_last:
        p.then(was.id, late, "kept for the next scan")
    program = replace(controller, inputs=(), lines=lines, lengths=(process.scans,) if lines else (), output=output, also=(y,))
    inputs = (Quantity(setpoint, "setpoint", "%"), Quantity("load", "load, added to the output at the process", "%"))
    return replace(p.added(program, (setpoint, "load", "process_late")), inputs=inputs)


def _sum(parts: list[Expr]) -> Expr:
    return blocks.summed(parts) if parts else expr(0.0)


def _measured(p: Parts, process: SampledProcess, x: list[Name], y: str, rest: float) -> None:
    level = p.coefficient("measurement_rest", rest, "measurement at which the process is at rest")
    weights = [*process.row.tolist(), process.through]
    parts: list[Expr] = [
        p.coefficient(f"process_c{i}", weight, "measurement per state", "-") * state
        for i, (weight, state) in enumerate(zip(weights, x, strict=True), 1)
        if weight
    ]
    p.first(y, level + _sum(parts), "measurement (section 9)")


def _moved(p: Parts, process: SampledProcess, x: list[Name], was: Name, late: Name) -> None:
    """Go on by a scan; states are assigned in place, the last first, where none depends on a later one."""
    n = len(x)
    rows = np.column_stack([process.growth, process.early, process.late]).tolist()
    in_place = all(rows[i][j] == 0 for i in range(n) for j in range(i + 1, n))
    now = [*x, was, late]
    for i in reversed(range(n)):
        parts: list[Expr] = [
            p.coefficient(f"process_a{i + 1}_{j + 1}", weight, "what a scan adds, per state", "-") * state
            for j, (weight, state) in enumerate(zip(rows[i], now, strict=True))
            if weight
        ]
        name = x[i].id if in_place else f"process_n{i + 1}"
        p.then(name, x[i] + _sum(parts), "the process goes on (section 9)")
        if in_place:
            p.then(name, blocks.flushed(x[i]), "no denormal numbers (section 7)")
    for i in range(0 if in_place else n):
        p.then(x[i].id, blocks.flushed(Name(f"process_n{i + 1}")), "no denormal numbers (section 7)")
