"""docs/testing.md: the bug of the page is found as it says; test_docs.py runs its code and checks its links."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.testing.installed import LOADED
from tools.regenerate.pages import ROOT, prepare, read

PAGE = ROOT / "docs" / "testing.md"


@pytest.mark.skipif(not LOADED, reason="pidemu is not installed with its entry points")
def test_the_bug_of_the_page_is_found_in_two_scans(tmp_path: Path) -> None:
    prepare(PAGE, tmp_path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "test_mypid.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8", check=False)
    assert "1 failed, 1 passed" in done.stdout
    assert "test_it_is_a_parallel_pid[direct]" in done.stdout
    (shown,) = re.findall(r"^```text\n(.*?)\n```$", read(PAGE), re.DOTALL | re.MULTILINE)
    assert shown in done.stdout
    assert re.search(r"^E +scan +0 +1$", done.stdout, re.MULTILINE)
    for term in ("e  error", "P  proportional term", "D  derivative", "I  integral", "v  sum of the terms"):
        assert term in done.stdout
