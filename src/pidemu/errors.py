"""Every error of the package.

::

    PidemuError
    ├── CardError            a card, or a folder of cards, is wrong; holds located problems
    │   └── CardNotFoundError
    ├── UnitError            a value or unit cannot be read or does not fit the dial
    ├── SettingError         a setting or option of a card is unknown, missing or out of range
    │   └── UndefinedError   a combination of options that makes no controller
    ├── ScanError            an algorithm cannot be run at this scan interval or with these limits
    │   └── ActionError      what to do depends on the action of the loop, which was not stated
    ├── EngineError          a back end is not there, or cannot run what it is asked to
    ├── FleetError           a fleet of loops cannot be read or run as asked
    ├── RecordError          a recorded signal file cannot be used
    │   └── FitRefusedError  a record tells nothing about the process
    ├── ListError            a loop list, its mapping, the plant's rules or decisions cannot be used
    ├── CertificateError     a file is not the certificate of a conversion, so that it cannot be verified
    ├── ProcessError         a process model cannot be one, or a controller cannot close a loop with it
    ├── TuningError          a tuning rule is unknown, or does not serve this process
    └── ConversionRefusedError    the target cannot do what the source does; holds the nearest settings
        └── QuestionError         what was given can mean several things, and the result depends on which; holds the questions

The last two hold conversions and questions, and stand with them in `pidemu.conversion.refused`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Final

from pidemu.excerpt import excerpt, shortened, visible

MOST_PROBLEMS: Final = 50
"""Problems of one file that are told one by one."""
_LONGEST_PATH: Final = 400
_LONGEST_MESSAGE: Final = 1000
_LONGEST_WORD: Final = 60
"""A longer word is not a misspelt name."""
_MOST_KNOWN: Final = 1000
"""Names that are compared with a word, letter by letter."""


class PidemuError(Exception):
    """Base of every error pidemu raises on purpose: one cause, one remedy."""


@dataclass(frozen=True, order=True)
class Problem:
    """One fault in a text file, with its place.

    Attributes
    ----------
    path : str
        The file as the user named it.
    line, column : int
        1-based place of the offending token.
    message : str
        The cause and, where there is one, the remedy.
    width : int
        Length of the offending token, for the marks under it.
    source : tuple of str
        All lines of the file, for the excerpt; none where they are not to be shown.
    stands_for : int
        How many problems it counts for: more than one where it is the last of very many.
    """

    path: str
    line: int
    column: int
    message: str
    width: int = 1
    source: tuple[str, ...] = field(default=(), compare=False, repr=False)
    stands_for: int = field(default=1, compare=False)

    def __post_init__(self) -> None:
        for name, most in (("path", _LONGEST_PATH), ("message", _LONGEST_MESSAGE)):  # both hold text that is not ours
            object.__setattr__(self, name, visible(shortened(getattr(self, name), most)))

    def headline(self) -> str:
        """Return ``path:line:column: message``."""
        return f"{self.path}:{self.line}:{self.column}: {self.message}"

    def render(self) -> str:
        """Return the headline with the lines around and marks under the token, as a compiler prints it."""
        if not 1 <= self.line <= len(self.source):
            return self.headline()
        return "\n".join([self.headline(), *excerpt(self.source, self.line, self.column, self.width)])


def capped(problems: Iterable[Problem]) -> list[Problem]:
    """Return problems in the order of the file; of very many the first, and how many more there are.

    Parameters
    ----------
    problems : iterable of Problem
        All of them; those that are alike count once.
    """
    found = sorted(set(problems))
    if len(found) <= MOST_PROBLEMS + 1:
        return found
    first, more = found[:MOST_PROBLEMS], found[MOST_PROBLEMS]
    count = sum(p.stands_for for p in found[MOST_PROBLEMS:])
    return [*first, replace(more, message=f"and {count} more problems, from here on", stands_for=count)]


class CardError(PidemuError):
    """A card is wrong.

    Attributes
    ----------
    problems : tuple of Problem
        Every fault found, in the order of the file.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(p.render() for p in self.problems))


class CardNotFoundError(CardError):
    """No card has this id."""

    def __init__(self, message: str) -> None:
        super().__init__(())
        self.args = (message,)


class UnitError(PidemuError):
    """A value or a unit cannot be read, or has the wrong dimension for its dial."""


class SettingError(PidemuError):
    """A setting or an option is unknown, missing, out of range or not a number."""


class UndefinedError(SettingError):
    """A combination of options makes no controller."""


class ScanError(PidemuError):
    """An algorithm cannot be run as asked: scan interval, limits, engine or signals."""


class ActionError(ScanError):
    """What to do depends on the action of the loop, direct or reverse, which was not stated."""


class EngineError(PidemuError):
    """A back end is not there, or cannot run what it is asked to."""


class FleetError(PidemuError):
    """A fleet of loops cannot be read or run as asked."""


class RecordError(PidemuError):
    """A file of recorded signals cannot be used."""


class FitRefusedError(RecordError):
    """A record tells nothing, or nothing true, about the process: no bump, no answer, a closed loop."""


class ListError(PidemuError):
    """A loop list cannot be read, or its mapping, the plant's rules or decisions cannot be used."""


class CertificateError(PidemuError):
    """A file is not the certificate of a conversion, or not a whole one."""


class ProcessError(PidemuError):
    """A process model cannot be one, or a controller cannot close a loop with it."""


class TuningError(PidemuError):
    """A tuning rule is unknown, does not serve this process, or a parameter of it cannot be used."""


def suggest(word: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the nearest known word, or an empty string.

    Parameters
    ----------
    word : str
        What was written.
    known : iterable of str
        What could have been written.
    """
    if len(word) > _LONGEST_WORD:
        return ""
    known = list(known)
    folded = {k.casefold(): k for k in known}
    if word.casefold() in folded:
        return f" (did you mean '{folded[word.casefold()]}'?)"
    near = difflib.get_close_matches(word, known[:_MOST_KNOWN], n=1, cutoff=0.6)
    return f" (did you mean '{near[0]}'?)" if near else ""
