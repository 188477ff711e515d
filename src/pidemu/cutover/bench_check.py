"""The bench check: what a technician does at the controller before cut-over, and what the output must do.

The figures come from the emulated target at the printed dials (specs/equations.md, sections 2 and 4). A step of the measurement
gives the low-frequency moments of the law: once the derivative has died out the output has jumped by ``m1`` times the step and goes
on at ``m0`` times it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pidemu.arrays import Floats
from pidemu.card.model.base import Rule
from pidemu.card.model.card_file import default_scan
from pidemu.controller.bench import Bench
from pidemu.errors import ScanError
from pidemu.formatting import number
from pidemu.settings.action import Action, carried_action, switch_position
from pidemu.settings.ranges import PERCENT, are_limits
from pidemu.settings.settings import Settings

STEPS: Final = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
"""Steps of the measurement [% of span], the usual one first; below 1 % only where gain or derivative is very large."""
MOST: Final = 30.0
"""The output moves by less than this [% of span], so that it stays off its limits from half way."""
_MIDDLE: Final = 50.0
_DEAD: Final = 1e-7
"""What is left of filters and derivative when they have died out."""
_INTEGRATOR: Final = 1e-8
"""How near to 1 a pole is the integrator's own, which stays."""
_LONGEST: Final = 2**16
"""Scans after which nothing more is waited for."""
_SHARE: Final = {Rule.BACKWARD: 1.0, Rule.TRAPEZOIDAL: 0.5, Rule.FORWARD: 0.0}
"""What the integral adds in the scan of the step, of what it adds per scan."""


@dataclass(frozen=True, slots=True)
class BenchCheck:
    """One step of the measurement, and what the output does; signs as they are seen.

    Attributes
    ----------
    text : str
        What to do and what must happen, in one or two sentences with four digits.
    step : float
        Step of the measurement, up [% of span]; where the action is not known, step of the error.
    jump : float
        What the output has moved by once the derivative has died out, without the ramp [% of span].
    kick : float
        What it moves by at most before that [% of span]; 0 without derivative.
    settles : float
        Time after which less than 1 % of the kick is left [s].
    ramp_per_minute : float
        How fast it goes on [% of span per minute].
    action : {"reverse", "direct"} or None
        The action that the signs are for; ``None``: they are for the error.
    """

    text: str
    step: float
    jump: float
    kick: float
    settles: float
    ramp_per_minute: float
    action: Action | None


@dataclass(frozen=True, slots=True)
class _Move:
    """What the output did."""

    jump: float
    kick: float
    settles: float
    ramp: float


def bench_check(settings: Settings, scan: float | None = None, action: Action | None = None) -> BenchCheck:
    """Return a check of the dials that a technician can do at the controller.

    Parameters
    ----------
    settings : Settings
        The target's settings, as they are printed.
    scan : float, optional
        Scan interval [s]; by default the card's.
    action : {"reverse", "direct"}, optional
        Action of the loop; where the sign of the gain is the action it is known without. Not known, the check is worded for the
        error.

    Raises
    ------
    ScanError
        The controller cannot be run at this interval, or the smallest step takes its output to a limit.

    Examples
    --------
    >>> import pidemu
    >>> s = pidemu.load_card("allen-bradley/pide").settings(PGain=1.8, IGain=1.25, DependIndepend="true")
    >>> check = bench_check(s, 0.5, "reverse")
    >>> check.text.partition("move ")[2]
    'PV up by 10 %: the output falls by 18 % and goes on falling at 14.4 % per minute.'
    >>> check.step, round(check.jump, 9), round(check.ramp_per_minute, 9)
    (10.0, -18.0, -14.4)
    """
    h = default_scan(settings.equation) if scan is None else float(scan)
    known = action or carried_action(settings)
    span = _output_span(settings)
    for step in STEPS:
        # without an action: the reverse-acting controller, whose error rises as the measurement falls
        move = _moved(settings, h, known or "reverse", step if known else -step)
        if max(abs(move.jump), abs(move.kick)) < MOST * span / 100:
            break
    has_span = settings.equation.signals == "percent" or settings.op_range is not None
    if has_span and max(abs(move.jump), abs(move.kick)) >= _MIDDLE:
        raise ScanError("gain or derivative is so large that the smallest step of PV would take the output to a limit")
    text = _text(settings, step, move, known, h)
    return BenchCheck(text, step, move.jump, move.kick, move.settles, move.ramp, known)


def _moved(settings: Settings, h: float, action: Action, step: float) -> _Move:
    """Return what the emulated output does after a step of the measurement [% of span]."""
    a, (pv, op) = settings.algorithm(own_units=True, scan=h), settings.own_ranges
    wait = _scans_to_die_out(settings, h)
    bench = Bench.in_percent(settings, h, sp=_MIDDLE, pv=_MIDDLE, op=_MIDDLE, action=switch_position(settings, action))
    controller, low, after = bench.at_rest(), bench.pv, pv.from_percent(_MIDDLE + step)
    watched = min(max(math.ceil(60 / h), 20), _LONGEST)
    still = controller.run(low, np.full(wait, low))[-1]  # P on PV without integral does not rest where it is put
    u = op.in_percent(controller.run(low, np.full(wait + watched, after))) - op.in_percent(float(still))
    ramp = float(u[-1] - u[wait - 1]) / watched if a.ki or a.dahlin else 0.0
    scans = np.arange(u.size) + _SHARE.get(a.integral.rule, 1.0) - a.measurement.previous_scan
    level = u - ramp * scans
    if not np.isfinite(level).all():
        raise ScanError("gain or derivative is so large that a step of PV takes the output beyond all numbers")
    jump = _clean(float(level[wait - 1]), step)
    kick, settles = _kick(u[:wait], level[:wait] - jump, jump, h) if a.kd else (0.0, 0.0)
    return _Move(jump, kick, settles, _clean(ramp * 60 / h, step))


def _kick(u: Floats, excess: Floats, jump: float, h: float) -> tuple[float, float]:
    """Return the largest move on the way, and how long until less than 1 % of it is left [s]; zeros where it does not overshoot."""
    worst = int(np.argmax(np.abs(excess)))
    peak = float(excess[worst])
    if not peak or abs(jump + peak) <= 1.01 * abs(jump):
        return 0.0, 0.0
    left = np.flatnonzero(np.abs(excess) > 0.01 * abs(peak))
    return float(u[worst]), float(left[-1] + 1) * h


def _scans_to_die_out(settings: Settings, h: float) -> int:
    """Return after how many scans nothing is left of filters and derivative."""
    den = np.trim_zeros(np.asarray(settings.law(h).feedback.den, dtype=float), "b")
    poles = 1 / np.roots(den[::-1]) if den.size > 1 else np.array([])
    poles = poles[np.abs(poles - 1) > _INTEGRATOR]
    slowest = float(np.max(np.abs(poles))) if poles.size else 0.0
    scans = math.log(_DEAD) / math.log(slowest) if 0 < slowest < 1 else 0.0
    return min(math.ceil(scans) + 8, _LONGEST)  # differences reach back over four scans at most


def _clean(x: float, step: float) -> float:
    """Return zero for a figure that is rounding only (float32 in signals of 50)."""
    return 0.0 if abs(x) < 2e-6 * max(1.0, abs(step)) else x


def _output_span(settings: Settings) -> float:
    """Return what the output can move by [the unit of the figures]: 100, or the card's own limits where no range is given."""
    low, high = limits = settings.equation.output.limits
    if settings.equation.signals == "percent" or settings.op_range is not None or not are_limits(limits):
        return PERCENT.span
    return high - low


def _text(settings: Settings, step: float, move: _Move, known: Action | None, h: float) -> str:
    size = _amount(settings, "pv", step)
    if known:
        how = f"move PV up by {size}"
    else:
        how = f"move PV until the error (SP - PV reverse acting, PV - SP direct acting) is +{size}"
    return f"In automatic, with PV at SP and the output half way, {how}: the output {_response(settings, move, h)}."


def _response(settings: Settings, move: _Move, h: float) -> str:
    """Return what the output does, as the end of a sentence."""
    text = f"{_verb(move.jump)} by {_amount(settings, 'op', move.jump)}" if move.jump else ""
    if move.kick:
        noun = "fall" if move.jump < 0 else "rise"
        rest = f"a {noun} of {_amount(settings, 'op', move.jump)} is left" if move.jump else "it is back"
        text = (
            f"{_verb(move.kick)} by {_amount(settings, 'op', move.kick)} at first, at a scan every {number(h)} s; when the "
            f"derivative has died out, after {number(move.settles, 2)} s, {rest}"
        )
    if not move.ramp:
        return text or "does not move"
    pace = f"{_amount(settings, 'op', move.ramp)} per minute"
    rate = f"{_verb(move.ramp, 'ing')} at {pace}"
    if not text:
        return f"does not jump but begins {rate}"
    if move.kick:  # all the while the integral has been at work
        return f"{text}, and with it a {'fall' if move.ramp < 0 else 'rise'} of {pace} since the step"
    return f"{text} and goes on {rate}"


def _verb(x: float, ending: str = "s") -> str:
    return f"{'fall' if x < 0 else 'ris' if ending == 'ing' else 'rise'}{ending}"


def _amount(settings: Settings, signal: str, x: float) -> str:
    """Return a size in percent of span, and in the signal's own units where its range is given."""
    given = settings.pv_range if signal == "pv" else settings.op_range
    size = number(abs(x), 4)
    if given is None:
        return f"{size} {'%' if settings.equation.signals == 'percent' else f'{signal.upper()} units'}"
    own = given.change_from_percent(abs(x))
    if given.ends == PERCENT.ends and given.unit in ("", "%"):
        return f"{size} %"
    unit = given.unit or f"{signal.upper()} units"
    return f"{size} % ({number(own, 4)} {unit})"
