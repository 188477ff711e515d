"""The plan for the cut-over, followed step by step on every card, and by hand on those that people have."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Any, Final

import pytest
from simple_pid import PID

import pidemu
from pidemu import Controller, ScanError, Settings
from pidemu.card.base import Form
from pidemu.card.load import Card
from pidemu.card.references import is_active
from pidemu.cutover.plan import TransferPlan, transfer_plan
from pidemu.errors import SettingError
from pidemu.settings import limits
from pidemu.units import Role, from_canonical, parse_unit
from tests.helpers import made_up_card, option_combinations

SP, PV, OP = 54.0, 50.0, 43.0
E = SP - PV
WIDE = (-1000.0, 1000.0)

_TYPICAL: Final[dict[Role, float]] = {
    Role.GAIN: 1.5,
    Role.MULTIPLIER: 1.0,
    Role.INTEGRAL: 1 / 30,
    Role.DERIVATIVE: 6.0,
    Role.FILTER_TIME: 1.2,
    Role.FILTER_RATIO: 0.125,
    Role.FILTER_GAIN: 8.0,
    Role.PROPORTIONAL_WEIGHT: 0.7,
    Role.DERIVATIVE_WEIGHT: 0.3,
    Role.TRACKING_TIME: 10.0,
    Role.FILTER_FACTOR: 0.5,
    Role.INTEGRAL_LIMIT: 500.0,
    Role.DEADBAND: 1.0,
    Role.GAP_GAIN: 0.5,
    Role.LINEARITY: 0.8,
    Role.FEEDFORWARD_GAIN: 1.0,
    Role.SETPOINT_RATE: 2.0,
}
"""Canonical values by role: a temperature loop."""


def typical(card: Card, options: dict[str, str]) -> Settings:
    """Every dial at a typical value; reverse acting also where the sign of the gain decides that."""
    equation = card.variant(options).equation
    backwards = equation.action.fixed and equation.action.reverse == "pv - sp"
    given: dict[str, object] = dict(options)
    for name, s in equation.settings.items():
        role = Role(s.sets)
        left = s.default is not None and (role not in _TYPICAL or role is Role.INTEGRAL_LIMIT)
        if left or not is_active(equation, name, s):
            continue
        value = from_canonical(role, -1.5 if backwards and role is Role.GAIN else _TYPICAL[role], parse_unit(s.unit))
        low, high = limits(s)
        value = value if low < 0 else min(max(value, low), high)
        given[name] = round(value / s.resolution) * s.resolution if s.resolution else value
    return card.settings(given)


def defined(card: Card) -> Iterator[Settings]:
    """Settings for every combination of options that makes a controller."""
    for options in option_combinations(card):
        try:
            settings = typical(card, options)
            settings.algorithm()
        except SettingError:
            continue
        yield settings


PIDS = [name for name in pidemu.cards() if pidemu.load_card(name).data.form is not Form.DAHLIN]
on_every_card = pytest.mark.parametrize("name", PIDS)


def numbers(plan: TransferPlan) -> dict[str, float]:
    """What the steps set, by name without unit; of a setpoint that is set twice, the first."""
    found: dict[str, float] = {}
    for step in plan.steps:
        for name, value in step.set.items():
            found.setdefault(name.partition(" [")[0], value)
    return found


def wait(plan: TransferPlan) -> int:
    """How many scans the steps leave the target in manual, at least one."""
    return max([1, *(int(n) for step in plan.steps for n in re.findall(r"\((\d+) scans?\)", step.do))])


def followed(plan: TransferPlan, s: Settings, scans: int = 3, output_limits: tuple[float, float] = WIDE) -> list[float]:
    """The first automatic outputs where a technician does what the steps say, no more; signals in the controller's own units."""
    a, given = s.algorithm(), numbers(plan)
    sp, start = given.get("SP", PV), a.start
    ctl = Controller(s, output_limits=output_limits, bias=given.get("bias", 0.0), initial_output=OP)
    ctl.scan(20.0, PV, auto=False, manual=given.get("manual entry", OP))  # the setpoint was another one before
    u = ctl.run(sp, [PV] * wait(plan), auto=False, manual=given.get("manual entry", OP))[-1]
    if a.manual_output != "zero":
        assert u == pytest.approx(OP, rel=1e-6, abs=0.01)  # nothing moves the valve in manual: 24 bits, whole counts
    if "load" in given or "I" in given:
        states = ctl.state
        states |= {"u": given["load"]} if "load" in given else {"I": given["I"]} | {n: OP for n in ("own", "inner") if n in states}
        if start == "zero":
            states |= {"on": 1.0} | {n: 0.0 for n in ("x1", "D") if n in states}
        ctl = Controller(s, output_limits=output_limits, initial_output=OP)
        ctl.start(**states)
    return [ctl.scan(sp, PV) for _ in range(scans)]


def increment(s: Settings, e: float) -> float:
    """What the integral adds per scan, ``ki h S(e)`` (specs/equations.md, sections 4 and 8)."""
    a, size = s.algorithm(), abs(e)
    if a.shape is not None and a.shape.on_integral:
        gap = a.shape.gain if size <= a.shape.band else 1.0
        e *= {"gap": gap, "squared": size / 100, "gain-linear": a.shape.linearity + (1 - a.shape.linearity) * size / 100}[
            a.shape.kind
        ]
    return a.ki * Controller(s).interval * e


@on_every_card
def test_following_the_plan_moves_the_output_by_one_increment_of_the_integral_at_most(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE)
        precision = s.algorithm().precision
        # rounding of 24 bits in signals of 50 and terms of a few hundred; one count of the output
        assert plan.resolution <= {"float64": 1e-9, "float32": 1e-3, "integer": 0.011}[precision], s.summary
        bare = not s.algorithm().ki and not s.algorithm().keeps_integral
        assert plan.is_bumpless or bare, s.summary
        if not plan.is_bumpless:
            continue
        u = followed(plan, s)
        grown = increment(s, numbers(plan).get("SP", PV) - PV)
        assert min(abs(u[0] - OP), abs(u[0] - OP - grown)) <= plan.resolution + 1e-12, (s.summary, u, grown)
        assert abs(plan.bump) <= plan.resolution


@on_every_card
def test_what_the_plan_avoids_in_the_first_scan_does_not_come_in_the_second(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE)
        if plan.is_bumpless:
            u = followed(plan, s, scans=4)
            # with constant signals the integral goes on at one rate, behind a filter on the output at less; counts come singly
            allowed, grown = max(2 * plan.resolution, 1e-9), increment(s, numbers(plan).get("SP", PV) - PV)
            for moved in (u[1] - u[0], u[2] - u[1], u[3] - u[2]):
                assert min(0.0, grown) - allowed <= moved <= max(0.0, grown) + allowed, (s.summary, u)


@on_every_card
def test_without_the_plan_the_output_moves_as_a_plain_switch_to_automatic_shows(name: str) -> None:
    for s in defined(pidemu.load_card(name)):
        plan = transfer_plan(s, SP, PV, OP, output_limits=WIDE)
        ctl = Controller(s, output_limits=WIDE, initial_output=OP)
        if s.algorithm().start != "running":
            ctl.run(SP, [PV] * 400, auto=False, manual=OP)
        moved = ctl.scan(SP, PV) - OP
        # the integral's own increment is in the scan or not, as the card has it
        error = E if not s.algorithm().sp_tracks else 0.0
        shares = [0.0, 0.5, 1.0]
        assert min(abs(moved - plan.without_plan - x * increment(s, error)) for x in shares) <= plan.resolution + 1e-9, s.summary


def plan_for(name: str, *, sp: float = SP, pv: float = PV, op: float = OP, **dials: Any) -> TransferPlan:
    return transfer_plan(pidemu.load_card(name).settings(**dials), sp, pv, op)


def sentences(plan: TransferPlan) -> str:
    return "\n".join([s.do for s in plan.steps])


# --- by hand: an error of 4 ------------------------------------------------------------------------------------------


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
    plan = plan_for("gnc-tools/cpid", Kp=1.2, Ki=0.15, rRampMax=1e-4)  # 54 at 0.0001 per second
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
    assert wait(plan) >= SP / 0.5 / 0.1  # from 0 at 0.5 per second, in scans of 0.1 s
    assert plan.is_bumpless
    # without the plan: P and the kick of D at the first scan of all, for a setpoint that has come up by one scan's reach
    assert plan.without_plan == pytest.approx((1.2 * 0.7 * 0.05 - 1.2 * PV) + 0.8 / 0.6 * (0.3 * 0.05 - PV) - OP, abs=1e-9)


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
    plan = transfer_plan(with_bias().settings(kp=2.0), SP, PV, op)
    assert numbers(plan)["MR"] == op - 2 * E  # 0 as well, in place of the 50 of the dial
    assert (plan.bump, plan.without_plan) == (0.0, 50 + 2 * E - op)


def test_a_bias_beyond_its_dial_leaves_a_bump_that_is_stated() -> None:
    plan = transfer_plan(with_bias(range=[0, 10], default=5).settings(kp=2.0), SP, PV, OP)
    assert plan.bump == 5 + 2 * E - OP
    assert any(f"a bump of {5 + 2 * E - OP:g} % of span remains" in note for note in plan.notes)


# --- setpoint, limits, ranges ----------------------------------------------------------------------------------------


def test_a_setpoint_that_tracks_in_manual_has_to_be_set_again() -> None:
    plan = plan_for("automationdirect/directlogic", GAIN=2, RESET=20)
    assert (plan.bump, plan.without_plan) == (0.0, 0.0)
    assert [dict(s.set) for s in plan.steps] == [{"OP [%]": OP}, {}, {"SP [%]": SP}]
    assert any("in manual its setpoint follows the measurement" in note for note in plan.notes)
    moved = 2 * E + 2 / 20 * 0.05 * E
    assert f"moves by {moved:.6g} %" in plan.steps[-1].do


def test_without_an_error_there_is_no_setpoint_to_give_back() -> None:
    plan = plan_for("arduino/pid", sp=PV, Kp=2, Ki=0.5)
    assert [dict(s.set) for s in plan.steps] == [{"SP [%]": PV}, {"OP [%]": OP}, {}]


def test_an_output_at_its_limit_that_the_integral_pushes_further_is_no_bump() -> None:
    plan = plan_for("generic/standard", op=100.0, K=2, Ti=20)
    assert plan.bump == 0.0
    tracked = made_up_card(transfer={"start": "tracked"}).settings(kp=2.0, ki=0.25)
    assert transfer_plan(tracked, SP, PV, 99.5).bump == 0.0  # one increment is 1


def test_an_integral_whose_limits_are_too_narrow_leaves_a_bump_that_is_stated() -> None:
    plan = plan_for("ardupilot/ac-pid", P=2, I=0.5, IMAX=10)
    assert not plan.is_bumpless
    assert plan.bump == pytest.approx(10 + 2 * E - OP, abs=1e-4)  # I stands at its limit, in 24 bits
    assert any("remains" in note for note in plan.notes)


def test_engineering_ranges_are_those_of_the_signals_and_of_the_steps() -> None:
    dials: dict[str, Any] = {"GAIN": 2, "RESET": 20, "TRANSFER": "II"}
    plain = plan_for("automationdirect/directlogic", **dials)
    ranges: dict[str, Any] = {"pv_range": (100.0, 300.0), "op_range": (4.0, 20.0)}
    plan = plan_for("automationdirect/directlogic", sp=100 + 2 * SP, pv=100 + 2 * PV, op=4 + 0.16 * OP, **dials, **ranges)
    assert numbers(plan) == {"SP": pytest.approx(100 + 2 * PV), "OP": pytest.approx(4 + 0.16 * OP)}
    assert set(plan.steps[1].set) == {"OP [eu]"}
    assert plan.without_plan == pytest.approx(plain.without_plan, abs=1e-12)  # both in percent
    assert f"moves by {0.16 * (2 * E + 2 / 20 * 0.05 * E):.6g} eu" in plan.steps[-1].do


@pytest.mark.parametrize("op", [4.1, 19.3])
def test_an_output_at_a_limit_in_engineering_units_is_within_it(op: float) -> None:
    s = pidemu.load_card("generic/standard").settings(K=2, Ti=20, op_range=(4.1, 19.3))
    assert transfer_plan(s, SP, PV, op).is_bumpless
    with pytest.raises(ScanError, match=r"the output of 19.4 eu is outside the output limits, 4.1 eu to 19.3 eu"):
        transfer_plan(s, SP, PV, 19.4)


def test_a_card_in_engineering_units_takes_the_signals_as_they_are() -> None:
    ranges: dict[str, Any] = {"pv_range": (0.0, 300.0), "op_range": (4.0, 20.0)}
    plan = plan_for("arduino/pid", sp=150, pv=140, op=10, Kp=0.1, Ki=0.5, **ranges)
    assert plan.without_plan == pytest.approx(0.1 * 10 / 16 * 100, abs=1e-12)
    assert numbers(plan) == {"SP": 140.0, "OP": 10.0}
    assert not any("taken as 100" in note for note in plan.notes)


def test_the_numbers_in_the_sentences_are_those_that_are_set() -> None:
    for name in PIDS:
        for step in transfer_plan(typical(pidemu.load_card(name), {}), SP, PV, OP, output_limits=WIDE).steps:
            for value in step.set.values():
                assert f"{value:.6g}" in step.do


def test_the_plan_in_plain_values_is_json_with_everything_in_it() -> None:
    plan = plan_for("arduino/pid", Kp=2, Ki=0.5)
    plain = json.loads(json.dumps(plan.to_dict()))
    assert plain["steps"] == [{"do": s.do, "set": dict(s.set)} for s in plan.steps]
    assert [plain[name] for name in ("bump", "without_plan", "is_bumpless", "notes")] == [0.0, 2 * E, True, list(plan.notes)]


@pytest.mark.parametrize("signal", ["sp", "pv", "op"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_signal_that_is_no_number_is_refused(signal: str, value: float) -> None:
    with pytest.raises(ScanError, match="is not a finite number; give the one at the cut-over"):
        plan_for("arduino/pid", Kp=2, Ki=0.5, **{signal: value})


def test_an_output_outside_the_limits_is_refused_with_the_limits_and_the_remedy() -> None:
    with pytest.raises(ScanError, match=r"the output of 43 % is outside the output limits, -1 % to 1 %.*output_limits"):
        plan_for("modelica/limpid")
    s = pidemu.load_card("modelica/limpid").settings(k=2, Ti=5, Td=0)
    assert transfer_plan(s, SP, PV, OP, output_limits=(0, 100)).is_bumpless
