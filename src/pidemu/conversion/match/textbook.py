"""The textbook match: what manuals print."""

from __future__ import annotations

from pidemu.algorithm.model import Algorithm
from pidemu.card.model.base import Form
from pidemu.conversion.match.factors import ROUNDING, leads, without_proportional
from pidemu.conversion.match.no_match import NoMatchError
from pidemu.conversion.target.numbers import Numbers
from pidemu.conversion.target.target import Target


def textbook(source: Algorithm, dial_kd: float, target: Target) -> Numbers:
    """Return what manuals print: filters ignored (specs/equations.md, section 3, textbook match).

    Parameters
    ----------
    source : Algorithm
        The source.
    dial_kd : float
        ``K Td`` by the source's derivative dial [s].
    target : Target
        The target.

    Raises
    ------
    NoMatchError
        The rule has no answer.
    """
    kp, ki, kd = source.kp, source.ki, dial_kd
    if source.series and target.form is Form.SERIES and target.has_proportional:
        return Numbers(kp, ki, kd)
    if source.series and kd:
        kp = source.kp * (1 + (kd / source.kp) * (ki / source.kp))
    if not target.has_proportional:
        return without_proportional(ki, kd, target, target.idle_gain)
    if target.form is not Form.SERIES or not kd:
        return Numbers(kp, ki, kd)
    if kp * kp < 4 * ki * kd * (1 - ROUNDING):
        raise NoMatchError("the textbook rule needs an integral time of 4 times the derivative time or more")
    lead = leads(ki, kp, kd)[0]
    K = kp - ki * lead
    return Numbers(K, ki, K * lead)
