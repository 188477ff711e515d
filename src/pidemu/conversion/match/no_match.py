"""The error of a match that has no answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from pidemu.conversion.target.filter import TargetFilter
from pidemu.errors import SettingError


class NoMatchError(Exception):
    """A match has no answer; the message is the reason, for the user.

    Attributes
    ----------
    fundamental : bool
        Whether no filter and no other match of the same target could help.
    tried : TargetFilter or None
        The filter that was tried last; ``None``: the target's own.
    """

    def __init__(self, reason: str, *, fundamental: bool = False, tried: TargetFilter | None = None) -> None:
        super().__init__(reason)
        self.fundamental = fundamental
        self.tried = tried


Refusal = NoMatchError | SettingError
"""Why a match gives no settings: it has no answer, or the dials cannot be set so."""
REFUSALS: Final = (NoMatchError, SettingError)
"""The same, for what catches them."""


def tried_with(refusal: Exception) -> TargetFilter | None:
    """Return the filter that was tried last before a refusal; ``None``: the target's own."""
    return refusal.tried if isinstance(refusal, NoMatchError) else None


def with_tried(refusal: Exception, tried: TargetFilter | None) -> NoMatchError:
    """Return a refusal that says which filter was tried last."""
    fundamental = isinstance(refusal, NoMatchError) and refusal.fundamental
    return NoMatchError(str(refusal), fundamental=fundamental, tried=tried)


@contextmanager
def trying(filt: TargetFilter) -> Iterator[None]:
    """Let refusals within say that a filter was tried, unless they say so of another one."""
    try:
        yield
    except REFUSALS as refusal:
        raise with_tried(refusal, tried_with(refusal) or filt) from None
