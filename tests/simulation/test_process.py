"""Process models against python-control, scipy and step responses known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable

import control
import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.arrays import Floats
from pidemu.errors import ProcessError
from pidemu.process.hold import Plant
from pidemu.process.process import Process, parse_process
from tests.simulation.processes import processes


@given(process=processes(), delay=st.just(0.0) | st.floats(0.1, 20))
def test_the_response_is_python_controls_times_the_exact_dead_time(process: Process, delay: float) -> None:
    w = np.geomspace(1e-3, 1e2, 25)
    found = Process(process.gain, process.poles, process.zeros, delay).response(w)
    zpk = control.zpk([z for z in process.zeros if z], [p for p in process.poles if p], 1.0)
    lowest = zpk(0.0).real
    integrated = (1j * w) ** -sum(p == 0 for p in process.poles)
    np.testing.assert_allclose(found, process.gain * zpk(1j * w) / lowest * integrated * np.exp(-1j * w * delay), rtol=1e-9)


@given(process=processes(), h=st.floats(0.05, 5))
def test_the_sampled_model_is_scipys_zero_order_hold(process: Process, h: float) -> None:
    num, den = process.rational.num[::-1], process.rational.den[::-1]
    A, B, C, D, _ = scipy.signal.cont2discrete(scipy.signal.tf2ss(num, den), h)
    w = np.geomspace(1e-2, 0.9, 10) * math.pi / h  # a response may be zero at the Nyquist frequency itself
    z = np.exp(1j * w * h)
    expected = np.array([(C @ np.linalg.solve(x * np.eye(len(A)) - A, B) + D).item() for x in z])
    # the companion form loses digits where poles are far apart; the model itself agrees to 1e-12 with a computation in 60 digits
    np.testing.assert_allclose(process.sampled(h).response(w), expected, rtol=1e-6, atol=1e-12 * np.max(np.abs(expected)))


STEPS: list[tuple[Process, Callable[[Floats], Floats]]] = [
    (Process.from_lags(2, [10]), lambda t: 2 * (1 - np.exp(-t / 10))),
    (Process.from_lags(1, [3, 3]), lambda t: 1 - np.exp(-t / 3) * (1 + t / 3)),
    (Process.from_lags(0.5, integrators=1), lambda t: 0.5 * t),
    (Process.from_lags(1, [10], [2]), lambda t: 1 - 0.8 * np.exp(-t / 10)),
    (Process(-1, [-0.3 + 0.4j, -0.3 - 0.4j]), lambda t: -1 + np.exp(-0.3 * t) * (np.cos(0.4 * t) + 0.75 * np.sin(0.4 * t))),
    (Process(-1, [0.2]), np.expm1),
]


@pytest.mark.parametrize(("process", "exact"), STEPS, ids=[p.text for p, _ in STEPS])
@pytest.mark.parametrize("delay", [0.0, 0.25, 1.9, 2.1])
def test_the_step_response_is_exact_at_the_scans_with_any_dead_time(
    process: Process, exact: Callable[[Floats], Floats], delay: float
) -> None:
    h = 0.7
    plant = Plant(Process(process.gain, process.poles, process.zeros, delay).sampled(h))
    found = []
    for _ in range(30):
        found.append(plant.measure())
        plant.move(1.0)
    t = np.arange(30) * h - delay
    t *= 0.2 if process.poles == (0.2,) else 1.0
    expected = np.where(t > 1e-9, exact(np.maximum(t, 0.0)), 0.0)  # at an edge: as it was just before
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_a_dead_time_of_whole_scans_is_whole_in_spite_of_rounding() -> None:
    model = Process(1, [-1], delay=0.3).sampled(0.1)  # 0.3/0.1 is 2.9999999999999996
    assert model.scans == 3
    assert not model.early.any()


def test_a_process_far_slower_than_the_scan_stays_accurate() -> None:
    h, T = 0.01, 1e6
    [late], w = Process.from_lags(1, [T]).sampled(h).late, 1e-6
    assert late == pytest.approx(-math.expm1(-h / T), rel=1e-14)
    three = Process.from_lags(1, [T, T, T])
    assert three.sampled(h).response(w) == pytest.approx(complex(three.response(w)), rel=1e-7)  # the hold delays by h/2


def test_pure_gain_answers_one_scan_later() -> None:
    w = np.array([0.1, 1.0])
    np.testing.assert_allclose(Process(3, delay=2).sampled(0.5).response(w), 3 * np.exp(-2.5j * w), rtol=1e-14)


@pytest.mark.parametrize(
    ("process", "expected"),
    [
        (Process.from_lags(1, [1, 1, 1]), math.sqrt(3)),
        (Process.from_lags(5, [2, 2, 2, 2]), 0.5),
        (Process.from_lags(1, [1, 1, 1], [-1]), 1.0),
        (Process(2, delay=4), math.pi / 4),
        (Process(0.1, [0], delay=5), math.pi / 10),
        (Process(-0.1, [0], delay=5), math.pi / 10),
        (Process.from_lags(1, [1], delay=1), 2.0287578381104342),  # w + arctan w = pi
        (Process.from_lags(1, [1, 1]), math.inf),
        (Process.from_lags(1, [1], integrators=2), math.inf),
        (Process(1), math.inf),
        (Process(1, [0, 0]), math.inf),
        (Process(-1, [1], delay=0.5), 2.3311223704144226),  # arctan w = w/2, from -180 degrees up and down again
        (Process(-1, [1], delay=2), math.inf),
    ],
    ids=str,
)
def test_the_frequency_where_the_phase_falls_to_minus_180_degrees(process: Process, expected: float) -> None:
    assert process.w180 == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("process", "text"),
    [
        (Process.from_lags(1.5, [10, 2], delay=3), "1.5 exp(-3 s)/((10 s + 1)(2 s + 1))"),
        (Process.from_lags(1, [1, 1, 1], delay=1), "1 exp(-s)/(s + 1)^3"),
        (Process.from_lags(-0.1, [5], [2, -3], 1), "-0.1 (2 s + 1)(1 - 3 s)/(s (5 s + 1))"),
        (Process(0.1, [0]), "0.1/s"),
        (Process(0.1, [0, 0]), "0.1/s^2"),
        (Process(2, [0.5]), "2/(1 - 2 s)"),
        (Process(2, [-1 + 2j, -1 - 2j]), "2/(0.2 s^2 + 0.4 s + 1)"),
        (Process(2, [1j, -1j]), "2/(s^2 + 1)"),
        (Process(2, [1 + 2j, 1 - 2j]), "2/(0.2 s^2 - 0.4 s + 1)"),
        (Process(2, delay=1), "2 exp(-s)"),
    ],
)
def test_a_process_is_written_as_people_write_it(process: Process, text: str) -> None:
    assert str(process) == process.text == text


def test_stability_and_the_sign_of_the_feedback() -> None:
    assert Process(1, [-1]).is_stable
    assert not Process(1, [0]).is_stable
    assert not Process(1, [-1, 0.1]).is_stable
    signs: list[tuple[float, list[complex]]] = [(2, [-1]), (-2, [-1]), (-1, [1]), (1, [1, 2]), (1, [1j, -1j])]
    assert [Process(gain, poles).feedback_sign for gain, poles in signs] == [1, -1, 1, 1, 1]
    assert pidemu.Process(1, [-1]) == Process(1.0, (complex(-1),))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Process(0, [-1]), "the gain is 0.*give the process's gain"),
        (lambda: Process(math.nan, [-1]), "gain is nan; give a finite number"),
        (lambda: Process("much", [-1]), "gain is 'much'; give a number"),  # type: ignore[arg-type]
        (lambda: Process(1, [-1], delay=-2), "dead time -2 s is negative; give the time"),
        (lambda: Process(1, [-1], delay=math.inf), "delay is inf; give a finite number"),
        (lambda: Process(1, [-1 + 1j]), r"the pole -1\+1j has no partner.*add -1-1j"),
        (lambda: Process(1, [-1, -2], [-1 - 1j, -1 + 1j, -1 + 1j]), r"the zero -1\+1j has no partner.*add -1-1j"),
        (lambda: Process(1, [-1 - 1j]), r"the pole -1-1j has no partner.*add -1\+1j"),
        (lambda: Process(1, [complex(math.inf)]), "the pole .* is not finite; give its place"),
        (lambda: Process(1, -0.1), r"poles is -0.1; give a list of numbers \[rad/s\]"),  # type: ignore[arg-type]
        (lambda: Process(1, [-1], [-2, -3]), "2 zeros and 1 poles.*add the small lags"),
        (lambda: Process.from_lags(1, [0]), "lag 0 s is not positive; leave out a lag of zero"),
        (lambda: Process.from_lags(1, [-5]), "lag -5 s is not positive.*give an unstable process its pole"),
        (lambda: Process.from_lags(1, [5], [0]), "a lead of 0 s does nothing; leave it out"),
        (lambda: Process.from_lags(1, integrators=-1), "integrators is -1; give how many"),
        (lambda: Process.from_lags(1, integrators=0.5), "integrators is 0.5; give how many"),  # type: ignore[arg-type]
        (lambda: Process(1, [-1]).sampled(0), "scan interval 0 s is not a positive number; give the time"),
        (lambda: Process(1, [100]).sampled(10), "outgrows all numbers within one scan of 10 s; give a shorter"),
    ],
)
def test_what_is_no_process_is_refused_with_a_remedy(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ProcessError, match=message):
        make()


@pytest.mark.parametrize(
    ("text", "process"),
    [
        ("gain=1.5,lag=10,lag=2,lead=1,delay=3", Process.from_lags(1.5, [10, 2], [1], 0, 3)),
        (" gain = -2 %/% , lag=2 min, delay=500 ms", Process.from_lags(-2, [120], delay=0.5)),
        ("gain=1,integrators=1,delay=1", Process(1, [0], delay=1)),
        ("gain=1,pole=-0.1+0.2j", Process(1, [-0.1 + 0.2j, -0.1 - 0.2j])),
        ("gain=1,pole=-0.1+0.2j,pole=-0.1-0.2j,zero=0.5", Process(1, [-0.1 + 0.2j, -0.1 - 0.2j], [0.5])),
        ("gain=1,lead=-1,lag=2", Process.from_lags(1, [2], [-1])),
    ],
)
def test_a_process_is_read_from_a_line_of_text(text: str, process: Process) -> None:
    assert parse_process(text) == process


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not NAME=VALUE; write for example"),
        ("lag=10", "has no gain; add gain="),
        ("gain=1,5", "'5' in 'gain=1,5' is not NAME=VALUE"),
        ("gain=1,leg=5", r"unknown name 'leg'.*did you mean 'lag'.*names: gain"),
        ("gain=1,gain=2", "gain comes twice"),
        ("gain=1,delay=2,delay=3", "delay comes twice"),
        ("gain=1,lag=5 miles", "lag=5 miles: unknown unit"),
        ("gain=1,lag=5 %", "lag=5 %: '%' is a percentage.*use one of"),
        ("gain=1,lag=fast", "lag=fast: 'fast' is not a number"),
        ("gain=2 eu/eu", "gain=2 eu/eu: a process gain is in %/%.*convert it"),
        ("gain=big", "gain=big: 'big' is not a number"),
        ("gain=1,pole=left", r"pole=left is not a number \[rad/s\] such as"),
        ("gain=1,integrators=half", "integrators is 'half'; give how many"),
        ("gain=0,lag=1", "the gain is 0"),
    ],
)
def test_a_line_that_is_no_process_is_refused_with_a_remedy(text: str, message: str) -> None:
    with pytest.raises(ProcessError, match=message):
        parse_process(text)
