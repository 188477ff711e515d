"""What a command reads, and must not write."""

from __future__ import annotations

from pathlib import Path

from pidemu.card.library import loaded_files


def inputs(*files: str | Path | None) -> list[str | Path]:
    """Return what a command reads: these files, and those of all cards that were read."""
    return [*(file for file in files if file is not None), *loaded_files()]
