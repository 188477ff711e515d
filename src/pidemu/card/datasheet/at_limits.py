"""What a card does at the limits, and between the sum of the terms and the output: in words, as a data sheet has them."""

from __future__ import annotations

import math

from pidemu.card.datasheet.legend import named
from pidemu.card.model.base import Form, Reference
from pidemu.card.model.card_file import Equation
from pidemu.card.model.integral import IntegralLimits

Row = tuple[str, str]
"""What it is about, and what happens."""


def limit_rows(q: Equation) -> list[Row]:
    """Return what happens at limits, and what else stands between sum and output (specs/equations.md, sections 5 and 8)."""
    low, high = q.output.limits
    rows = [("output limits", f"{low:g} to {high:g}" if math.isfinite(high - low) else "none unless given")]
    if q.form is Form.DAHLIN:
        rows.append(("at a limit", "the recursion goes on from the limited outputs"))
    elif q.integral.on != "none":
        rows.append(("at a limit", f"{q.integral.windup.scheme}: {q.integral.windup.in_words(lambda given: named(q, given))}"))
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


def _integral_limits(q: Equation, limits: IntegralLimits[Reference]) -> str:
    if limits.high == "output" and limits.low in ("output", None):
        return "those of the output"
    high = "the output's" if limits.high == "output" else named(q, limits.high)
    low = f"-{high}" if limits.low is None else "the output's" if limits.low == "output" else named(q, limits.low)
    return f"{low} to {high}"
