"""What transfers do to the integral scan by scan: one file each, of the same name as in `pidemu.card.transfer`."""

from __future__ import annotations

import importlib

from pidemu.card.transfer import Start
from pidemu.program.transfer.hooks import StartHooks


def start_hooks(way: type[Start]) -> StartHooks:
    """Return what a start does within a scan.

    Parameters
    ----------
    way : type of Start
        The start, as ``transfer.way`` of an algorithm.
    """
    room = way.__module__.rpartition(".")[2]
    hooks: StartHooks = importlib.import_module(f"{__name__}.{room}").Hooks()
    return hooks
