"""Words for action, mode and whether a range was changed; what remarks and options give away."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final, Literal

from pidemu.plant.fields import folded
from pidemu.settings.action import Action

_ACTIONS: Final[Mapping[Action, tuple[str, ...]]] = {
    "reverse": ("reverse", "rev", "r", "INC-DEC", "INC/DEC", "reverse acting", "revers", "CTLACTN REVERSE", "SP-PV"),
    "direct": ("direct", "dir", "d", "INC-INC", "INC/INC", "direct acting", "direkt", "CTLACTN DIRECT", "PV-SP"),
}
Mode = Literal["auto", "cascade", "manual"]
_MODES: Final[Mapping[Mode, tuple[str, ...]]] = {
    "auto": ("auto", "a", "automatic", "aut", "local", "loc", "automatik"),
    "cascade": ("cas", "cascade", "c", "rsp", "remote", "kaskade", "bcas", "rcas"),
    "manual": ("man", "m", "manual", "hand"),
}
_NONLINEAR: Final = re.compile(
    r"\bgap\b|error.?squared|sq(uare)?d?\.?.?error|\berr.?sq|squared|charact|\bfeed.?forward|\bff\b|\bffwd|split.?range|\bsplit\b|ratio\b|"
    r"\badaptive|gain.?sched|dead.?band|\bnonlin|override|\bselector",
    re.IGNORECASE,
)
_IN_REMARKS: Final = re.compile(
    r"\bgap (control|action)|error.?squared|characteri[sz]er|feed.?forward|split.?range|gain.?sched", re.IGNORECASE
)
_UNUSED: Final = re.compile(
    r"\bspare\b|not in use|\bunused\b|not used|out of service|\boos\b|decommission|demolish|removed|abandoned|mothball|stillgelegt|"
    r"au(ß|ss)er betrieb|nicht benutzt|demontiert|\breserve\b",
    re.IGNORECASE,
)
_HARMLESS: Final = re.compile(
    r"\W*(none|no|n/?a|keine|standard|normal|pv.?track\w*|sp.?track\w*|track\w*|bumpless|anti.?windup|arw)?\W*", re.I
)
_YES: Final = ("y", "yes", "j", "ja", "true", "1", "x", "other range", "otherrange")
_NO: Final = ("n", "no", "nein", "false", "0", "same signal", "samesignal")


class ActionWords:
    """The words for the control action; those of the mapping file come before the usual ones.

    Parameters
    ----------
    words : mapping
        Words by action, from the mapping file.
    """

    def __init__(self, words: Mapping[str, Sequence[str]]) -> None:
        usual = {folded(word): action for action, spellings in _ACTIONS.items() for word in spellings}
        own: dict[str, Action] = {}
        for action in _ACTIONS:
            own |= {folded(word): action for word in words.get(action, ())}
        self._table = {**usual, **own}
        self._own = own

    def meaning(self, text: str) -> Action | None:
        """Return the action that a word stands for; ``None`` where it is not known."""
        return self._table.get(folded(text))

    def is_mapped(self, text: str) -> bool:
        """Whether the mapping file says what the word means."""
        return folded(text) in self._own


def mode_named(text: str) -> Mode | None:
    """Return the mode that a word stands for; ``None`` where it is not known."""
    found = folded(text)
    return next((mode for mode, words in _MODES.items() if found in words), None)


def range_change(text: str) -> str:
    """Return what the column on a changed range says: ``other range``, ``same signal``, or nothing."""
    found = folded(text)
    if found in map(folded, _YES):
        return "other range"
    return "same signal" if found in map(folded, _NO) else ""


def beyond_pid(options: str, remarks: str) -> str:
    """Return what options or remarks say of a loop that is more than PID; empty where they do not."""
    if options and not _HARMLESS.fullmatch(options):
        known = _NONLINEAR.search(options)
        return f"'{options}'" + ("" if known else ", which is not an option that is known")
    found = _IN_REMARKS.search(remarks)
    return f"'{found[0]}' in the remark '{remarks}'" if found else ""


def says_unused(remarks: str, service: str = "") -> str:
    """Return the word by which remarks or service say that a loop is not used; empty where they do not."""
    found = _UNUSED.search(remarks) or re.search(r"^\s*(spare|reserve)\b", service, re.IGNORECASE)
    return found[0] if found else ""
