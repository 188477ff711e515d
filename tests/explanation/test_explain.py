"""What an explanation says is what the law and the emulation do."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.card.library import card_files
from pidemu.card.model.card_file import default_scan
from pidemu.card.model.signals import Measurement
from pidemu.errors import ScanError
from pidemu.explanation.forms import Times
from pidemu.law.law import Law
from tests.algorithms import changed
from tests.cli.helpers import strict_json

EXAMPLES = [(i, e.given) for i in card_files() for e in pidemu.load_card(i).data.examples]
W = np.geomspace(1e-4, 1e3, 60)


def explained(card: str, scan: float | None = None, **given: Any) -> pidemu.Explanation:
    return pidemu.explain(pidemu.load_card(card).settings(given), scan)


@pytest.mark.parametrize(("card", "given"), EXAMPLES, ids=str)
def test_every_form_is_the_law(card: str, given: dict[str, Any]) -> None:
    """Each form is written out here by hand, with the filter where the explanation says it sits."""
    settings = pidemu.load_card(card).settings(given)
    e, a = pidemu.explain(settings), settings.algorithm().linear
    if e.forms is None:
        assert a.dahlin is not None
        return
    bare = changed(a, setpoint__filter=None, measurement=Measurement(), error__filter=None)
    law, s = Law(bare).response(W), 1j * W
    lag = 1 + a.Tf * s + (a.Tf * s) ** 2 / 2 if a.filter_order == 2 else 1 + a.Tf * s
    D, all_behind = (s / lag, np.ones_like(s)) if e.forms.term_filter else (s, lag if a.has_signal_filter else np.ones_like(s))
    p = e.forms.parallel
    np.testing.assert_allclose((p.kp + p.ki / s + p.kd * D) / all_behind, law, rtol=1e-9)  # rounding, of differences too
    if e.forms.standard is not None:
        K, rate, Td = e.forms.standard.K, 1 / e.forms.standard.Ti, e.forms.standard.Td
        np.testing.assert_allclose(K * (1 + rate / s + Td * D) / all_behind, law, rtol=1e-9)
    if e.forms.series is not None:
        K, rate, Td = e.forms.series.K, 1 / e.forms.series.Ti, e.forms.series.Td
        lead = (1 + Td * s) / lag if e.forms.term_filter and e.forms.lead_lag else 1 + Td * D
        np.testing.assert_allclose(K * (1 + rate / s) * lead / all_behind, law, rtol=1e-6)  # roots lose half the digits
    assert (e.forms.standard is None, e.forms.series is None) == ("standard" in e.forms.why_not, "series" in e.forms.why_not)


@pytest.mark.parametrize(("card", "given"), EXAMPLES, ids=str)
def test_every_explanation_can_be_read_and_written_as_json(card: str, given: dict[str, Any]) -> None:
    settings = pidemu.load_card(card).settings(given)
    for scan in (None, default_scan(settings.equation)):
        e = pidemu.explain(settings, scan)
        assert [line for line in e.text.splitlines() if len(line) > 110] == []
        assert [word for word in (" nan", "None", "-0 ") if word in e.text] == []
        assert strict_json(json.dumps(e.to_dict()))["card"] == card


STEPPED: dict[str, dict[str, Any]] = {
    "fisher/provox": {"GAIN": 2, "RESET": 4, "RATE": 0.1},
    "emerson/deltav": {"GAIN": 0.8, "RESET": 20, "RATE": 4, "FORM": "Series", "STRUCTURE": "1"},
    "generic/standard": {"K": 1.5, "Ti": 12, "Td": 2, "Tf": 0.5},
    "generic/parallel": {"kp": 1.5, "ki": 0.1, "kd": 2, "Tf": 1},
    "yokogawa/fieldbus-pid": {"GAIN": 0.6, "RESET": 8, "PV_FTIME": 2},
    "honeywell/tdc3000": {"K": 0.5, "T1": 1, "T2": 0.1},
}


def moved(card: str, scan: float, *, sp: float, pv: float, seconds: float) -> list[float]:
    """Emulate a step from rest at 50 %, without limits: what the output has moved by, scan by scan."""
    settings = pidemu.load_card(card).settings(STEPPED[card])
    controller = pidemu.Controller(settings, scan, output_limits=(-1e9, 1e9), initial_output=50.0)
    controller.rest(50.0, 50.0, 50.0)
    return [controller.scan(50.0 + sp, 50.0 + pv) - 50.0 for _ in range(round(seconds / scan))]


@pytest.mark.parametrize("card", STEPPED)
def test_jump_and_ramp_are_what_the_emulated_controller_does(card: str) -> None:
    e, scan = explained(card, **STEPPED[card]), 0.002
    assert e.ramp is not None
    out = moved(card, scan, sp=0.0, pv=1.0, seconds=30.0)
    at = np.array([20.0, 29.9])
    expected = -(e.ramp.jump + e.ramp.slope * at)
    # a scan rule is off by up to a scan interval of ramp, and a filter of 2 s has decayed to 5e-5 after 20 s
    np.testing.assert_allclose([out[round(t / scan) - 1] for t in at], expected, atol=2e-3)


@pytest.mark.parametrize("card", STEPPED)
def test_kicks_at_a_scan_interval_are_the_first_scan_of_the_emulated_controller(card: str) -> None:
    e = explained(card, 0.5, **STEPPED[card])
    assert e.automatic.at_scan is not None
    first = moved(card, 0.5, sp=1.0, pv=0.0, seconds=0.5)[0], -moved(card, 0.5, sp=0.0, pv=1.0, seconds=0.5)[0]
    assert first == pytest.approx((e.automatic.at_scan.setpoint_kick, e.automatic.at_scan.measurement_kick), abs=1e-12)


def test_published_conversion_from_provox_to_standard_holds_where_no_filter_is_counted() -> None:
    """J. Beall and M. Coughran 2013: gain (reset + rate)/reset, reset + rate, reset rate/(reset + rate); here of a series form."""
    e = explained("generic/series", K=2, Ti=15, Td=6)
    assert e.forms is not None
    assert e.forms.standard == Times(pytest.approx(2 * 21 / 15), pytest.approx(21.0), pytest.approx(15 * 6 / 21))  # type: ignore[arg-type]


def test_the_proof_of_provox_in_standard_form_is_the_one_by_fractions() -> None:
    """2, 15 s, 6 s and a filter of 1/8 are 27/10, 81/4 s and 133/36 s: by hand, from n1 = 3, n0 = 2/15."""
    e = explained("fisher/provox", GAIN=2, RESET=4, RATE=0.1)
    assert e.forms is not None
    assert e.forms.standard == Times(pytest.approx(27 / 10), pytest.approx(81 / 4), pytest.approx(133 / 36))  # type: ignore[arg-type]
    assert (e.filters[0].time, e.filters[0].on) == (0.75, "lead-lag")
    assert e.filters[0].ratio == pytest.approx(0.125)


def test_a_series_controller_keeps_its_own_order_of_times() -> None:
    e = explained("generic/series", K=2, Ti=6, Td=15)
    assert e.forms is not None
    assert e.forms.series == Times(2.0, pytest.approx(6.0), pytest.approx(15.0))  # type: ignore[arg-type]


def test_the_summary_says_it_all() -> None:
    assert explained("fisher/provox", GAIN=2, RESET=4, RATE=0.1).summary.splitlines() == [
        "PID controller, series form: K 2, Ti 15 s (4 repeats/min), Td 6 s; a filter of 0.75 s on the derivative (lead-lag). "
        "In the standard form K 2.7, Ti 20.25 s (2.963 repeats/min), Td 3.694 s.",
        "A 10 % step of PV moves the output by 160 % at once; when the derivative has died out (about 3 s), the output has moved "
        "by 27 %, plus a ramp of 80 % per minute since the step.",
        "P and I act on the error, D acts on PV alone: a 10 % step of SP moves the output by 20 % at once.",
        "Reverse acting (error SP - PV, here 'Reverse') the output falls when PV rises; direct acting (error PV - SP, here "
        "'Direct') it rises.",
    ]


def test_where_the_equation_depends_on_the_mode_both_are_said() -> None:
    """I-PD in automatic, PI-D in cascade: 0 and 0.6 of a setpoint step at once."""
    e = explained("yokogawa/fieldbus-pid", 0.5, GAIN=0.6, RESET=8)
    assert e.automatic.responses is not None
    assert e.cascade.responses is not None
    assert (e.automatic.responses.setpoint_kick, e.cascade.responses.setpoint_kick) == (0.0, 0.6)
    assert e.summary.splitlines()[2:4] == [
        "In automatic P acts on PV alone, I acts on the error: a 10 % step of SP moves nothing at once.",
        "In cascade P and I act on the error: a 10 % step of SP moves the output by 6 % at once.",
    ]


def test_integral_only_has_one_form_and_ramps() -> None:
    e = explained("emerson/deltav", GAIN=1.5, RESET=30, STRUCTURE="6")
    assert (e.kind, set(e.forms.why_not if e.forms else ())) == ("I", {"standard", "series"})
    assert e.summary.splitlines()[1] == "A 10 % step of PV moves nothing at once: the output ramps at 30 % per minute."


def test_without_integral_the_output_stays() -> None:
    e = explained("honeywell/tdc3000", K=2, T1=math.inf)
    assert e.kind == "P"
    assert e.summary.splitlines()[1] == "A 10 % step of PV moves the output by 20 % at once, where it stays."
    assert next(d for d in e.dials if d.name == "T1").off


def test_all_gains_zero_are_an_output_that_does_not_move() -> None:
    e = explained("generic/parallel", kp=0, ki=0, kd=0)
    assert (e.kind, e.summary) == ("none", "All gains are zero: the output does not move.")


def test_a_multiplier_multiplies_all_three_gains() -> None:
    e = explained("bailey/fc19", K=2, KP=2.5, KI=0.5, KD=0.2)
    assert e.forms is not None
    assert (e.forms.parallel.kp, e.forms.parallel.ki, e.forms.parallel.kd) == pytest.approx((5.0, 1 / 60, 24.0))


def test_gains_in_engineering_units_are_said_to_be_so_until_both_ranges_are_known() -> None:
    """A gain of 2.5 %/degF over 0 to 400 degF is 10 %/%."""
    without = explained("bailey/fc19", K=1, KP=2.5)
    assert (without.gain_unit, without.forms.parallel.kp if without.forms else 0) == ("output units per PV unit", 2.5)
    assert any(line.startswith("pv_range, op_range:") for line in without.not_stated)
    known = explained("bailey/fc19", K=1, KP=2.5, pv_range=(0, 400), op_range=(0, 100))
    assert (known.gain_unit, known.forms.parallel.kp if known.forms else 0) == ("%/%", 10.0)
    assert next(d for d in known.dials if d.name == "KP").others == {"%/%": 10.0}
    one = explained("bailey/fc19", K=1, KP=2.5, pv_range=(0, 400))
    assert any(line.startswith("op_range: a span of 100 was taken") for line in one.not_stated)


def test_the_sign_of_the_gain_is_the_action_where_there_is_no_other() -> None:
    """IEC 61131-3 computes with PV - SP: a positive KP raises the output when PV rises."""
    positive, negative = (explained("iec/61131-3-pid", KP=kp, TR=10, TD=0) for kp in (2, -2))
    assert (positive.reverse_with_gains, negative.reverse_with_gains) == (False, True)
    assert positive.summary.splitlines()[-1] == (
        "The error is PV - SP and the sign of the gain decides: with these settings the output rises when PV rises (direct acting; "
        "a positive gain of this card is direct acting, and K is negative here)."
    )
    assert "float32 arithmetic" in positive.beyond


def test_negative_gains_turn_the_action_round() -> None:
    e = explained("simple-pid/simple-pid", Kp=-2, Ki=-0.1)
    assert "the output rises when PV rises" in e.action
    assert e.forms is not None
    assert e.forms.standard == Times(-2.0, 20.0, 0.0)


def test_terms_of_different_signs_have_no_times() -> None:
    e = explained("simple-pid/simple-pid", Kp=1, Ki=-0.1)
    assert e.forms is not None
    assert e.forms.why_not["standard"] == "its terms have gains of different signs, and times are not negative"


def test_pole_cancellation_is_said_to_have_no_pid_settings() -> None:
    e = explained("generic/dahlin", Kp=1.2, tau=30, theta=5, **{"lambda": 10})
    assert (e.kind, e.forms, e.ramp, e.scan) == ("pole cancellation", None, None, 1.0)
    assert e.summary.startswith("Pole cancellation (Dahlin): it has no PID settings.")
    assert "scan interval: 1 s, the card's default" in e.not_stated


def test_why_there_is_no_series_form_is_said_with_the_times() -> None:
    e = explained("generic/standard", K=1, Ti=10, Td=3, Tf=0)
    assert e.forms is not None
    assert e.forms.why_not["series"] == (
        "a series form has an integral time of at least 4 derivative times in the standard form; here Ti is 10 s and Td 3 s"
    )


def test_a_filter_on_the_measurement_is_told_apart_from_that_of_the_derivative() -> None:
    e = explained("yokogawa/fieldbus-pid", GAIN=0.6, RESET=8, PV_FTIME=2)
    assert [(f.on, f.time) for f in e.filters] == [("measurement", 2.0)]
    assert e.automatic.responses is not None
    assert e.automatic.responses.measurement_kick == 0.0
    corner = 0.6 * abs(1 + 1 / (8 * 0.5j)) / math.sqrt(2)  # PI behind 1/(1 + 2 s) falls from its corner on, at 0.5 rad/s
    assert e.automatic.responses.noise_gain == pytest.approx(corner)
    assert e.ramp is not None
    assert e.ramp.jump == pytest.approx(0.6 * (1 - 2 / 8))  # K (1 - Tf/Ti), equations section 2


def test_a_filter_that_the_card_refers_to_the_effective_derivative_time_keeps_the_number_of_its_dial() -> None:
    """The block's KD is 10 for tau = (1/KD)/(1/INT + 1/DERIV)."""
    e = explained("foxboro/ia-pid", PBAND=50, INT=2, DERIV=0.3, KD=10)
    assert (e.filters[0].on, e.filters[0].order) == ("measurement", 2)
    assert e.filters[0].ratio == pytest.approx(0.1)
    assert e.summary.splitlines()[1].startswith(
        "A 10 % step of PV moves nothing at once; when the derivative has died out and the "
    )


def test_only_what_matters_at_these_settings_is_said_to_be_unverified() -> None:
    with_rate, without = explained("fisher/provox", GAIN=2, RESET=4, RATE=0.1), explained("fisher/provox", GAIN=2, RESET=4)
    assert [f.path for f in without.rests_on] == ["action.names.reverse"]
    assert [f.path for f in with_rate.rests_on] == [
        "derivative.filter.applies-to", "derivative.filter.ratio", "action.names.reverse",
    ]  # fmt: skip


def test_what_was_not_stated_is_said_with_what_was_taken() -> None:
    e = explained("emerson/deltav", 1.0, GAIN=2, RESET=20)
    assert e.not_stated[:2] == (
        "FORM: Standard, the card's default (also there: Series)",
        "STRUCTURE: 1, the card's default (also there: 0, 2, 3, 4, 5, 6, 7)",
    )
    assert "RATE: 0 s, which is off, the card's default" in e.not_stated


@pytest.mark.parametrize("scan", [0.0, -1.0, math.nan, math.inf])
def test_a_scan_interval_that_is_none_is_refused(scan: float) -> None:
    with pytest.raises(ScanError, match="is not a positive number"):
        explained("fisher/provox", scan, GAIN=2, RESET=4)


@pytest.mark.parametrize("scan", [5e-324, 1e300])
def test_a_scan_interval_that_no_controller_has_is_refused(scan: float) -> None:
    with pytest.raises(ScanError, match="is not an interval at which a controller is executed"):
        explained("fisher/provox", scan, GAIN=2, RESET=4)
