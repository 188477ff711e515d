"""What measurement noise does to the output of one controller against another, for choosing between settings."""

from __future__ import annotations

import math
from typing import Final

from pidemu.law import Law

_ALIKE: Final = 1.25 * (1 + 1e-9)
"""Ratio of noise gains up to which two controllers are alike."""


def high_frequency_gain(law: Law) -> tuple[float, bool]:
    """Return what a unit step of the measurement does to the output at once, without sign, and whether that is a spike.

    Of a discrete law it is the first sample [%/%]. Of a continuous one without a filter on its derivative it is infinite, and the
    strength of the derivative [s] stands for it.
    """
    num, den = (list(x) for x in (law.feedback.num, law.feedback.den))
    if law.scan is not None:
        return abs(num[0] / den[0]), False
    while len(num) > 1 and num[-1] == 0:
        num.pop()
    while len(den) > 1 and den[-1] == 0:
        den.pop()
    if len(num) < len(den):
        return 0.0, False
    return abs(num[-1] / den[-1]), len(num) > len(den)


def noise_ratio(source: Law, target: Law, factor: float) -> float:
    """Return the target's noise gain per source's; infinite or zero where only one of them spikes.

    Parameters
    ----------
    source, target : Law
        Both continuous, or each discrete at its own interval.
    factor : float
        What the source's gain is multiplied by for new signal ranges.
    """
    (old, spikes), (new, new_spikes) = high_frequency_gain(source), high_frequency_gain(target)
    old *= abs(factor)
    if spikes != new_spikes:
        return math.inf if new_spikes else 0.0
    return new / old if old else 1.0 if not new else math.inf


def noise_is_alike(source: Law, target: Law, factor: float) -> bool:
    """Whether noise does no more with the target than with the source, or up to a quarter more."""
    return noise_ratio(source, target, factor) <= _ALIKE
