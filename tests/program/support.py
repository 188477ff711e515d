"""Signals, and a plain loop over every option of the linear algorithm, written from specs/equations.md, sections 2 and 4."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pidemu.algorithm.model import Algorithm
from pidemu.backends.python import compiled
from pidemu.card.model.base import Rule
from pidemu.card.model.signals import SignalFilter
from pidemu.program.ir import Program
from tests.helpers import Floats


def signals(seed: int, n: int = 120, amplitude: float = 40.0) -> tuple[Floats, Floats]:
    """Setpoint steps and a wandering, noisy measurement, not at rest at the start."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-amplitude, amplitude, n // 20 + 1), 20)[:n]
    pv = 0.5 * sp + np.cumsum(rng.normal(0, amplitude / 20, n)) + rng.normal(0, 0.5, n)
    return sp, pv


def states_of(program: Program, sp: Floats, pv: Floats, *names: str) -> list[Floats]:
    """Run a program in automatic and return what it keeps under these names after every scan."""
    functions = compiled(program)
    state = list(functions.initial)
    places = [[q.name for q in program.states].index(name) for name in names]
    rows = []
    for r, y in zip(sp.tolist(), pv.tolist(), strict=True):
        functions.scan(state, r, y, 1.0, math.nan)
        rows.append([float(state[place]) for place in places])
    return list(np.array(rows).T)


def lagged(x: Floats, f: SignalFilter[float] | None, h: float) -> Floats:
    """A first-order lag that starts in the steady state of the first sample."""
    if f is None:
        return x
    out, Tf = [float(x[0])], f.time or 0.0
    for new, old in zip(x[1:].tolist(), x[:-1].tolist(), strict=True):
        if f.factor is not None:
            out.append(out[-1] + f.factor * (new - out[-1]))
        elif f.rule is Rule.BACKWARD:
            out.append((Tf * out[-1] + h * new) / (Tf + h))
        elif f.rule is Rule.FORWARD:
            out.append(out[-1] + h / Tf * (old - out[-1]))
        else:
            out.append(((2 * Tf - h) * out[-1] + h * (new + old)) / (2 * Tf + h))
    return np.array(out)


def derivative(x: Floats, kd: float, Tf: float, h: float, rule: Rule) -> Floats:
    """The derivative term of a signal, from rest."""
    D, xf = [0.0], float(x[0])
    decay = math.exp(-h / Tf) if Tf else 0.0
    for n in range(1, len(x)):
        x0, x1, x2, x3 = (float(x[max(n - k, 0)]) for k in range(4))
        if rule is Rule.FOUR_POINT:
            D.append(kd * (3 * (x0 - x3) + x1 - x2) / (10 * h))
        elif not Tf:
            D.append(kd * (x0 - x1) / h)
        elif rule is Rule.EXACT:
            D.append(decay * D[-1] + kd * (1 - decay) * (x0 - x1) / h)
        elif rule is Rule.LAGGED_DIFFERENCE:
            xf = decay * xf + (1 - decay) * x0
            D.append(kd / Tf * (x0 - xf))
        elif rule is Rule.BACKWARD:
            D.append((Tf * D[-1] + kd * (x0 - x1)) / (Tf + h))
        elif rule is Rule.FORWARD:
            D.append((1 - h / Tf) * D[-1] + kd / Tf * (x0 - x1))
        else:
            D.append(((2 * Tf - h) * D[-1] + 2 * kd * (x0 - x1)) / (2 * Tf + h))
    return np.array(D)


@dataclass(frozen=True)
class Parts:
    """What P and D are, and what the integral acts on, scan by scan."""

    P: Floats
    D: Floats
    w: Floats


def parts(a: Algorithm, h: float, sp: Floats, pv: Floats) -> Parts:
    """Previous-scan measurement, then the filters, then the terms; the filtered error goes with P and D on error."""
    y = np.concatenate([pv[:1], pv[:-1]]) if a.measurement.previous_scan else pv
    y, r = lagged(y, a.measurement.filter, h), lagged(sp, a.setpoint.filter, h)
    e = lagged(r - y, a.error.filter, h)
    filtered = a.error.filter is not None
    D = derivative(e if filtered else a.c * r - y, a.kd, a.Tf, h, a.derivative.rule)
    P = a.kp * (e if filtered else a.b * r - y)
    return Parts(P, D, e + D / a.kp if a.series else e)


def positional(a: Algorithm, h: float, sp: Floats, pv: Floats, u0: float) -> Floats:
    """The sum of the terms, unlimited: ``I = u0 - P - D`` in the first scan, and then ``ki h w`` more in each (backward)."""
    x, out = parts(a, h, sp, pv), []
    I = u0 - x.P[0] - x.D[0]  # noqa: E741 (the field's symbol)
    for n in range(len(sp)):
        I += a.ki * h * x.w[n] if n else 0.0  # noqa: E741
        out.append(x.P[n] + I + x.D[n])
    return np.array(out)


def velocity(a: Algorithm, h: float, sp: Floats, pv: Floats, u0: float) -> Floats:
    """The increments of the terms added to the last output, unlimited."""
    x, out = parts(a, h, sp, pv), [u0]
    for n in range(1, len(sp)):
        out.append(out[-1] + (x.P[n] - x.P[n - 1]) + a.ki * h * x.w[n] + (x.D[n] - x.D[n - 1]))
    return np.array(out)
