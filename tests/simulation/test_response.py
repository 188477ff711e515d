"""Figures of responses against closed forms, and by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import pidemu
from pidemu.arrays import Floats
from pidemu.simulation.response import UNITS, ResponseFigures, response_figures


def second_order(zeta: float, h: float = 0.002) -> pidemu.Simulation:
    """P control of ``1/(s (s + 1))``: ``K/(s^2 + s + K)``, the standard second-order system with ``2 zeta sqrt(K) = 1``."""
    K = 1 / (4 * zeta * zeta)
    settings = pidemu.load_card("generic/parallel").settings(kp=K, ki=0, kd=0)
    process = pidemu.Process(gain=1.0, poles=[0, -1])
    return pidemu.simulate(settings, process, h, setpoint=(0, 1), load=0, time=40, output_limits=(-1e3, 1e3))


@pytest.mark.parametrize("zeta", [0.2, 0.4, 0.6])
def test_a_second_order_loop_overshoots_and_decays_as_the_closed_form_says(zeta: float) -> None:
    """Overshoot ``exp(-pi zeta/sqrt(1 - zeta^2))``, each swing of the error that factor of the one before; hold and scan cost 1e-3.

    The first swing is the step itself, so that the third is the square of the overshoot.
    """
    (found,) = response_figures(second_order(zeta))
    overshoot = math.exp(-math.pi * zeta / math.sqrt(1 - zeta * zeta))
    assert found.overshoot == pytest.approx(overshoot, abs=3e-3)
    assert found.decay_ratio == pytest.approx(overshoot**2, abs=3e-3)
    assert found.ie == pytest.approx(2 * zeta / (1 / (2 * zeta)), abs=2e-3)  # 2 zeta/w, of which the scan takes half a scan


def test_a_first_order_loop_has_the_areas_of_an_exponential() -> None:
    """Pole cancelled: the error is ``exp(-t/T)``, T 5 s: areas T, T/2, T^2; from 10 to 90 % in T ln 9; 5 % after T ln 20."""
    settings = pidemu.load_card("generic/standard").settings(K=2, Ti=10, Td=0)
    run = pidemu.simulate(
        settings, pidemu.Process.from_lags(1.0, lags=[10]), 0.001, setpoint=(0, 1), load=0, time=60, output_limits=(-1e3, 1e3)
    )
    (found,) = response_figures(run)
    times = {"rise_time": 5 * math.log(9), "settling_time": 5 * math.log(20)}
    for name, value in {"ie": 5, "iae": 5, "ise": 2.5, "itae": 25, **times}.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-3)
    assert (found.overshoot, found.decay_ratio) == (0, 0)
    assert found.peak_output == pytest.approx(2, rel=1e-3)
    assert found.travel == pytest.approx(3, rel=1e-3)  # 2 at once, and 1 back


def made(error: list[float], output: list[float], **steps: tuple[float, float] | None) -> tuple[ResponseFigures, ...]:
    """Return the figures of signals at scans of 1 s."""
    run = second_order(0.4, 0.5)
    n = len(error)
    sp: Floats = np.full(n, 50.0)
    steps = {"setpoint_step": None, "load_step": None, **steps}
    signals = {"times": np.arange(n, dtype=float), "setpoint": sp, "measurement": sp - np.array(error), "output": np.array(output)}
    return response_figures(replace(run, scan=1.0, **signals, **steps))  # type: ignore[arg-type]


def test_a_load_response_by_hand() -> None:
    (found,) = made([0, 0, -4, 2, -1, 0, 0], [50, 50, 46, 48, 47, 47, 47], load_step=(1.0, 5.0))
    assert (found.step, found.largest_error, found.decay_ratio, found.peak_output, found.travel) == ("load", 4, 0.25, 4, 7)
    assert math.isnan(found.overshoot)
    assert math.isnan(found.rise_time)
    assert found.ie == -3
    assert found.itae == pytest.approx(1 * 4 + 2 * 2 + 3 * 1)
    assert found.settling_time == pytest.approx(3 + 0.8)  # from 1 to a twentieth of 4 on the way to 0
    assert found.last_error == 0


def test_each_step_has_its_own_part_and_what_does_not_settle_says_so() -> None:
    first, second = made([0, 2, 1, 0, 1, 1], [50] * 6, setpoint_step=(1.0, 2.0), load_step=(4.0, 1.0))
    assert (first.step, second.step) == ("setpoint", "load")
    assert first.iae == pytest.approx(1.5 + 0.5)
    assert math.isnan(second.settling_time)
    assert made([0, 0], [50, 50]) == ()


def test_a_negative_step_is_the_mirror_of_a_positive_one() -> None:
    up, down = (made([0, 2 * s, -s, 0, 0], [50, 50 + s, 50, 50, 50], setpoint_step=(1.0, 2.0 * s))[0] for s in (1, -1))
    assert (up.overshoot, up.rise_time, up.iae) == (down.overshoot, down.rise_time, down.iae)
    assert up.overshoot == 0.5
    assert up.rise_time == pytest.approx(0.8 / 1.5)
    assert up.iae == pytest.approx(4 / 3)
    assert up.ie == -down.ie


def test_every_figure_has_a_unit() -> None:
    assert set(UNITS) == {name for name in ResponseFigures.__slots__ if name != "step"}
