"""Every command runs in an empty folder, with no cards but the built-in ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from pidemu.card.library import ENVIRONMENT


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the empty folder that is the current one."""
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path
