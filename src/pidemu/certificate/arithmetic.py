"""What the precision of two controllers makes of slow integrals (specs/equations.md, section 7)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pidemu.backends.python import compiled
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.scaled_controller import ScaledController
from pidemu.errors import PidemuError
from pidemu.program.builder import build
from pidemu.program.ir import StateRole
from pidemu.records.standard import REST
from pidemu.settings.ranges import UNLIMITED

_KEPT: Final = (StateRole.INTEGRAL, StateRole.COUNTS, StateRole.INTEGRAL_REMAINDER)
"""States that an integral is kept in: the sum; with whole numbers the output's sum and the remainder."""
_RANGE: Final = (1e-18, 50.0)
"""Errors between which the smallest that integrates is looked for [% of span]; the first is nothing beside a signal of 50 %."""
_STEPS: Final = 50
"""Bisections: more than a float32 can tell apart."""
_SCANS: Final = 6
_DIFFERS: Final = 0.01
"""Relative difference of smallest errors that is worth a word."""
_MEASURED: Final = 1e-3
"""An error that a transmitter can show [% of span]: a converter of 16 bits resolves 0.0015 %. Smaller ones lose nothing."""
_NEGLIGIBLE: Final = 1e-4
"""Below this no digits are given [% of span]."""


def smallest_error(side: ScaledController) -> float:
    """Return the smallest error that still integrates with the output at 50 % [% of the measurement span].

    It is found by emulation, with the setpoint above a measurement of 50 %: the controller's own program starts in the steady state
    of that error, bumpless, with nothing of the derivative, and the integral moves within a few scans or never. Bands and limits of
    the integral are left out. Where the state holds the integral of ``ki e`` it moves from half a unit in its last place:
    ``ki h e``; where it holds that of ``e/Ti`` or ``e``: ``h e/Ti`` or ``h e``.

    Parameters
    ----------
    side : ScaledController
        A controller with integral action.

    Returns
    -------
    float
        The error [%]; infinite where one of 50 % does not integrate.

    Raises
    ------
    ScanError
        It cannot be emulated at this interval.
    """
    a = side.own.at_rest
    plain = replace(a, error=replace(a.error, shape="linear"), integral=replace(a.integral, deadband=None, limits=None))
    pv, op = side.settings.own_ranges
    program = build(plain, side.scan, limits=UNLIMITED, initial_output=op.from_percent(REST))
    functions = compiled(program)
    names = [q.name for q in program.states]
    watched = [names.index(name) for name in _KEPT if name in names] or [names.index(StateRole.OUTPUT)]
    at, unit = pv.from_percent(REST), pv.change_from_percent(1.0)

    def moves(error: float) -> bool:
        state, sp = list(functions.initial), at + error * unit
        functions.scan(state, sp, at, 1.0, math.nan)
        before = [state[i] for i in watched]
        for _ in range(_SCANS):
            functions.scan(state, sp, at, 1.0, math.nan)
        return [state[i] for i in watched] != before

    with np.errstate(all="ignore"):
        if not moves(_RANGE[1]):
            return math.inf
        still, moving = (math.log(e) for e in _RANGE)
        for _ in range(_STEPS):
            middle = (still + moving) / 2
            still, moving = (still, middle) if moves(math.exp(middle)) else (middle, moving)
    return math.exp(moving)


def arithmetic_differences(source: ScaledController, target: ScaledController) -> Iterator[NonlinearDifference]:
    """Yield the smallest errors that two controllers integrate, where these differ and one is large enough to be measured."""
    both = (source, target)
    precisions = [side.own.arithmetic.type for side in both]
    if precisions == ["float64", "float64"] or not all(side.integrates for side in both):
        return
    kinds = " and ".join(f"{side.name} computes in {_KINDS[side.own.arithmetic.type]}" for side in both)
    try:
        least = smallest_error(source), smallest_error(target)
    except PidemuError as error:
        if precisions[0] != precisions[1]:
            text = f"The smallest error that integrates is not known ({error}); {kinds}."
            yield NonlinearDifference("arithmetic", text, {})
        return
    if max(least) >= _MEASURED and not math.isclose(*least, rel_tol=_DIFFERS):
        words = ", ".join(f"{_least(e)} on {side.name}" for e, side in zip(least, both, strict=True))
        text = f"With the output at 50 % the smallest error that the integral follows is {words}: {kinds}."
        yield NonlinearDifference("arithmetic", text, {"smallest error that integrates [% of PV span]": least})


_KINDS: Final = {"float64": "64 bits", "float32": "32 bits", "integer": "whole numbers"}


def _least(error: float) -> str:
    if math.isinf(error):
        return "above 50 % of span"
    return "below 0.0001 % of span" if error < _NEGLIGIBLE else f"{error:.2g} % of span"
