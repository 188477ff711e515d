"""Settings of a target by the closed forms: which of them applies, and in what order."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from pidemu.conversion.match import exact as closed
from pidemu.conversion.match import textbook as book
from pidemu.conversion.match.no_match import REFUSALS, NoMatchError, Refusal
from pidemu.conversion.match.terms import check_terms
from pidemu.conversion.match_method import Match
from pidemu.conversion.solver.found import Found
from pidemu.conversion.solver.low_frequency import keeps_the_moments, low_frequency
from pidemu.conversion.solver.own_numbers import own_numbers
from pidemu.conversion.solver.pair import Pair
from pidemu.conversion.target.numbers import Numbers

_ROUNDING = 1e-6
"""Deviation that rounding may make of an exact match where its numbers nearly cancel."""


def by_closed_form(pair: Pair, match: Match | None) -> Found:
    """Return the target's settings, found exactly or at low frequencies.

    Raises
    ------
    NoMatchError, SettingError
        There are none, or they leave the target's ranges.
    """
    if match == "low-frequency":
        found = low_frequency(pair, moments=True)
        if not keeps_the_moments(pair, found):
            raise NoMatchError("no settings keep the moments: with these options the target lacks a term")
        return found
    try:
        return exact(pair)
    except REFUSALS as refusal:
        why = refusal
        if match == "exact" and pair.target.filter.free:
            raise
    found = low_frequency_because(pair, why)
    if match == "exact" and found.match != "exact":
        raise NoMatchError("its filter is fixed, and no settings give the same law")
    return found


def low_frequency_because(pair: Pair, why: Refusal) -> Found:
    """Match the moments where no exact match was found, which this one may turn out to be.

    Raises
    ------
    NoMatchError, SettingError
        There are no such settings; a fundamental reason against the exact match comes before that against this one.
    """
    try:
        found = low_frequency(pair)
    except REFUSALS as refusal:
        if isinstance(why, NoMatchError) and why.fundamental:
            raise why from None
        raise refusal from None
    if pair.verdict(found.settings) != "approximate":
        return replace(found, match="exact")
    return replace(found, why=str(why))


def exact(pair: Pair) -> Found:
    """Return settings with the source's law: its own numbers, where these have it, else those of the closed form.

    Raises
    ------
    NoMatchError, SettingError
        There are none.
    """
    own = None
    with suppress(*REFUSALS):
        own = replace(own_numbers(pair, filtered=True), match="exact")
    verdict = "approximate" if own is None else pair.verdict(own.settings)
    if own is not None and verdict == "exact":
        return own
    try:
        return _proven(pair, pair.best_of(closed.exact(pair.scaled, pair.target), "exact"))
    except REFUSALS:
        if own is None or verdict == "approximate":
            raise
        return own


def textbook(pair: Pair) -> Found:
    """Return what the rule in manuals gives, without choice of setpoint weights.

    Raises
    ------
    NoMatchError, SettingError
        The rule has no answer, or the target no such settings.
    """
    return pair.unweighted(textbook_numbers(pair), "textbook")


def textbook_numbers(pair: Pair) -> Numbers:
    """Return the numbers that the rule in manuals gives; raises as `textbook`."""
    check_terms(pair.wanted, pair.target.variant)
    return book.textbook(pair.wanted, pair.dial_kd, pair.target)


def _proven(pair: Pair, found: Found) -> Found:
    """Refuse an exact match that is none: whatever the card says of its terms, the law decides."""
    if pair.sameness(found.settings)[0] > _ROUNDING:
        raise NoMatchError("no settings give the same law")
    return found
