"""What a way to cut over comes to, found by emulation (specs/equations.md, sections 4 to 7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Rule
from pidemu.controller.controller import Controller
from pidemu.controller.running import Running
from pidemu.cutover.takeover import Takeover
from pidemu.program.ir import DERIVATIVE_STATES, StateRole
from pidemu.settings.ranges import UNLIMITED

NO_BUMP: Final = 1e-9
"""Moves of the output below this [% of span] are rounding in float64."""
LONGEST: Final = 2**18
"""Scans after which filters that have not settled are left alone."""
_RESTLESS: Final = frozenset(
    {
        StateRole.INTEGRAL,
        StateRole.OUTPUT,
        StateRole.OWN_OUTPUT,
        StateRole.INNER_SUM,
        StateRole.INTEGRAL_REMAINDER,
        StateRole.DERIVATIVE_REMAINDER,
    }
)
"""States that need not come to rest before the transfer: integral and output are set by it, remainders go round."""


@dataclass(frozen=True, slots=True)
class Way:
    """One way to cut over, in the controller's own units.

    Attributes
    ----------
    sp : float
        The setpoint up to the first automatic scan.
    entry : float or None
        What is entered in manual; without it the controller computes unused.
    waits : bool
        Whether it has been in manual, or computing unused, until its filters have settled.
    prepared : bool
        Whether the setpoint is set there only, and was another one before.
    bias, integral, load : float or None
        What is set as bias; what the integral's state is set to; what it is loaded with in place of the output.
    """

    sp: float
    entry: float | None
    waits: bool = True
    prepared: bool = True
    bias: float | None = None
    integral: float | None = None
    load: float | None = None


@dataclass(frozen=True, slots=True)
class Cut:
    """What a way comes to, by emulation, in the controller's own units.

    Attributes
    ----------
    bump : float
        The move of the output in the first automatic scan, less the integral's increment.
    increment : float
        What the integral adds per scan.
    proportional : float
        The proportional term in that scan.
    waited : int or None
        Scans until the filters had settled; ``None``: they had not.
    kick : float
        What the output moves by in the next scan, in which the setpoint is given back.
    """

    bump: float
    increment: float
    proportional: float
    waited: int | None
    kick: float


def cut_over(new: Takeover, way: Way) -> Cut:
    """Emulate a way: the first automatic scan, and the next with the setpoint given back."""
    ctl, waited = before(new, way)
    p = 0.0 if new.increments else proportional(ctl, new, way.sp)
    at_once = _integrates_at_once(new.a, ctl.state)
    increment = _increment(new, way)
    u = ctl.scan(way.sp, new.pv)
    cut = Cut(u - new.op, increment, p, waited, ctl.scan(new.sp, new.pv) - u)
    if is_none(new, cut):  # nothing was integrated, as at a limit
        return cut
    return replace(cut, bump=u - min(max(new.op + at_once * increment, new.limits[0]), new.limits[1]))


def resolution(new: Takeover, cut: Cut) -> float:
    """Return the rounding of the arithmetic [% of output span] (specs/equations.md, section 7)."""
    a = new.a
    size = abs(new.op) + 2 * abs(cut.proportional) + abs(cut.increment)
    part = {"float64": 1e-14, "float32": 2.0**-21, "integer": 0.0}[a.arithmetic.type]  # some operations, half a bit each
    step = (a.output.resolution or 0.0) + (1 / (a.arithmetic.counts or 1) if a.arithmetic.type == "integer" else 0.0)
    return max(NO_BUMP, new.out.percent(part * size + step))


def is_none(new: Takeover, cut: Cut) -> bool:
    """Tell whether a bump is none."""
    return new.out.percent(abs(cut.bump)) <= resolution(new, cut)


def before(new: Takeover, way: Way) -> tuple[Controller, int | None]:
    """Return the controller just before its first automatic scan, and how many scans it has been waiting."""
    ctl = new.controller(way.bias)
    if not way.waits:
        return ctl, 0
    entry = new.op if way.entry is None else way.entry
    if way.prepared:
        ctl.scan(new.measured.other_than(way.sp), new.pv, auto=False, manual=entry)
    waited = _settle(ctl, way.sp, new.pv, entry)
    preset: dict[str, float] = {} if way.load is None else {StateRole.OUTPUT: way.load}
    if way.integral is not None:
        preset = _preset(new, ctl.state, way.integral)
    if preset:
        states = ctl.state | preset
        ctl = new.controller(way.bias)
        ctl.start(**states)
    return ctl, waited


def factors(a: Algorithm, ctl: Controller) -> tuple[float, float]:
    """Return the gain on the sum of the terms, and the integral time that the integral's state is divided by (section 6)."""
    if a.integral.holds == "ki e":
        return 1.0, 1.0
    numbers = dict(zip((q.name for q in ctl.program.coefficients), ctl.program.values, strict=True))
    if not a.has_gain_on_sum:
        return 1.0, 1 / numbers["ki"] if a.ki else 1.0
    return numbers["kp"], numbers.get("Ti", 1.0) if a.integral.holds == "e" else 1.0


def term(ctl: Controller, new: Takeover, sp: float) -> float:
    """Return what the program will compute as proportional term in its next scan, before a gain on the whole sum."""
    running = Running(lambda _h: new.a, lambda _a, _h: ctl.program, ctl.interval)
    if not running.computes("P"):
        return 0.0
    for name, value in ctl.state.items():
        running[name] = value
    return running.would_be({"sp": sp, "pv": new.pv, "auto": 1.0}, "P")


def proportional(ctl: Controller, new: Takeover, sp: float) -> float:
    """Return what the next scan's proportional term adds to the output [own output units]."""
    return factors(new.a, ctl)[0] * term(ctl, new, sp)


def _preset(new: Takeover, state: Mapping[str, float], integral: float) -> dict[str, float]:
    """Return the states that go with an integral that is set: what the algorithm knows of its output is the output."""
    preset: dict[str, float] = {name: new.op for name in (StateRole.OWN_OUTPUT, StateRole.INNER_SUM) if name in state}
    preset[StateRole.INTEGRAL] = integral
    if new.a.transfer.way.clears:  # set after the transfer has cleared it, and the derivative with it
        preset |= {StateRole.MODE: 1.0}
        if new.a.transfer.derivative == "zeroed":
            preset |= {name: 0.0 for name in DERIVATIVE_STATES if name in state}
    return preset


def _settle(ctl: Controller, sp: float, pv: float, entry: float) -> int | None:
    """Scan in manual until filters and differences stand still, and return how often that was."""
    scans = 1
    ctl.scan(sp, pv, auto=False, manual=entry)
    while scans < LONGEST:
        was = ctl.state
        ctl.scan(sp, pv, auto=False, manual=entry)
        now = ctl.state
        moving = (n for n in now.keys() - _RESTLESS if abs(now[n] - was[n]) > 1e-14 * max(1.0, abs(now[n])))
        if not any(moving):
            return scans
        more = 1 + scans // 4
        ctl.run(sp, np.full(more, pv), auto=False, manual=entry)
        scans += 1 + more
    return None


def _integrates_at_once(a: Algorithm, state: Mapping[str, float]) -> float:
    """Return the share of its increment that the integral adds in the first automatic scan (sections 4 and 6)."""
    if a.velocity or not a.ki or a.transfer.way.is_bumpless or a.integral.rule is Rule.FORWARD:
        return 0.0
    if state.get(StateRole.BEGUN, 1.0) == 0:  # the first scan of all
        waits = a.transfer.first_scan == "holds" if a.transfer.power_up == "zero" or a.transfer.way.loads_output else True
        share = 0.5 if a.integral.starts == "zero" and a.integral.rule is Rule.TRAPEZOIDAL else 1.0
        return 0.0 if waits else share
    return (
        0.0
        if a.transfer.first_scan == "holds"
        and not (a.transfer.way.runs_on or a.transfer.way.tracks)
        and not state.get(StateRole.MODE)
        else 1.0
    )


def _increment(new: Takeover, way: Way) -> float:
    """Return what the integral adds per scan away from all limits [own output units]."""
    if not new.a.ki or new.increments:
        return 0.0
    ctl, _ = before(replace(new, limits=UNLIMITED), way)
    states = []
    for _ in range(3):  # the first may be a transfer
        ctl.scan(way.sp, new.pv)
        states.append(ctl.state[StateRole.INTEGRAL])
    gain, time = factors(new.a, ctl)
    return gain * (states[2] - states[1]) / time
