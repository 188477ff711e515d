"""Terms that a source has and a target lacks."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.card.load import Variant
from pidemu.card.model.base import Form
from pidemu.conversion.match.no_match import NoMatchError


def check_terms(source: Algorithm, target: Variant) -> None:
    """Refuse a source with a term that the target does not have.

    Raises
    ------
    NoMatchError
        The target lacks integral, derivative or proportional action, or cannot be without proportional action.
    """
    reason = missing_term(source, target)
    if reason:
        raise NoMatchError(reason)


def missing_term(source: Algorithm, target: Variant) -> str:
    """Return what a target lacks of a source, or cannot be without; empty where it has all terms."""
    have = f"{target.card.id} ({target.choice_text})" if target.chosen else target.card.id
    if not (source.kp or source.ki or source.kd):
        return "the source has no action, every term is off"
    if source.ki and not target.has_integral:
        return f"the source has integral action, {have} has none"
    if source.kd and not target.has_derivative:
        return f"the source has derivative action, {have} has none"
    if source.kp and not target.has_proportional:
        return f"the source has proportional action, {have} has none"
    if source.kp or not target.has_proportional:
        return ""
    form, filt = target.equation.form, target.equation.derivative.filter
    if form is not Form.PARALLEL:
        return f"the source has no proportional action; the {form.value} form of {have} cannot be without it"
    if source.kd and filt is not None and filt.of == "derivative-time":
        return f"the source has no proportional action; the derivative's filter of {have} goes with kd/kp"
    return ""
