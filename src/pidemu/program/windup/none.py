"""Scheme `none`: nothing is done at a limit."""

from __future__ import annotations

from pidemu.card.windup.none import WindupNone
from pidemu.program.windup.hooks import WindupHooks


class Hooks(WindupHooks[WindupNone[float]]):
    """The integral goes on whatever the output does."""
