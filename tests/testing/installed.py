"""Whether pidemu is installed with its entry points, so that pytest finds the plugin."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Final

LOADED: Final = any(e.name == "pidemu" and e.value == "pidemu.testing.plugin" for e in entry_points(group="pytest11"))
