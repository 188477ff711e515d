"""Signals that are not numbers, and scans that come unevenly or not at all (card language, ``faults`` and ``scan.interval``)."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu import Controller
from pidemu.controller.signals import Event
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings
from tests.helpers import Floats, made_up_card, settings_of
from tests.histories import history

VELOCITY: dict[str, Any] = {"implementation": "velocity", "integral": {"rule": "backward", "windup": {"scheme": "velocity"}}}
MEASURED: dict[str, Any] = {"scan": {"default": "1 s", "interval": "measured"}}
FILTERED: dict[str, Any] = {"derivative": {"on": "error", "filter": {"applies-to": "term", "time": 4.0}}}
BAD = [math.nan, math.inf, -math.inf]

seeds = st.integers(0, 2**32 - 1)
with_every_bad_value = pytest.mark.parametrize("value", BAD)
on_either_signal = pytest.mark.parametrize("name", ["setpoint", "measurement"])
in_each_implementation = pytest.mark.parametrize("fields", [{}, VELOCITY], ids=["positional", "velocity"])


def bench(kd: float = 4.0, **fields: Any) -> Controller:
    """A parallel PID at 1 s that has run for three scans."""
    ctl = Controller(made_up_card(**fields).settings(kp=2, ki=0.25, kd=kd), initial_output=40.0)
    ctl.run([50.0, 52.0, 52.0], [50.0, 50.0, 51.0])
    return ctl


def bad(name: str, value: float) -> tuple[float, float]:
    return (value, 50.0) if name == "setpoint" else (52.0, value)


# --- signals that are not numbers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("policy", "returned", "said"),
    [("hold", None, "output held"), ("nan", math.nan, "output NaN"), ("zero", 0.0, "output 0"), (None, None, "output held")],
)
@with_every_bad_value
@on_either_signal
@in_each_implementation
def test_a_bad_signal_is_answered_as_the_card_says_and_the_state_stands_still(
    policy: str | None, returned: float | None, said: str, value: float, name: str, fields: dict[str, Any]
) -> None:
    faults: dict[str, Any] = {} if policy is None else {"faults": {"signal": policy}}
    ctl, undisturbed = bench(**faults, **fields), bench(**fields)
    before = ctl.state
    expected = before["u"] if returned is None else returned
    assert repr(ctl.scan(*bad(name, value))) == repr(expected)  # NaN like NaN
    assert before == ctl.state
    assert ctl.events[1:] == [Event(3, "signal", f"{name} is {value}: {said}")]
    assert ctl.scan(53.0, 51.0) == undisturbed.scan(53.0, 51.0)


@with_every_bad_value
@on_either_signal
def test_a_bad_signal_that_propagates_is_computed_with_and_stays_in_the_integral(value: float, name: str) -> None:
    ctl = bench(kd=0.0, faults={"signal": "propagate"})
    I, (sp, pv) = ctl.state["I"], bad(name, value)  # noqa: E741 (the field's symbol)
    I += 0.25 * (sp - pv)  # noqa: E741
    v = 2 * (sp - pv) + I
    assert repr(ctl.scan(sp, pv)) == repr(v if math.isnan(v) else min(max(v, 0.0), 100.0))
    assert repr(ctl.state["I"]) == repr(I)
    signal, *lost = ctl.events[1:]
    assert signal == Event(3, "signal", f"{name} is {value}: computed with")
    assert [(e.scan, e.kind) for e in lost] == [(3, "state")]
    ctl.scan(52.0, 50.0)
    assert not math.isfinite(ctl.state["I"])


@pytest.mark.parametrize("policy", ["hold", "nan", "zero"])
@with_every_bad_value
@in_each_implementation
def test_in_manual_a_bad_signal_does_not_keep_the_operator_from_the_output(
    policy: str, value: float, fields: dict[str, Any]
) -> None:
    ctl = bench(faults={"signal": policy}, **fields)
    u = [ctl.scan(52.0, value, auto=False, manual=m) for m in (70.0, None, 30.0)]
    u += [ctl.scan(52.0, value, track=12.0), ctl.scan(52.0, 50.0)]
    assert u == pytest.approx([70.0, 70.0, 30.0, 12.0, 12.0], abs=1e-13)  # the last one is u - P - D + P + D
    assert [e.text for e in ctl.events if e.kind == "transfer"][1:] == [
        "automatic to manual", "manual to tracking", "tracking to automatic",
    ]  # fmt: skip


@pytest.mark.parametrize(("manual_output", "expected"), [("operator", 30.0), ("gain-times-operator", 60.0), ("zero", 0.0)])
def test_in_manual_with_a_bad_signal_the_output_is_the_one_of_a_card_in_manual(manual_output: str, expected: float) -> None:
    ctl = bench(transfer={"start": "bumpless", "manual-output": manual_output})
    assert ctl.scan(52.0, math.nan, auto=False, manual=30.0) == expected


@pytest.mark.parametrize("output", [{"resolution": 1.0}, {"deadband": 2.0}], ids=str)
@in_each_implementation
def test_what_the_operator_sets_while_a_signal_is_bad_is_where_automatic_starts(
    output: dict[str, Any], fields: dict[str, Any]
) -> None:
    ctl = bench(output={"limits": [0, 100]} | output, **fields)
    ctl.scan(52.0, math.nan, auto=False, manual=70.0)
    assert ctl.scan(52.0, 51.0) == 70.0


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_an_infinite_remote_setpoint_is_a_bad_signal_like_an_infinite_setpoint(value: float) -> None:
    once, often, undisturbed = bench(), bench(), bench()
    for ctl in (once, often):
        ctl.scan(52.0, 51.0, cascade=55.0)
    u = once.run(52.0, [51.0, 51.0], cascade=[value, 55.0])
    assert u.tolist() == [often.scan(52.0, 51.0, cascade=r) for r in (value, 55.0)]
    assert u.tolist() == [undisturbed.scan(55.0, 51.0) for _ in range(2)]  # held at the first, then one scan later
    assert [e.kind for e in once.events if e.kind == "signal"] == ["signal"]


def test_a_transfer_that_a_bad_signal_puts_off_is_an_event_when_it_happens() -> None:
    ctl = bench(kd=0.0, transfer={"start": "load-output"})
    u = [ctl.scan(54.0, pv, auto=auto, manual=30.0) for pv, auto in ((50.0, False), (math.nan, True), (50.0, True))]
    assert u == [30.0, 30.0, 30 + 8 + 1]
    assert [(e.scan, e.text, e.bump) for e in ctl.events if e.kind == "transfer"][-1] == (5, "manual to automatic", 9.0)


@pytest.mark.parametrize("name", pidemu.cards())
@settings(max_examples=8)
@given(data=st.data(), seed=seeds)
def test_a_record_with_gaps_gives_the_same_in_a_run_and_scan_after_scan_and_the_state_is_finite_after_it(
    name: str, data: st.DataObject, seed: int
) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    rng = np.random.default_rng(seed)
    x = history(seed, chosen.algorithm(), 60)
    gaps = {s: np.where(rng.uniform(size=60) < 0.1, rng.choice(BAD, 60), x.columns[s]) for s in ("sp", "pv")}
    x = x.moved(**gaps)
    a = chosen.algorithm()
    h = 1.0 if not a.dahlin else max(1.0, a.dahlin.delay / 20)
    if a.Tf and a.Tf <= 2 * h:
        return  # some rules refuse it
    once, often = (Controller(chosen, h, output_limits=(0, 100), initial_output=50.0) for _ in range(2))
    assert np.array_equal(x.run(once), np.array(x.step(often)), equal_nan=True)
    assert [repr(e) for e in once.events] == [repr(e) for e in often.events]
    columns = x.columns
    in_cascade = (columns["auto"] > 0) & ~np.isnan(columns["cascade"]) & np.isnan(columns["track"])  # the local setpoint rests
    seen = (columns["hold"] == 0) & ~((np.isfinite(gaps["sp"]) | in_cascade) & np.isfinite(gaps["pv"]))
    noted = [range(e.scan, e.scan + e.scans) for e in once.events if e.kind == "signal"]
    assert list(itertools.chain(*noted)) == np.flatnonzero(seen).tolist()
    faults = chosen.equation.faults
    if faults is None or faults.signal != "propagate":
        assert all(math.isfinite(value) for value in once.state.values())


# --- intervals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [n for n in pidemu.cards() if pidemu.load_card(n).data.scan.interval == "nominal"])
@settings(max_examples=3)
@given(data=st.data(), seed=seeds)
def test_a_card_that_takes_the_nominal_interval_ignores_when_its_scans_come(name: str, data: st.DataObject, seed: int) -> None:
    chosen = settings_of(data, pidemu.load_card(name))
    try:
        even, uneven = (Controller(chosen, initial_output=50.0) for _ in range(2))
    except ScanError:
        return  # the card's own interval is too long for some filters
    x = history(seed, chosen.algorithm(), 40)
    jitter = np.random.default_rng(seed).choice([-1.0, 0.0, 0.3, 2.0, math.nan, math.inf], 40)
    assert x.run(even).tolist() == x.moved(interval=jitter).run(uneven).tolist()
    assert (even.state, even.events) == (uneven.state, uneven.events)


def jittered(seed: int, n: int = 40) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    return 50 + np.repeat(rng.uniform(-5, 5, n // 10), 10), 50 + np.cumsum(rng.normal(0, 1, n)), rng.choice([0.5, 1.0, 1.7], n)


@in_each_implementation
@settings(max_examples=10)
@given(seed=seeds)
def test_a_card_that_measures_the_interval_computes_with_it(fields: dict[str, Any], seed: int) -> None:
    sp, pv, h = jittered(seed)
    ctl = Controller(made_up_card(**MEASURED, **FILTERED, **fields).settings(kp=2, ki=0.25, kd=4), initial_output=40.0)
    I, D, u = 40 - 2 * float(sp[0] - pv[0]), 0.0, 40.0  # noqa: E741 (the field's symbol)
    expected = [u]
    for n in range(1, sp.size):
        e, e1, before = float(sp[n] - pv[n]), float(sp[n - 1] - pv[n - 1]), D
        D = (4 * D + 4 * (e - e1)) / (4 + h[n])
        I += 0.25 * h[n] * e  # noqa: E741
        step = 2 * (e - e1) + 0.25 * h[n] * e + (D - before)
        u = min(max(u + step if fields else 2 * e + I + D, 0.0), 100.0)
        expected.append(u)
    assert ctl.run(sp, pv, interval=h).tolist() == pytest.approx(expected, rel=1e-12, abs=1e-10)  # sums in another order


@in_each_implementation
@settings(max_examples=5)
@given(seed=seeds)
def test_every_scan_at_another_interval_is_that_of_a_controller_of_that_interval_in_the_same_state(
    fields: dict[str, Any], seed: int
) -> None:
    chosen = made_up_card(**MEASURED, **FILTERED, **fields).settings(kp=2, ki=0.25, kd=4)
    ctl = Controller(chosen, initial_output=40.0)
    sp, pv, h = jittered(seed, 20)
    for n in range(20):
        other = Controller(chosen, float(h[n]))
        other.start(**ctl.state)
        assert ctl.scan(float(sp[n]), float(pv[n]), interval=float(h[n])) == other.scan(float(sp[n]), float(pv[n]))
        assert ctl.state == other.state


@in_each_implementation
@settings(max_examples=10)
@given(seed=seeds)
def test_a_jittered_run_is_scan_after_scan(fields: dict[str, Any], seed: int) -> None:
    chosen = made_up_card(**MEASURED, **FILTERED, **fields).settings(kp=2, ki=0.25, kd=4)
    once, often = (Controller(chosen, initial_output=40.0) for _ in range(2))
    intervals = np.random.default_rng(seed).choice([0.5, 1.0, 2.0, 0.0, -1.0, math.nan, math.inf], 80)
    x = history(seed).moved(interval=intervals)
    assert x.run(once).tolist() == x.step(often)
    assert (once.state, once.events) == (often.state, often.events)


@pytest.mark.parametrize("interval", [0.0, -2.0, math.nan, math.inf])
def test_with_an_interval_that_is_none_nothing_is_computed_unless_the_card_says_otherwise(interval: float) -> None:
    ctl = bench(**MEASURED)
    before = ctl.state
    assert ctl.scan(60.0, 40.0, interval=interval) == before["u"]
    assert before == ctl.state
    assert ctl.events[1:] == [Event(3, "interval", f"interval of {interval:g} s: nothing computed, output held")]


def test_a_negative_interval_is_refused_where_the_card_says_so_and_changes_nothing() -> None:
    ctl = bench(faults={"negative-interval": "refuse"}, **MEASURED)
    before = ctl.state
    for refused in (lambda: ctl.scan(60.0, 40.0, interval=-0.5), lambda: ctl.run(60.0, [40.0], interval=-0.5)):
        with pytest.raises(ScanError, match=r"nobody/bench refuses a scan interval of -0\.5 s; give a positive one"):
            refused()
    assert (before, 1) == (ctl.state, len(ctl.events))


def lagged_difference(**faults: str) -> Settings:
    """The one rule that can be computed at an interval of zero."""
    term = {"on": "error", "rule": "lagged-difference", "filter": {"applies-to": "term", "time": 4.0}}
    return made_up_card(derivative=term, faults=faults, **MEASURED).settings(kp=2, ki=0.25, kd=4)


@pytest.mark.parametrize("interval", [0.0, -2.0])
def test_an_interval_of_zero_is_computed_with_where_the_card_says_so(interval: float) -> None:
    ctl = Controller(lagged_difference(**{"zero-interval": "compute", "negative-interval": "zero"}), initial_output=40.0)
    ctl.scan(50.0, 50.0)
    # 2 times 6; no integral in no time; 4/4 times 6, as the lag has not moved
    assert ctl.scan(56.0, 50.0, interval=interval) == 40 + 12 + 6
    assert [e.text for e in ctl.events[1:]] == ([] if interval == 0 else ["interval of -2 s: counted as 0"])


def test_a_negative_interval_that_counts_as_zero_is_held_like_zero() -> None:
    ctl = Controller(lagged_difference(**{"negative-interval": "zero"}), initial_output=40.0)
    ctl.scan(50.0, 50.0)
    assert ctl.scan(56.0, 50.0, interval=-2.0) == 40.0
    assert [e.text for e in ctl.events[1:]] == [
        "interval of -2 s: nothing computed, output held",
    ]  # fmt: skip


def test_a_filter_factor_is_the_share_per_scan_whatever_the_interval_of_the_scan() -> None:
    card = made_up_card(measurement={"filter": {"factor": 0.25}}, **MEASURED)
    ctl = Controller(card.settings(kp=1), output_limits=(-100, 100))
    out = ctl.run(0.0, [0, 16.0, 16.0, 16.0], interval=[1.0, 0.2, 3.0, 1.0])
    assert out.tolist() == pytest.approx([0, -4, -7, -9.25], rel=1e-12)  # h (1 - k)/k is rounded


@pytest.mark.parametrize("value", BAD)
def test_in_cascade_a_local_setpoint_that_is_no_number_is_not_missed(value: float) -> None:
    once, often, undisturbed = bench(), bench(), bench()
    u = once.run([52.0, value, 52.0], 51.0, cascade=55.0)
    assert u.tolist() == [often.scan(sp, 51.0, cascade=55.0) for sp in (52.0, value, 52.0)]
    assert u.tolist() == undisturbed.run(52.0, [51.0] * 3, cascade=55.0).tolist()
    assert not [e for e in once.events if e.kind == "signal"]


def test_in_manual_a_bad_signal_leaves_an_integral_that_tracks_with_the_operator() -> None:
    ctl = bench(transfer={"start": "tracked"})
    ctl.scan(50.0, 50.0, auto=False, manual=40.0)
    assert ctl.scan(50.0, math.nan, auto=False, manual=80.0) == 80.0
    assert ctl.scan(50.0, 50.0) == pytest.approx(80.0)


def test_other_kinds_of_numbers_are_computed_with_as_floats() -> None:
    ctl = bench()
    ctl.scan(np.float32(51.1), np.float64(50.3))  # type: ignore[arg-type]
    ctl.scan(51, 50, auto=False, manual=np.float32(33.3))  # type: ignore[arg-type]
    assert {type(x) for x in ctl.state.values()} == {float}
    assert {type(x) for x in ctl._state} == {float}
