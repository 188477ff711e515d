"""What can be wrong with the outcome of an input."""

from __future__ import annotations

import traceback
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pidemu

ROOT = Path(__file__).resolve().parent.parent.parent
_OURS = str(Path(pidemu.__file__).parent)


class Breach(Exception):  # noqa: N818  # what it is called is printed
    """The outcome of an input is wrong, though nothing was raised.

    Attributes
    ----------
    what, place : str
        What is wrong, and in what; inputs that agree in both are one group.
    """

    def __init__(self, what: str, place: str, detail: str = "") -> None:
        super().__init__(detail or what)
        self.what, self.place = what, place


class TooLong(BaseException):  # not an Exception: nobody may catch it
    """The time is up."""


@dataclass(frozen=True)
class Failure:
    """What is wrong with the outcome of an input.

    Attributes
    ----------
    what : str
        The exception's type, or the rule that was broken.
    place : str
        ``file:line`` where it was raised, or what broke the rule.
    detail : str
        The message.
    trace : str
        The traceback.
    """

    what: str
    place: str
    detail: str
    trace: str = ""

    @property
    def group(self) -> tuple[str, str]:
        """What it shares with other inputs that fail for the same reason."""
        return self.what, self.place


def failure_of(error: BaseException) -> Failure:
    """Return the failure that an exception is."""
    if isinstance(error, Breach):
        return Failure(error.what, error.place, str(error))
    trace = "".join(traceback.format_exception(error, limit=-30))
    return Failure(type(error).__name__, place_of(error), str(error)[:300], trace)


def place_of(error: BaseException) -> str:
    """Return the innermost place in pidemu that an exception went through, else the innermost at all."""
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return "?"
    ours = [f for f in frames if f.filename.startswith(_OURS)] or frames
    if isinstance(error, RecursionError):  # where it ends is chance; the place comes most often
        file, line = Counter((f.filename, f.lineno) for f in ours).most_common(1)[0][0]
    else:
        file, line = ours[-1].filename, ours[-1].lineno
    path = Path(file)
    root = next((r for r in (ROOT, Path(_OURS).parent.parent) if path.is_relative_to(r)), path.parent)
    return f"{path.relative_to(root).as_posix()}:{line}"
