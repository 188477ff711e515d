"""Engines leave the floating-point state alone: no denormal number is taken for zero, and no handling of errors is changed."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import pidemu
from pidemu.backends import native
from pidemu.backends.choice import has_numba
from pidemu.backends.engine_names import ENGINES, Engine

SMALLEST = 5e-324


def denormal_numbers_are_kept() -> bool:
    """Whether Python and NumPy compute with denormal numbers; code built for fast math would switch that off for a thread."""
    one, half = np.full(64, SMALLEST), np.full(64, 2.3e-308)
    return bool(SMALLEST * 1.0 > 0 and 2.3e-308 / 4 > 0 and (one * 1.0 > 0).all() and (half / 4 > 0).all())


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_leaves_denormal_numbers_and_error_handling_alone(engine: Engine) -> None:
    if engine == "numba" and not has_numba():
        pytest.skip("there is no Numba for this machine")
    if engine == "c" and not native.available():
        pytest.skip("no C compiler on this machine")
    before = np.geterr()
    card, process = pidemu.load_card("generic/standard"), pidemu.Process.from_lags(1.0, lags=[10, 2], delay=1)
    loops = [pidemu.Loop(f"L{i}", card.settings(K=1 + 0.1 * i, Ti=10, Td=1, Tf=0.2), process, scan=0.5) for i in range(3)]
    assert pidemu.Fleet(loops).simulate(time=50, engine=engine).counts == {"done": 3}
    pidemu.simulate(loops[0].settings, process, 0.5, time=50, engine=engine)
    assert denormal_numbers_are_kept()
    assert np.geterr() == before
    found: list[bool] = []
    thread = threading.Thread(target=lambda: found.append(denormal_numbers_are_kept()))  # it starts from the process's state
    thread.start()
    thread.join()
    assert found == [True]
