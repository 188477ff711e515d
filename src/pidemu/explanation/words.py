"""A controller in a few sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from pidemu.algorithm.model import Algorithm
from pidemu.explanation.forms import Times
from pidemu.formatting import number
from pidemu.settings.settings import Settings

if TYPE_CHECKING:
    from pidemu.explanation.model import Explanation, Mode

_STEPS: Final = (10.0, 5.0, 2.0, 1.0)
_MOST: Final = 30.0
"""A step is chosen so small that the output moves by less than this [%]."""
_LASTS: Final = 4.0
"""A derivative has died out after so many filter times, to 2 %."""


def four(x: float) -> str:
    """Return a number in four significant digits."""
    return number(x + 0.0, 4)


def summary_of(e: Explanation, a: Algorithm) -> Iterator[str]:
    """Yield what the controller is, what a step of the measurement and of the setpoint does, and the action."""
    if a.dahlin is not None:
        d = a.dahlin
        yield (
            "Pole cancellation (Dahlin): it has no PID settings. It takes the process for one with a gain of "
            f"{four(d.gain)}, a time constant of {four(d.time)} s and a dead time of {four(d.delay)} s, and PV is to follow SP "
            f"with a time constant of {four(d.wanted)} s."
        )
    elif e.kind == "none":
        yield "All gains are zero: the output does not move."
        return
    else:
        yield _what(e)
        yield _measurement_step(e, a)
        yield from _setpoint_steps(e)
    yield e.action


def _what(e: Explanation) -> str:
    assert e.forms is not None
    named = e.forms.standard
    if named is None:
        p = e.forms.parallel
        parts = [f"{name} {four(x)}{unit}" for name, x, unit in (("kp", p.kp, ""), ("ki", p.ki, " 1/s"), ("kd", p.kd, " s")) if x]
        return f"{e.kind} controller: {', '.join(parts)}{_filtered(e)}."
    series = e.forms.series
    if not named.Td or series is None or series == named:
        return f"{e.kind} controller: {_times(named)}{_filtered(e)}."
    forms = [("standard", named), ("series", series)]
    own, other = reversed(forms) if e.forms.own == "series" else forms
    return f"{e.kind} controller, {own[0]} form: {_times(own[1])}{_filtered(e)}. In the {other[0]} form {_times(other[1])}."


def _times(t: Times) -> str:
    parts = [f"K {four(t.K)}"]
    if math.isfinite(t.Ti):
        parts.append(f"Ti {four(t.Ti)} s ({four(60 / t.Ti)} repeats/min)")
    if t.Td:
        parts.append(f"Td {four(t.Td)} s")
    return ", ".join(parts)


def _filtered(e: Explanation) -> str:
    words = {"derivative": "the derivative", "lead-lag": "the derivative (lead-lag)", "output": "the output"}
    parts = [f"a filter of {four(f.time)} s on {words.get(f.on, f'the {f.on}')}" for f in e.filters if f.on != "setpoint"]
    return f"; {' and '.join(parts)}" if parts else ""


def _measurement_step(e: Explanation, a: Algorithm) -> str:
    """Return what a step of the measurement does: at once, when derivative and filters have died out, and from then on."""
    assert e.ramp is not None
    assert e.automatic.responses is not None
    jump, slope, kick = abs(e.ramp.jump), abs(e.ramp.slope), abs(e.automatic.responses.measurement_kick)
    size = next((s for s in _STEPS if s * jump < _MOST), _STEPS[-1])
    ramp = f"{_moved(e, 60 * size * slope)} per minute" if slope else ""
    step = f"{_step(e, size)} of PV"
    filtered = any(f.on in ("measurement", "output", "error") for f in e.filters)
    if not a.kd and not filtered:
        if not jump:
            return f"{step} moves nothing at once: the output ramps at {ramp}."
        way = "back" if e.ramp.jump * e.ramp.slope < 0 else "on"
        then = f" at once, and then {way} at {ramp}" if ramp else " at once, where it stays"
        return f"{step} moves the output by {_moved(e, size * jump)}{then}."
    first = "spikes the output for one scan" if math.isinf(kick) else f"moves {_output(e, size * kick)} at once"
    what = " and ".join(
        word for word, there in (("the derivative has died out", a.kd), ("the filter has settled", filtered)) if there
    )
    after = max((f.time for f in e.filters if f.on != "setpoint"), default=0.0)
    when = f" (about {four(_LASTS * after)} s)" if after else ""
    turned = "minus" if e.ramp.jump * e.ramp.slope < 0 else "plus"
    rest = f", {turned} a ramp of {ramp} since the step" if ramp else ", and it stays there"
    return f"{step} {first}; when {what}{when}, the output has moved by {_moved(e, size * jump)}{rest}."


def _moved(e: Explanation, x: float) -> str:
    """Return an amount of the output."""
    text = four(x)
    return f"{text} %" if e.gain_unit == "%/%" else f"{text} unit" if text == "1" else f"{text} units"


def _output(e: Explanation, x: float) -> str:
    return f"the output by {_moved(e, x)}" if x else "nothing"


def _step(e: Explanation, size: float) -> str:
    return f"A {four(size)} {'%' if e.gain_unit == '%/%' else 'unit'} step"


def _setpoint_steps(e: Explanation) -> Iterator[str]:
    same = e.automatic == e.cascade
    for name, mode in (("", e.automatic),) if same else (("In automatic ", e.automatic), ("In cascade ", e.cascade)):
        yield f"{name}{terms_see(e, mode)}: {_setpoint_step(e, mode)}."


def terms_see(e: Explanation, mode: Mode) -> str:
    """Return what each term acts on: which of them see the setpoint."""
    weights = {"P": mode.b, "I": 1.0 if "I" in e.kind else None, "D": mode.c}
    groups: dict[str, list[str]] = {}
    for term, weight in weights.items():
        if weight is not None:
            what = {1.0: "the error", 0.0: "PV alone"}.get(weight, f"{four(weight)} SP - PV")
            groups.setdefault(what, []).append(term)
    return ", ".join(f"{_listed(terms)} {'act' if len(terms) > 1 else 'acts'} on {what}" for what, terms in groups.items())


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _setpoint_step(e: Explanation, mode: Mode) -> str:
    assert mode.responses is not None
    kick, step = abs(mode.responses.setpoint_kick), f"a{_step(e, 10.0)[1:]} of SP"
    if math.isinf(kick):
        return f"{step} spikes the output for one scan (unfiltered derivative on the error)"
    return f"{step} moves {_output(e, 10 * kick)} at once"


def action_sentence(settings: Settings, reverse: bool | None) -> str:
    """Return which way the output moves, by the error formula and in the vendor's words.

    Parameters
    ----------
    settings : Settings
        The settings.
    reverse : bool or None
        Whether the output falls as the measurement rises, where the gains decide it; ``None`` where the action is chosen apart.
    """
    action = settings.equation.action
    names = action.names
    if reverse is None:
        return (
            f"Reverse acting (error SP - PV, here '{names['reverse']}') the output falls when PV rises; "
            f"direct acting (error PV - SP, here '{names['direct']}') it rises."
        )
    moves, word = ("falls", "reverse") if reverse else ("rises", "direct")
    if action.fixed:
        turned = "; a positive gain of this card is direct acting, and K is negative here" if action.reverse == "pv - sp" else ""
        return (
            f"The error is {action.reverse.upper()} and the sign of the gain decides: with these settings the output {moves} when "
            f"PV rises ({word} acting{turned if not reverse else ''})."
        )
    return (
        f"The gains are negative, which turns the action round: with the error SP - PV the output {moves} when PV rises "
        f"({word} acting)."
    )
