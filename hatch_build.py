"""The build's own step: the built-in cards are compiled into the wheel."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompiledCards(BuildHookInterface[Any]):
    """Puts ``pidemu/compiled`` into the wheel; an editable installation compiles into the user's cache folder."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the cards and add them to the wheel."""
        if version == "editable":
            return
        sys.path.insert(0, str(Path(self.root) / "src"))
        from pidemu.card.wheel import compile_builtin_cards

        self.folder = tempfile.TemporaryDirectory()
        compile_builtin_cards(Path(self.folder.name))
        build_data["force_include"][self.folder.name] = "pidemu/compiled"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002 (hatchling's signature)
        """Remove what is in the wheel now."""
        if version != "editable":
            self.folder.cleanup()
