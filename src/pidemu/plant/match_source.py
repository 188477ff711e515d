"""Options of the target that the plant's rules fix: named, or whatever does as the source does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pidemu.card.load import Card, match_name
from pidemu.card.model.card_file import Equation
from pidemu.plant.rules import AS_NEEDED, MATCH_SOURCE, LoopRules, option_text
from pidemu.settings.settings import Settings

_TERMS: Final = ("proportional", "integral", "derivative")


def wanted_options(source: Settings, target: Card, ruled: LoopRules, mode: str | None) -> tuple[dict[str, str], dict[str, object]]:
    """Return options and dials of the target that the rules fix."""
    options: dict[str, str] = {}
    given: dict[str, object] = {}
    for name, value in ruled.options.items():
        option = match_name(name, target.data.options)
        text = option_text(value)
        if text == AS_NEEDED or (option and text == MATCH_SOURCE):
            continue
        if option:
            options[option] = text
        else:
            given[name] = value
    for name, value in ruled.options.items():
        option = match_name(name, target.data.options)
        if option and option_text(value) == MATCH_SOURCE:
            choice = matching_choice(source, target, option, options, mode)
            if choice is not None:
                options[option] = choice
    return options, given


def matching_choice(source: Settings, target: Card, option: str, fixed: Mapping[str, str], mode: str | None) -> str | None:
    """Return the choice of an option with which the target does as the source does: its form, and which terms see the setpoint.

    Parameters
    ----------
    source : Settings
        The source.
    target : Card
        The target.
    option : str
        The option.
    fixed : mapping
        Options that are fixed.
    mode : str or None
        The mode that counts.

    Returns
    -------
    str or None
        ``None`` where no choice does as the source does.
    """
    variants = {choice: target.variant({**fixed, option: choice}).equation for choice in target.options[option]}
    own = source.equation
    a = source.algorithm()
    used = {"proportional": a.kp, "integral": a.ki, "derivative": a.kd}
    varied = [t for t in _TERMS if used[t] and len({_acts_on(v, t) for v in variants.values()}) > 1]
    forms = len({v.form for v in variants.values()}) > 1
    if not varied and not forms:
        varied = [t for t in _TERMS if len({_acts_on(v, t) for v in variants.values()}) > 1]
    delivered = target.variant(fixed).equation
    fits = []
    for choice, equation in variants.items():
        if forms and equation.form is not own.form:
            continue
        if all(_matches(own, equation, term, bool(used[term]), mode) for term in varied) and not _extra(equation, used):
            likeness = sum(_acts_on(equation, t) == _acts_on(delivered, t) for t in _TERMS)
            fits.append((-likeness, choice))
    return min(fits, key=lambda f: f[0])[1] if fits else None


def _acts_on(equation: Equation, term: str) -> str:
    return str(getattr(equation, term).on)


def _matches(own: Equation, equation: Equation, term: str, used: bool, mode: str | None) -> bool:
    """Whether a term of the target acts on what the source's acts on; one that is not used can be either way."""
    if not used:
        return True
    acts = _acts_on(own, term)
    if term == "proportional" and mode == "cascade" and own.cascade is not None and own.cascade.proportional is not None:
        acts = str(own.cascade.proportional.on)
    return _acts_on(equation, term) == acts


def _extra(equation: Equation, used: Mapping[str, float]) -> bool:
    """Whether the target has a proportional term that cannot be set to zero and that the source has not."""
    return not used["proportional"] and equation.proportional.on != "none" and equation.form.value != "parallel"
