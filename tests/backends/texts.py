"""Programs with every kind of text, and the same with other texts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pidemu
from pidemu.program.ir import Assign, Line, Program, Quantity


@cache
def programs() -> tuple[Program, ...]:
    """Return programs with every kind of text: one in float64, one in float32 with wide numbers, one with delay lines."""
    plain = (("emerson/deltav", {"GAIN": 2, "RESET": 60, "RATE": 16}), ("iec/61131-3-pid", {"KP": 1, "TR": 8}))
    found = [pidemu.Controller(pidemu.load_card(name).settings(given)).program for name, given in plain]
    dahlin = pidemu.load_card("generic/dahlin")
    values = dict(dahlin.data.examples[-1].given)
    found.append(pidemu.Controller(dahlin.settings(values)).program)
    return tuple(found)


def retold(program: Program, text: str) -> Program:
    """Return the program with one text in place of all of its own."""

    def told(q: Quantity) -> Quantity:
        return replace(q, text=text, unit=text)

    return replace(
        program,
        title=text,
        inputs=tuple(map(told, program.inputs)),
        coefficients=tuple(map(told, program.coefficients)),
        states=tuple(map(told, program.states)),
        lines=tuple(Line(x.name, text, text, x.source) for x in program.lines),
        body=tuple(Assign(a.name, a.value, text, text) for a in program.body),
    )
