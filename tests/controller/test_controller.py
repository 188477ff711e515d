"""The Controller, and what it owes to two programs that anyone can run: Arduino PID_v1 and simple-pid."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simple_pid import PID

import pidemu
from pidemu.errors import EngineError, ScanError
from pidemu.settings.settings import Settings
from tests.helpers import Floats, option_combinations, scans_of, settings_of

DATA = Path(__file__).parents[1] / "data"


def pi(**given: object) -> Settings:
    return pidemu.load_card("generic/standard").settings({"K": 2, "Ti": 8} | given)


def controller(**more: Any) -> pidemu.Controller:
    return pidemu.Controller(pi(), scan=1.0, initial_output=40.0, **more)


# --- the interface ---------------------------------------------------------------------------------------------------


def test_a_pi_controller_starts_from_its_output_and_then_acts() -> None:
    ctl = controller()
    # K e = 2, and K h e/Ti = 0.25 for each scan with e = 1
    assert [ctl.scan(sp=sp, pv=50.0) for sp in (50.0, 51.0, 51.0)] == [40.0, 42.25, 42.5]
    assert ctl.output == 42.5


def test_direct_action_moves_the_output_the_other_way() -> None:
    ctl = controller(action="direct")
    assert [ctl.scan(sp=sp, pv=50.0) for sp in (50.0, 51.0)] == [40.0, 37.75]


def test_the_scan_interval_is_by_default_that_of_the_card() -> None:
    assert pidemu.Controller(pi()).interval == 1.0
    assert pidemu.Controller(pidemu.load_card("arduino/pid").settings(Kp=1, Ki=1)).interval == 0.1


def test_the_output_limits_are_by_default_those_of_the_card() -> None:
    ctl = pidemu.Controller(pi(), initial_output=50.0)
    ctl.scan(sp=0.0, pv=0.0)
    assert [ctl.scan(sp=1000.0, pv=0.0), ctl.scan(sp=0.0, pv=10000.0)] == [100.0, 0.0]


def test_the_output_stays_within_limits_of_ones_own() -> None:
    ctl = controller(output_limits=(35, 45))
    ctl.scan(sp=0.0, pv=0.0)
    assert [ctl.scan(sp=1000.0, pv=0.0), ctl.scan(sp=0.0, pv=10000.0)] == [45.0, 35.0]


def test_a_bias_is_the_output_at_zero_error_of_a_proportional_controller() -> None:
    ctl = pidemu.Controller(pi(Ti=math.inf), bias=50.0)
    assert [ctl.scan(sp=20.0, pv=20.0), ctl.scan(sp=22.0, pv=20.0)] == [50.0, 54.0]


def test_manual_sets_the_output_and_without_a_value_holds_it() -> None:
    ctl = controller()
    assert [
        ctl.scan(sp=50.0, pv=50.0),
        ctl.scan(sp=60.0, pv=50.0, auto=False),
        ctl.scan(sp=60.0, pv=50.0, auto=False, manual=33.0),
        ctl.scan(sp=60.0, pv=50.0, auto=False),
        ctl.scan(sp=60.0, pv=50.0),  # bumpless
    ] == [40.0, 40.0, 33.0, 33.0, 33.0]


def test_before_the_first_scan_the_held_output_is_the_initial_one() -> None:
    assert controller().scan(sp=60.0, pv=50.0, auto=False) == 40.0


def test_reset_goes_back_to_before_the_first_scan() -> None:
    ctl = controller()
    before = ctl.state
    first = [ctl.scan(sp=sp, pv=50.0) for sp in (50.0, 53.0, 48.0)]
    assert before != ctl.state
    ctl.reset()
    assert before == ctl.state
    assert first == [ctl.scan(sp=sp, pv=50.0) for sp in (50.0, 53.0, 48.0)]


def test_the_state_is_a_copy_that_nobody_can_change_the_controller_by() -> None:
    ctl = controller()
    ctl.state["u"] = 99.0
    assert ctl.output == 40.0


def test_two_controllers_of_the_same_settings_do_not_share_their_state() -> None:
    settings = pi()
    one, other = pidemu.Controller(settings), pidemu.Controller(settings)
    one.scan(sp=50.0, pv=0.0, auto=False, manual=80.0)
    assert [one.output, other.output] == [80.0, 0.0]


def test_scalars_count_for_every_sample_of_a_run() -> None:
    assert controller().run(sp=[50.0, 51.0, 51.0], pv=50.0).tolist() == [40.0, 42.25, 42.5]
    assert controller().run(sp=50.0, pv=[50.0, 49.0], auto=False, manual=33.0).tolist() == [33.0, 33.0]


def test_a_run_over_no_samples_has_no_outputs_and_changes_nothing() -> None:
    ctl = controller()
    before = ctl.state
    assert ctl.run([], []).tolist() == []
    assert before == ctl.state


@pytest.mark.parametrize("scan", [0.0, -1.0, math.nan, math.inf])
def test_a_scan_interval_that_is_no_positive_number_is_refused(scan: float) -> None:
    with pytest.raises(ScanError, match=r"is not a positive number|give a finite number"):
        pidemu.Controller(pi(), scan=scan)


@pytest.mark.parametrize("limits", [(100, 0), (5, 5), (math.nan, 100), (0, math.nan)])
def test_limits_that_are_no_range_are_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(ScanError, match="are not a range; give low, then high"):
        pidemu.Controller(pi(), output_limits=limits)


@pytest.mark.parametrize("limits", [(0, 1e300), (-1e300, 100)])
def test_a_limit_of_no_plausible_size_is_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(ScanError, match="output limit"):
        pidemu.Controller(pi(), output_limits=limits)


def test_an_unknown_action_is_refused_with_the_cards_own_words() -> None:
    with pytest.raises(ScanError, match=r"action is 'DIRECT'; it is one of 'reverse' \(DIRECT\), 'direct' \(REVERSE\)"):
        pidemu.Controller(pidemu.load_card("arduino/pid").settings(Kp=1, Ki=1), action="DIRECT")  # type: ignore[arg-type]


def test_an_engine_that_is_not_there_is_refused() -> None:
    with pytest.raises(EngineError, match="there is no engine 'steam'; engines: python, numpy, numba, c"):
        pidemu.Controller(pi(), engine="steam")  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_initial_output_that_is_no_finite_number_is_refused(value: float) -> None:
    with pytest.raises(ScanError, match="initial output"):
        pidemu.Controller(pi(), initial_output=value)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_bias_that_is_no_finite_number_is_refused(value: float) -> None:
    with pytest.raises(ScanError, match="bias"):
        pidemu.Controller(pi(Ti=math.inf), bias=value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_signal_that_is_no_finite_number_holds_the_output_and_an_event_says_so(value: float) -> None:
    ctl = controller()
    assert ctl.run(sp=[50.0, value, 51.0, 51.0], pv=[50.0, 50.0, value, 50.0]).tolist() == [40.0, 40.0, 40.0, 42.25]
    assert [e.text for e in ctl.events[1:]] == [f"setpoint is {value}: output held", f"measurement is {value}: output held"]


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_an_infinite_manual_output_is_refused(value: float) -> None:
    with pytest.raises(ScanError, match="manual"):
        controller().scan(sp=50.0, pv=50.0, auto=False, manual=value)
    with pytest.raises(ScanError, match="manual"):
        controller().run(sp=50.0, pv=[50.0, 50.0], auto=False, manual=[40.0, value])


def test_signals_of_different_lengths_are_refused() -> None:
    with pytest.raises(ScanError, match="the signals have different lengths: 3, 2, 1, 1"):
        controller().run(sp=[1, 2, 3], pv=[1, 2])
    with pytest.raises(ScanError, match="the signals have different lengths"):
        controller().run(sp=[1, 2, 3], pv=[1, 2, 3], auto=[True, False])


def test_signals_in_two_dimensions_are_refused() -> None:
    with pytest.raises(ScanError, match="one-dimensional"):
        controller().run(sp=[[1, 2], [3, 4]], pv=50.0)


@pytest.mark.parametrize("name", pidemu.cards())
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_a_run_gives_the_same_bits_as_scan_after_scan(name: str, data: st.DataObject, seed: int) -> None:
    settings = settings_of(data, pidemu.load_card(name))
    scan = data.draw(scans_of(settings.algorithm()))
    rng = np.random.default_rng(seed)
    n = 80
    sp = np.repeat(rng.uniform(0, 100, n // 20), 20)
    pv = 50 + np.cumsum(rng.normal(0, 3, n))
    auto = np.repeat(rng.integers(0, 3, n // 4), 4) > 0
    manual = np.where(rng.uniform(size=n) < 0.5, rng.uniform(0, 100, n), math.nan)
    once, often = (pidemu.Controller(settings, scan=scan, output_limits=(10, 90), initial_output=50.0) for _ in range(2))
    cut = int(rng.integers(0, n))
    parts = [once.run(*(signal[piece] for signal in (sp, pv, auto, manual))) for piece in (slice(cut), slice(cut, None))]
    expected = [
        often.scan(float(sp[i]), float(pv[i]), bool(auto[i]), None if math.isnan(manual[i]) else float(manual[i])) for i in range(n)
    ]
    assert expected == np.concatenate(parts).tolist()
    assert often.state == once.state


@pytest.mark.parametrize("name", pidemu.cards())
def test_the_example_of_action_moves_the_output_of_every_card_the_way_it_says(name: str) -> None:
    card = pidemu.load_card(name)
    settings = card.settings(card.data.examples[0].given)
    shown = settings.equation.action.example
    (action,) = (key for key, word in settings.equation.action.names.items() if word == shown.name)
    ctl = pidemu.Controller(settings, action=action, output_limits=(-1e6, 1e6))
    before = ctl.run(np.full(300, shown.sp), shown.sp)[-1]  # at rest: some start with their derivative from zero
    after = ctl.scan(shown.sp, shown.pv)
    assert (after > before) == (shown.output == "rises")
    assert (after < before) == (shown.output == "falls")


# --- Arduino PID_v1 --------------------------------------------------------------------------------------------------


def trace(name: str) -> dict[str, Floats]:
    """The columns of a trace; its first line says which implementation made it."""
    with (DATA / name).open(encoding="utf-8") as file:
        assert next(file).startswith("# ")
        rows = list(csv.DictReader(file))
    return {column: np.array([float(row[column]) for row in rows]) for column in rows[0]}


def test_the_arduino_card_reproduces_the_library() -> None:
    t = trace("arduino_pid_v1.csv")
    settings = pidemu.load_card("arduino/pid").settings(Kp=1.2, Ki=0.15, Kd=0.8)
    assert settings.equation.action.names["reverse"] == "DIRECT"
    ctl = pidemu.Controller(settings, scan=0.5, action="reverse", output_limits=(0, 100))
    out = ctl.run(t["sp"], t["pv"], t["auto"], t["man"])
    assert out.size == 300
    # the library multiplies ki by the interval beforehand, as the card's program does, and prints 17 digits
    assert np.all(np.abs(t["out"] - out) <= 1e-12 * (1 + np.abs(t["out"])))


def test_the_arduino_trace_reaches_a_limit_and_leaves_automatic_three_times() -> None:
    t = trace("arduino_pid_v1.csv")
    assert t["out"][t["auto"] > 0].min() == 0.0
    assert 10 < np.count_nonzero((t["out"] == 0) & (t["auto"] > 0)) < 150
    assert np.count_nonzero(np.diff(np.concatenate([[1.0], t["auto"]])) < 0) == 3


# --- simple-pid ------------------------------------------------------------------------------------------------------


def simple_settings(on_measurement: bool, differential: bool, **gains: float) -> Settings:
    """Settings of the card under the options that put P and D where the package's two flags do."""
    card = pidemu.load_card("simple-pid/simple-pid")
    for options in option_combinations(card):
        equation = card.variant(options).equation
        if (equation.proportional.on == "pv", equation.derivative.on == "pv") == (on_measurement, differential):
            return card.settings({**options, **gains})
    raise AssertionError(f"no option puts P on {on_measurement} and D on {differential}")


def simple_outputs(pid: Any, dt: float, sp: Floats, pv: Floats, auto: Floats, manual: Floats) -> list[float]:
    """Run the real package; while it is off it computes nothing, and the operator's output is what it is told at the switch."""
    out: list[float] = []
    for n in range(len(sp)):
        if not auto[n]:
            pid.set_auto_mode(False)
            out.append(float(manual[n]))
            continue
        pid.set_auto_mode(True, last_output=out[-1] if out else None)  # has no effect while it is on
        pid.setpoint = float(sp[n])
        out.append(pid(float(pv[n]), dt=dt))
    return out


gains = st.just(0.0) | st.floats(0.01, 20)


@pytest.mark.parametrize("differential", [True, False], ids=["D on measurement", "D on error"])
@pytest.mark.parametrize("on_measurement", [True, False], ids=["P on measurement", "P on error"])
@pytest.mark.parametrize("beyond", [0.0, 30.0], ids=["manual within limits", "manual beyond limits"])
@given(
    Kp=gains,
    Ki=gains.map(lambda k: k / 10),
    Kd=gains,
    sign=st.sampled_from([1.0, -1.0]),
    dt=st.floats(0.01, 10),
    low=st.floats(-100, 20),
    width=st.floats(1, 150),
    start=st.floats(0, 1),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_simple_pid_card_does_what_the_package_does(
    on_measurement: bool,
    differential: bool,
    beyond: float,
    Kp: float,
    Ki: float,
    Kd: float,
    sign: float,
    dt: float,
    low: float,
    width: float,
    start: float,
    seed: int,
) -> None:
    high, n = low + width, 100
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-50, 50, n // 20), 20)
    pv = sp * 0.5 + np.cumsum(rng.normal(0, 4, n))
    auto = (np.repeat(rng.integers(0, 4, n // 5), 5) > 0).astype(float)
    auto[0] = 1.0
    manual = rng.uniform(low - beyond, high + beyond, n)
    initial = low + start * width
    pid = PID(
        Kp=sign * Kp,
        Ki=sign * Ki,
        Kd=sign * Kd,
        sample_time=None,
        output_limits=(low, high),
        starting_output=initial,
        proportional_on_measurement=on_measurement,
        differential_on_measurement=differential,
    )
    settings = simple_settings(on_measurement, differential, Kp=sign * Kp, Ki=sign * Ki, Kd=sign * Kd)
    ctl = pidemu.Controller(settings, scan=dt, output_limits=(low, high), initial_output=initial)
    expected = np.array(simple_outputs(pid, dt, sp, pv, auto, manual))
    out = ctl.run(sp, pv, auto, manual)
    # Ki e dt and (Ki dt) e, Kd dx/dt and (Kd/dt) dx: the terms round differently, by 1e-16 of themselves, and may cancel in the sum
    terms = np.max(np.abs(sp)) + np.max(np.abs(pv))
    scale = 1 + np.abs(expected) + terms * (Kp * 10 + 4 * Kd / dt + Ki * dt)
    assert np.all(np.abs(expected - out) <= 1e-12 * scale)


def test_without_limits_the_simple_pid_card_does_what_the_package_does() -> None:
    rng = np.random.default_rng(7)
    sp, pv = np.full(200, 20.0), np.cumsum(rng.normal(0, 2, 200))
    pid = PID(2.0, 0.3, 0.5, setpoint=20.0, sample_time=None, starting_output=5.0)
    expected = [pid(float(y), dt=0.5) for y in pv]
    ctl = pidemu.Controller(simple_settings(False, True, Kp=2.0, Ki=0.3, Kd=0.5), scan=0.5, initial_output=5.0)
    assert ctl.run(sp, pv).tolist() == pytest.approx(expected, rel=1e-12, abs=1e-12)  # as above
