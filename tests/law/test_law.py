"""The linear law against block diagrams drawn with python-control, and against the tables of specs/equations.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import control
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.algorithm.model import Algorithm, Place
from pidemu.card.load import Card
from pidemu.card.model.base import GENERAL_RULES, Form, Rule
from pidemu.errors import ScanError
from pidemu.law.law import Law
from pidemu.settings.settings import Settings
from tests.algorithms import algorithm, filter_at
from tests.helpers import made_up_card, scans_of, settings_of

Block = Any
"""A transfer function of python-control, which has no types."""

Response = npt.NDArray[np.complex128]
Layout = Literal["parallel", "standard", "series lead-lag", "series term"]
PATHS: tuple[Literal["feedback"], Literal["setpoint"]] = ("feedback", "setpoint")
LAYOUTS: tuple[Layout, ...] = ("parallel", "standard", "series lead-lag", "series term")
FILTERS: tuple[tuple[Place, Literal[1, 2]], ...] = (("term", 1), ("measurement", 1), ("measurement", 2), ("output", 1))
PLACES: list[tuple[Layout, Place, Literal[1, 2]]] = [
    (layout, place, order)
    for layout in LAYOUTS
    for place, order in FILTERS
    if layout != "series lead-lag" or place == "term"  # the lead-lag is its own filter
]


def gain(k: float) -> Block:
    return control.tf([k], [1.0])


def tf(num: list[float], den: list[float]) -> Block:
    return control.tf(num, den)


@dataclass(frozen=True)
class Numbers:
    """Dials of one controller: gains of a parallel layout, or K, Ti, Td of the others, and what goes with them."""

    k: float
    i: float
    d: float
    b: float
    c: float
    filt: float


weights = st.sampled_from([0.0, 1.0]) | st.floats(0.01, 1)
zero_or = st.just(0.0) | st.floats(0.05, 50)
numbers = st.builds(
    Numbers,
    k=zero_or,
    i=st.floats(0.05, 50),
    d=zero_or,
    b=weights,
    c=weights,
    filt=st.just(0.0) | st.floats(0.01, 1),
)
frequencies = st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=5).map(np.array)


def bench(layout: Layout, place: Place, order: int) -> Card:
    """A card with this form and filter, weights b and c, and the dials k, i, d, filt."""
    parallel = layout == "parallel"
    lead_lag = layout == "series lead-lag"
    own_time = parallel or place != "term"
    sets = {
        "k": {"sets": "gain", "unit": "1", "off": 0},
        "i": {"sets": "integral", "unit": "1/s" if parallel else "s", "off": 0 if parallel else "inf"},
        "d": {"sets": "derivative", "unit": "s", "off": 0},
        "filt": {"sets": "filter-time" if own_time else "filter-ratio", "unit": "s" if own_time else "1", "off": 0},
        "b": {"sets": "proportional-weight", "unit": "1"},
        "c": {"sets": "derivative-weight", "unit": "1"},
    }
    dial = {"time" if own_time else "ratio": "filt"}
    return made_up_card(
        form=layout.split(" ")[0],
        proportional={"on": "weighted", "weight": "b"},
        derivative={
            "on": "weighted",
            "weight": "c",
            "filter": {"applies-to": "lead-lag" if lead_lag else place, "order": order, **dial},
        },
        settings=sets,
    )


def drawn(layout: Layout, place: Place, order: int, x: Numbers) -> tuple[Block, Block]:
    """Feedback and setpoint path, from the block diagram: who acts on what, one transfer function per box."""
    own_time = layout == "parallel" or place != "term"
    Tf = x.filt if own_time else x.filt * x.d
    term = Tf if place == "term" else 0.0
    if layout in ("parallel", "standard"):
        kp, ki, kd = (x.k, x.i, x.d) if layout == "parallel" else (x.k, x.k / x.i, x.k * x.d)
        integral, rate = tf([ki], [1, 0]), tf([kd, 0], [term, 1])
        feedback = gain(kp) + integral + rate
        setpoint = gain(kp * x.b) + integral + rate * gain(x.c)
    else:
        pi = gain(x.k) + tf([x.k / x.i], [1, 0])
        # the lead-lag is one box on the measurement; what it adds to a straight wire is what the setpoint weight c scales
        box = tf([x.d, 1], [term, 1]) if layout == "series lead-lag" else gain(1) + tf([x.d, 0], [term, 1])
        feedback = pi * box
        setpoint = gain(x.k * x.b) + tf([x.k / x.i], [1, 0]) + pi * (box - gain(1)) * gain(x.c)
    lag = tf([1], [Tf**2 / 2, Tf, 1] if order == 2 else [Tf, 1])
    if place == "measurement":
        return feedback * lag, setpoint
    return (feedback * lag, setpoint * lag) if place == "output" else (feedback, setpoint)


def dialled(layout: Layout, place: Place, order: int, x: Numbers) -> Settings:
    return bench(layout, place, order).settings(k=x.k, i=x.i, d=x.d, b=x.b, c=x.c, filt=x.filt)


def size(layout: Layout, x: Numbers, s: Response) -> npt.NDArray[np.float64]:
    """Sum of the terms' magnitudes: where they cancel, each one's rounding is what remains."""
    ki, kd = (x.i, x.d) if layout == "parallel" else (x.k / x.i, x.k * x.d)
    cross = 0.0 if layout in ("parallel", "standard") else x.k * x.d / x.i
    total: npt.NDArray[np.float64] = x.k + cross + ki / np.abs(s) + kd * np.abs(s)
    return total


def assert_same(expected: Response, actual: Response, scale: npt.NDArray[np.float64]) -> None:
    """Equal to 1e-9 of the response, and to 1e-12 of its terms where these cancel (a few dozen roundings of 1e-16)."""
    assert np.all(np.abs(expected - actual) <= 1e-9 * np.abs(expected) + 1e-12 * scale)


@pytest.mark.parametrize(("layout", "place", "order"), PLACES)
@given(x=numbers, w=frequencies)
def test_both_paths_are_those_of_the_block_diagram(layout: Layout, place: Place, order: int, x: Numbers, w: Response) -> None:
    if layout.startswith("series") and x.d and not x.k:
        x = Numbers(1.0, x.i, x.d, x.b, x.c, x.filt)  # a series controller without gain is none
    law = dialled(layout, place, order, x).law()
    feedback, setpoint = drawn(layout, place, order, x)
    scale = size(layout, x, 1j * w)
    assert_same(np.atleast_1d(feedback(1j * w)), law.response(w), scale)
    assert_same(np.atleast_1d(setpoint(1j * w)), law.response(w, "setpoint"), scale)


@pytest.mark.parametrize(("layout", "place", "order"), PLACES)
@given(x=numbers, w=frequencies)
def test_without_integral_both_paths_are_those_of_the_block_diagram_without_its_integrator(
    layout: Layout, place: Place, order: int, x: Numbers, w: Response
) -> None:
    x = Numbers(x.k or 1.0, x.i, x.d, x.b, x.c, x.filt)
    off = 0.0 if layout == "parallel" else math.inf
    law = bench(layout, place, order).settings(k=x.k, i=off, d=x.d, b=x.b, c=x.c, filt=x.filt).law()
    feedback, setpoint = drawn(layout, place, order, Numbers(x.k, off, x.d, x.b, x.c, x.filt))
    scale = x.k + np.abs((x.d if layout == "parallel" else x.k * x.d) * w)
    assert_same(np.atleast_1d(feedback(1j * w)), law.response(w), scale)
    assert_same(np.atleast_1d(setpoint(1j * w)), law.response(w, "setpoint"), scale)
    assert 0.0 == law.coefficients()[0] == law.moments()[0]


def close(expected: tuple[float, ...], actual: tuple[float, ...], scales: tuple[float, ...]) -> None:
    """Equal to 1e-12 of the largest product in each formula: a dozen roundings of 1e-16 before terms cancel."""
    for want, got, scale in zip(expected, actual, scales, strict=True):
        assert want == pytest.approx(got, rel=1e-12, abs=1e-12 * scale)


class Table:
    """The tables of specs/equations.md, section 2, written out."""

    @staticmethod
    def parallel(kp: float, ki: float, kd: float, Tf: float) -> tuple[float, ...]:
        return ki, kp + ki * Tf, kd + kp * Tf, Tf, 0.0

    @staticmethod
    def standard(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K * (1 + Tf / Ti), K * (Td + Tf), Tf, 0.0

    @staticmethod
    def standard_measurement_1(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K, K * Td, Tf, 0.0

    @staticmethod
    def standard_measurement_2(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K, K * Td, Tf, Tf**2 / 2

    @staticmethod
    def series_lead_lag(K: float, Ti: float, Td: float, alpha: float) -> tuple[float, ...]:
        return K / Ti, K * (1 + Td / Ti), K * Td, alpha * Td, 0.0

    @staticmethod
    def series_term(K: float, Ti: float, Td: float, ratio: float) -> tuple[float, ...]:
        Tf = ratio * Td
        return K / Ti, K * (1 + (Td + Tf) / Ti), K * (Td + Tf), Tf, 0.0


class Moments:
    """The table of low-frequency moments, written out."""

    @staticmethod
    def parallel(kp: float, ki: float, kd: float, Tf: float) -> tuple[float, ...]:
        return ki, kp, kd

    @staticmethod
    def standard(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K, K * Td

    @staticmethod
    def standard_measurement_1(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K * (1 - Tf / Ti), K * (Td - Tf + Tf**2 / Ti)

    @staticmethod
    def standard_measurement_2(K: float, Ti: float, Td: float, Tf: float) -> tuple[float, ...]:
        return K / Ti, K * (1 - Tf / Ti), K * (Td - Tf + Tf**2 / (2 * Ti))

    @staticmethod
    def series_lead_lag(K: float, Ti: float, Td: float, alpha: float) -> tuple[float, ...]:
        return K / Ti, K * (1 + (1 - alpha) * Td / Ti), K * (1 - alpha) * Td * (1 - alpha * Td / Ti)

    @staticmethod
    def series_term(K: float, Ti: float, Td: float, ratio: float) -> tuple[float, ...]:
        return K / Ti, K * (1 + Td / Ti), K * Td * (1 - ratio * Td / Ti)


Formula = Callable[[float, float, float, float], tuple[float, ...]]
ROWS: list[tuple[Layout, Place, int, Formula, Formula]] = [
    ("parallel", "term", 1, Table.parallel, Moments.parallel),
    ("standard", "measurement", 1, Table.standard_measurement_1, Moments.standard_measurement_1),
    ("standard", "measurement", 2, Table.standard_measurement_2, Moments.standard_measurement_2),
    ("series lead-lag", "term", 1, Table.series_lead_lag, Moments.series_lead_lag),
    ("series term", "term", 1, Table.series_term, Moments.series_term),
]
ROW_NAMES = [row[3].__name__ for row in ROWS]


def largest(kp: float, ki: float, kd: float, cross: float, Tf: float) -> tuple[float, float, float]:
    """The largest products that meet in the coefficients of s^0, s^1 and s^2."""
    one = kp + cross + ki * Tf
    return ki, one, kd + one * Tf + cross * Tf


@pytest.mark.parametrize(("layout", "place", "order", "table", "moments"), ROWS, ids=ROW_NAMES)
@given(x=numbers)
def test_coefficients_and_moments_are_those_of_the_tables(
    layout: Layout, place: Place, order: int, table: Formula, moments: Formula, x: Numbers
) -> None:
    assume(layout == "parallel" or x.k)
    law = dialled(layout, place, order, x).law()
    ki, kd = (x.i, x.d) if layout == "parallel" else (x.k / x.i, x.k * x.d)
    cross = x.k * x.d / x.i if layout.startswith("series") else 0.0
    Tf = x.filt * x.d if layout.startswith("series") else x.filt
    scales = largest(x.k, ki, kd, cross, Tf)
    close(table(x.k, x.i, x.d, x.filt), law.coefficients(), (*scales, Tf, Tf**2))
    close(moments(x.k, x.i, x.d, x.filt), law.moments(), scales)


@given(x=numbers)
def test_coefficients_and_moments_of_a_standard_card_with_its_own_filter_time_are_those_of_the_tables(x: Numbers) -> None:
    assume(x.k)
    law = pidemu.load_card("generic/standard").settings(K=x.k, Ti=x.i, Td=x.d, Tf=x.filt).law()
    Tf = x.filt if x.d else law.coefficients()[3]  # a filter on a term that is not there may be left out, or kept
    scales = largest(x.k, x.k / x.i, x.k * x.d, 0.0, x.filt)
    close(Table.standard(x.k, x.i, x.d, Tf), law.coefficients(), (*scales, x.filt, x.filt**2))
    close(Moments.standard(x.k, x.i, x.d, Tf), law.moments(), scales)


def test_the_setpoint_kick_of_a_series_controller_with_derivative_on_the_measurement_is_its_gain() -> None:
    law = Law(algorithm(form=Form.SERIES, kp=2.0, ki=0.1, kd=6.0, c=0.0, Tf=1.0))
    assert law.kick() == 2.0
    with_weight = Law(algorithm(form=Form.SERIES, kp=2.0, ki=0.1, kd=6.0, b=0.25, c=0.0, Tf=1.0))
    assert with_weight.kick() == 0.5


def test_the_setpoint_kick_of_a_filtered_derivative_on_error_is_finite_and_of_an_unfiltered_one_infinite() -> None:
    assert Law(algorithm(kp=2.0, ki=0.1, kd=6.0, Tf=1.5)).kick() == 2.0 + 6.0 / 1.5
    assert math.inf == Law(algorithm(kp=2.0, ki=0.1, kd=6.0)).kick()
    assert -math.inf == Law(algorithm(kp=-2.0, ki=-0.1, kd=-6.0)).kick()


# --- the discrete law ------------------------------------------------------------------------------------------------


def z_integral(rule: Rule, ki: float, h: float) -> Block:
    """I_n of section 4, one difference equation per rule."""
    match rule:
        case Rule.BACKWARD:  # I_n = I_{n-1} + ki h x_n
            return control.TransferFunction([ki * h, 0], [1, -1], h)
        case Rule.FORWARD:  # I_n = I_{n-1} + ki h x_{n-1}
            return control.TransferFunction([ki * h], [1, -1], h)
        case Rule.TRAPEZOIDAL:  # I_n = I_{n-1} + ki h (x_n + x_{n-1})/2
            return control.TransferFunction([ki * h / 2, ki * h / 2], [1, -1], h)


def z_derivative(rule: Rule, kd: float, Tf: float, h: float) -> Block:
    """D_n of section 4; without filter the backward difference."""
    if not Tf:
        return control.TransferFunction([kd / h, -kd / h], [1, 0], h)
    match rule:
        case Rule.BACKWARD:  # D_n = (Tf D_{n-1} + kd (x_n - x_{n-1}))/(Tf + h)
            return control.TransferFunction([kd, -kd], [Tf + h, -Tf], h)
        case Rule.FORWARD:  # D_n = (1 - h/Tf) D_{n-1} + (kd/Tf)(x_n - x_{n-1})
            return control.TransferFunction([kd / Tf, -kd / Tf], [1, -(1 - h / Tf)], h)
        case Rule.TRAPEZOIDAL:  # D_n = ((2 Tf - h) D_{n-1} + 2 kd (x_n - x_{n-1}))/(2 Tf + h)
            return control.TransferFunction([2 * kd, -2 * kd], [2 * Tf + h, -(2 * Tf - h)], h)


def z_lag(rule: Rule, Tf: float, h: float, order: int) -> Block:
    """A lag as a feedback loop of discrete integrators: first order, or second order with Tf^2/2."""
    if not Tf:
        return control.TransferFunction([1], [1], h)
    one = z_integral(rule, 1.0, h)
    if order == 1:  # y' = (x - y)/Tf
        return control.feedback(one * (1 / Tf), control.TransferFunction([1], [1], h))
    half = Tf * Tf / 2  # y'' = (x - y - Tf y')/(Tf^2/2)
    speed = control.feedback(one * (1 / half), control.TransferFunction([Tf], [1], h))
    return control.feedback(speed * one, control.TransferFunction([1], [1], h))


def z_drawn(a: Algorithm, h: float) -> tuple[Block, Block]:
    """Feedback and setpoint path of an algorithm from its difference equations."""
    one = control.TransferFunction([1], [1], h)
    P = one * a.kp
    I = z_integral(a.integral.rule, a.ki, h)  # noqa: E741 (the field's symbol)
    D = z_derivative(a.derivative.rule, a.kd, a.Tf if a.filter_on == "term" else 0.0, h)
    into = one + D * (1 / a.kp) if a.series and a.kd else one  # what the integral sees of the measurement
    feedback = P + I * into + D
    setpoint = P * a.b + I * (one + D * (a.c / a.kp) if a.series and a.kd else one) + D * a.c
    lag = z_lag(a.filter_rule, a.Tf, h, a.filter_order)
    if a.filter_on == "measurement":
        return feedback * lag, setpoint
    return (feedback * lag, setpoint * lag) if a.filter_on == "output" else (feedback, setpoint)


RULES = [(i, d, f) for i in GENERAL_RULES for d in GENERAL_RULES for f in GENERAL_RULES if d is f or i is Rule.BACKWARD]


@pytest.mark.parametrize("series", [False, True], ids=["parallel", "series"])
@pytest.mark.parametrize(("place", "order"), FILTERS)
@pytest.mark.parametrize(("integral", "derivative", "filt"), RULES)
@settings(max_examples=12)
@given(x=numbers, h=st.floats(0.05, 5), part=st.floats(1e-3, 0.99))
def test_the_discrete_law_is_that_of_the_difference_equations(
    series: bool,
    place: Place,
    order: Literal[1, 2],
    integral: Rule,
    derivative: Rule,
    filt: Rule,
    x: Numbers,
    h: float,
    part: float,
) -> None:
    a = algorithm(
        form=Form.SERIES if series else Form.STANDARD,
        kp=x.k or float(series),
        ki=x.i,
        kd=x.d,
        b=x.b,
        c=x.c,
        Tf=x.filt * 10 * h,
        integral__rule=integral,
        derivative__rule=derivative,
        derivative__filter=filter_at(place, order, filt),
    )
    forward = (derivative if place == "term" else filt) is Rule.FORWARD
    assume(not forward or not a.Tf or a.Tf > h)
    w = np.array([part * math.pi / h])
    z = np.exp(1j * w * h)
    law = Law(a, scan=h)
    feedback, setpoint = z_drawn(a, h)
    # near a filter's own resonance, and at high frequency under the forward rule, the terms are larger than they are in s
    s = np.abs((z - 1) / h)
    worst = np.max(np.abs(z_lag(filt, a.Tf, h, order)(z))) if place != "term" else 1.0
    scale = (1 + worst) * (a.kp + a.ki / s + a.kd / h * 4 + (a.kd * a.ki / a.kp * 4 / h / s if series else 0.0)) / min(1.0, h)
    assert_same(np.atleast_1d(feedback(z)), law.response(w), scale)
    assert_same(np.atleast_1d(setpoint(z)), law.response(w, "setpoint"), scale)


@pytest.mark.parametrize("name", pidemu.cards())
@given(data=st.data())
def test_the_discrete_law_of_every_card_tends_to_its_continuous_law(name: str, data: st.DataObject) -> None:
    w, h = np.array([0.01]), 0.01
    given_settings = settings_of(data, pidemu.load_card(name))
    a = given_settings.algorithm(scan=h)  # a filter that is set as a share per scan has its time from the interval
    if a.dahlin is not None:
        return  # it has no continuous law
    assume(not a.Tf or a.Tf > h)  # the forward rule is unstable otherwise
    cross = abs(a.ki * a.derivative_per_gain) if a.series else 0.0
    scale = abs(a.kp) + abs(a.ki) / w + abs(a.kd) * w + cross
    if a.derivative.rule is Rule.LAGGED_DIFFERENCE and a.kd:
        scale = scale + 1e4 * abs(a.kd) * w * h / a.Tf  # this rule's derivative is short by h/Tf of itself
    for path in PATHS:
        difference = np.abs(Law(a).response(w, path) - given_settings.law(scan=h).response(w, path))
        assert np.all(difference <= 2e-4 * scale)  # one scan is 1e-4 rad here: every s is off by up to that much of itself


@given(x=numbers, h=st.floats(0.05, 1), angle=st.floats(1e-7, 1e-3), rule=st.sampled_from(GENERAL_RULES))
def test_the_discrete_law_is_accurate_at_the_slow_end_of_the_loop_band(x: Numbers, h: float, angle: float, rule: Rule) -> None:
    # the band begins at 0.01/Ti: with Ti = 1000 s and h = 0.1 s that is 1e-6 rad per scan
    a = algorithm(kp=1.0, ki=x.i / 1000, kd=x.d, Tf=x.filt + h, derivative__rule=rule)
    q = np.exp(-1j * angle)
    one = -np.expm1(-1j * angle)  # 1 - q, without cancellation
    s = {Rule.BACKWARD: one / h, Rule.FORWARD: one / (h * q), Rule.TRAPEZOIDAL: 2 / h * one / (1 + q)}[rule]
    exact = a.kp + a.ki * h / one + a.kd * s / (1 + a.Tf * s)
    got = Law(a, scan=h).response(angle / h)
    assert abs(exact - got) <= 1e-10 * abs(exact)  # a tenth of what an exact conversion may deviate by


@pytest.mark.parametrize("name", pidemu.cards())
@given(data=st.data(), path=st.sampled_from(["feedback", "setpoint"]))
def test_the_impulse_response_of_every_card_transforms_to_its_discrete_law(
    name: str, data: st.DataObject, path: Literal["feedback", "setpoint"]
) -> None:
    given_settings = settings_of(data, pidemu.load_card(name))
    h = data.draw(scans_of(given_settings.algorithm()))
    law = given_settings.law(scan=h)
    rational = law.path(path)
    samples = law.impulse(50, path)
    # num(q) = den(q) sum(u_n q^n): the convolution of samples and denominator gives back the numerator, then nothing
    back = np.convolve(samples, rational.den)[:50]
    want = np.zeros(50)
    want[: min(50, len(rational.num))] = rational.num[:50]
    scale = np.max(np.abs(samples)) * np.sum(np.abs(rational.den))
    assert np.all(np.abs(want - back) <= 1e-12 * scale)  # a handful of roundings per sample


@pytest.mark.parametrize("Tf", [0.1, 0.5])
def test_an_unstable_forward_filter_is_refused_with_the_interval_that_would_do(Tf: float) -> None:
    a = algorithm(kp=1.0, ki=0.1, kd=2.0, Tf=Tf, derivative__rule=Rule.FORWARD)
    with pytest.raises(ScanError, match=f"use a scan interval below {2 * Tf:g} s or no filter"):
        Law(a, scan=1.0)


@pytest.mark.parametrize("scan", [0.0, -1.0, math.nan, math.inf])
def test_a_scan_interval_must_be_a_positive_number(scan: float) -> None:
    with pytest.raises(ScanError, match="is not a positive number"):
        Law(algorithm(kp=1.0, ki=0.1, kd=2.0), scan=scan)


def test_each_law_refuses_what_belongs_to_the_other() -> None:
    a = algorithm(kp=1.0, ki=0.1, kd=2.0)
    with pytest.raises(ValueError, match="the continuous law has no samples"):
        Law(a).impulse(3)
    discrete: Law = Law(a, scan=1.0)
    with pytest.raises(ValueError, match="this is the discrete law"):
        discrete.coefficients()
    with pytest.raises(ValueError, match="this is the discrete law"):
        discrete.moments()


def test_a_path_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="it is 'feedback' or 'setpoint'"):
        Law(algorithm(kp=1.0, ki=0.1, kd=2.0)).response(1.0, "both")  # type: ignore[arg-type]
