"""The record that a printed block is tested with inside its controller: standard cases, one after the other, without a restart."""

from __future__ import annotations

from itertools import chain
from math import isnan, nan
from typing import Final

import numpy as np

from pidemu.backends.python import compiled, starting
from pidemu.backends.structured_text_self_test import SelfTest
from pidemu.controller.signals import SIGNALS
from pidemu.program.ir import Program
from pidemu.vector_sets.signals import ABSENT
from pidemu.vector_sets.vector_set import VectorSet

_CASES: Final = ("linear", "saturation", "manual")
_WITH: Final = {"cascade": "cascade", "track": "tracking", "reset": "external-reset", "feedforward": "feedforward"}
"""Further cases, by the program's input that they are about."""


def block_test(program: Program, vectors: VectorSet) -> SelfTest:
    """Return the record of a program with its outputs.

    Parameters
    ----------
    program : Program
        The program that is printed.
    vectors : VectorSet
        The vectors of its settings.
    """
    names = {q.name for q in program.inputs}
    wanted = (*_CASES, *(case for signal, case in _WITH.items() if signal in names))
    cases = [case for case in vectors.cases if case.name in wanted]
    arguments = {program_name: name for name, program_name in SIGNALS.items()}
    signals = {}
    for q in program.inputs:
        name = arguments.get(q.name, q.name)
        absent = 0.0 if name == "feedforward" else ABSENT.get(name, nan)
        parts = (case.inputs.get(name, (absent,) * len(case.outputs)) for case in cases)
        column = list(chain.from_iterable(parts))
        signals[q.name] = [0.0 if isnan(x) else x for x in column] if name == "feedforward" else column
    with np.errstate(all="ignore"):
        outputs = compiled(program).run(list(starting(program)), *signals.values())
    return SelfTest(signals, [float(u) for u in outputs])
