"""Manual, automatic, cascade, tracking and hold, and the events that tell of them (specs/equations.md, section 6)."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Controller
from pidemu.controller.signals import Event
from pidemu.errors import ScanError
from tests.helpers import made_up_card, scans_of, settings_of
from tests.histories import history

VELOCITY: dict[str, Any] = {"implementation": "velocity", "integral": {"rule": "backward", "windup": {"scheme": "velocity"}}}
EXTERNAL: dict[str, Any] = {"integral": {"rule": "backward", "windup": {"scheme": "external-reset"}}}

seeds = st.integers(0, 2**32 - 1)


def bench(*, kp: float = 2.0, ki: float = 0.1, kd: float = 0.0, initial: float = 40.0, **fields: Any) -> Controller:
    """A parallel PID at 1 s with some fields of its card changed."""
    return Controller(made_up_card(**fields).settings(kp=kp, ki=ki, kd=kd), initial_output=initial)


in_each_implementation = pytest.mark.parametrize("fields", [{}, VELOCITY], ids=["positional", "velocity"])

# --- the modes -------------------------------------------------------------------------------------------------------


def test_the_mode_is_what_the_signals_of_the_last_scan_ask_for() -> None:
    ctl = bench()
    asked: list[tuple[dict[str, Any], str]] = [
        ({}, "automatic"),
        ({"auto": False}, "manual"),
        ({"cascade": 55.0}, "cascade"),
        ({"auto": False, "cascade": 55.0}, "manual"),
        ({"cascade": math.nan}, "automatic"),
        ({"cascade": 55.0, "track": 30.0}, "tracking"),
        ({"auto": False, "track": 30.0}, "tracking"),
        ({"track": math.nan}, "automatic"),
        ({"hold": True}, "hold"),
        ({"hold": True, "auto": False, "track": 30.0}, "hold"),
    ]
    seen = [ctl.mode]
    for signals, _ in asked:
        ctl.scan(50.0, 50.0, **signals)
        seen.append(ctl.mode)
    assert seen == ["power-up", *(mode for _, mode in asked)]


@in_each_implementation
def test_the_first_automatic_scan_goes_on_from_the_output_before_it(fields: dict[str, Any]) -> None:
    for signals in ({}, {"auto": False}, {"track": 33.0}, {"auto": False, "manual": 71.0}, {"hold": True}):
        ctl = bench(**fields)
        before = ctl.scan(60.0, 50.0, **signals)
        assert ctl.scan(60.0, 50.0) == pytest.approx(before + (0.0 if signals else 1.0), abs=1e-14)  # u - P + P is rounded


@in_each_implementation
def test_an_output_to_follow_is_followed_whatever_the_mode(fields: dict[str, Any]) -> None:
    ctl = bench(**fields)
    assert [
        ctl.scan(60.0, 50.0, track=12.0),
        ctl.scan(60.0, 50.0, auto=False, manual=90.0, track=13.0),
        ctl.scan(60.0, 50.0, cascade=70.0, track=14.0),
        ctl.scan(60.0, 50.0),  # bumpless
        ctl.scan(60.0, 50.0),  # 0.1 times 10
    ] == [12.0, 13.0, 14.0, 14.0, 15.0]


@in_each_implementation
def test_in_a_hold_nothing_is_computed_and_the_scan_after_it_is_a_transfer(fields: dict[str, Any]) -> None:
    ctl = bench(kd=3.0, **fields)
    ctl.run([50.0, 60.0, 60.0], [50.0, 50.0, 51.0])
    before = ctl.state
    assert [ctl.scan(99.0, 1.0, hold=True), ctl.scan(-99.0, 77.0, hold=True, auto=False, manual=3.0)] == [before["u"]] * 2
    assert {**before, "on": 0.0} == ctl.state
    assert ctl.scan(70.0, 40.0) == pytest.approx(before["u"], abs=1e-13)  # u - P - D + P + D, of terms of some hundred


# --- cascade ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=5)
@given(data=st.data(), seed=seeds)
def test_a_remote_setpoint_is_a_setpoint_where_cascade_has_no_structure_of_its_own(
    name: str, data: st.DataObject, seed: int
) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    a = chosen.algorithm()
    if (
        a.cascade_b is not None or a.setpoint.tracks or a.setpoint.rate_counts == "local"
    ):  # what tracks the measurement or has a rate is the local one
        return
    h, x = data.draw(scans_of(a)), history(seed).columns
    remote, local = (Controller(chosen, h, initial_output=30.0) for _ in range(2))
    sp = np.where(np.isnan(x["cascade"]) | (x["auto"] == 0), x["sp"], x["cascade"])
    one = remote.run(x["sp"], x["pv"], x["auto"], x["manual"], cascade=x["cascade"])
    assert one.tolist() == local.run(sp, x["pv"], x["auto"], x["manual"]).tolist()


def test_a_rate_that_counts_for_the_local_setpoint_does_not_hold_back_the_remote_one() -> None:
    ctl = bench(kp=1.0, ki=0.0, setpoint={"rate": 2.0, "rate-counts": "local"})
    local, remote = float("nan"), [10.0, 30.0]
    outputs = [ctl.scan(sp, 0.0, cascade=r) for sp, r in ((0.0, local), (5.0, local), *((5.0, r) for r in remote), (5.0, local))]
    assert outputs == [0.0, 2.0, 10.0, 30.0, 28.0]  # back at the local setpoint, it goes there from where the remote one was


def test_in_cascade_the_proportional_term_has_the_weight_of_cascade() -> None:
    ctl = bench(kp=2.0, ki=0.0, proportional={"on": "pv"}, cascade={"proportional": {"on": "weighted", "weight": 0.5}})
    # 2 (0 - y), then 2 (0.5 r - y); without integral the structure's own difference shows
    assert [ctl.scan(9.0, -20.0), ctl.scan(9.0, -20.0, cascade=10.0), ctl.scan(9.0, -20.0)] == [40.0, 50.0, 40.0]


def test_in_cascade_a_velocity_controller_changes_its_structure_without_a_bump() -> None:
    ctl = bench(kp=2.0, ki=0.0, proportional={"on": "pv"}, cascade={"proportional": {"on": "error"}}, **VELOCITY)
    steps: list[tuple[float, float, dict[str, Any], float]] = [
        (50.0, 50.0, {}, 40.0),
        (55.0, 50.0, {}, 40.0),  # the local setpoint is not seen
        (55.0, 51.0, {}, 38.0),
        (55.0, 51.0, {"cascade": 55.0}, 38.0),
        (55.0, 51.0, {"cascade": 58.0}, 44.0),
        (58.0, 51.0, {}, 44.0),
        (70.0, 51.0, {}, 44.0),
    ]
    assert [ctl.scan(sp, pv, **signals) for sp, pv, signals, _ in steps] == [u for *_, u in steps]


def test_in_cascade_a_shaped_error_is_shaped_as_well() -> None:
    gap = {"shape": "gap", "band": 5.0}
    ctl = bench(ki=0.0, error=gap, cascade={"proportional": {"on": "weighted", "weight": 0.5}})
    assert [ctl.scan(54.0, 50.0), ctl.scan(54.0, 50.0, cascade=108.0), ctl.scan(54.0, 50.0, cascade=112.0)] == [0, 0, 12]
    ctl = bench(ki=0.0, error=gap, cascade={"proportional": {"on": "weighted", "weight": 0.5}}, **VELOCITY)
    assert [ctl.scan(50.0, 50.0), ctl.scan(54.0, 50.0), ctl.scan(56.0, 50.0)] == [40, 40, 52]


# --- a setpoint that follows the measurement -------------------------------------------------------------------------


@in_each_implementation
def test_a_tracking_setpoint_stays_where_the_measurement_was_until_it_is_changed(fields: dict[str, Any]) -> None:
    ctl = bench(kp=2.0, ki=0.5, setpoint={"tracks": True}, **fields)
    steps: list[tuple[float, float, dict[str, Any], float]] = [
        (60.0, 50.0, {"auto": False}, 40.0),
        (60.0, 52.0, {"auto": False}, 40.0),
        (60.0, 52.0, {}, 40.0),  # the setpoint in force is 52
        (60.0, 52.0, {}, 40.0),
        (60.0, 51.0, {}, 42.5),  # 2 and 0.5
        (53.0, 51.0, {}, 45.5),  # changed: an error of 2, 4 and 0.5 + 1
        (53.0, 49.0, {"track": 20.0}, 20.0),
        (53.0, 49.0, {}, 20.0),
        (53.0, 49.0, {"cascade": 50.0}, 22.5),  # the remote one is not held back
    ]
    assert [ctl.scan(sp, pv, **signals) for sp, pv, signals, _ in steps] == [u for *_, u in steps]


def test_a_tracking_setpoint_begins_as_it_is_given() -> None:
    assert bench(kp=2.0, ki=0.0, setpoint={"tracks": True}).run(60.0, [50.0, 50.0]).tolist() == [20.0, 20.0]


# --- events ----------------------------------------------------------------------------------------------------------


def test_every_change_of_mode_is_an_event_with_its_bump() -> None:
    ctl = bench(kp=2.0, ki=0.0)  # nothing makes it bumpless
    ctl.run(60.0, np.full(5, 50.0), [1, 1, 0, 0, 1], [math.nan, math.nan, math.nan, 33.0, math.nan])
    assert ctl.events == [
        Event(0, "transfer", "power-up to automatic", -20.0),
        Event(2, "transfer", "automatic to manual", 0.0),
        Event(4, "transfer", "manual to automatic", -13.0),
    ]
    ctl.reset()
    assert (ctl.events, ctl.mode) == ([], "power-up")


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=8)
@given(data=st.data(), seed=seeds)
def test_scan_after_scan_gives_the_outputs_states_and_events_of_a_run_with_all_signals(
    name: str, data: st.DataObject, seed: int
) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    h, x = data.draw(scans_of(chosen.algorithm())), history(seed, chosen.algorithm())
    once, often = (Controller(chosen, h, initial_output=50.0) for _ in range(2))
    u = x.run(once)
    assert u.tolist() == x.step(often)
    assert (once.state, once.events, once.mode) == (often.state, often.events, often.mode)


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=5)
@given(data=st.data(), seed=seeds)
def test_the_bump_of_an_event_is_the_move_of_the_output_in_that_scan(name: str, data: st.DataObject, seed: int) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    ctl = Controller(chosen, data.draw(scans_of(chosen.algorithm())), initial_output=50.0)
    before, mode = [50.0], ["power-up"]
    for now in history(seed, chosen.algorithm(), 50).scans():
        before.append(ctl.scan(**now))
        mode.append(ctl.mode)
    changes = [n for n in range(50) if mode[n + 1] != mode[n]]
    assert ctl.events == [Event(n, "transfer", f"{mode[n]} to {mode[n + 1]}", before[n + 1] - before[n]) for n in changes]


# --- signals that come and go ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=5)
@given(data=st.data(), seed=seeds, since=st.integers(1, 40))
def test_a_signal_that_first_appears_in_mid_run_disturbs_nothing(name: str, data: st.DataObject, seed: int, since: int) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    a = chosen.algorithm()
    x = history(seed, a, 60)
    late = x.moved(**{s: np.where(np.arange(60) < since, math.nan, x.columns[s]) for s in x.columns if s not in x_always()})
    h = data.draw(scans_of(a))
    known, surprised = (Controller(chosen, h, initial_output=50.0) for _ in range(2))
    expected = late.run(known)
    first = [c[:since] for c in (x.columns["sp"], x.columns["pv"], x.columns["auto"], x.columns["manual"])]
    u = [*surprised.run(*first, hold=x.columns["hold"][:since])]
    u += [*surprised.run(**{s: c[since:] for s, c in late.columns.items()})]
    assert expected.tolist() == u
    assert known.state == surprised.state


def x_always() -> tuple[str, ...]:
    """What a record has from its first scan on."""
    return ("sp", "pv", "auto", "manual", "hold")


def test_a_feedforward_signal_that_is_no_number_counts_as_none() -> None:
    for fields in ({"feedforward": {"summed": "before-limits"}}, {"feedforward": {"summed": "before-limits"}, **VELOCITY}):
        once, often = bench(**fields), bench(**fields)
        signal = [math.nan, 5.0, math.nan, 2.0]
        u = once.run(50.0, np.full(4, 50.0), feedforward=signal)
        assert u.tolist() == [often.scan(50.0, 50.0, feedforward=s) for s in signal] == [40.0, 45.0, 40.0, 42.0]


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        ("external_reset", "nobody/bench takes no external reset: its windup scheme is 'none'"),
        ("feedforward", "states no feedforward"),
    ],
)
def test_a_signal_that_the_card_has_no_use_for_is_refused_and_changes_nothing(signal: str, message: str) -> None:
    ctl, one = bench(), cast("dict[str, Any]", {signal: 1.0})
    ctl.scan(50.0, 50.0)
    before = ctl.state
    with pytest.raises(ScanError, match=message):
        ctl.scan(51.0, 50.0, **one)
    with pytest.raises(ScanError, match=message):
        ctl.run([51.0], [50.0], **one)
    assert (ctl.state, len(ctl.events)) == (before, 1)
    assert bench(**EXTERNAL).scan(50.0, 50.0, external_reset=40.0) == 40.0


@pytest.mark.parametrize("value", [math.inf, -math.inf])
@pytest.mark.parametrize("signal", ["track", "external_reset", "feedforward"])
def test_an_infinite_signal_is_refused_like_an_infinite_manual_output(signal: str, value: float) -> None:
    fields = EXTERNAL | {"feedforward": {"summed": "before-limits"}}
    one = cast("dict[str, Any]", {signal: value})
    with pytest.raises(ScanError, match=r"infinite|not a finite number"):
        bench(**fields).scan(50.0, 50.0, **one)
    with pytest.raises(ScanError, match=r"infinite|not a finite number"):
        bench(**fields).run(50.0, [50.0], **one)
