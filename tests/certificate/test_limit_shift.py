"""What an output limit leaves behind in controllers without integral action, by hand."""

from __future__ import annotations

import math

import pytest

import pidemu
from pidemu.certificate.limit_shift import choices_that_hold, limit_shift
from pidemu.settings.settings import Settings


def settings(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(**values)


def pide(gain: float, **ranges: object) -> Settings:
    return settings("allen-bradley/pide", PGain=gain, IGain=0, DGain=0, DependIndepend="false", **ranges)


DELTAV = settings("emerson/deltav", GAIN=2, STRUCTURE=4)


def test_a_positional_block_without_integral_into_a_velocity_block_stays_shifted_after_a_limit() -> None:
    """Direct acting, PV 50 to 90 and back: 50 + 2 x 40 = 130, limited to 100; DeltaV ends at 50, PIDE at 100 - 80 = 20."""
    found = limit_shift(DELTAV, pide(2), (0.5, 0.5))
    assert (found.error, found.start, found.limit, found.source, found.target) == (40, 50, 100, 50, 20)
    assert found.shift == -30
    assert (found.permanent, found.refuses) == (True, True)
    assert (found.source_forgets, found.target_forgets) == (False, True)
    assert "Without integral action nothing removes this difference" in found.text


def test_a_velocity_source_forgets_in_the_same_way_and_is_not_refused() -> None:
    into_positional = limit_shift(settings("honeywell/tdc3000", K=2, T1="inf"), DELTAV, (1.0, 0.1))
    assert (into_positional.source, into_positional.target) == (20, 50)
    assert (into_positional.permanent, into_positional.refuses) == (True, False)
    assert "the old controller was shifted after every limit; the new one keeps its bias" in into_positional.text
    into_velocity = limit_shift(settings("honeywell/tdc3000", K=2, T1="inf"), pide(2), (1.0, 0.1))
    assert (into_velocity.source, into_velocity.target) == (20, 20)
    assert (into_velocity.permanent, into_velocity.text) == (False, "")


def test_positional_into_positional_leaves_nothing_behind() -> None:
    found = limit_shift(DELTAV, settings("generic/standard", K=2, Ti=math.inf), (1.0, 1.0))
    assert (found.source, found.target, found.permanent) == (50, 50, False)


def test_an_integral_of_the_target_removes_what_a_limit_left() -> None:
    target = settings("yokogawa/fieldbus-pid", GAIN=2, RESET=60)
    found = limit_shift(settings("generic/standard", K=2, Ti=60), target, (1.0, 1.0))
    assert found.target_integrates
    assert (found.permanent, found.refuses, found.text) == (False, False, "")


@pytest.mark.parametrize(("gain", "error", "start", "lost"), [(0.5, 40, 87.5, 7.5), (8, 10, 50, 30), (-2, 40, 50, 30)])
def test_any_gain_reaches_the_limit(gain: float, error: float, start: float, lost: float) -> None:
    """What is lost is what the limit cuts off: 0.5 x 40 = 20 from 87.5 leads to 107.5; 8 x 10 = 80 from 50 to 130."""
    source = settings("simple-pid/simple-pid", Kp=gain, Ki=0)
    found = limit_shift(source, pide(abs(gain)), (1.0, 1.0), factor=1.0 if gain > 0 else -1.0)
    assert (found.error, found.start) == (error, start)
    assert (found.source, found.target) == pytest.approx((start, start - lost), abs=1e-4)  # PIDE computes in float32


def test_where_the_sign_of_the_gain_is_the_action_the_output_rises_all_the_same() -> None:
    """The output has to rise on both, whichever way that moves the measurement."""
    holds = settings("advanced-pid/advanced-pid", Kp=-2, Ki=0, Kd=0, Tf=0)
    found = limit_shift(pide(2), holds, (1.0, 1.0), factor=-1.0)
    assert (found.source, found.target) == pytest.approx((20, 50), abs=1e-4)


def test_new_ranges_ask_for_the_same_move_of_the_output() -> None:
    source = settings("emerson/deltav", GAIN=2, STRUCTURE=4, pv_range=(0, 100), op_range=(0, 100))
    wide = pide(8, pv_range=(0, 400), op_range=(0, 100))
    assert limit_shift(source, wide, (1.0, 1.0), factor=4.0).target == pytest.approx(20, abs=1e-4)


def test_a_filtered_derivative_does_not_count_as_a_shift() -> None:
    source = settings("generic/standard", K=2, Ti=math.inf, Td=5, Tf=0.5)
    found = limit_shift(source, settings("generic/parallel", kp=2, ki=0, kd=10, Tf=0.5), (0.5, 0.5))
    assert (found.source, found.target) == pytest.approx((50, 50), abs=0.1)


def test_options_that_make_a_block_positional_are_named() -> None:
    block = pide(2)
    assert choices_that_hold(block.card, block.options) == ()  # it is incremental whatever is chosen
    deltav = DELTAV
    assert {"STRUCTURE": "1"} in choices_that_hold(deltav.card, deltav.options)


def test_a_target_of_integer_arithmetic_is_tried_with_dials_that_it_can_hold() -> None:
    """Toshiba's gain counts hundredths: 1.625 is not one, which was an error of the scan."""
    source = pidemu.load_card("allen-bradley/plc5").settings(EQUATION="independent", KP=1.625, KI=0)
    with pytest.raises(pidemu.ConversionRefusedError, match="cannot hold the output of a loop without integral action"):
        pidemu.convert(source, "toshiba/pid3", emulate=False)
