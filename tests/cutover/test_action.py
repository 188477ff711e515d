"""The plan for the cut-over and the loop's action."""

from __future__ import annotations

import pytest

import pidemu
from pidemu.cutover.plan import TransferPlan
from pidemu.errors import ActionError, ScanError
from tests.cli.helpers import said
from tests.cutover.bench import numbers

P_ONLY = ("convert", "honeywell/tdc3000", "K=2", "T1=inf", "--to", "emerson/deltav", "--cut-over", "50,55,60")


def p_only() -> pidemu.Conversion:
    return pidemu.convert(pidemu.load_card("honeywell/tdc3000").settings(K=2, T1="inf"), "emerson/deltav")


@pytest.mark.parametrize(("action", "bias"), [("reverse", 70.0), ("direct", 50.0)])  # 60 = bias + 2 e, e = -5 and 5
def test_a_p_only_loop_gets_the_bias_of_its_action_and_does_not_bump(action: pidemu.Action, bias: float) -> None:
    conversion = p_only()
    plan = conversion.transfer_plan(sp=50, pv=55, op=60, action=action)
    assert numbers(plan)["bias"] == bias
    controller = pidemu.Controller(conversion.settings, 1.0, action, bias=bias, initial_output=60)
    controller.scan(50, 55, auto=False, manual=60)
    assert controller.scan(50, 55) == 60.0
    other = pidemu.Controller(conversion.settings, 1.0, action, bias=120 - bias, initial_output=60)
    other.scan(50, 55, auto=False, manual=60)
    assert abs(other.scan(50, 55) - 60) == 20.0  # what the other action's bias bumps by
    assert (plan.action, action in plan.action_text) == (action, True)


def test_without_an_action_it_is_refused_with_both_readings_and_the_remedy() -> None:
    with pytest.raises(ActionError) as caught:
        p_only().transfer_plan(sp=50, pv=55, op=60)
    assert "depends on the action of the loop, which was not stated; add --action reverse or --action direct" in str(caught.value)
    assert "direct acting, PV - SP: Direct_Acting on in CONTROL_OPTS" in str(caught.value)


def test_a_plan_that_is_the_same_for_both_needs_no_action_and_says_so() -> None:
    c = pidemu.convert(pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4), "emerson/deltav")
    plan, reverse, direct = (c.transfer_plan(50, 48.5, 40, a) for a in (None, "reverse", "direct"))
    assert plan.action is None
    assert plan.action_text.startswith("either action (reverse acting, SP - PV")
    assert plan.steps == reverse.steps == direct.steps
    assert any("up or down according to the action" in note for note in plan.notes)
    assert any("the integral raises the output by" in note for note in reverse.notes)
    assert any("the integral lowers the output by" in note for note in direct.notes)


def test_the_sign_of_the_gain_is_the_action_and_nothing_is_asked() -> None:
    plans: list[TransferPlan] = []
    for gain in (2, -2):
        s = pidemu.load_card("simple-pid/simple-pid").settings(Kp=gain, Ki=gain / 20)
        plans.append(pidemu.convert(s, "simple-pid/simple-pid").transfer_plan(50, 48, 43))
    assert [numbers(plan)["load"] for plan in plans] == [39.0, 47.0]  # 43 less 2 x 2
    assert [plan.action for plan in plans] == ["reverse", "direct"]
    with pytest.raises(ScanError, match="stated as direct acting"):
        pidemu.convert(pidemu.load_card("simple-pid/simple-pid").settings(Kp=2), "simple-pid/simple-pid").transfer_plan(
            50, 48, 43, "direct"
        )


def test_the_sign_of_the_source_s_gain_tells_the_action_of_a_target_with_a_switch() -> None:
    source = pidemu.load_card("simple-pid/simple-pid").settings(Kp=-2, pv_range=(0, 100), op_range=(0, 100))
    plan = pidemu.convert(source, "emerson/deltav").transfer_plan(50, 55, 60)
    assert numbers(plan)["bias"] == 50.0


def test_the_command_line_gives_the_dials_and_asks_for_the_action() -> None:
    status, out, err = said(*P_ONLY)
    assert status == 1
    assert "GAIN" in out
    assert "Cut-over" not in out
    assert err.startswith("error: emerson/deltav: what to set at this cut-over depends on the action")
    status, out, err = said(*P_ONLY, "--action", "direct")
    assert (status, err) == (0, "")
    assert "give the target a bias of 50 %" in out
    assert "for direct acting, PV - SP: Direct_Acting on in CONTROL_OPTS" in out
