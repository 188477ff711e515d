"""Setpoint, limits and ranges at the cut-over, the figures that the plan states, and the signals that it refuses."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

import pidemu
from pidemu import ScanError
from pidemu.cutover.plan import transfer_plan
from tests.cutover.bench import OP, PIDS, PV, SP, WIDE, E, numbers, plan_for, typical
from tests.helpers import made_up_card


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
    assert transfer_plan(tracked, SP, PV, 99.5, action="reverse").bump == 0.0  # one increment is 1


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
    assert transfer_plan(s, SP, PV, op, action="reverse").is_bumpless
    with pytest.raises(ScanError, match=r"the output of 19.4 eu is outside the output limits, 4.1 eu to 19.3 eu"):
        transfer_plan(s, SP, PV, 19.4, action="reverse")


def test_a_card_in_engineering_units_takes_the_signals_as_they_are() -> None:
    ranges: dict[str, Any] = {"pv_range": (0.0, 300.0), "op_range": (4.0, 20.0)}
    plan = plan_for("arduino/pid", sp=150, pv=140, op=10, Kp=0.1, Ki=0.5, **ranges)
    assert plan.without_plan == pytest.approx(0.1 * 10 / 16 * 100, abs=1e-12)
    assert numbers(plan) == {"SP": 140.0, "OP": 10.0}
    assert not any("taken as 100" in note for note in plan.notes)


def test_the_numbers_in_the_sentences_are_those_that_are_set() -> None:
    for name in PIDS:
        for step in transfer_plan(typical(pidemu.load_card(name), {}), SP, PV, OP, output_limits=WIDE, action="reverse").steps:
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
    assert transfer_plan(s, SP, PV, OP, output_limits=(0, 100), action="reverse").is_bumpless
