"""The low-frequency match: what it promises, and what emulated controllers show of it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.settings.settings import Settings
from pidemu.units import Role
from tests.conversion.support import HUNDRED, Floats, outputs, settings_that_act

TABLE = {
    "textbook": {0.1: ("0.00", "0.1"), 0.3: ("0.00", "0.4"), 1: ("0.04", "1.6"), 3: ("0.36", "3.4"), 10: ("0.89", "2.3")},
    None: {0.1: ("0.00", "0.0"), 0.3: ("0.00", "0.0"), 1: ("0.00", "0.0"), 3: ("0.03", "0.1"), 10: ("0.04", "1.2")},
}
"""specs/equations.md, section 3: dB and degrees at frequency x Ti; `None` is the default match with ALPHA left where it is."""


@pytest.mark.parametrize("match", TABLE)
@pytest.mark.parametrize("Ti", [1.0, 60.0])
def test_the_table_that_makes_it_the_default_is_reproduced_to_its_digits(match: str | None, Ti: float) -> None:
    source = pidemu.load_card("generic/series").settings(K=1.7, Ti=Ti, Td=Ti / 4, alpha=0.1)
    options = {"FORM": "Standard"}  # by default the series form is kept
    conversion = pidemu.convert(source, "emerson/deltav", options=options, given={"ALPHA": 0.125}, match=match)
    assert conversion.match == (match or "low-frequency")
    found = {}
    for x in TABLE[match]:
        ratio = complex(conversion.settings.law().response(x / Ti) / source.law().response(x / Ti))
        found[x] = (f"{abs(20 * math.log10(abs(ratio))):.2f}", f"{abs(math.degrees(math.atan2(ratio.imag, ratio.real))):.1f}")
    assert found == TABLE[match]


def test_the_textbook_rule_is_shown_beside_the_default_with_its_figures() -> None:
    source = pidemu.load_card("generic/series").settings(K=1, Ti=60, Td=15, alpha=0.1)
    options, alpha = {"FORM": "Standard", "STRUCTURE": "1"}, {"ALPHA": 0.125}
    conversion = pidemu.convert(source, "emerson/deltav", options=options, given=alpha)
    alone = pidemu.convert(source, "emerson/deltav", options=options, given=alpha, match="textbook")
    assert conversion.textbook.settings == alone.settings
    assert conversion.textbook.certificate is not None
    assert conversion.textbook.certificate.feedback == alone.certificate.feedback
    assert conversion.textbook.certificate.setpoint == alone.certificate.setpoint
    assert alone.certificate.feedback.loop_band.max_deviation > 5 * conversion.certificate.feedback.loop_band.max_deviation


def moments(s: Settings) -> tuple[float, float, float]:
    """``m0, m1, m2`` by the table of specs/equations.md, section 2, from the dials."""
    dial = {v.role: v.canonical for v in s.values() if v.active}
    form, filt = s.equation.form, s.equation.derivative.filter
    Tf, times = s.algorithm().Tf, dial.get(Role.MULTIPLIER, 1.0)
    K, rate, Td = (dial.get(r, 0.0) for r in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE))
    place = "term" if filt is None or not Tf else filt.applies_to
    if form == "parallel":
        assert place == "term"
        return times * rate, times * K, times * Td
    if form == "standard" and place == "term":
        return K * rate, K, K * Td
    if form == "standard" and place in ("measurement", "output"):
        square = Tf * Tf * rate / (2 if filt and filt.order == 2 else 1)
        return K * rate, K * (1 - Tf * rate), K * (Td - Tf + square)
    if place == "lead-lag":
        D = Td - Tf
        return K * rate, K * (1 + D * rate), K * D * (1 - Tf * rate)
    if place == "term":
        return K * rate, K * (1 + Td * rate), K * Td * (1 - Tf * rate)
    # series behind a filter on the measurement: the standard form's row with the interacting sums for K, Ti and Td
    assert filt is not None
    lead, square = Td + (1 / rate if rate else 0.0), Tf * Tf / (2 if filt.order == 2 else 1)
    if not rate:
        return 0.0, K, K * (Td - Tf)
    return K * rate, K * rate * (lead - Tf), K * rate * (Td / rate - Tf * lead + square)


CARDS = (
    "generic/standard",
    "generic/parallel",
    "generic/series",
    "fisher/provox",
    "emerson/deltav",
    "honeywell/tdc3000",
    "honeywell/udc",
    "foxboro/pneumatic",
    "foxboro/ia-pid",
    "bailey/fc19",
    "allen-bradley/plc5",
)

TARGETS: tuple[tuple[str, Mapping[str, object], Mapping[str, object]], ...] = (
    ("generic/parallel", {}, {}),
    ("generic/parallel", {}, {"Tf": 1.5}),
    ("generic/standard", {}, {"Tf": 1.5}),
    ("generic/series", {}, {"alpha": 0.1}),
    ("generic/series", {}, {"alpha": 0}),
    ("emerson/deltav", {"FORM": "Standard"}, {"ALPHA": 0.125}),
    ("emerson/deltav", {"FORM": "Series"}, {"ALPHA": 0.125}),
    ("emerson/deltav", {"FORM": "Standard"}, {}),
    ("fisher/provox", {}, {}),
    ("honeywell/tdc3000", {"FORM": "interactive"}, {}),
    ("honeywell/tdc3000", {"FORM": "ideal"}, {}),
    ("honeywell/udc", {}, {}),
    ("foxboro/ia-pid", {}, {"KD": 10}),
    ("foxboro/ia-pid", {}, {}),
    ("bailey/fc18", {}, {}),
    ("allen-bradley/plc5", {"EQUATION": "independent"}, {}),
    ("allen-bradley/plc5", {"EQUATION": "ISA"}, {}),
)


def name(target: tuple[str, Mapping[str, object], Mapping[str, object]]) -> str:
    return target[0] + "".join(f",{k}={v}" for k, v in {**target[1], **target[2]}.items())


@pytest.mark.parametrize("card", CARDS)
@given(data=st.data())
def test_the_moments_of_every_card_are_those_of_the_table(card: str, data: st.DataObject) -> None:
    s = settings_that_act(data, pidemu.load_card(card))
    assume(s.equation.proportional.on != "none")
    assume(not (s.equation.form == "series" and s.algorithm().filter_on != "term" and s.equation.integral.on == "none"))
    assume(s.algorithm().measurement.filter is None)  # the table has no filter on the measurement beside the derivative's
    expected, found = moments(s), s.law().moments()
    sizes = scale(expected)
    for a, b, size in zip(expected, found, sizes, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * size)


def scale(m: tuple[float, float, float]) -> tuple[float, float, float]:
    """What a moment may be the small difference of: its neighbours, brought to its unit."""
    m0, m1, m2 = (abs(x) for x in m)
    return m0, m1, max(m2, m1 * m1 / m0 if m0 else 0.0)


@pytest.mark.parametrize("target", TARGETS, ids=name)
@given(data=st.data())
@settings(max_examples=60)
def test_a_low_frequency_match_keeps_the_moments(
    target: tuple[str, Mapping[str, object], Mapping[str, object]], data: st.DataObject
) -> None:
    card = data.draw(st.sampled_from(CARDS))
    source = settings_that_act(data, pidemu.load_card(card))
    try:
        conversion = pidemu.convert(source, target[0], options=target[1], given=target[2], match="low-frequency", emulate=False)
    except ConversionRefusedError:
        assume(False)
    old, new = source.law().moments(), conversion.settings.law().moments()
    sizes = scale(old)
    # an integral or derivative near the end of its range may be rounded by the unit conversion, no more
    for a, b, size in zip(old, new, sizes, strict=True):
        assert b == pytest.approx(a, rel=1e-8, abs=1e-8 * size)


@given(data=st.data(), card=st.sampled_from(CARDS), target=st.sampled_from(TARGETS))
@settings(max_examples=40)
def test_the_deviation_of_a_low_frequency_match_falls_with_the_cube_of_the_frequency(
    data: st.DataObject, card: str, target: tuple[str, Mapping[str, object], Mapping[str, object]]
) -> None:
    source = settings_that_act(data, pidemu.load_card(card))
    try:
        conversion = pidemu.convert(source, target[0], options=target[1], given=target[2], match="low-frequency", emulate=False)
    except ConversionRefusedError:
        assume(False)
    a, b = source.law(), conversion.settings.law()
    m0, m1, m2 = (abs(x) for x in a.moments())
    assume(m0 > 0)
    assume(m1 or m2)
    third = [abs(x.expansion(4)[3]) for x in (a, b)]
    # far enough down for the series to be its next term: w times every time constant well below 1
    slow = max(m1 / m0, math.sqrt(m2 / m0), (max(third) / m0) ** (1 / 3), a.coefficients()[3], b.coefficients()[3])
    w = 0.01 / slow
    deviation = [abs(complex(b.response(x) / a.response(x)) - 1) for x in (w, w / 2)]
    assume(deviation[1] > 1e-10)
    assert deviation[0] / deviation[1] == pytest.approx(8, rel=0.2)


APPROXIMATE = [
    ("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.1}, "emerson/deltav", {"ALPHA": 0.125}, None),
    ("fisher/provox", {"GAIN": 2, "RESET": 4, "RATE": 0.1}, "emerson/deltav", {"ALPHA": 0.125}, "textbook"),
    ("generic/series", {"K": 1, "Ti": 60, "Td": 15, "alpha": 0.1}, "emerson/deltav", {"ALPHA": 0.125}, None),
    ("foxboro/pneumatic", {"PB": 100, "INT": 1, "DERIV": 0.25}, "honeywell/udc", {}, None),
    ("foxboro/ia-pid", {"PBAND": 50, "INT": 1, "DERIV": 0.2}, "emerson/deltav", {}, None),
    ("honeywell/tdc3000", {"K": 2, "T1": 1, "T2": 0.1, "FORM": "ideal"}, "fisher/provox", {}, None),
    ("allen-bradley/plc5", {"EQUATION": "ISA", "KC": 2, "TI": 0.5, "TD": 0.1}, "bailey/fc19", {"K": 1}, None),
]
"""Conversions that leave a deviation."""

PER_PERIOD = 2000
"""Samples per period of the sine: w h = 0.00314."""


def measured(s: Settings, w: float, scan: float) -> complex:
    """Feedback response of the running controller, by least squares over the last of ten periods of a sine on the measurement."""
    n = np.arange(10 * PER_PERIOD)
    phase = w * scan * n
    u = outputs(s, np.full(n.size, 50.0), np.asarray(50 + np.sin(phase)), scan)
    last = slice(9 * PER_PERIOD, None)
    basis: Floats = np.column_stack([np.sin(phase[last]), np.cos(phase[last]), np.ones(PER_PERIOD)])
    sine, cosine, _ = np.linalg.lstsq(basis, u[last], rcond=None)[0]
    return -complex(sine, cosine)


@pytest.mark.parametrize(("card", "dials", "target", "given_", "match"), APPROXIMATE)
def test_the_stated_deviation_is_what_the_emulated_controllers_show_on_a_sine(
    card: str, dials: dict[str, object], target: str, given_: dict[str, object], match: str | None
) -> None:
    source = pidemu.load_card(card).settings(**dials, **HUNDRED)
    conversion = pidemu.convert(source, target, given=given_, match=match)
    assert conversion.verdict == "approximate"
    band = conversion.certificate.feedback.loop_band
    w = band.worst_at
    scan = 2 * math.pi / (w * PER_PERIOD)
    shown = measured(conversion.settings, w, scan) / measured(source, w, scan)
    discrete = complex(conversion.settings.law(scan).response(w) / source.law(scan).response(w))
    assert shown == pytest.approx(discrete, abs=1e-6)  # least squares on doubles; the transients are gone after nine periods
    # the rules put s (1 - s h/2) for s, a relative error of w h/2: so much, and no more than twice it, of the deviation itself
    # where only one integral is trapezoidal, the backward one's w h/2 is not in both
    rules = {s.equation.integral.rule for s in (source, conversion.settings)}
    error = (band.max_deviation + (0.5 if len(rules) > 1 else 0.0)) * w * scan
    assert abs(shown - 1) == pytest.approx(band.max_deviation, abs=error)
    assert abs(math.log(abs(shown))) <= band.gain_db * math.log(10) / 20 + error
    assert abs(math.atan2(shown.imag, shown.real)) <= math.radians(band.phase_deg) + error


def test_a_controller_without_derivative_gets_no_filter_out_of_rounding() -> None:
    source = pidemu.load_card("generic/standard").settings(K=24.999999999999993, Ti=1, Tf=2)  # its m2 is 0, but for rounding
    assert 0 < abs(source.law().moments()[2]) < 1e-12
    conversion = pidemu.convert(source, "generic/parallel", match="low-frequency", emulate=False)
    assert (conversion.settings["kd"].value, conversion.settings["Tf"].value) == (0, 0)
    assert conversion.settings.law().moments() == pytest.approx((25, 25, 0), rel=1e-12, abs=1e-12)
