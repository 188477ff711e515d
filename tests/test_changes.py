"""Settings and options that change while the controller runs (specs/equations.md, section 6)."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Controller, Settings
from pidemu.controller.signals import Event
from pidemu.errors import ScanError, SettingError
from tests.helpers import made_up_card, scans_of, settings_of
from tests.histories import history

NONE: dict[str, Any] = {"scheme": "none"}
STANDARD: dict[str, Any] = {
    "form": "standard",
    "settings": {
        "K": {"sets": "gain", "unit": "%/%"},
        "Ti": {"sets": "integral", "unit": "s/repeat", "off": 0, "default": 0},
        "Td": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
    },
    "examples": [{"given": {"K": 1}, "canonical": {"kp": 1, "ki": 0, "kd": 0}}],
}
DIALS: dict[str, Any] = {
    "kp": {"sets": "gain", "unit": "%/%"},
    "ki": {"sets": "integral", "unit": "1/s", "off": 0, "default": 0},
    "kd": {"sets": "derivative", "unit": "s", "off": 0, "default": 0},
}
INCREMENTAL: dict[str, Any] = {"implementation": "velocity", "integral": {"rule": "backward", "windup": {"scheme": "velocity"}}}
DEFAULTS: dict[str, object] = {"kp": 2.0, "ki": 0.25}
RUN = ([50.0, 52.0, 54.0, 54.0], [50.0, 50.0, 50.0, 51.0])
"""Errors of 0, 2, 4 and 3; from an output of 40."""

seeds = st.integers(0, 2**32 - 1)


def bench(given: dict[str, object], **fields: Any) -> Controller:
    """A controller at 1 s that has run over `RUN`."""
    ctl = Controller(made_up_card(**fields).settings(given), initial_output=40.0)
    ctl.run(*RUN)
    return ctl


def standard(holds: str, **given: object) -> Controller:
    """K = 2 and Ti = 8 s, with an integral state of one kind."""
    fields = STANDARD | {"integral": {"rule": "backward", "holds": holds, "windup": NONE}}
    return bench({"K": 2.0, "Ti": 8.0} | given, **fields)


def option(before: dict[str, Any], after: dict[str, Any], **fields: Any) -> dict[str, Any]:
    """Fields of a card with an option between two ways of being."""
    return fields | {"options": {"KIND": {"default": "one", "choices": {"one": before, "other": after}}}}


def settled(ctl: Controller, **changes: object) -> tuple[float, float]:
    """Change settings; return what the next output moves by, at the last error of 3, and what the event says it does."""
    before = ctl.output
    ctl.change(changes)
    (event,) = (e for e in ctl.events if e.kind == "settings")
    return ctl.scan(54.0, 51.0) - before, event.bump


# --- what the state is the integral of: S = sum of e h = 9, so that I = 40 + 2 S/8 = 42.25 and u = 2 times 3 + I = 48.25 ----


@pytest.mark.parametrize(
    ("holds", "change", "expected"),
    [
        # the state is the integral term: a change shows in P and in what is added from now on only
        ("ki e", {"Ti": 4.0}, 2 * 3 / 4),
        ("ki e", {"K": 3.0}, (3 - 2) * 3 + 3 * 3 / 8),
        # the state is (40 + 2 S/8)/2, and the gain multiplies all of it
        ("e/Ti", {"Ti": 4.0}, 2 * 3 / 4),
        ("e/Ti", {"K": 3.0}, (3 - 2) * 3 + (3 - 2) * 42.25 / 2 + 3 * 3 / 8),
        # the state is (40 + 2 S/8) 8/2 and is divided by the integral time as well
        ("e", {"Ti": 4.0}, 42.25 * 8 / 4 - 42.25 + 2 * 3 / 4),
        ("e", {"K": 3.0}, (3 - 2) * 3 + (3 - 2) * 42.25 / 2 + 3 * 3 / 8),
        ("e", {"K": 3.0, "Ti": 12.0}, (3 - 2) * 3 + 3 / 12 * (42.25 * 4) - 42.25 + 3 * 3 / 12),
    ],
    ids=str,
)
def test_a_change_acts_on_what_the_integral_holds(holds: str, change: dict[str, object], expected: float) -> None:
    ctl = standard(holds)
    assert ctl.output == pytest.approx(48.25, rel=1e-15)
    moved, bump = settled(ctl, **change)
    assert moved == pytest.approx(min(expected, 100 - 48.25), rel=1e-13)  # the change is rounded to 1e-16 of 100
    unchanged = 2 * 3 / 8
    assert bump == pytest.approx(min(expected, 100 - 48.25) - unchanged, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("holds", ["ki e", "e/Ti", "e"])
def test_a_change_to_the_same_settings_changes_nothing(holds: str) -> None:
    ctl, undisturbed = standard(holds), standard(holds)
    ctl.change({"K": 2.0})
    assert ctl.state == undisturbed.state
    assert ctl.events[-1] == Event(4, "settings", "no change", 0.0)
    assert ctl.scan(54.0, 51.0) == undisturbed.scan(54.0, 51.0)


def test_the_event_of_a_change_names_what_changed_and_when() -> None:
    ctl = bench(DEFAULTS, **option({}, {"proportional": {"on": "pv"}}))
    ctl.scan(54.0, 51.0)
    ctl.change({"ki": 0.5}, kp=3)
    ctl.change(KIND="other")
    assert [(e.scan, e.text) for e in ctl.events if e.kind == "settings"] == [(5, "kp = 3, ki = 0.5"), (5, "KIND = other")]


def test_before_the_first_scan_a_change_is_no_event() -> None:
    ctl = Controller(made_up_card().settings(DEFAULTS), initial_output=40.0)
    assert ctl.change(kp=3.0) == ctl.settings
    assert ctl.events == []
    assert ctl.run(*RUN).tolist() == [40.0, 46.5, 53.5, 51.25]


def test_a_velocity_controller_adds_increments_of_its_new_gains_to_the_output_that_it_has() -> None:
    ctl = bench(DEFAULTS, **INCREMENTAL)
    moved, bump = settled(ctl, kp=5.0, ki=0.5)
    assert (moved, bump) == pytest.approx((0.5 * 3, 0.25 * 3), rel=1e-13)  # the error stands still
    before = ctl.output
    assert ctl.scan(55.0, 51.0) - before == pytest.approx(5.0 + 0.5 * 4, rel=1e-13)


@pytest.mark.parametrize("fields", [{}, INCREMENTAL], ids=["positional", "velocity"])
def test_whole_numbers_as_arguments_do_not_make_whole_numbers_of_the_states(fields: dict[str, Any]) -> None:
    chosen = made_up_card(**fields).settings(kp=2, ki=0.25)
    whole, real = (Controller(chosen, 1, output_limits=(0, 100), initial_output=u) for u in (40, 40.0))
    for ctl in (whole, real):
        ctl.run(*RUN)
        ctl.change(ki=0.5)
    assert whole.state == real.state
    whole.reset()
    whole.start(u=12.5)
    assert whole.output == 12.5


# --- changes that are made bumpless ----------------------------------------------------------------------------------


@pytest.mark.parametrize("change", [{"kp": 5.0}, {"kp": 0.5, "ki": 0.3}, {"b": 0.25}, {"kp": 3.0, "b": 0.0}], ids=str)
def test_where_changes_are_bumpless_the_output_moves_by_the_integral_alone(change: dict[str, object]) -> None:
    dials = DIALS | {"b": {"sets": "proportional-weight", "unit": "1"}}
    ctl = bench(
        DEFAULTS | {"b": 1.0},
        settings=dials,
        proportional={"on": "weighted", "weight": "b"},
        transfer={"start": "bumpless", "changes": "bumpless"},
    )
    ki = float(str(change.get("ki", 0.25)))
    moved, bump = settled(ctl, **change)
    assert moved == pytest.approx(3 * ki, rel=1e-12)  # P old less P new is taken out and put back: 1e-16 of 100
    assert bump == pytest.approx(3 * (ki - 0.25), abs=1e-12)


def test_in_manual_nothing_is_made_up_for() -> None:
    ctl = bench(DEFAULTS, transfer={"start": "keep", "changes": "bumpless"})
    ctl.scan(54.0, 51.0, auto=False)
    before = ctl.state
    ctl.change(kp=5.0)
    assert before == ctl.state


# --- terms that come and go ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", ["bumpless", "load-output", "tracked", "keep", "running"])
@pytest.mark.parametrize("derivative", ["running", "restarted"])
def test_an_integral_that_is_switched_on_goes_on_from_the_output(start: str, derivative: str) -> None:
    """A loop with P and D alone stands at 3 kp; the integral begins at what is left of the output, which is nothing."""
    transfer = {"start": start, "derivative": derivative} | ({"without-integral": "zero"} if start == "load-output" else {})
    ctl = bench({"kp": 2.0, "kd": 4.0}, transfer=transfer)
    ctl.scan(54.0, 51.0)
    assert ctl.output == 6.0
    ctl.change(ki=0.25)
    assert ctl.scan(54.0, 51.0) == pytest.approx(6.0, abs=0.75)  # with this scan's 0.25 times 3, or one scan later


def test_an_integral_that_is_switched_off_stays_as_a_constant_and_comes_back_as_the_output_is() -> None:
    ctl = bench(DEFAULTS)
    before = ctl.output
    ctl.change(ki=0)
    assert [ctl.scan(54.0, 51.0), ctl.scan(54.0, 51.0)] == [before, before]
    ctl.change(kp=3.0)
    assert ctl.scan(54.0, 51.0) == pytest.approx(before + 3.0)
    ctl.change(ki=0.25)
    assert ctl.scan(54.0, 51.0) == pytest.approx(before + 3.0, abs=0.75)
    ctl.reset()
    ctl.change(ki=0)
    assert ctl.scan(54.0, 51.0) == 9.0


def test_an_integral_that_is_switched_off_is_gone_where_the_card_says_so() -> None:
    ctl = bench(DEFAULTS, transfer={"start": "bumpless", "without-integral": "zero"})
    ctl.change(ki=0)
    assert ctl.scan(54.0, 51.0) == 6.0


@pytest.mark.parametrize("transfer", [{"derivative": "running"}, {"derivative": "restarted"}, {"derivative": "zeroed"}], ids=str)
@pytest.mark.parametrize("starts", ["sample", "zero"])
@pytest.mark.parametrize("term", [{}, {"filter": {"applies-to": "term", "time": 4.0}}], ids=["unfiltered", "filtered"])
def test_a_derivative_that_is_switched_on_starts_at_rest(transfer: dict[str, Any], starts: str, term: dict[str, Any]) -> None:
    ctl = bench(DEFAULTS, transfer={"start": "bumpless"} | transfer, derivative={"on": "pv", "starts": starts} | term)
    moved, bump = settled(ctl, kd=8.0)
    assert (moved, bump) == pytest.approx((0.75, 0.0), abs=1e-12)  # the integral alone; the measurement has stood still
    last = ctl.output
    share = 8 / 5 if term else 8.0
    assert ctl.scan(54.0, 50.0) - last == pytest.approx(2 + 1.0 + share, rel=1e-12)  # P, I and the step of the measurement


def test_a_rate_limit_on_the_setpoint_that_is_switched_on_starts_at_the_setpoint() -> None:
    dials = {"kp": DIALS["kp"], "R": {"sets": "setpoint-rate", "unit": "%/s", "off": 0, "default": 0}}
    fields = {"integral": {"on": "none", "rule": "backward", "windup": NONE}, "derivative": {"on": "none"}, "settings": dials}
    for starts in ("setpoint", "zero"):
        ctl = bench({"kp": 2.0}, setpoint={"rate": "R", "starts": starts}, **fields)
        ctl.change(R=1.0)
        assert [ctl.scan(54.0, 51.0), ctl.scan(60.0, 51.0)] == [6.0, 8.0]


@pytest.mark.parametrize("order", [(0.0, 5.0), (5.0, 0.0)])
def test_a_filter_that_comes_or_goes_does_not_move_a_loop_at_rest(order: tuple[float, float]) -> None:
    dials = DIALS | {"Tf": {"sets": "filter-time", "unit": "s", "off": 0, "default": 0}}
    ctl = bench(DEFAULTS | {"Tf": order[0]}, measurement={"filter": {"time": "Tf"}}, settings=dials)
    ctl.run(54.0, [54.0] * 400)  # 400 scans of a lag of 5: the filter is where the signal is
    before = ctl.output
    ctl.change(Tf=order[1])
    assert ctl.scan(54.0, 54.0) == pytest.approx(before, abs=1e-12)


# --- options that change ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("first", "then"), [("one", "other"), ("other", "one")])
def test_a_controller_that_becomes_positional_or_incremental_goes_on_from_its_output(first: str, then: str) -> None:
    ctl = bench(DEFAULTS | {"KIND": first}, **option({}, INCREMENTAL))
    moved, bump = settled(ctl, KIND=then)
    # the integral goes on, or the change is a transfer that adds nothing
    assert any((moved, bump) == pytest.approx(both, abs=1e-12) for both in ((0.75, 0.0), (0.0, -0.75)))
    before = ctl.output
    assert ctl.scan(54.0, 51.0) - before == pytest.approx(0.75, rel=1e-12)


def test_a_loaded_sum_without_integral_action_is_what_the_output_leaves_when_it_comes_to_be() -> None:
    loads = option(INCREMENTAL | {"transfer": {"start": "bumpless"}}, {}, transfer={"start": "load-output"})
    ctl = bench({"kp": 2.0}, **loads)
    assert settled(ctl, KIND="other") == (0.0, 0.0)
    assert ctl.scan(56.0, 51.0) == 46.0 + 4.0


@pytest.mark.parametrize("change", [{"rule": "forward"}, {"rule": "trapezoidal"}, {"windup": {"scheme": "conditional"}}], ids=str)
def test_another_rule_or_windup_scheme_goes_on_from_the_same_integral(change: dict[str, Any]) -> None:
    ctl = bench(DEFAULTS, **option({}, {"integral": change}))
    before = ctl.state["I"]
    ctl.change(KIND="other")
    assert ctl.state["I"] == before
    late = -0.75 if change == {"rule": "forward"} else 0.0  # this scan's error counts one scan late
    assert ctl.events[-1].bump == pytest.approx(late, abs=1e-12)


def test_p_on_the_measurement_in_place_of_the_error_bumps_by_the_setpoint() -> None:
    ctl = bench(DEFAULTS, output={"limits": [-1000, 1000]}, **option({}, {"proportional": {"on": "pv"}}))
    assert settled(ctl, KIND="other") == pytest.approx((-2 * 54 + 0.75, -2 * 54), rel=1e-13)


# --- refusals --------------------------------------------------------------------------------------------------------


def assert_unmoved(ctl: Controller, undisturbed: Controller, before: Settings) -> None:
    assert ctl.settings is before
    assert (ctl.state, ctl.events) == (undisturbed.state, undisturbed.events)
    assert ctl.scan(53.0, 51.0) == undisturbed.scan(53.0, 51.0)


@pytest.mark.parametrize("change", [{"kp": -1.0}, {"kq": 1.0}, {"kp": "two"}, {"kp": 3.0, "ki": -1.0}], ids=str)
def test_a_setting_that_is_refused_leaves_everything_as_it_was(change: dict[str, object]) -> None:
    ctl, undisturbed = bench(DEFAULTS), bench(DEFAULTS)
    before = ctl.settings
    with pytest.raises(pidemu.errors.PidemuError):
        ctl.change(change)
    assert_unmoved(ctl, undisturbed, before)


def test_settings_of_another_card_are_refused() -> None:
    ctl, undisturbed = bench(DEFAULTS), bench(DEFAULTS)
    before = ctl.settings
    with pytest.raises(ScanError, match="runs nobody/bench; settings of generic/standard need a controller of their own"):
        ctl.change(pidemu.load_card("generic/standard").settings(K=2, Ti=8))
    assert_unmoved(ctl, undisturbed, before)


def test_settings_that_cannot_be_computed_at_this_interval_leave_everything_as_it_was() -> None:
    slow, fast = ({"derivative": {"rule": "forward", "filter": {"applies-to": "term", "time": t}}} for t in (4.0, 0.25))
    given = DEFAULTS | {"kd": 3.0}
    ctl, undisturbed = (bench(given, **option(slow, fast)) for _ in range(2))
    before = ctl.settings
    with pytest.raises(ScanError, match="the forward rule is unstable"):
        ctl.change(KIND="other")
    assert_unmoved(ctl, undisturbed, before)


def test_settings_that_make_no_controller_leave_everything_as_it_was() -> None:
    dials = DIALS | {"N": {"sets": "filter-gain", "unit": "1"}}
    fields: dict[str, Any] = {"derivative": {"on": "error", "filter": {"applies-to": "term", "gain": "N"}}, "settings": dials}
    ctl, undisturbed = (bench(DEFAULTS | {"kd": 3.0, "N": 8.0}, **fields) for _ in range(2))
    before = ctl.settings
    with pytest.raises(SettingError, match="a derivative gain of zero means no derivative"):
        ctl.change(N=0.0)
    assert_unmoved(ctl, undisturbed, before)


# --- every card ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=8)
@given(data=st.data(), seed=seeds)
def test_the_bump_of_a_change_is_the_difference_that_it_makes(name: str, data: st.DataObject, seed: int) -> None:
    card = pidemu.load_card(name)
    old, new = settings_of(data, card), settings_of(data, card)
    h = data.draw(scans_of(old.algorithm()))
    with_it, without = (Controller(old, h, output_limits=(0, 100), initial_output=50.0) for _ in range(2))
    x = history(seed, None, 30).columns
    columns = {s: x[s] for s in ("sp", "pv", "auto", "manual")}
    for ctl in (with_it, without):
        ctl.run(**columns)
    try:
        with_it.change(new)
    except ScanError:
        assert (with_it.settings, with_it.state) == (old, without.state)
        return
    last: dict[str, Any] = {s: float(c[-1]) for s, c in columns.items()} | {"auto": bool(columns["auto"][-1])}
    bump = with_it.events[-1].bump
    difference = with_it.scan(**last) - without.scan(**last)
    assert (bump == difference) or (math.isnan(bump) and math.isnan(difference))
