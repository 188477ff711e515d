"""Every tuning rule that serves a process, side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from pidemu.card.load import Card
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import PidemuError, TuningError
from pidemu.process.process import Process
from pidemu.tuning.choice import find_rule, serves
from pidemu.tuning.model import rule_model
from pidemu.tuning.rules import TuningRule, tuning_rules
from pidemu.tuning.tune import Tuning, percent_process, tune

SORTS: Final = ("iae", "Ms", "Mt", "gain_margin", "phase_margin", "delay_margin", "rule")
"""What rules can be sorted by."""
_THE_MORE: Final = ("gain_margin", "phase_margin", "delay_margin")


@dataclass(frozen=True)
class RuleTable:
    """What all rules give for a process.

    Attributes
    ----------
    tunings : tuple of Tuning
        The rules that serve, sorted; unstable loops last.
    refused : dict
        Why the others do not, by rule.
    """

    tunings: tuple[Tuning, ...]
    refused: Mapping[str, str]


def tune_all(card: Card, process: Process, sort: str = "iae", controller: str | None = None, **arguments: Any) -> RuleTable:
    """Return what every rule gives for a process, in the dials of a card.

    Parameters
    ----------
    card : Card
        The card.
    process : Process
        The process.
    sort : str
        What to sort by, one of `SORTS`: the best first.
    controller : {"P", "PI", "PID"}, optional
        Only rules for these terms.
    **arguments
        Those of `pidemu.tune`; parameters count for the rules that have them.

    Raises
    ------
    TuningError
        `sort` is not one of `SORTS`.
    PidemuError
        No rule gives anything; the error is that of the first.
    """
    if sort not in SORTS:
        raise TuningError(f"cannot sort by '{sort}'; sort by {', '.join(SORTS)}")
    process = percent_process(process, arguments.get("pv_range"), arguments.get("op_range"))
    model, found, refused = rule_model(process), list[Tuning](), dict[str, str]()
    first: PidemuError | None = None
    options: dict[tuple[str, bool], Mapping[str, object]] = {}
    for rule in tuning_rules():
        if controller is not None and rule.controller != controller.upper():
            continue
        try:
            found.append(_one(card, process, rule, options, arguments, known=serves(rule, model)))
        except PidemuError as error:
            first = first or error
            refused[rule.name] = str(error)
    if not found and first is not None:
        raise first
    return RuleTable(tuple(sorted(found, key=lambda t: _place(t, sort))), refused)


def _one(
    card: Card,
    process: Process,
    rule: TuningRule,
    options: dict[tuple[str, bool], Mapping[str, object]],
    arguments: Mapping[str, Any],
    *,
    known: bool,
) -> Tuning:
    """Return what a rule gives; options that were chosen for its like before are tried first, since choosing takes time."""
    own = {n: x for n, x in arguments.items() if not n.startswith("_") and (n in rule.parameters or n in _ARGUMENTS)}
    key = (rule.controller, rule.on_measurement)
    if known and key in options:
        try:
            return tune(card, process, rule.name, **{**own, "options": {**options[key], **(own.get("options") or {})}})
        except ConversionRefusedError:
            pass
    found = tune(card, process, rule.name, **own)
    options[key] = found.settings.options
    return found


_ARGUMENTS: Final = ("options", "given", "pv_range", "op_range", "scan", "action", "digits", "allow_approximate")


def check_parameters(rules: str | None, parameters: Mapping[str, object]) -> None:
    """Refuse parameters that the rule, or with ``None`` any rule, does not have.

    Raises
    ------
    TuningError
        A parameter is unknown.
    """
    wanted = tuning_rules() if rules is None else (find_rule(rules),)
    there = {name for rule in wanted for name in rule.parameters}
    for name in parameters:
        if name not in there:
            raise TuningError(f"no rule has a parameter '{name}'; parameters: {', '.join(sorted(there)) or 'none'}")


def _place(t: Tuning, sort: str) -> tuple[bool, float, str]:
    if sort == "rule":
        return False, 0.0, t.rule.name
    x = float(getattr(t.figures, sort))
    return not t.figures.stable, math.inf if math.isnan(x) else -x if sort in _THE_MORE else x, t.rule.name
