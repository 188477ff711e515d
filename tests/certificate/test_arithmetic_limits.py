"""Smallest errors that integrate, and limits, bands and rates in numbers, against formulas."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import pidemu
from pidemu.certificate.arithmetic import smallest_error
from pidemu.certificate.models import NonlinearDifference
from pidemu.certificate.nonlinear import nonlinear_differences
from pidemu.certificate.scaled_controller import scaled_controllers
from pidemu.settings.settings import Settings
from tests.checks.bench import VALID, edited, written

SMALLEST = "smallest error that integrates [% of PV span]"


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(**values)


def differences(source: Settings, target: Settings, scan: float = 1.0) -> dict[str, NonlinearDifference]:
    return {d.aspect: d for d in nonlinear_differences(source, target, (scan, scan), (60.0, 4.0))}


def least(s: Settings, h: float) -> float:
    return smallest_error(scaled_controllers(s, s, (h, h))[0])


def seen(error: float) -> float:
    """An error as float32 has it, with the setpoint above a measurement of 50."""
    return float(np.float32(50 + error)) - 50


@pytest.mark.parametrize("Ti", [60.0, 600.0, 5000.0])
@pytest.mark.parametrize("h", [0.05, 1.0])
@pytest.mark.parametrize("K", [0.5, 2.0])
def test_an_integral_of_e_in_float32_needs_half_a_unit_in_its_last_place(K: float, Ti: float, h: float) -> None:
    state = 50 / K * Ti  # what the IEC example's integral holds at an output of 50: that of e, with KP/TR applied afterwards
    half = float(np.spacing(np.float32(state))) / 2
    found = least(settings("iec/61131-3-pid", KP=-K, TR=Ti), h)
    below = seen(found - float(np.spacing(np.float32(50))))
    assert h * seen(found) >= half * (1 - 1e-6) > h * below * (1 - 1e-5)


def test_the_slow_integral_of_the_specification_stands_still_in_float32() -> None:
    """Section 7: with h = 0.05 s, Ti = 5000 s and K = 1 the update is 1e-5 e."""
    found = differences(settings("generic/standard", K=1, Ti=5000), settings("iec/61131-3-pid", KP=-1, TR=5000), 0.05)["arithmetic"]
    half = float(np.spacing(np.float32(50 * 5000))) / 2
    assert found.figures[SMALLEST][1] == pytest.approx(half / 0.05, rel=1e-4)  # 0.156 %, of which the setpoint shows 4e-6
    assert found.figures[SMALLEST][0] < 1e-8
    assert found.text == (
        "With the output at 50 % the smallest error that the integral follows is below 0.0001 % of span on generic/standard, 0.16 "
        "% of span on iec/61131-3-pid: generic/standard computes in 64 bits and iec/61131-3-pid computes in 32 bits."
    )


@pytest.mark.parametrize("Ti", [300.0, 3000.0])
def test_an_integral_of_ki_e_in_float32_needs_half_a_unit_of_the_output(Ti: float) -> None:
    K, h = 2.0, 0.1
    found = least(settings("ardupilot/ac-pid", P=K, I=K / Ti, D=0, FLTT=0, FLTE=0, FLTD=0, IMAX=100), h)
    half = float(np.spacing(np.float32(50))) / 2
    assert K / Ti * h * found == pytest.approx(half, rel=4e-6 / found)  # P takes a little of the 50, and the setpoint is rounded


def test_engineering_ranges_scale_the_error_and_leave_its_share_of_the_span() -> None:
    plain = least(settings("iec/61131-3-pid", KP=-1, TR=5000, pv_range=(0, 100), op_range=(0, 100)), 0.05)
    ranged = least(settings("iec/61131-3-pid", KP=-0.125, TR=5000, pv_range=(0, 800), op_range=(0, 100)), 0.05)
    assert ranged == pytest.approx(plain, rel=1e-4)  # powers of two


def test_a_float64_integral_needs_half_a_unit_of_its_own_last_place() -> None:
    K, Ti, h = 2.0, 1e10, 0.05
    assert K / Ti * h * least(settings("generic/standard", K=K, Ti=Ti), h) == pytest.approx(math.ulp(49.0) / 2, rel=1e-3)


def test_counts_integrate_every_error_that_is_half_a_count() -> None:
    source = settings("generic/standard", K=1, Ti=60)
    found = differences(source, pidemu.convert(source, "toshiba/pid3").settings)["arithmetic"]
    assert found.figures[SMALLEST][1] == pytest.approx(0.005)  # counts are hundredths, and remainders are carried
    assert "whole numbers" in found.text


def test_two_of_the_same_precision_and_speed_have_no_difference_of_arithmetic() -> None:
    one = settings("oscat/ft-pid", KP=1, TN=60, TV=0)
    assert "arithmetic" not in differences(one, settings("oscat/ft-pidw", KP=1, TN=60, TV=0))
    assert "arithmetic" in differences(one, settings("oscat/ft-pidw", KP=1, TN=6000, TV=0))
    assert "arithmetic" not in differences(settings("generic/standard", K=1, Ti=1e9), settings("generic/parallel", kp=1, ki=1e-9))


def test_a_precision_that_loses_no_error_that_can_be_measured_is_not_told() -> None:
    """32 bits lose errors below 0.0001 % here; without integral they lose nothing that adds up."""
    fast = differences(settings("generic/standard", K=2, Ti=60), settings("oscat/ft-pidw", KP=2, TN=60, TV=0))
    assert "arithmetic" not in fast
    without = differences(
        settings("generic/parallel", kp=2, ki=0), settings("ardupilot/ac-pid", P=2, I=0, D=0, FLTT=0, FLTE=0, FLTD=0, IMAX=100)
    )
    assert "arithmetic" not in without


def test_limits_in_percent_are_compared_as_they_are() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("ni/pid", Kc=2, Ti=1))["limits"]
    assert found.figures == {"low output limit [%]": (0, -100), "high output limit [%]": (100, 100)}
    assert found.text == (
        "Output limits as delivered: 0 to 100 % on generic/standard, -100 to 100 % on ni/pid. "
        "Set those of the old controller on the new one."
    )


def test_with_the_output_range_known_limits_in_engineering_units_are_percent() -> None:
    source = settings("generic/parallel", kp=2, ki=0.02, pv_range=(0, 100), op_range=(0, 255))
    assert "limits" not in differences(source, settings("arduino/pid", Kp=2, Ki=0.02, pv_range=(0, 100), op_range=(0, 255)))
    source = settings("generic/parallel", kp=2, ki=0.02, pv_range=(0, 100), op_range=(4, 20))
    found = differences(source, settings("simple-pid/simple-pid", Kp=2, Ki=0.02, pv_range=(0, 100), op_range=(4, 20)))["limits"]
    assert found.figures == {"low output limit [%]": (0, -math.inf), "high output limit [%]": (100, math.inf)}
    assert "0 to 100 % on generic/parallel, none on simple-pid/simple-pid" in found.text
    assert "0 to 100 % is 4 to 20 there" in found.text


def test_without_the_range_limits_stand_in_the_units_of_each() -> None:
    found = differences(settings("generic/parallel", kp=2, ki=0.02), settings("arduino/pid", Kp=2, Ki=0.02))["limits"]
    assert found.figures["low output limit [% or engineering units]"] == (0, 0)
    assert found.figures["high output limit [% or engineering units]"] == (100, 255)
    assert "0 to 100 % on generic/parallel, 0 to 255 engineering units on arduino/pid" in found.text
    assert "give the range of the output" in found.text


def test_the_largest_float32_is_no_limit() -> None:
    found = differences(settings("oscat/ft-pidw", KP=1, TN=60, TV=0), settings("simple-pid/simple-pid", Kp=1, Ki=1 / 60))
    assert "limits" not in found


def test_limits_before_the_gain_count_with_it() -> None:
    source = settings("oscat/ft-pid", KP=4, TN=60, TV=0, ILIM_L=-5, ILIM_H=10)
    found = differences(source, settings("ros/control-toolbox", p=4, i=4 / 60, i_min=-20, i_max=30))["limits"]
    assert found.figures["low limit of the integral term [% of output span]"] == (-20, -20)
    assert found.figures["high limit of the integral term [% of output span]"] == (40, 30)
    assert "-20 to 40 % on oscat/ft-pid, -20 to 30 % on ros/control-toolbox" in found.text


def test_a_limit_of_the_integral_is_a_share_of_the_output_range() -> None:
    source = settings("generic/parallel", kp=2, ki=0.02, pv_range=(0, 50), op_range=(0, 50))
    target = settings("ros/control-toolbox", p=2, i=0.02, i_min=-10, i_max=10, pv_range=(0, 50), op_range=(0, 50))
    found = differences(source, target)["limits"]
    assert found.figures["high limit of the integral term [% of output span]"] == (math.inf, 20)


def test_bands_of_the_error_are_percent_of_the_measurement() -> None:
    source = settings("automationdirect/directlogic", GAIN=2, RESET=60, ERROR_TERM="DEADBAND", DEADBAND=1.5)
    target = settings("ros/control-toolbox", p=2, i=2 / 60, error_deadband=1, pv_range=(0, 200), op_range=(0, 100))
    found = differences(source, target)["error"]
    assert found.figures == {
        "error: half width of the band [% of PV span]": (1.5, 0),
        "error: gain within the band [-]": (0, 1),
        "integral deadband [% of PV span]": (0, 0.5),
    }
    assert "automationdirect/directlogic takes it as zero within 1.5 %" in found.text
    assert "ros/control-toolbox does not integrate within 0.5 %" in found.text


def test_shapes_of_the_error_are_told_apart() -> None:
    squared = settings("automationdirect/directlogic", GAIN=2, RESET=60, ERROR_TERM="SQUARED")
    found = differences(squared, settings("ni/pid", Kc=2, Ti=1, LINEARITY=0.4))["error"]
    assert found.figures == {"error: gain near zero [-]": (0, 0.4)}
    assert "squares it (gain 1 at 100 %)" in found.text
    assert "a gain of 0.4 near zero, rising to 1 at 100 %" in found.text
    linear = differences(settings("generic/standard", K=2, Ti=60), settings("ni/pid", Kc=2, Ti=1))
    assert "error" not in linear


def test_a_deadband_below_the_rounding_of_signals_is_none() -> None:
    found = differences(settings("ros/control-toolbox", p=2, i=0.02), settings("generic/parallel", kp=2, ki=0.02))
    assert "error" not in found  # 2.2e-16 by default


def test_output_stages_are_percent_of_the_output() -> None:
    source = settings("generic/standard", K=2, Ti=60, op_range=(0, 50), pv_range=(0, 100))
    target = settings("epics/epid", KP=2, KI=1 / 60, ODEL=1, op_range=(0, 50), pv_range=(0, 100))
    found = differences(source, target)["output"]
    assert found.figures == {"output deadband [%]": (0, 2)}
    assert found.text == "Output deadband: none on generic/standard, 2 % on epics/epid."


def test_output_rate_and_step_are_named(tmp_path: Path) -> None:
    text = edited(VALID, ("output: {limits: [0, 100]}", "output: {limits: [0, 100], rate: 5, resolution: 0.1}"))
    bench = pidemu.load_card(written(tmp_path, text)).settings(GAIN=2, RESET=60)
    found = differences(bench, settings("generic/standard", K=2, Ti=60))["output"]
    assert found.figures == {"output rate limit [%/s]": (5, math.inf), "output step [%]": (0.1, 0)}
    assert found.text.startswith("Output rate limit: 5 %/s on nobody/bench, none on generic/standard. Output step: 0.1 % on")


def test_setpoint_rates_are_percent_of_the_measurement_and_a_start_from_zero_is_told() -> None:
    limited = settings("gnc-tools/cpid", Kp=2, Ki=0.02, rRampMax=4, pv_range=(0, 200), op_range=(0, 100))
    found = differences(settings("generic/parallel", kp=2, ki=0.02), limited)["setpoint"]
    assert found.figures == {"setpoint rate limit [%/s]": (math.inf, 2)}
    assert "On gnc-tools/cpid the rate-limited setpoint starts at zero at power-up" in found.text


def test_a_setpoint_that_follows_in_manual_is_told() -> None:
    found = differences(settings("generic/standard", K=2, Ti=60), settings("automationdirect/directlogic", GAIN=2, RESET=60))
    assert "On automationdirect/directlogic the setpoint follows PV in manual" in found["setpoint"].text
