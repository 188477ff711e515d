"""What a match found: all that it decided, in one value."""

from __future__ import annotations

from dataclasses import dataclass

from pidemu.conversion.match_method import Match
from pidemu.conversion.target.filter import TargetFilter
from pidemu.conversion.target.numbers import Numbers
from pidemu.settings.settings import Settings


@dataclass(frozen=True, slots=True)
class Found:
    """Settings of a target, and how they were found.

    Attributes
    ----------
    settings : Settings
        The settings.
    numbers : Numbers
        The numbers that the dials stand for.
    filter : TargetFilter
        The derivative's filter as these settings have it.
    match : str
        The match that found them.
    why : str
        Why it is not the exact match, where none was asked for; empty where it is.
    compensated : bool
        Whether they make up for the scans: where there is nothing to make up for, they are the plain ones.
    """

    settings: Settings
    numbers: Numbers
    filter: TargetFilter
    match: Match
    why: str = ""
    compensated: bool = False
