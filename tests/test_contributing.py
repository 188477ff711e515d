"""CONTRIBUTING.md names commands that are there."""

from __future__ import annotations

import importlib.util
import re

import pytest

from tools.regenerate.pages import ROOT, read

TEXT = read(ROOT / "CONTRIBUTING.md")


@pytest.mark.parametrize("module", sorted(set(re.findall(r"`python -m ([\w.]+)", TEXT)) - {"pytest"}))
def test_a_command_that_is_to_be_run_is_there(module: str) -> None:
    assert importlib.util.find_spec(module) is not None
