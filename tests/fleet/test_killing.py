"""A fleet that is killed leaves what is complete, and goes on; ``python -m tests.fleet.killing`` does it at length."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.fleet.killing import KILLS, Whole, kill_and_resume

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are another matter there")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    return Whole.run(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize(("number", "share"), list(zip(KILLS, (0.3, 0.5, 0.7), strict=True)))
def test_a_fleet_that_is_killed_leaves_complete_rows_and_goes_on_to_the_same_numbers(
    number: int, share: float, whole: Whole, tmp_path: Path
) -> None:
    kill_and_resume(tmp_path / "killed", whole, number, whole.moment(share))
