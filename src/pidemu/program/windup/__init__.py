"""What windup schemes do scan by scan: one file each, of the same name as in `pidemu.card.windup`."""

from __future__ import annotations

import importlib
from typing import Any

from pidemu.card.windup import Scheme
from pidemu.program.windup.hooks import WindupHooks


def windup_hooks(scheme: Scheme[Any]) -> WindupHooks[Any]:
    """Return what a scheme does within a scan.

    Parameters
    ----------
    scheme : Scheme
        The scheme of an algorithm.
    """
    room = type(scheme).__module__.rpartition(".")[2]
    hooks: WindupHooks[Any] = importlib.import_module(f"{__name__}.{room}").Hooks(scheme)
    return hooks
