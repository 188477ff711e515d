"""A card's settings to an `Algorithm`: the numbers of its terms, filter and windup in canonical units."""

from __future__ import annotations

import math
from typing import Any

from pidemu.algorithm import Algorithm, Place
from pidemu.card.models import Filter, Form, WindupBackCalculation
from pidemu.errors import SettingError, UndefinedError
from pidemu.settings import Settings
from pidemu.units import Role, Spans, parse_unit, to_canonical


def _pick(settings: Settings, value: str | float | None, default: float) -> float:
    """Return a number that a card gives itself, or by the name of a setting."""
    if isinstance(value, str):
        return settings[value].canonical
    return default if value is None else value


def algorithm_of(settings: Settings, *, own_units: bool = False) -> Algorithm:
    """Return the algorithm with its numbers; see `Settings.algorithm`."""
    equation = settings.equation
    engineering = equation.signals == "engineering"
    spans = Spans() if own_units and engineering else settings.spans

    def number(role: Role, default: float) -> float:
        value = settings.by_role(role)
        if value is None:
            return default
        if value.off:
            return 0.0
        return to_canonical(role, value.value, parse_unit(value.unit), spans)

    gain = number(Role.GAIN, 0.0 if equation.form is Form.PARALLEL else 1.0)
    scale = number(Role.MULTIPLIER, 1.0)
    rate = number(Role.INTEGRAL, 0.0) if equation.integral.on != "none" else 0.0
    time = number(Role.DERIVATIVE, 0.0) if equation.derivative.on != "none" else 0.0
    if equation.form is Form.PARALLEL:
        scale *= float(spans.ratio) if engineering else 1.0
        kp = gain * number(Role.MULTIPLIER, 1.0)
        ki, kd = rate * scale, time * scale
    else:
        kp = gain * scale
        ki, kd = kp * rate, kp * time
    filt = equation.derivative.filter
    if filt is not None and equation.derivative.on == "none" and filt.applies_to in ("term", "lead-lag"):
        filt = None  # it filters what is not there
    Tf, place, order = _filter(settings, filt, rate, time)
    if filt is not None and filt.applies_to == "lead-lag":
        kd -= kp * Tf
    if equation.proportional.on == "none":
        kp = 0.0
    if equation.form is Form.SERIES and kd and not kp:
        raise UndefinedError(
            f"{settings.card.id}: a series form with derivative but without proportional action is not defined; "
            f"change {settings.variant.choice_text}"
        )
    windup = equation.integral.windup
    return Algorithm(
        series=equation.form is Form.SERIES,
        kp=kp,
        ki=ki,
        kd=kd,
        b=_weight(settings, equation.proportional.on, equation.proportional.weight),
        c=_weight(settings, equation.derivative.on, equation.derivative.weight),
        Tf=Tf,
        filter_on=place,
        filter_order=order,
        velocity=equation.implementation == "velocity",
        integral_rule=equation.integral.rule,
        derivative_rule=equation.derivative.rule,
        filter_rule=(equation.derivative.filter and equation.derivative.filter.rule) or equation.derivative.rule,
        windup=windup.scheme,
        tracking_time=_tracking(settings, rate, time, kp, ki, kd) if ki else 0.0,
        accumulated=equation.proportional.accumulated,
        load_output=equation.transfer.start == "load-output",
        restarted=equation.transfer.derivative == "restarted",
    )


def _weight(settings: Settings, on: str, weight: str | float | None) -> float:
    return _pick(settings, weight, 1.0) if on == "weighted" else float(on == "error")


def _filter(settings: Settings, filt: Filter | None, rate: float, time: float) -> tuple[float, Place, Any]:
    if filt is None:
        return 0.0, "term", 1
    place: Place = "term" if filt.applies_to == "lead-lag" else filt.applies_to
    if filt.time is not None:
        return _pick(settings, filt.time, 0.0), place, filt.order
    base = time / (1 + rate * time) if filt.of == "effective-derivative" else time
    if base == 0:
        return 0.0, place, filt.order
    if isinstance(filt.gain, str) and settings[filt.gain].off:
        return 0.0, place, filt.order
    if filt.gain is not None:
        gain = _pick(settings, filt.gain, math.inf)
        if gain == 0:
            raise SettingError(
                f"{settings.card.id}: {filt.gain} is 0: a derivative gain of zero is no derivative; set the derivative to zero"
            )
        return base / gain, place, filt.order
    return base * _pick(settings, filt.ratio, 0.0), place, filt.order


def _tracking(settings: Settings, rate: float, time: float, kp: float, ki: float, kd: float) -> float:
    """Return the time in which the integral follows the cut-off [s] (specs/equations.md, section 5)."""
    parallel = settings.equation.form is Form.PARALLEL and kp != 0
    integral_time, derivative_time = (kp / ki, kd / kp) if parallel else (1 / rate, time)
    windup = settings.equation.integral.windup
    given = windup.tracking_time if isinstance(windup, WindupBackCalculation) else "Ti"
    if given == "Ti":
        return abs(integral_time)
    if given == "sqrt(Ti Td)":
        return math.sqrt(abs(integral_time * derivative_time)) if derivative_time else abs(integral_time)
    return _pick(settings, given, integral_time)
