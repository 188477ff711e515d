"""The fast selection, one Hypothesis profile, and a folder for generated code.

Files that `selection` does not list as slow are marked `fast`; ``pytest -m fast`` does not even read the slow ones.

One Hypothesis profile holds for every property: loops over scans are slow, and slowness is no failure.

In continuous integration (``CI`` set) the examples are the same in every run; elsewhere every run looks at new ones.

Generated code goes into a folder of the tests' own, with pytest's cache and kept from run to run: its files are named after what
they hold, so nothing old is ever used for something new, and the workers of one run share what each compiles. Where that folder
cannot be written, a temporary one takes its place. What depends on what is compiled already asks for the fixture `no_code_yet`.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from pidemu.files import cache
from tests.selection import FOLDER, is_slow

settings.register_profile(
    "pidemu",
    deadline=None,
    max_examples=40,
    print_blob=True,
    derandomize=bool(os.environ.get("CI")),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
settings.load_profile("pidemu")


def _folder_for_generated_code() -> str:
    path = Path(__file__).parent.parent / ".pytest_cache" / "v" / "pidemu"
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return str(path)
    except OSError:
        made = tempfile.mkdtemp(prefix="pidemu-tests-")
        atexit.register(shutil.rmtree, made, ignore_errors=True)
        return made


if "PYTEST_XDIST_WORKER" not in os.environ:  # workers have that of the process that started them
    os.environ["PIDEMU_CACHE"] = _folder_for_generated_code()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave slow files unread where only fast tests are asked for."""
    return True if config.option.markexpr == "fast" and collection_path != FOLDER and is_slow(collection_path) else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of all files that are not slow."""
    for item in items:
        if not is_slow(item.path):
            item.add_marker(pytest.mark.fast)


@pytest.fixture
def no_code_yet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a folder for generated code in which there is none; this process knows of none either."""
    from pidemu.backends import native, numba

    made = (numba._record_module, numba._block_module, native._compiled)
    monkeypatch.setenv("PIDEMU_CACHE", str(tmp_path / "code"))
    monkeypatch.setattr(numba, "_FUNCTIONS", {})
    for function in (cache.folder, *made):
        function.cache_clear()
    yield tmp_path / "code"
    for function in (cache.folder, *made):
        function.cache_clear()
