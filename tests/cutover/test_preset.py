"""What a user can set at the transfer: what the card says of it, and what the plan makes of that."""

from __future__ import annotations

import re
from typing import Any

import advanced_pid
import pytest

import pidemu
from pidemu.card.load import variants
from pidemu.card.model.base import Status
from pidemu.cutover.plan import TransferPlan, transfer_plan
from tests.cutover.bench import OP, PIDS, PV, SP, E, numbers, plan_for
from tests.helpers import made_up_card

STATED = {
    "simple-pid/simple-pid": "output",
    "advanced-pid/advanced-pid": "integral",
    "ardupilot/ac-pid": "integral",
    "modelica/limpid": "initial",
}
"""The cards whose sources say that something can be set, and what."""


def on_presets(plan: TransferPlan) -> list[str]:
    """The notes on what can be set."""
    return [note for note in plan.notes if re.search(r"another value to load|can be set|does not state", note)]


@pytest.mark.parametrize("name", PIDS)
def test_a_preset_is_claimed_where_a_source_states_it_and_goes_with_the_start_that_it_belongs_to(name: str) -> None:
    for variant in variants(pidemu.load_card(name)):
        t = variant.equation.transfer
        assert t.preset == STATED.get(name, "none")
        if t.preset == "none":
            continue
        (stated,) = [s for s in variant.statements if s.path == "transfer.preset"]
        assert stated.key == "transfer.preset"  # evidence of its own
        assert stated.evidence is not None
        assert stated.evidence.status is Status.DOCUMENTED
        assert t.start in (["load-output"] if t.preset == "output" else ["keep", "zero", "running"])


def test_advanced_pid_itself_goes_on_from_the_output_with_the_integral_that_the_plan_gives_it() -> None:
    plan = plan_for("advanced-pid/advanced-pid", Kp=2, Ki=0.5, Kd=1, Tf=0.2)
    real = advanced_pid.PID(2, 0.5, 1, 0.2)
    t = 0.0
    for t in (0.1 * k for k in range(100)):  # 50 filter times
        real(t, numbers(plan)["SP"] - PV)
    last, error, _ = real.get_initial_value()
    real.set_initial_value(last, error, numbers(plan)["I"])
    assert real(t + 0.1, E) == pytest.approx(OP + 0.5 * 0.1 * E, abs=1e-9)  # exp(-50) of the derivative is left
    assert plan.is_bumpless


@pytest.mark.parametrize(
    ("name", "dials", "note"),
    [
        (
            "simple-pid/simple-pid",
            {"Kp": 2, "Ki": 0.5},
            "can be given another value to load than its output (documented: set_auto_mode: last_output is an argument)",
        ),
        (
            "advanced-pid/advanced-pid",
            {"Kp": 2, "Ki": 0.5, "Kd": 0, "Tf": 0},
            "can be set (documented: set_initial_value: i0, the integral)",
        ),
        ("ardupilot/ac-pid", {"P": 2, "I": 0.5, "IMAX": 500}, "can be set (documented: set_integrator"),
        ("modelica/limpid", {"k": 2, "Ti": 5}, "can be set for its first scan of all, not later (documented: "),
        ("mathworks/pid2", {"Kp": 2, "Ki": 0.5}, "does not state where its integral is set"),
        ("gnc-tools/cpid", {"Kp": 2, "Ki": 0.5}, "does not state where its integral is set"),
        ("oscat/ft-pidwl", {"KP": 2, "TN": 20, "TV": 0}, "does not state where its integral is set"),
        ("ros/control-toolbox", {"p": 2, "i": 0.5}, "does not state where its integral is set"),
        ("arduino/pid", {"Kp": 2, "Ki": 0.5}, "does not state that anything but its output can be loaded"),
        ("epics/epid", {"KP": 2, "KI": 0.5}, "does not state that anything but its output can be loaded"),
    ],
)
def test_the_plan_says_whether_what_it_sets_is_stated(name: str, dials: dict[str, Any], note: str) -> None:
    plan = transfer_plan(pidemu.load_card(name).settings(**dials), SP, PV, OP, output_limits=(0.0, 100.0), action="reverse")
    assert [note in found for found in on_presets(plan)] == [True]


@pytest.mark.parametrize(
    ("name", "dials"),
    [
        ("emerson/deltav", {"GAIN": 2, "RESET": 20}),
        ("honeywell/tdc3000", {"K": 2, "T1": 1}),
        ("iec/61131-3-pid", {"KP": -2, "TR": 8}),
        ("automationdirect/directlogic", {"GAIN": 2, "RESET": 20}),  # its setpoint follows the measurement anyway
        ("epics/epid", {"KP": 2}),  # and this one loads nothing without integral
    ],
)
def test_where_nothing_is_preset_the_plan_does_not_speak_of_it(name: str, dials: dict[str, Any]) -> None:
    assert on_presets(plan_for(name, **dials)) == []


@pytest.mark.parametrize("preset", ["output", "none"])
def test_an_output_that_can_be_given_spares_the_setpoint_its_detour(preset: str) -> None:
    s = made_up_card(transfer={"start": "load-output", "preset": preset}).settings(kp=2.0, ki=0.25)
    plan = transfer_plan(s, SP, PV, OP, action="reverse")
    assert numbers(plan) == {"SP": SP, "OP": OP, "load": OP - 2 * E} if preset == "output" else {"SP": PV, "OP": OP}
    assert plan.is_bumpless
    assert plan.without_plan == 2 * E
