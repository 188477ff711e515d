"""Which tuning rule is meant, whether it serves a process, and which one does where it does not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from pidemu.errors import SettingError, TuningError, suggest
from pidemu.parsing import seconds
from pidemu.plausible import shown
from pidemu.tuning.formula import names_in, value
from pidemu.tuning.model import Kind, RuleModel
from pidemu.tuning.rules import TuningRule, tuning_rules


def find_rule(name: str, controller: str | None = None) -> TuningRule:
    """Return the rule of this name; of a family the one with the most terms, or that for `controller`.

    Raises
    ------
    TuningError
        There is none.
    """
    rules = tuning_rules()
    word = str(name).strip().casefold()
    wanted = None if controller is None else str(controller).strip().upper()
    found = [r for r in rules if word in (r.name, r.family) and wanted in (None, r.controller)]
    if found:
        return next((r for r in found if r.name == word), found[-1])
    known = dict.fromkeys((*(r.name for r in rules), *(r.family for r in rules)))
    if word in known:
        there = [r for r in rules if word in (r.name, r.family)]
        raise TuningError(f"the rule '{name}' has no settings for a controller '{controller}'; it has {_listed(there)}")
    raise TuningError(f"no tuning rule '{name}'{suggest(word, known)}; rules: {_listed(rules)}")


def _listed(rules: Iterable[TuningRule]) -> str:
    return ", ".join(r.name for r in rules)


def kind_for(rule: TuningRule, model: RuleModel) -> Kind:
    """Return which formulas of a rule are for a process.

    Raises
    ------
    TuningError
        None are, or the process is outside the range that the rule is stated for; the error names the nearest rule that serves.
    """
    reason = _refusal(rule, model)
    if not reason:
        return _kind(rule, model)
    other = nearest(rule, model)
    raise TuningError(f"the rule '{rule.name}' does not serve this process: {reason}; {_remedy(other)}")


def _remedy(other: TuningRule | None) -> str:
    return "no rule does; give a process with a dead time" if other is None else f"the nearest that does is '{other.name}'"


def _kind(rule: TuningRule, model: RuleModel) -> Kind:
    return "ultimate" if "ultimate" in rule.formulas else model.kind or "self-regulating"


def _refusal(rule: TuningRule, model: RuleModel) -> str:
    """Return why a rule does not serve a process; empty where it does."""
    numbers = model.numbers
    if "ultimate" in rule.formulas:
        return "" if "Ku" in numbers else "it has no ultimate gain, since proportional control alone never makes it swing for ever"
    if model.kind is None:
        return f"{model.why_not}, and the rule is for gain, time constant and dead time"
    if model.kind not in rule.formulas:
        return f"it is {model.kind}, and the rule is for {' and '.join(rule.formulas)} processes"
    low, high = rule.mu
    mu = numbers.get("mu", math.nan)
    if not (low * (1 - 1e-9) <= mu <= high * (1 + 1e-9)) and (low, high) != (0.0, math.inf):
        return f"it is stated for a dead time of {low:g} to {high:g} time constants, and this one is {mu:.4g}"
    used = frozenset[str]().union(*(names_in(f) for f in rule.formulas[model.kind].values()))
    if "L" in used and not numbers["L"] and not rule.parameters:
        return "it has no dead time, by which the rule divides"
    if numbers.get("T", 1.0) == 0 and rule.family not in ("one-third", "amigo"):
        return "it has no time constant"
    return ""


def serves(rule: TuningRule, model: RuleModel) -> bool:
    """Tell whether a rule is for a process."""
    return not _refusal(rule, model)


def nearest(rule: TuningRule, model: RuleModel) -> TuningRule | None:
    """Return the rule that serves a process and has most in common with one that does not: terms, then criterion, then source."""
    there = [r for r in tuning_rules() if serves(r, model)]

    def distance(r: TuningRule) -> tuple[bool, bool, bool]:
        return r.controller != rule.controller, r.criterion != rule.criterion, r.source != rule.source

    return min(there, key=distance, default=None)


def parameters_of(rule: TuningRule, model: RuleModel, given: Mapping[str, object]) -> dict[str, float]:
    """Return the parameters of a rule [s]: as given, or by default.

    Raises
    ------
    TuningError
        A parameter is unknown, not a time, or less than the rule allows.
    """
    unknown = [name for name in given if name not in rule.parameters]
    if unknown:
        those = ", ".join(rule.parameters) or "none"
        raise TuningError(f"the rule '{rule.name}' has no parameter '{unknown[0]}'; parameters: {those}")
    numbers = {"T": 0.0, **model.numbers}
    found = {}
    for name, default in rule.parameters.items():
        time = value(default, numbers) if name not in given else _time(name, given[name])
        least = value(rule.least[name], numbers) if name in rule.least else 0.0
        if time < least * (1 - 1e-9):
            raise TuningError(
                f"{name} is {time:g} s, and the rule '{rule.name}' allows no less than {rule.least[name]}, {least:g} s"
            )
        if not (0 < time < math.inf or (time == 0 and numbers.get("L"))):
            raise TuningError(
                f"the rule '{rule.name}' needs {name}, which has no default for a process without dead time; give it [s]"
            )
        found[name] = time
    return found


def _time(name: str, given: object) -> float:
    try:
        return seconds(given) if isinstance(given, str) else float(given)  # type: ignore[arg-type]
    except (SettingError, TypeError, ValueError):
        raise TuningError(f"{name} is {shown(given)}; give a time, such as 20 or '20 s'") from None
