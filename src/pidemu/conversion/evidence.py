"""How sure the facts are that a conversion rests on."""

from __future__ import annotations

from typing import Final

from pidemu.card.model.base import Status
from pidemu.settings.settings import Settings

_SURENESS: Final = (Status.ASSUMED, Status.INFERRED, Status.DOCUMENTED, Status.MEASURED)


def status_of(settings: Settings, *heads: str) -> Status:
    """Return how sure the least sure field is whose path begins so; measured where there is none.

    Parameters
    ----------
    settings : Settings
        The settings; fields of their equation count.
    *heads : str
        Beginnings of paths, such as ``"derivative.filter"``. Scan rules do not count: they are judged apart.
    """
    found = [
        s.evidence.status
        for s in settings.variant.statements
        if s.evidence is not None and s.path.startswith(heads) and not s.path.endswith(".rule")
    ]
    return min(found, key=_SURENESS.index, default=Status.MEASURED)


def filter_status(settings: Settings) -> Status:
    """Return how sure it is what filters the derivative of settings: of the filter, or that there is none."""
    heads = ("derivative.filter",) if settings.equation.derivative.filter is not None else ("derivative",)
    return status_of(settings, *heads)
