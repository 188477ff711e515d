"""What each answer to a question of a loop leads to: the loop is read and converted again as if it were given."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from pidemu.conversion.result import Conversion
from pidemu.plant.converting import LoopConversion
from pidemu.plant.decisions import Decisions
from pidemu.plant.reading_model import Decision, Finding, LoopChoice, LoopReading
from pidemu.plant.rows import RetrofitRow
from pidemu.plant.rules import PlantRules

_TOLD: Final = ("D-unit", "D-form", "D-equation", "D-mode", "D-rerange", "D-update", "D-structure")
"""What is worked out; the others ask for what no number tells."""
_MOST: Final = 4

Attempt = Callable[[LoopReading, PlantRules, Decisions], LoopConversion | None]


def with_outcomes(
    row: RetrofitRow, again: Callable[[Decisions], LoopReading], rules: PlantRules, decisions: Decisions, attempt: Attempt
) -> RetrofitRow:
    """Return a row whose one question says what each answer leads to.

    Parameters
    ----------
    row : RetrofitRow
        The row, which waits for a decision.
    again : callable
        Reads the loop with other decisions.
    rules : PlantRules
        The target.
    decisions : Decisions
        What people decided.
    attempt : callable
        Converts a reading that nothing stops.
    """
    stopping = row.stopping()
    if len(stopping) != 1 or stopping[0].code not in _TOLD or not stopping[0].choices:
        return row
    asked = stopping[0]
    worked_out = [_outcome(choice, asked, row, again, rules, decisions, attempt) for choice in asked.choices[:_MOST]]
    found = [c for c, _ in worked_out]
    answered = replace(asked, choices=(*found, *asked.choices[_MOST:]), measure=_ratio([c for _, c in worked_out if c is not None]))
    findings = row.reading.findings
    findings[findings.index(asked)] = answered
    return row


def _outcome(
    choice: LoopChoice,
    asked: Finding,
    row: RetrofitRow,
    again: Callable[[Decisions], LoopReading],
    rules: PlantRules,
    decisions: Decisions,
    attempt: Attempt,
) -> tuple[LoopChoice, Conversion | None]:
    tag = row.reading.tag
    answer = Decision(tag, asked.code, _answer(asked, choice), "", "", "")
    other = again(Decisions({**decisions.given, (tag, asked.code): answer}, decisions.digest))
    converted = attempt(other, rules, decisions)
    if converted is None:
        stops = next((f.text for f in other.findings if f.level != "flag"), "not converted")
        return replace(choice, outcome=stops), None
    c = converted.conversion
    dials = ", ".join(
        f"{n} {v.value:.5g}" for n, v in c.settings.items() if v.active and v.role.value in ("gain", "integral", "derivative")
    )
    return replace(choice, outcome=f"{dials} ({c.verdict})"), c


def _answer(asked: Finding, choice: LoopChoice) -> str:
    """Return an answer as the decisions file holds it; of a unit it says of which setting."""
    setting = asked.text.partition(":")[0]
    return f"{setting}: {choice.answer}" if asked.code == "D-unit" and ":" not in choice.answer else choice.answer


def _ratio(conversions: list[Conversion]) -> float:
    """Return the largest ratio between the readings, of gain or of integral action; 0 where there are no two."""
    ratios = [0.0]
    for name in ("kp", "ki"):
        values = [abs(v) for c in conversions if (v := getattr(c.settings.algorithm(), name))]
        if len(values) > 1:
            ratios.append(max(values) / min(values))
    return max(r for r in ratios if math.isfinite(r))
