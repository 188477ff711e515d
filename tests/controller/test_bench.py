"""A controller on a bench is at rest at the signals that it is given, in its own units or in percent."""

from __future__ import annotations

import numpy as np
import pytest

import pidemu
from pidemu import Settings
from pidemu.controller.bench import Bench, limits_in_percent
from pidemu.matrix.typical import has_terms, typical_settings
from pidemu.settings.ranges import UNLIMITED

INTEGRATING = [c for c in pidemu.cards() if has_terms(pidemu.load_card(c)) and typical_settings(pidemu.load_card(c)).algorithm().ki]


def proportional() -> Settings:
    return pidemu.load_card("generic/standard").settings(K=2, Ti="off")


def arduino(**dials: float) -> Settings:
    return pidemu.load_card("arduino/pid").settings({"Kp": 2, "Ki": 0.02, "pv_range": (-50, 150), "op_range": (4, 20), **dials})


@pytest.mark.parametrize("card", INTEGRATING)
def test_a_controller_at_rest_stays_where_it_is(card: str) -> None:
    settings = typical_settings(pidemu.load_card(card))
    limits = settings.equation.integral.limits
    wide = {} if limits is None else {limits.low: -1e6, limits.high: 1e6}  # at rest the integral makes the output
    settings = settings.changed({name: x for name, x in wide.items() if isinstance(name, str) and name in settings})
    bench = Bench.in_percent(settings, 1.0, op=40.0)
    outputs = bench.at_rest().run(bench.sp, np.full(20, bench.pv))
    np.testing.assert_allclose(outputs, bench.op, atol=1e-5 * abs(bench.op))


def test_signals_and_limits_in_percent_are_those_in_own_units() -> None:
    found = Bench.in_percent(arduino(), 0.5, sp=30.0, pv=25.0, op=50.0, limits=(0.0, 75.0), action="direct")
    assert found == Bench(arduino(), 0.5, sp=10.0, pv=0.0, op=12.0, limits=(4.0, 16.0), action="direct")


def test_without_limits_a_controller_goes_as_far_as_its_law_says() -> None:
    bench = Bench.in_percent(arduino(), 1.0)
    assert bench.limits == UNLIMITED
    assert bench.at_rest().scan(bench.sp, bench.pv - 1e6) == pytest.approx(bench.op + 2.02e6)


def test_a_controller_keeps_within_the_limits_that_it_is_given() -> None:
    bench = Bench.in_percent(arduino(), 1.0, limits=(25.0, 75.0))
    assert [bench.at_rest().scan(bench.sp, bench.pv + x) for x in (-1e6, 1e6)] == [16.0, 8.0]


def test_where_nothing_integrates_the_output_is_a_bias_at_zero_error() -> None:
    bench = Bench(proportional(), 1.0, sp=10.0, pv=10.0, op=7.0)
    assert bench.is_biased
    assert bench.at_rest().scan(10.0, 10.0) == 7.0
    assert bench.at_rest().scan(11.0, 10.0) == 9.0


def test_balanced_it_keeps_its_output_at_any_error() -> None:
    bench = Bench(proportional(), 1.0, sp=12.0, pv=10.0, op=7.0)
    assert bench.at_rest().scan(12.0, 10.0) == 11.0
    assert bench.balanced().scan(12.0, 10.0) == 7.0


@pytest.mark.parametrize(("settings", "op"), [(arduino(), 7.0), (arduino(Ki=0), 7.0), (proportional(), 0.0)])
def test_an_integral_needs_no_bias_nor_does_a_loaded_sum_or_an_output_of_zero(settings: Settings, op: float) -> None:
    bench = Bench(settings, 1.0, sp=10.0, pv=10.0, op=op)
    assert not bench.is_biased
    assert bench.balanced().state == bench.at_rest().state


def test_before_its_first_scan_it_has_its_output_and_knows_no_signals() -> None:
    controller = Bench(arduino(), 1.0, sp=10.0, pv=3.0, op=7.0).before_first_scan()
    assert (controller.output, controller.mode) == (7.0, "power-up")


@pytest.mark.parametrize(
    ("card", "expected"),
    [("arduino/pid", (-25.0, 1568.75)), ("simple-pid/simple-pid", (10.0, 90.0)), ("oscat/ft-pidwl", (10.0, 90.0))],
)
def test_a_card_without_limits_of_its_own_has_those_that_are_meant_instead(card: str, expected: tuple[float, float]) -> None:
    settings = typical_settings(pidemu.load_card(card)).changed({"op_range": (4, 20)})
    assert limits_in_percent(settings, None, (10.0, 90.0)) == expected
    assert limits_in_percent(settings, (1.0, 2.0), (10.0, 90.0)) == (1.0, 2.0)
