"""The match at low frequencies: with the filter as the target fixes it, as it is delivered, or as the source has it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from pidemu.card.model.base import Form, Status
from pidemu.certificate.models import EXACT
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.match import low_frequency as closed
from pidemu.conversion.match.factors import without_rounding
from pidemu.conversion.match.moments import meet, sizes
from pidemu.conversion.match.no_match import REFUSALS, NoMatchError, Refusal
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.own_numbers import own_numbers
from pidemu.conversion.solver.pair import Pair
from pidemu.conversion.solver.through_moments import solutions, through_moments
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers

_DEAR = 0.01
"""Deviation in the loop band from which leaving a filter as delivered costs too much."""
_KEPT = 1e-6
"""By how much moments may be off where they are to be kept: what the ends of a dial's range round."""


def low_frequency(pair: Pair, *, moments: bool = False) -> Found:
    """Match the moments, with the filter as the target fixes it or as it is delivered.

    A filter that can be set takes the source's filter time where it costs more than 1 % in the loop band to leave it, and the
    source's filter is documented, measured or inferred: an assumed one is not imitated, and neither is the lack of one. With
    that filter the source's own gain and integral may come nearer than the moments; with `moments` these are kept even so.

    Raises
    ------
    NoMatchError, SettingError
        There are none, or they leave the target's ranges.
    """
    own, a = pair.target.filter, pair.wanted
    delivered: Found | None = None
    why: Refusal | None = None
    try:
        delivered = _with_filter(pair, own.fixed)
    except REFUSALS as refusal:
        why = refusal
    imitated = own.free and a.kd and a.Tf and filter_status(pair.source) is not Status.ASSUMED
    if imitated and (delivered is None or pair.off(delivered) > _DEAR):
        like = _with_the_sources_filter(pair, moments=moments)
        if like is not None:
            return like
    if delivered is None:
        assert why is not None
        raise why
    return delivered


def keeps_the_moments(pair: Pair, found: Found) -> bool:
    """Whether settings have the moments of the source, but for what the ends of a dial's range round."""
    wanted, have = pair.scaled.moments(), pair.moments(found.settings)
    m0, m1, _ = wanted
    size = [max(x, y) for x, y in zip(sizes(wanted), sizes((m0, m1, 0.0)), strict=True)]  # m2 can be 0 but for rounding
    return all(abs(x - y) <= _KEPT * s for x, y, s in zip(wanted, have, size, strict=True))


def _with_the_sources_filter(pair: Pair, *, moments: bool) -> Found | None:
    """Return what is nearest with the source's filter time: the same moments or, where these may go, its own numbers."""
    found: list[Found] = []
    if not moments:
        with suppress(*REFUSALS):
            kept = _gain_and_integral_kept(pair)
            if pair.off(kept) <= _DEAR:
                return kept
        with suppress(*REFUSALS):
            found.append(replace(own_numbers(pair, filtered=True), match="low-frequency"))
    with suppress(*REFUSALS):
        found.append(_with_filter(pair, pair.target.filter.nearest_to(*_wanted_filter(pair))))
    return min(found, key=pair.off, default=None)


def _gain_and_integral_kept(pair: Pair) -> Found:
    """Return the source's gain and integral with its filter time, and the derivative that keeps the moments.

    Raises
    ------
    NoMatchError, SettingError
        The target has another form or filter, or does not take them.
    """
    target, a, (_, m1, m2) = pair.target, pair.wanted, pair.scaled.moments()
    same_form = pair.source.equation.form is target.form
    K = a.kp
    if not same_form or target.filter.lead_lag or target.shape.filter_on != "term" or not (K and a.ki):
        raise NoMatchError("gain and integral cannot be kept")
    kd = K * (m1 - K) / a.ki if target.form is Form.SERIES else m2
    if kd * K <= 0:
        raise NoMatchError("the derivative would turn round")
    return pair.settle(Numbers(K, a.ki, kd, a.Tf), "low-frequency")


def _with_filter(pair: Pair, filt: TargetFilter) -> Found:
    return _with_the_moments(pair, pair.best_of(solutions(pair, pair.scaled.moments(), filt), "low-frequency"))


def _with_the_moments(pair: Pair, found: Found) -> Found:
    """Return the settings or, behind a filter that no closed form knows, such that have the moments."""
    wanted, have = pair.scaled.moments(), pair.moments(found.settings)
    if all(abs(x - y) <= EXACT * size for x, y, size in zip(wanted, have, sizes(wanted), strict=True)):
        return found
    return through_moments(pair, lambda problem, _: (problem, meet(problem)), found)


def _wanted_filter(pair: Pair) -> tuple[float, float]:
    """Return the source's filter time, and the derivative time on the target that it goes with [s].

    Series forms have their derivative between the lead of the numerator and the filter; the others by the second moment.
    """
    target, filt, Tf = pair.target, pair.target.filter, pair.wanted.Tf
    _, m1, m2 = without_rounding(pair.scaled.moments())
    behind = replace(filt, kind="time", value=Tf, free=False)
    numbers = next(iter(closed.low_frequency(pair.scaled.moments(), target, behind)), None)
    if numbers is not None and target.shape.filter_on == "term":
        return Tf, float(target.filter_base(numbers))
    plain = target.form is Form.PARALLEL and filt.kind != "time" and filt.of != "derivative-time"
    return Tf, m2 / (1.0 if plain else m1 or target.idle_gain)
