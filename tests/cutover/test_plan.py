"""The plan for the cut-over, by hand on the controllers that people have: an error of 4."""

from __future__ import annotations

from typing import Any

import pytest
from simple_pid import PID

from pidemu.card.load import Card
from pidemu.cutover.plan import transfer_plan
from tests.cutover.bench import OP, PV, SP, E, numbers, plan_for, sentences, wait
from tests.helpers import made_up_card


def test_arduino_adds_its_gain_times_the_error_so_the_setpoint_goes_to_the_measurement_first() -> None:
    plan = plan_for("arduino/pid", Kp=2, Ki=0.5, Kd=1)
    assert (plan.without_plan, plan.bump) == (2 * E, 0.0)
    assert [dict(s.set) for s in plan.steps] == [{"SP [%]": PV}, {"OP [%]": OP}, {}, {"SP [%]": SP}]
    back = 2 * E + 0.5 * 0.1 * E  # P, and one increment of the integral
    assert f"moves by {back:.6g} %" in plan.steps[-1].do


def test_arduino_with_p_on_measurement_needs_nothing() -> None:
    plan = plan_for("arduino/pid", Kp=2, Ki=0.5, POn="P_ON_M")
    assert (plan.without_plan, plan.bump) == (0.0, 0.0)
    assert [dict(s.set) for s in plan.steps] == [{"SP [%]": SP}, {"OP [%]": OP}, {}]


def test_simple_pid_is_given_the_output_less_the_proportional_term_as_its_last_output() -> None:
    plan = plan_for("simple-pid/simple-pid", Kp=2, Ki=0.5, Kd=1)
    assert (plan.without_plan, plan.bump) == (2 * E, 0.0)
    real = PID(2, 0.5, 1, setpoint=numbers(plan)["SP"], auto_mode=False)
    real.set_auto_mode(True, last_output=numbers(plan)["load"])
    assert real(PV, dt=0.01) == pytest.approx(OP + 0.5 * 0.01 * E, abs=1e-12)  # the package itself: one increment


def test_epics_adds_its_gain_times_the_error_and_does_not_integrate_in_that_scan() -> None:
    plan = plan_for("epics/epid", KP=2, KI=0.5, KD=0.1)
    assert (plan.without_plan, plan.bump) == (2 * E, 0.0)
    assert [dict(s.set) for s in plan.steps] == [{"SP [%]": PV}, {"OP [%]": OP}, {}, {}, {"SP [%]": SP}]
    back = 2 * E + 2 * 0.5 * 0.1 * E + 2 * 0.1 * E / 0.1  # P, I, and D on the error
    assert f"moves by {back:.6g} %" in plan.steps[-1].do


def test_epics_without_integral_keeps_nothing_and_the_plan_says_what_remains() -> None:
    plan = plan_for("epics/epid", KP=2)
    assert not plan.is_bumpless
    assert plan.bump == plan.without_plan == 2 * E - OP
    assert any(f"a bump of {2 * E - OP:g} % of span remains" in note for note in plan.notes)


def test_the_iec_block_is_given_the_output_divided_by_its_gain() -> None:
    plan = plan_for("iec/61131-3-pid", KP=-1.2, TR=8, TD=0.6)
    assert numbers(plan)["manual entry"] == OP / -1.2
    assert plan.without_plan == pytest.approx(-1.2 * OP - OP, rel=1e-6)  # 24 bits
    assert plan.is_bumpless
    assert plan.resolution < 1e-4  # [%], 24 bits


def test_the_iec_block_without_gain_puts_out_nothing_in_manual_so_the_valve_is_held_from_outside() -> None:
    assert "hold the valve at 43 % from outside" in sentences(plan_for("iec/61131-3-pid", KP=0, TR=8))
    assert numbers(plan_for("iec/61131-3-pid", op=0.0, KP=-1.2, TR=8))["manual entry"] == 0.0


def test_filters_that_do_not_settle_in_any_reasonable_time_are_named() -> None:
    plan = plan_for("gnc-tools/cpid", Kp=1.2, Ki=0.15, rRampMax=1e-4)  # 54 by 0.0001 per scan
    assert "until its filters and differences have settled, more than 26214.4 s" in sentences(plan)
    assert any("have not settled after 262144 scans" in note for note in plan.notes)


def test_deltav_and_a_velocity_algorithm_need_no_more_than_manual_with_the_output() -> None:
    for plan in (
        plan_for("emerson/deltav", GAIN=2, RESET=20, RATE=5),
        plan_for("honeywell/tdc3000", K=2, T1=1),
        plan_for("yokogawa/fieldbus-pid", GAIN=2, RESET=20, RATE=3),
    ):
        assert (plan.without_plan, plan.bump) == (0.0, 0.0)
        assert [dict(s.set) for s in plan.steps] == [{"SP [%]": SP}, {"OP [%]": OP}, {}]


def test_a_derivative_on_the_error_that_has_seen_the_setpoint_move_is_waited_for() -> None:
    plan = plan_for("honeywell/tdc3000", K=2, T1=1, T2=0.2)
    lag = 0.1 * 0.2 * 60  # alpha Td [s]
    assert 20 * lag < wait(plan) < 60 * lag  # exp(-20) of it is left, or less


def test_an_assumed_transfer_is_named() -> None:
    for name, dials in (("emerson/deltav", {"GAIN": 2, "RESET": 20}), ("honeywell/tdc3000", {"K": 2, "T1": 1})):
        assert any(note.startswith("that is assumed, not stated: ") for note in plan_for(name, **dials).notes)
    assert not any("assumed" in note for note in plan_for("arduino/pid", Kp=2, Ki=0.5).notes)


def test_the_ros_class_is_switched_on_at_an_error_of_zero_because_its_derivative_starts_from_zero() -> None:
    plan = plan_for("ros/control-toolbox", p=2, i=0.5, d=0.1)
    assert numbers(plan) == {"SP": PV, "I": OP}
    assert plan.without_plan == pytest.approx(2 * E + 0.1 * E / 0.01 - OP, abs=1e-12)  # P and the kick of D, the integral is 0
    assert (plan.bump, plan.steps[-1].set) == (0.0, {"SP [%]": SP})


def test_the_ros_class_without_derivative_gets_its_integral_and_keeps_its_setpoint() -> None:
    plan = plan_for("ros/control-toolbox", p=2, i=0.5)
    assert numbers(plan) == {"SP": SP, "I": OP - 2 * E}
    assert plan.bump == 0.0
    assert "hold the valve at 43 % from outside" in sentences(plan)


def test_cpid_computes_unused_until_its_ramp_is_there_and_then_gets_its_integral() -> None:
    plan = plan_for("gnc-tools/cpid", Kp=1.2, Ki=0.15, Kd=0.8, Tf=0.6, b=0.7, c=0.3, rRampMax=0.5)
    assert numbers(plan) == {"SP": SP, "I": pytest.approx(OP - 1.2 * (0.7 * SP - PV), abs=1e-12)}
    assert wait(plan) >= SP / 0.5  # from 0 by 0.5 per scan
    assert plan.is_bumpless
    # without the plan: P and the kick of D at the first scan of all, for a setpoint that has come up by one scan's reach
    assert plan.without_plan == pytest.approx((1.2 * 0.7 * 0.5 - 1.2 * PV) + 0.8 / 0.6 * (0.3 * 0.5 - PV) - OP, abs=1e-9)


def test_pid2_gets_the_integral_that_p_leaves() -> None:
    plan = plan_for("mathworks/pid2", Kp=2, Ki=0.5, Kd=3, Tf=2, b=0.5, c=0)
    left = OP - 2 * (0.5 * SP - PV)
    assert numbers(plan)["I"] == pytest.approx(left, abs=1e-12)
    assert f"set its integral to {left:.6g} %" in sentences(plan)
    assert any("inferred" in note for note in plan.notes)


@pytest.mark.parametrize(
    ("name", "dials", "held"),
    [
        ("oscat/ft-pidwl", {"KP": 2, "TN": 20, "TV": 0}, OP - 2 * E),  # the integral of ki e
        ("oscat/ft-pid", {"KP": 2, "TN": 20, "TV": 0}, OP / 2 - E),  # of e/Ti
    ],
)
def test_the_integral_is_stated_in_the_unit_of_what_its_state_holds(name: str, dials: dict[str, Any], held: float) -> None:
    assert numbers(plan_for(name, **dials))["I"] == pytest.approx(held, abs=1e-5)  # 24 bits


@pytest.mark.parametrize("start", ["keep", "zero", "running"])
@pytest.mark.parametrize("rule", ["backward", "forward", "trapezoidal"])
@pytest.mark.parametrize("holds", ["ki e", "e/Ti", "e"])
@pytest.mark.parametrize("action", ["reverse", "direct"])
def test_every_integral_that_has_to_be_set_is_set_to_what_the_output_leaves(start: str, rule: str, holds: str, action: Any) -> None:
    card = made_up_card(transfer={"start": start}, integral={"rule": rule, "holds": holds, "windup": {"scheme": "none"}})
    s = card.settings(kp=2.0, ki=0.25)
    plan = transfer_plan(s, SP, PV, OP, action=action)
    sign = 1.0 if action == "reverse" else -1.0
    left = {"ki e": OP - sign * 2 * E, "e/Ti": sign * OP / 2 - E, "e": (sign * OP / 2 - E) * 8}[holds]  # Ti = kp/ki = 8 s
    assert numbers(plan) == {"SP": SP, "I": pytest.approx(left, abs=1e-12)} | ({} if start == "running" else {"OP": OP})
    assert plan.is_bumpless
    unit = {"ki e": "%", "e/Ti": "%", "e": "% s"}[holds]
    assert any(f"I [{unit}]" in step.set for step in plan.steps)


# --- without integral ------------------------------------------------------------------------------------------------


def test_a_proportional_controller_gets_the_bias_that_p_leaves() -> None:
    plan = plan_for("generic/parallel", kp=2, ki=0, kd=3, Tf=1)
    assert numbers(plan)["bias"] == pytest.approx(OP - 2 * E, abs=1e-12)
    assert plan.without_plan == pytest.approx(2 * E - OP, abs=1e-9)
    assert plan.is_bumpless
    assert any("names no setting for a bias" in note for note in plan.notes)


def with_bias(**dial: Any) -> Card:
    plain = {
        "kp": {"sets": "gain", "unit": "%/%"},
        "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0},
        "kd": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
    }
    return made_up_card(settings=plain | {"MR": {"sets": "bias", "unit": "%", "default": 50} | dial})


@pytest.mark.parametrize("op", [OP, 2 * E])
def test_a_bias_that_has_a_dial_is_set_there(op: float) -> None:
    plan = transfer_plan(with_bias().settings(kp=2.0), SP, PV, op, action="reverse")
    assert numbers(plan)["MR"] == op - 2 * E  # 0 as well, in place of the 50 of the dial
    assert (plan.bump, plan.without_plan) == (0.0, 50 + 2 * E - op)


def test_a_bias_beyond_its_dial_leaves_a_bump_that_is_stated() -> None:
    plan = transfer_plan(with_bias(range=[0, 10], default=5).settings(kp=2.0), SP, PV, OP, action="reverse")
    assert plan.bump == 5 + 2 * E - OP
    assert any(f"a bump of {5 + 2 * E - OP:g} % of span remains" in note for note in plan.notes)
