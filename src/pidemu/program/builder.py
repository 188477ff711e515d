"""An algorithm, a scan interval and limits to a scan program.

Order within a scan (specs/equations.md, section 4): read, filter, terms, sum, limits, then what is done after the output.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pidemu.algorithm.model import Algorithm, check_filters
from pidemu.card.model.base import Rule
from pidemu.columns.functions import each, isfinite
from pidemu.errors import ScanError
from pidemu.program.blocks import EXTRA_INPUTS, TINY, TINY_SINGLE, Builder
from pidemu.program.dahlin import dahlin
from pidemu.program.integer import integer
from pidemu.program.ir import Program
from pidemu.program.positional import positional
from pidemu.program.terms import terms
from pidemu.program.velocity import velocity
from pidemu.settings.action import Action


def build(
    algorithm: Algorithm,
    scan: float,
    *,
    action: Action = "reverse",
    limits: tuple[float, float] = (0.0, 100.0),
    bias: float = 0.0,
    initial_output: float = 0.0,
    signals: Sequence[str] = (),
    title: str = "PID",
) -> Program:
    """Return the scan program of an algorithm.

    Parameters
    ----------
    algorithm : Algorithm
        What to run, reverse acting.
    scan : float
        Scan interval [s].
    action : {"reverse", "direct"}
        Control action: with ``"direct"`` the output rises when the measurement rises.
    limits : tuple of float
        Output limits [%, or the card's output units].
    bias : float
        Output at zero error of a positional controller without integral [as limits].
    initial_output : float
        Output before the first scan [as limits].
    signals : sequence of str
        What the program reads besides setpoint, measurement, mode and the operator's output: ``"cascade"``, ``"track"``,
        ``"reset"``,
        ``"feedforward"``.
    title : str
        The program's title.

    Raises
    ------
    ScanError
        The scan interval, the limits or the bias cannot be used, or the combination is not defined.
    """
    _check(algorithm, scan, limits, bias, initial_output, signals)
    sign = 1.0 if action == "reverse" else -1.0
    a = replace(algorithm, kp=sign * algorithm.kp, ki=sign * algorithm.ki, kd=sign * algorithm.kd)
    b = Builder(title, signals, sign, TINY_SINGLE if algorithm.arithmetic.type == "float32" else TINY)
    own_terms = replace(a, kp=0.0, kd=0.0) if a.arithmetic.type == "integer" else a  # counts have terms of their own
    common = terms(b, own_terms, scan, _representable(limits, a), initial_output)
    if a.dahlin is not None:
        dahlin(b, a, scan, sign, common)
    elif a.arithmetic.type == "integer":
        integer(b, a, scan, common)
    elif a.velocity:
        velocity(b, a, scan, common)
    else:
        positional(b, a, scan, common, bias or (0.0 if a.ki else a.bias))
    return b.program(a)


def _representable(limits: tuple[float, float], a: Algorithm) -> tuple[float, float]:
    """Return the limits as the program's numbers can hold them, never outside those given."""
    if a.arithmetic.type != "float32":
        return limits
    return each(_not_below, limits[0]), -each(_not_below, -limits[1])


def _not_below(x: float) -> float:
    """Return the smallest float32 number that is not below."""
    found = np.float32(x)
    return float(np.nextafter(found, np.float32(math.inf)) if float(found) < x else found)


def _check(a: Algorithm, h: float, limits: tuple[float, float], bias: float, initial_output: float, signals: Sequence[str]) -> None:
    if not (isfinite(h) and (h > 0 or (h == 0 and a.derivative.rule is Rule.LAGGED_DIFFERENCE))):
        raise ScanError(f"scan interval {h:g} s is not a positive number")
    for name, value in (("bias", bias), ("initial output", initial_output)):
        if not isfinite(value):
            raise ScanError(f"the {name} {value:g} is not a finite number")
    low, high = limits
    if not low < high:
        raise ScanError(f"output limits {low:g} to {high:g} are not a range; give low, then high")
    if bias and (a.ki or a.velocity):
        raise ScanError("a bias belongs to a positional controller without integral action; leave it out")
    windup = a.integral.windup
    if a.ki and a.integral.rule not in windup.rules:
        words = " and ".join(rule.value for rule in windup.rules)
        raise ScanError(f"{windup.scheme} windup is defined for the {words} rules only")
    for name in signals:
        if name not in EXTRA_INPUTS:
            raise ScanError(f"there is no signal '{name}'; signals: {', '.join(EXTRA_INPUTS)}")
    check_filters(a, h)
