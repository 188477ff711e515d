"""The error of a match that has no answer."""

from __future__ import annotations

from typing import Final

from pidemu.errors import SettingError


class NoMatchError(Exception):
    """A match has no answer; the message is the reason, for the user.

    Attributes
    ----------
    fundamental : bool
        Whether no filter and no other match of the same target could help.
    """

    def __init__(self, reason: str, *, fundamental: bool = False) -> None:
        super().__init__(reason)
        self.fundamental = fundamental


Refusal = NoMatchError | SettingError
"""Why a match gives no settings: it has no answer, or the dials cannot be set so."""
REFUSALS: Final = (NoMatchError, SettingError)
"""The same, for what catches them."""
