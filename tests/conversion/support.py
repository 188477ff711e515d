"""Two controllers side by side: the same record through both, and their responses by an own computation."""

from __future__ import annotations

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

import pidemu
from pidemu.arrays import Complexes
from pidemu.arrays import Floats as Floats  # noqa: PLC0414  # the tests take it from here
from pidemu.card.load import Card
from pidemu.card.references import is_active
from pidemu.checks.runs import working
from pidemu.conversion.target.computed import is_computed
from pidemu.settings.settings import Settings, limits
from pidemu.units import Role
from tests.helpers import WIDE, settings_of

Complex = Complexes


def random_signal(seed: int, scans: int = 200, rest: int = 3) -> Floats:
    """At rest at 50 % for a few scans, then a random walk with jumps."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 0.5, scans) + 10 * (rng.random(scans) < 0.05) * rng.normal(0, 1, scans)
    steps[:rest] = 0
    return np.asarray(50 + np.cumsum(steps))


def outputs(settings: Settings, sp: Floats, pv: Floats, scan: float, start: float = 50.0) -> Floats:
    """Output of a reverse-acting controller that no limit touches, at rest at `start` before the first scan."""
    return pidemu.Controller(settings, scan, output_limits=WIDE, initial_output=start).run(sp, pv)


def difference(a: Floats, b: Floats) -> float:
    """Largest difference of two outputs, per span or per what they move over where that is more."""
    size = max(100.0, float(np.max(np.abs(a))), float(np.max(np.abs(b))))
    return float(np.max(np.abs(a - b))) / size


def continuous(settings: Settings, w: Floats, *, setpoint: bool = False) -> Complex:
    """Response of a card whose filter sits on the derivative or is a lead-lag, from the dials in canonical units (equations.md, 2).

    Written out term by term as block diagrams are drawn, not as the quotient of polynomials that pidemu uses.
    """
    signal = settings.equation.setpoint if setpoint else settings.equation.measurement
    lag = signal.filter.time if signal is not None and signal.filter is not None else None
    Tf = settings[lag].canonical if isinstance(lag, str) else 0.0
    return np.asarray(_behind_the_filters(settings, w, setpoint) / (1 + 1j * w * Tf))


def _behind_the_filters(settings: Settings, w: Floats, setpoint: bool) -> Complex:
    s = 1j * w
    a = settings.algorithm()
    assert a.filter_on == "term"
    dials = {v.role.value: v.canonical for v in settings.values() if v.active}
    e = settings.equation
    K = dials.get("gain", 0.0) * dials.get("multiplier", 1.0)
    filt = e.derivative.filter
    lead_lag = filt is not None and filt.applies_to == "lead-lag"
    b, c = (a.b, a.c) if setpoint else (1.0, 1.0)
    if e.form == "parallel":
        ki, kd = (dials.get(x, 0.0) * dials.get("multiplier", 1.0) for x in ("integral", "derivative"))
        return np.asarray(b * K + ki / s + c * kd * s / (1 + a.Tf * s))
    rate, Td = dials.get("integral", 0.0), dials.get("derivative", 0.0)
    if e.form == "standard":
        return np.asarray(K * (b + rate / s + c * Td * s / (1 + a.Tf * s)))
    lead = (1 + Td * s) / (1 + a.Tf * s) if lead_lag else 1 + Td * s / (1 + a.Tf * s)
    if not setpoint:
        return np.asarray(K * (1 + rate / s) * lead)
    return np.asarray(K * (b + rate / s + (1 + rate / s) * c * (lead - 1)))


def needed(card: Card, options: dict[str, object] | None = None) -> dict[str, object]:
    """Values for the dials that a conversion does not compute and the card has no default for."""
    equation = card.variant(options).equation
    within = equation.integral.limits
    low = None if within is None else within.low
    return {
        n: -working(*limits(s)) if n == low else working(*limits(s))
        for n, s in equation.settings.items()
        if s.default is None and is_active(equation, n, s) and not is_computed(equation, n, Role(s.sets)) and s.sets != "multiplier"
    }


HUNDRED: dict[str, object] = {"pv_range": (0, 100), "op_range": (0, 100)}
"""Ranges as they are stated where a test is about something else: a unit is then a percent on either side."""


def settings_that_act(data: st.DataObject, card: Card) -> Settings:
    """Draw settings of a card, with ranges of 0 to 100 and at least one term; with none there is no law to compare."""
    drawn = settings_of(data, card).changed(HUNDRED)
    assume(any(drawn.law().moments()))
    return drawn


def rules(settings: Settings) -> list[object]:
    """Rules of the terms that are in use, and the number format."""
    a = settings.algorithm()
    lags = [lag for lag in (a.setpoint.filter, a.measurement.filter, a.error.filter) if lag is not None]
    used = [a.ki and a.integral.rule, a.kd and a.derivative.rule, a.Tf and a.filter_rule, *(lag.rule for lag in lags)]
    # a series form multiplies integral and derivative: by two rules that is not what a sum of the two gives
    mixed = bool(a.ki and a.kd) and a.integral.rule is not a.derivative.rule
    return [*used, a.arithmetic.type, a.measurement.previous_scan, mixed and a.series]
