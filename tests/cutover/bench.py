"""What the tests of the cut-over have in common: cards at typical settings, and plans read and followed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

import pytest

import pidemu
from pidemu import Controller, Settings
from pidemu.card.load import Card
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import default_scan
from pidemu.card.references import is_active
from pidemu.cutover.plan import TransferPlan, transfer_plan
from pidemu.errors import SettingError
from pidemu.settings.settings import limits
from pidemu.units import Role, Spans, from_canonical, parse_unit
from tests.helpers import option_combinations

SP, PV, OP = 54.0, 50.0, 43.0
E = SP - PV
WIDE = (-1000.0, 1000.0)

_TYPICAL: Final[dict[Role, float]] = {
    Role.GAIN: 1.5,
    Role.MULTIPLIER: 1.0,
    Role.INTEGRAL: 1 / 30,
    Role.DERIVATIVE: 6.0,
    Role.FILTER_TIME: 1.2,
    Role.FILTER_RATIO: 0.125,
    Role.FILTER_GAIN: 8.0,
    Role.PROPORTIONAL_WEIGHT: 0.7,
    Role.DERIVATIVE_WEIGHT: 0.3,
    Role.TRACKING_TIME: 10.0,
    Role.FILTER_FACTOR: 0.5,
    Role.INTEGRAL_LIMIT: 500.0,
    Role.DEADBAND: 1.0,
    Role.GAP_GAIN: 0.5,
    Role.LINEARITY: 0.8,
    Role.FEEDFORWARD_GAIN: 1.0,
    Role.SETPOINT_RATE: 2.0,
}
"""Canonical values by role: a temperature loop."""


def typical(card: Card, options: dict[str, str]) -> Settings:
    """Every dial at a typical value; reverse acting also where the sign of the gain decides that."""
    equation = card.variant(options).equation
    backwards = equation.action.fixed and equation.action.reverse == "pv - sp"
    given: dict[str, object] = dict(options)
    spans = Spans(scan=default_scan(equation))  # a ramp may count per scan
    for name, s in equation.settings.items():
        role = Role(s.sets)
        left = s.default is not None and (role not in _TYPICAL or role is Role.INTEGRAL_LIMIT)
        if left or not is_active(equation, name, s):
            continue
        value = from_canonical(role, -1.5 if backwards and role is Role.GAIN else _TYPICAL[role], parse_unit(s.unit), spans)
        low, high = limits(s)
        value = value if low < 0 else min(max(value, low), high)
        given[name] = round(value / s.resolution) * s.resolution if s.resolution else value
    return card.settings(given)


def defined(card: Card) -> Iterator[Settings]:
    """Settings for every combination of options that makes a controller."""
    for options in option_combinations(card):
        try:
            settings = typical(card, options)
            limits = settings.equation.integral.limits
            wide = {} if limits is None else {limits.low: -1e6, limits.high: 1e6}  # the integral has to make the output
            settings = settings.changed({n: x for n, x in wide.items() if isinstance(n, str) and n in settings})
            settings.algorithm()
        except SettingError:
            continue
        yield settings


PIDS = [name for name in pidemu.cards() if pidemu.load_card(name).data.form is not Form.DAHLIN]
on_every_card = pytest.mark.parametrize("name", PIDS)


def numbers(plan: TransferPlan) -> dict[str, float]:
    """What the steps set, by name without unit; of a setpoint that is set twice, the first."""
    found: dict[str, float] = {}
    for step in plan.steps:
        for name, value in step.set.items():
            found.setdefault(name.partition(" [")[0], value)
    return found


def wait(plan: TransferPlan) -> int:
    """How many scans the steps leave the target in manual, at least one."""
    return max([1, *(int(n) for step in plan.steps for n in re.findall(r"\((\d+) scans?\)", step.do))])


def followed(plan: TransferPlan, s: Settings, scans: int = 3, output_limits: tuple[float, float] = WIDE) -> list[float]:
    """The first automatic outputs where a technician does what the steps say, no more; signals in the controller's own units."""
    a, given = s.algorithm(), numbers(plan)
    sp, start = given.get("SP", PV), a.transfer.start
    ctl = Controller(s, output_limits=output_limits, bias=given.get("bias", 0.0), initial_output=OP)
    ctl.scan(20.0, PV, auto=False, manual=given.get("manual entry", OP))  # the setpoint was another one before
    u = ctl.run(sp, [PV] * wait(plan), auto=False, manual=given.get("manual entry", OP))[-1]
    if a.transfer.manual_output != "zero":
        assert u == pytest.approx(OP, rel=1e-6, abs=0.01)  # nothing moves the valve in manual: 24 bits, whole counts
    if "load" in given or "I" in given:
        states = ctl.state
        states |= {"u": given["load"]} if "load" in given else {"I": given["I"]} | {n: OP for n in ("own", "inner") if n in states}
        if start == "zero":
            history = () if a.transfer.derivative == "restarted" else ("x1", "D")  # restarted, it is the present sample
            states |= {"on": 1.0} | {n: 0.0 for n in history if n in states}
        ctl = Controller(s, output_limits=output_limits, initial_output=OP)
        ctl.start(**states)
    return [ctl.scan(sp, PV) for _ in range(scans)]


def increment(s: Settings, e: float) -> float:
    """What the integral adds per scan, ``ki h S(e)`` (specs/equations.md, sections 4 and 8)."""
    a, size = s.algorithm(), abs(e)
    if a.shapes_integral:
        band, L = a.error.band or 0.0, 1.0 if a.error.linearity is None else a.error.linearity
        gap = a.error.gain if size <= band else 1.0
        e *= {"gap": gap, "squared": size / 100, "gain-linear": L + (1 - L) * size / 100}[a.error.shape]
    return a.ki * Controller(s).interval * e


def plan_for(name: str, *, sp: float = SP, pv: float = PV, op: float = OP, **dials: Any) -> TransferPlan:
    return transfer_plan(pidemu.load_card(name).settings(**dials), sp, pv, op, action="reverse")


def sentences(plan: TransferPlan) -> str:
    return "\n".join([s.do for s in plan.steps])
