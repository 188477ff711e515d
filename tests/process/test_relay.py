"""Relay experiments against exact limit cycles, closed forms, a fine simulation, and processes that no relay holds."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.errors import ProcessError
from pidemu.process.hold import Plant
from pidemu.process.process import Process
from pidemu.process.relay import relay_test
from tests.process.curves import reference

FIRST_ORDER = Process.from_lags(1, [20], delay=5)


def numbers(process: Process | None) -> tuple[float, float, float]:
    """Gain, lag and dead time; a lag of 0 is an integrator."""
    assert process is not None
    (pole,) = process.poles
    return process.gain, -1 / pole.real if pole else 0.0, process.delay


@pytest.mark.parametrize("case", reference()["relay"], ids=lambda case: f"hysteresis {case['hysteresis']}")
def test_the_limit_cycle_is_the_exact_one(case: dict[str, Any]) -> None:
    found = relay_test(FIRST_ORDER, case["relay d"], case["hysteresis"])
    assert found.ultimate_period == pytest.approx(case["period exact"], rel=1e-8)
    assert found.amplitude == pytest.approx(case["amplitude exact"], rel=1e-8)
    assert found.ultimate_gain == pytest.approx(case["Ku by 4d/(pi a)"], rel=1e-8)
    assert list(numbers(found.process)[1:]) == pytest.approx(case["FOPDT by the exact time domain relations: T, L"], rel=1e-9)
    assert found.fitted_gain == pytest.approx(case["true Ku"], rel=1e-8)
    assert found.fitted_period == pytest.approx(case["true Pu"], rel=1e-8)


@given(
    gain=st.floats(0.2, 5) | st.floats(-5, -0.2),
    lag=st.floats(0.5, 50),
    delay=st.floats(0.1, 20),
    wide=st.floats(0, 0.3),
    output=st.sampled_from([50.0, 98.0, 3.0]),
)
def test_a_process_of_first_order_is_found_again_whatever_the_limits(
    gain: float, lag: float, delay: float, wide: float, output: float
) -> None:
    process = Process.from_lags(gain, [lag], delay=delay)
    found = relay_test(process, 5, wide * abs(gain), output=output, limits=(0, 100))
    if math.exp(-delay / lag) > 1e-4:  # else the measurement has all but settled, and shows no lag
        assert numbers(found.process) == pytest.approx((gain, lag, delay), rel=1e-6)
        assert (len(found.notes) > 0) == (output != 50)


@given(gain=st.floats(0.01, 1) | st.floats(-1, -0.01), delay=st.floats(0.1, 20), wide=st.floats(0, 1))
def test_an_integrator_is_found_again_and_its_cycle_is_a_triangle(gain: float, delay: float, wide: float) -> None:
    found = relay_test(Process.from_lags(gain, integrators=1, delay=delay), 5, wide)
    assert found.ultimate_period == pytest.approx(4 * (delay + wide / (abs(gain) * 5)), rel=1e-9)
    assert found.amplitude == pytest.approx(5 * abs(gain) * delay + wide, rel=1e-9)
    assert numbers(found.process) == pytest.approx((gain, 0, delay), rel=1e-6)


@pytest.mark.parametrize("name", ["P2 T=1", "P3 T=0.5", "P4 n=4", "P5 alpha=0.5", "P6 L1=0.5", "P8 alpha=0.5", "P9 T=0.5"])
def test_the_cycle_is_that_of_a_fine_simulation(name: str) -> None:
    process, h = pidemu.test_batch()[name], 2e-4
    plant, up, swing = Plant(process.sampled(h)), True, [0.0]
    switched: list[int] = []
    for k in range(int(40 / h)):
        y = plant.measure()
        if (1 if up else -1) * y > 0 and (not switched or k - switched[-1] > 50):
            up = not up
            switched.append(k)
        if k > 20 / h:
            swing.append(y)
        plant.move(1.0 if up else -1.0)
    found = relay_test(process, 1)
    assert found.ultimate_period == pytest.approx((switched[-1] - switched[-5]) * h / 2, rel=2e-3)
    assert found.amplitude == pytest.approx((max(swing) - min(swing)) / 2, rel=2e-2)


def test_the_describing_function_is_low_by_as_much_as_is_said() -> None:
    errors = {}
    for name, process in pidemu.test_batch().items():
        if name.startswith(("P4", "P8", "P7 T=5")) or name == "P6 L1=1":
            true = float(1 / np.abs(process.response(process.w180)))
            errors[name] = relay_test(process, 1).ultimate_gain / true - 1
    assert -0.19 < min(errors.values()) < max(errors.values()) < 0
    assert min(errors, key=errors.__getitem__) == "P6 L1=1"  # an integrator with dead time: 8/pi^2


def test_a_relay_that_looks_at_scans_is_near_the_one_that_always_looks() -> None:
    always, scanned = relay_test(FIRST_ORDER, 5, 0.2), relay_test(FIRST_ORDER, 5, 0.2, scan=0.05)
    assert scanned.ultimate_period == pytest.approx(always.ultimate_period, rel=0.01)
    assert scanned.amplitude == pytest.approx(always.amplitude, rel=0.02)
    assert scanned.notes == ("the relay looks every 0.05 s: period and swing are averages over 10 periods, as seen at its scans",)


def test_the_hysteresis_is_three_standard_deviations_of_the_noise() -> None:
    found = relay_test(FIRST_ORDER, 5, noise=0.1)
    assert found.hysteresis == pytest.approx(0.3)
    assert found.notes == ("hysteresis 0.3: 3 standard deviations of the noise",)


def test_another_static_gain_leads_to_another_process() -> None:
    assert numbers(relay_test(FIRST_ORDER, 5, gain=2).process)[0] == 2
    assert numbers(relay_test(FIRST_ORDER, 5, gain=2).process)[1] > 30


def test_a_lag_without_dead_time_cycles_within_the_hysteresis() -> None:
    found = relay_test(Process.from_lags(1, [5]), 5, 0.5)
    assert (found.amplitude, found.ultimate_period) == pytest.approx((0.5, 10 * math.log(5.5 / 4.5)), rel=1e-9)
    assert numbers(found.process) == pytest.approx((1, 5, 0), rel=1e-9, abs=1e-6)


def test_a_dead_time_alone_shows_no_process_of_first_order() -> None:
    found = relay_test(Process(1, delay=2), 5)
    assert (found.ultimate_period, found.amplitude, found.process) == (4.0, 5.0, None)
    assert math.isnan(found.fitted_gain)
    assert found.notes == ("no process of first order with dead time makes this oscillation with this static gain",)


def test_the_signals_are_those_of_two_periods() -> None:
    found = relay_test(FIRST_ORDER, 5, 0.2)
    assert found.time[-1] == pytest.approx(2 * found.ultimate_period, rel=1e-6)
    assert set(found.output.tolist()) == {5.0, -5.0}
    assert np.ptp(found.measurement) == pytest.approx(2 * found.amplitude, rel=1e-3)


REFUSED: dict[str, tuple[Process, dict[str, Any], str]] = {
    "at once": (
        Process.from_lags(1, [5]), {"amplitude": 5},
        "the relay would switch without end: 1/(5 s + 1) answers at once; give it its dead time and small lags, or give a",
    ),
    "too small": (
        FIRST_ORDER, {"amplitude": 1, "hysteresis": 2},
        "the relay would not switch: its 1 moves the measurement by 1 at most, and the hysteresis is 2; give a larger amplitude",
    ),
    "no room": (
        FIRST_ORDER, {"amplitude": 5, "output": 100, "limits": (0, 100)},
        "an output of 100 leaves the relay no room between the limits 0 and 100; let it rest between",
    ),
    "unstable": (Process(1, [0.05, -1], delay=30), {"amplitude": 5}, "1 exp(-30 s)/((1 - 20 s)(s + 1)) runs away from the relay"),
    "two integrators": (Process.from_lags(1, integrators=2, delay=1), {"amplitude": 5}, "the relay does not switch within 360 s;"),
    "no gain": (Process(1, [-1, -2], [0]), {"amplitude": 5}, "1 s/((s + 1)(0.5 s + 1)) has a zero at 0, so that no output keeps"),
    "amplitude": (FIRST_ORDER, {"amplitude": 0}, "amplitude is 0; give a number above zero"),
    "hysteresis": (FIRST_ORDER, {"amplitude": 1, "hysteresis": -1}, "hysteresis is -1; give a number above zero, or 0"),
    "noise": (FIRST_ORDER, {"amplitude": 1, "noise": "loud"}, "noise is 'loud'; give a number"),
    "scan": (FIRST_ORDER, {"amplitude": 1, "scan": 0}, "the scan interval 0 s is not a positive number"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_oscillation_is_refused(name: str) -> None:
    process, how, message = REFUSED[name]
    with pytest.raises(ProcessError, match="^" + re.escape(message)):
        relay_test(process, **how)
