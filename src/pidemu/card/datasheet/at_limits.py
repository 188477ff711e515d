"""What a card does at the limits, and between the sum of the terms and the output: in words, as a data sheet has them."""

from __future__ import annotations

import math

from pidemu.card.datasheet.legend import named, short
from pidemu.card.model.base import Form
from pidemu.card.model.card_file import Equation
from pidemu.card.model.integral import (
    IntegralLimits,
    WindupBackCalculation,
    WindupClamp,
    WindupExternalReset,
    WindupGate,
    WindupRecompute,
    WindupResetOutsideBand,
    WindupVelocity,
)

Row = tuple[str, str]
"""What it is about, and what happens."""


def limit_rows(q: Equation) -> list[Row]:
    """Return what happens at limits, and what else stands between sum and output (specs/equations.md, sections 5 and 8)."""
    low, high = q.output.limits
    rows = [("output limits", f"{low:g} to {high:g}" if math.isfinite(high - low) else "none unless given")]
    if q.form is Form.DAHLIN:
        rows.append(("at a limit", "the recursion goes on from the limited outputs"))
    elif q.integral.on != "none":
        rows.append(("at a limit", f"{q.integral.windup.scheme}: {_windup(q)}"))
        if q.integral.limits is not None:
            rows.append(("integral limits", _integral_limits(q, q.integral.limits)))
    if q.output.rate is not None:
        rows.append(("output rate", f"at most {named(q, q.output.rate)}{'' if isinstance(q.output.rate, str) else ' per s'}"))
    if q.output.deadband is not None:
        rows.append(("output deadband", f"the output moves only by more than {named(q, q.output.deadband)}"))
    if q.output.resolution is not None:
        rows.append(("output steps", f"of {named(q, q.output.resolution)}, the nearest"))
    if q.feedforward is not None:
        after = q.feedforward.summed == "after-limits"
        words = "to the limited output, which is limited again" if after else "to the sum, before the limits"
        rows.append(("feedforward", f"FF is added {words}"))
    return rows


def _windup(q: Equation) -> str:
    w = q.integral.windup
    match w:
        case WindupClamp(scheme="clamp"):
            off = "; with the integral off it is what they make of zero" if w.without_integral == "limited" else ""
            return f"the integral sum is kept within the output limits, before it is used{off}"
        case WindupClamp():
            return "the sum of integral and P on PV is kept within the output limits, before it is used"
        case WindupGate():
            return _gate(w)
        case WindupRecompute():
            then = "; D comes on top, and is limited again" if w.without_derivative else ""
            sides = "P" if w.without_derivative else "P - D"
            return f"the integral is set to what the limit leaves for it, limit - {sides}{then}" + (
                "; it is kept within the output limits too" if w.clamped else ""
            )
        case WindupBackCalculation():
            share = "h/(Tt + h)" if w.implicit else "h/Tt"
            return f"each scan takes {share} of what was cut off out of the integral; {_tracking(q, w)}"
        case WindupExternalReset():
            lag = "positive feedback; the integral is a lag of the limited output, or of the external reset signal"
            return lag + _fast(q, w)
        case WindupResetOutsideBand():
            return "the integral is 0 while PV is outside the proportional band"
        case WindupVelocity():
            back = ", or from what is read back from downstream" if w.reads_back else ""
            return f"increments start from the limited output{back}"
    return "the integral goes on"


def _integral_limits(q: Equation, limits: IntegralLimits) -> str:
    if limits.high == "output" and limits.low in ("output", None):
        return "those of the output"
    high = "the output's" if limits.high == "output" else named(q, limits.high)
    low = f"-{high}" if limits.low is None else "the output's" if limits.low == "output" else named(q, limits.low)
    return f"{low} to {high}"


def _gate(w: WindupGate) -> str:
    if w.scheme == "conditional":
        if w.test == "error-times-output":
            return "the integral stands still while the sum is beyond a limit and has the sign of the error"
        if w.last_increment == "dropped":
            return "an increment that would lead beyond a limit is dropped; the output stops short of the limit"
        return "an increment that leads beyond a limit counts as far as the limit"
    where = {
        "output": "while the last output is at a limit",
        "sum-without-derivative": "while P + I of the last scan is at a limit",
        "sum": "where the sum leads beyond a limit; that increment counts for the output and is then forgotten",
    }[w.judged_on]
    what = {
        "further": "no integration that pushes further",
        "both": "no integration",
        "unless-smaller": "no integration that makes it larger",
    }
    resumes = "; afterwards it starts from the last error that was integrated" if w.resumes_from == "last-integrated" else ""
    return f"{'no integration' if w.judged_on == 'sum' else what[w.direction]} {where}{resumes}"


def _fast(q: Equation, w: WindupExternalReset) -> str:
    f = w.fast_return
    if f is None:
        return ""
    beyond = f"while the output is above {named(q, f.high)} or below {named(q, f.low)}"
    return f"; {beyond} and the integral on its way back, the integral time is divided by {f.factor:g}"


def _tracking(q: Equation, w: WindupBackCalculation) -> str:
    tracked = w.tracking_time
    text = named(q, tracked) + (" s" if isinstance(tracked, float) else "")
    if w.times == "Ti":
        text = f"{short(tracked)} x Ti"
    text = f"the setting {text}" if tracked == "Tt" else f"Tt = {text}"
    return text + (f", or {w.when_off} where it is off" if w.when_off is not None else "")
