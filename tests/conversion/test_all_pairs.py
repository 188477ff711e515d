"""What holds for every ordered pair of cards, whatever the settings."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.card.model.base import Status
from pidemu.certificate.linear import bands, deviation
from pidemu.conversion.evidence import filter_status
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings, limits
from tests.conversion.support import difference, needed, outputs, random_signal, rules, settings_that_act
from tests.conversion.usual import CARDS, SOURCES
from tests.helpers import WIDE, Floats

PAIRS = list(itertools.product(CARDS, CARDS))
SCANS = st.none() | st.floats(0.2, 3).map(lambda h: (h, h)) | st.tuples(st.floats(0.1, 2), st.floats(0.1, 2))
SAME = 1e-9
"""Of the span, or of what the outputs move over: sums over 200 scans of doubles."""


def convert(source: Settings, target: str, **arguments: object) -> Conversion:
    """Convert for automatic mode, asking nothing, or raise the refusal with what it must hold checked."""
    held = {} if source.card.id == target else needed(pidemu.load_card(target))
    try:
        return pidemu.convert(source, target, given=held, mode="auto", assume=True, **arguments)  # type: ignore[arg-type]
    except ConversionRefusedError as refusal:
        check_refusal(refusal, target)
        raise


def check_refusal(refusal: ConversionRefusedError, target: str) -> None:
    assert len(str(refusal)) > 20, "a refusal has a reason"
    assert target in str(refusal)
    if refusal.nearest is not None:
        assert_in_range(refusal.nearest.settings)
        assert refusal.nearest.certificate.feedback.loop_band.max_deviation < 1  # nearer than no controller at all


def assert_in_range(found: Settings) -> None:
    for name, value in found.items():
        low, high = limits(value.setting)
        assert value.off or low <= value.value <= high, f"{name} = {value.value}"


def from_rest(s: Settings, sp: Floats, pv: Floats, h: float) -> Floats:
    """Output of a controller that no limit touches, and that has been at rest at 50 % before."""
    controller = pidemu.Controller(s, h, output_limits=WIDE, initial_output=50.0)
    controller.rest(50.0, 50.0, 50.0)
    return controller.run(sp, pv)


def drawn(data: st.DataObject) -> tuple[Settings, str]:
    source, target = data.draw(st.sampled_from(PAIRS))
    return settings_that_act(data, pidemu.load_card(source)), target


@given(data=st.data(), scan=SCANS)
@settings(max_examples=160)
def test_a_verdict_is_always_given_and_it_is_what_the_emulations_show(
    data: st.DataObject, scan: tuple[float, float] | None
) -> None:
    source, target = drawn(data)
    try:
        conversion = convert(source, target, scan=scan)
    except (ConversionRefusedError, ScanError):
        return
    assert_in_range(conversion.settings)
    assert conversion.sentence.endswith(".")
    verdict, certificate = conversion.verdict, conversion.certificate
    assert verdict in ("exact", "exact-feedback", "approximate")
    if verdict == "approximate" or certificate.scan_by_scan is None or conversion.factor < 0:
        return
    # limits of the integral are limits, which the linear range leaves out; the certificate names them
    assume(all(s.algorithm().integral.limits is None for s in (source, conversion.settings)))
    h, same = certificate.scan_by_scan.scan, certificate.scan_by_scan
    claimed = same.is_exact if verdict == "exact" else same.is_exact_on_measurement
    alike = math.isclose(*h) and rules(conversion.source) == rules(conversion.settings)
    if not (claimed or alike):  # the same law; scan by scan the outputs are not said to be the same
        return
    if not math.isclose(*h):  # only what has no memory is the same at two intervals
        assert not (source.algorithm().ki)
        assert not (source.algorithm().kd)
        return
    sp, pv = random_signal(11, 120), random_signal(12, 120)
    if verdict == "exact-feedback":
        sp = np.full(120, 50.0)
    a, b = (from_rest(s, sp, pv, h[0]) for s in (conversion.source, conversion.settings))
    if not source.algorithm().ki:  # positional: counted from the bias; velocity: from the output at the transfer
        a, b = a - a[0], b - b[0]
    # the laws agree per frequency to 1e-9, an output adds up 120 scans of it
    assert difference(a, b) < 100 * SAME


@given(data=st.data(), scan=SCANS)
@settings(max_examples=140)
def test_no_conversion_that_costs_more_than_the_source_s_own_numbers_may_is_farther_off_than_the_textbook_rule(
    data: st.DataObject, scan: tuple[float, float] | None
) -> None:
    source, target = drawn(data)
    try:
        conversion = convert(source, target, scan=scan, emulate=False)
    except (ConversionRefusedError, ScanError):
        assume(False)
    book = conversion.textbook.certificate
    assume(book is not None)
    assert book is not None
    own, other = (c.headline.loop_band.max_deviation for c in (conversion.certificate, book))
    if conversion.match == "constrained":  # settings do not depend on scans: least deviation in the band that no scan cuts short
        own, other = (in_the_whole_band(conversion, s) for s in (conversion.settings, conversion.textbook.settings))
    # the source's own numbers are kept below 1 % in the loop band, below 2 % where its filter is only assumed
    kept = 0.02 if filter_status(source) is Status.ASSUMED else 0.01
    assert own <= max(other * (1 + 1e-5) + 1e-9, kept)  # the largest value is found on a grid, to 1e-5


def in_the_whole_band(conversion: Conversion, other: Settings | None) -> float:
    assert other is not None
    law = conversion.source.law()
    return deviation(law, other.law(), bands(law, None)[0], conversion.factor)


PER_PERIOD = 48
PERIODS = 40


def shown(s: Settings, w: float, h: float) -> complex:
    """Feedback response of a running controller at a frequency whose period is a whole number of scans."""
    n = np.arange(PERIODS * PER_PERIOD)
    phase = w * h * n
    u = outputs(s, np.full(n.size, 50.0), np.asarray(50 + np.sin(phase)), h)
    last = slice(-4 * PER_PERIOD, None)
    basis = np.column_stack([np.sin(phase[last]), np.cos(phase[last]), np.ones(4 * PER_PERIOD), n[last]])
    sine, cosine, *_ = np.linalg.lstsq(basis, u[last], rcond=None)[0]
    return -complex(sine, cosine)


@given(data=st.data(), place=st.floats(0, 1))
@settings(max_examples=80)
def test_the_stated_deviation_is_what_the_emulated_controllers_show_on_sines_in_the_band(data: st.DataObject, place: float) -> None:
    source, target = drawn(data)
    a = source.algorithm()
    assume(a.linear == a)
    band = bands(source.law(), None)[0]
    w = band[0] ** (1 - place) * band[1] ** place
    h = 2 * math.pi / (w * PER_PERIOD)
    assume(max(a.Tf, *(lag.at(h) for lag in (a.measurement.filter, a.error.filter) if lag is not None), 0.0) < 2 * PER_PERIOD * h)
    try:
        conversion = convert(source, target, scan=h, emulate=False)
        found = conversion.settings.algorithm()
        assume(found.linear == found and found.Tf < 2 * PER_PERIOD * h)
        ratio = shown(conversion.settings, w, h) / (conversion.factor * shown(source, w, h))
    except (ConversionRefusedError, ScanError):
        assume(False)
    if conversion.factor < 0:
        ratio = -ratio
    stated = conversion.certificate.feedback_at_scan
    assert stated is not None
    deviation = abs(ratio - 1)
    assert deviation <= stated.loop_band.max_deviation * 1.01 + 1e-6  # 1e-6: what is left of the transients
    # at the frequency itself, the law that the certificate is made of is what is shown, to 1 %
    law = complex(conversion.settings.law(h).held(w)[()] / (abs(conversion.factor) * source.law(h).held(w)[()]))
    assert deviation == pytest.approx(abs(math.copysign(1, conversion.factor) * law - 1), rel=0.01, abs=1e-6)


@pytest.mark.parametrize("source", CARDS)
def test_p_on_the_measurement_and_p_on_the_error_are_never_called_equal_for_setpoints(source: str) -> None:
    settings = dict(SOURCES)[source]
    if not settings.algorithm().kp:
        pytest.fail("a usual setting has proportional action")
    for target in ("yokogawa/fieldbus-pid", "generic/standard"):
        fixed = {"b": 1.0, "c": 0.0} if target == "generic/standard" else {}
        try:
            conversion = pidemu.convert(settings, target, given=fixed, mode="auto", emulate=False)
        except ConversionRefusedError:
            continue
        on_pv = [not s.algorithm().b for s in (conversion.source, conversion.settings)]
        if on_pv[0] != on_pv[1]:
            assert conversion.verdict in ("exact-feedback", "approximate")
            assert not conversion.certificate.setpoint.is_exact
            assert any(w.startswith("Setpoint steps: with the old controller the output") for w in conversion.warnings)
            lost = "P acts on the error on the old controller and on the measurement on the new one"
            assert any(w.startswith(lost) for w in conversion.warnings) == on_pv[1]
