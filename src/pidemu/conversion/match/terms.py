"""Terms that a source has and a target lacks."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.target import Target


def check_terms(source: Algorithm, target: Target) -> None:
    """Refuse a source with a term that the target does not have.

    Raises
    ------
    NoMatchError
        The target lacks integral, derivative or proportional action, or cannot be without proportional action.
    """
    have = f"{target.card.id}{_chosen(target)}"
    if not (source.kp or source.ki or source.kd):
        raise NoMatchError("the source has no action, every term is off")
    if source.ki and not target.has_integral:
        raise NoMatchError(f"the source has integral action, {have} has none")
    if source.kd and not target.has_derivative:
        raise NoMatchError(f"the source has derivative action, {have} has none")
    if source.kp and not target.has_proportional:
        raise NoMatchError(f"the source has proportional action, {have} has none")
    if not source.kp and target.has_proportional and target.form is not Form.PARALLEL:
        raise NoMatchError(f"the source has no proportional action; the {target.form.value} form of {have} cannot be without it")
    if source.kd and not source.kp and target.has_proportional and target.filter.of == "derivative-time":
        raise NoMatchError(f"the source has no proportional action; the derivative's filter of {have} goes with kd/kp")


def _chosen(target: Target) -> str:
    chosen = target.variant.choice_text
    return f" ({chosen})" if chosen else ""
