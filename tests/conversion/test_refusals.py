"""What a target cannot do: the reason, and the nearest settings it is offered instead."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.errors import PidemuError, SettingError
from pidemu.settings.settings import Settings, limits
from pidemu.units import Role, from_canonical, parse_unit


@dataclass(frozen=True)
class Refusal:
    title: str
    source: str
    given: Mapping[str, object]
    target: str
    reason: str
    options: Mapping[str, object] = field(default_factory=dict)
    dials: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.title.replace(" ", "-")

    def settings(self) -> Settings:
        return pidemu.load_card(self.source).settings(**self.given)

    def refused(self) -> ConversionRefusedError:
        with pytest.raises(ConversionRefusedError) as error:
            pidemu.convert(self.settings(), self.target, options=self.options, given=self.dials)
        return error.value

    def allowed(self) -> Conversion:
        return pidemu.convert(self.settings(), self.target, options=self.options, given=self.dials, allow_approximate=True)

    def nearest(self) -> Conversion:
        nearest = self.refused().nearest
        assert nearest is not None
        return nearest


PROVOX = {"GAIN": 2, "RESET": 4, "RATE": 0.1}
STANDARD = {"K": 2, "Ti": 60, "Td": 12}

SHAPE = [
    Refusal(
        "complex zeros into series",
        "generic/standard",
        {"K": 2, "Ti": 1, "Td": 0.5},
        "generic/series",
        "2 times its derivative time",
    ),
    Refusal(
        "complex zeros into series with a filter",
        "generic/parallel",
        {"kp": 2, "ki": 3, "kd": 0.5, "Tf": 0.02},
        "generic/series",
        "complex",
    ),
    Refusal(
        "complex zeros into a fixed lead-lag",
        "generic/standard",
        {"K": 2, "Ti": 60, "Td": 30},
        "fisher/provox",
        "needs 4.571 times or more",
    ),
    Refusal(
        "complex zeros into a filtered series",
        "generic/standard",
        {"K": 2, "Ti": 60, "Td": 30},
        "emerson/deltav",
        "needs 4.5 times or more",
        {"FORM": "Series"},
        {"ALPHA": 0.125},
    ),
    Refusal("no integral", "fisher/provox", PROVOX, "emerson/deltav", "integral action", {"STRUCTURE": "3"}),
    Refusal("no integral with D on PV", "generic/standard", STANDARD, "emerson/deltav", "integral action", {"STRUCTURE": "4"}),
    Refusal("no derivative", "generic/standard", STANDARD, "foxboro/ia-pid", "derivative action", {"MODOPT": "PI"}),
    Refusal("no proportional", "generic/standard", {"K": 2, "Ti": 60}, "emerson/deltav", "proportional action", {"STRUCTURE": "6"}),
]

NO_GAIN = [
    Refusal("integral alone into standard", "generic/parallel", {"kp": 0, "ki": 0.1}, "generic/standard", "no proportional action"),
    Refusal("integral alone into series", "generic/parallel", {"kp": 0, "ki": 0.1}, "generic/series", "no proportional action"),
    Refusal(
        "integral and derivative into standard",
        "generic/parallel",
        {"kp": 0, "ki": 0.1, "kd": 3},
        "emerson/deltav",
        "no proportional action",
        {"FORM": "Standard", "STRUCTURE": "1"},
    ),
]

RANGE = [
    Refusal(
        "rate below the UDC's",
        "generic/standard",
        {"K": 2, "Ti": 60, "Td": 3},
        "honeywell/udc",
        "RATE: 0.05 min is outside 0.09 to 10 min",
    ),
    Refusal("rate above the UDC's", "generic/standard", {"K": 2, "Ti": 2900, "Td": 700}, "honeywell/udc", "outside 0.09 to 10 min"),
    Refusal(
        "reset above the UDC's",
        "generic/standard",
        {"K": 2, "Ti": 6000, "Td": 60},
        "honeywell/udc",
        "RSET: 100 min/repeat is outside 0.02 to 50",
    ),
    Refusal("reset below the UDC's", "generic/standard", {"K": 2, "Ti": 0.6}, "honeywell/udc", "outside 0.02 to 50 min/repeat"),
    Refusal(
        "gain above the UDC's",
        "generic/standard",
        {"K": 2000, "Ti": 60, "Td": 12},
        "honeywell/udc",
        "GAIN: 2000 %/% is outside 0.001 to 1000",
    ),
    Refusal(
        "derivative 30 times the integral time",
        "honeywell/tdc3000",
        {"K": 1, "T1": 1, "T2": 30, "FORM": "interactive"},
        "emerson/deltav",
        "RATE would have to be negative",
        {"FORM": "Standard"},
    ),
]
"""A range of a dial left; in the last one a closed form asks for a negative derivative."""

ALL = [*SHAPE, *NO_GAIN, *RANGE]


@pytest.mark.parametrize("refusal", ALL, ids=str)
def test_the_refusal_names_its_reason_and_both_cards(refusal: Refusal) -> None:
    message = str(refusal.refused())
    assert refusal.reason in message
    assert refusal.source in message
    assert refusal.target in message


@pytest.mark.parametrize("refusal", ALL, ids=str)
def test_where_nearest_settings_are_offered_they_are_returned_on_request_and_marked(refusal: Refusal) -> None:
    error = refusal.refused()
    if error.nearest is None:
        with pytest.raises(ConversionRefusedError, match="no settings of it come near"):
            pidemu.convert(refusal.settings(), refusal.target, options=refusal.options, given=refusal.dials, allow_approximate=True)
        return
    allowed = pidemu.convert(
        refusal.settings(), refusal.target, options=refusal.options, given=refusal.dials, allow_approximate=True
    )
    assert allowed.settings == error.nearest.settings
    assert allowed.match == "constrained"
    assert allowed.verdict == "approximate"
    assert allowed.refusal == str(error)
    assert allowed.warnings[0] == f"These are only the nearest settings: {error}."
    assert allowed.certificate.feedback.loop_band.max_deviation < 1, "farther than no controller at all"


NONE_NEAR = (*(r.title for r in NO_GAIN), "no integral", "no integral with D on PV")
"""Without proportional action only ever smaller gains come nearer, which is no advice; and an integral that the target has not."""

OFFERED = [r for r in ALL if r.title not in NONE_NEAR]


def test_nearest_settings_are_offered_wherever_any_are_nearer_than_no_controller() -> None:
    assert [r for r in ALL if r.refused().nearest is not None] == OFFERED


@pytest.mark.parametrize("refusal", OFFERED, ids=str)
def test_the_nearest_settings_lie_inside_the_ranges_and_keep_the_integral_gain_if_these_allow_it(refusal: Refusal) -> None:
    nearest = refusal.nearest()
    for value in nearest.settings.values():
        if value.active and not value.off:
            low, high = limits(value.setting)
            assert low <= value.value <= high
    m0, kept = refusal.settings().law().moments()[0], nearest.settings.law().moments()[0]
    if refusal.title != "reset below the UDC's":  # there the gain would have to rise with it: whatever comes nearer
        assert kept == pytest.approx(m0, rel=1e-6)


def deviation(
    wanted: np.ndarray[tuple[int, ...], np.dtype[np.complex128]], w: np.ndarray[tuple[int, ...], np.dtype[np.float64]], s: Settings
) -> float:
    return float(np.max(np.abs(s.law().response(w) / wanted - 1)))


TRIALS = 2000


@pytest.mark.parametrize(
    "refusal",
    [r for r in OFFERED if r.title != "no proportional"],
    ids=str,
)
def test_no_random_settings_that_keep_the_integral_gain_are_nearer(refusal: Refusal) -> None:
    """Gain and derivative at random, near and far; integral time from the gain, filter as offered."""
    nearest = refusal.nearest()
    s, band = nearest.settings, nearest.certificate.feedback.loop_band
    w = np.geomspace(band.low, band.high, 100)
    wanted = refusal.settings().law().response(w)
    m0 = s.law().moments()[0]
    dials = {v.role: (name, v) for name, v in s.items() if v.active}
    fixed = {n: v.value for n, v in s.items() if v.active and v.role not in (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)}
    rng = np.random.default_rng(3)
    K0 = dials[Role.GAIN][1].canonical
    Td0 = (dials[Role.DERIVATIVE][1].canonical if Role.DERIVATIVE in dials else 0.0) or 0.1 * K0 / m0
    best = math.inf
    for trial in range(TRIALS):
        wide = 3.0 if trial % 2 else 0.1
        K, Td = (x * 10 ** rng.uniform(-wide, wide) for x in (K0, Td0))
        values = {Role.GAIN: K, Role.INTEGRAL: m0 / K, Role.DERIVATIVE: Td if trial % 5 else 0.0}
        given: dict[str, object] = {**s.options, **fixed}
        for role, value in values.items():
            if role in dials:
                name, dial = dials[role]
                given[name] = from_canonical(role, value, parse_unit(dial.unit)) if value else "off"
        try:
            best = min(best, deviation(wanted, w, s.card.settings(given)))
        except SettingError:
            continue
    assert best < math.inf
    # the search judges by 40 frequencies, here there are 100: 2 % between them
    assert deviation(wanted, w, s) <= 1.02 * best


def test_a_missing_proportional_term_is_approached_by_a_long_filtered_derivative() -> None:
    """No settings are the nearest: ``kd s/(1 + Tf s)`` with a long ``Tf`` is a proportional term of ``kd/Tf``."""
    refusal = next(r for r in SHAPE if r.title == "no proportional")
    nearest = refusal.nearest()
    assert nearest.certificate.feedback.loop_band.max_deviation < 0.1
    assert nearest.settings.law().moments()[0] == pytest.approx(2 / 60)


def test_a_derivative_without_filter_is_not_imitated_the_delivered_filter_stays_with_its_cost() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=12, Tf=0)
    conversion = pidemu.convert(source, "emerson/deltav")
    dials = {n: conversion.settings[n].value for n in ("GAIN", "RESET", "RATE", "ALPHA")}
    assert dials == pytest.approx({"GAIN": 2, "RESET": 60, "RATE": 12, "ALPHA": 0.125}, rel=1e-12)
    assert conversion.verdict == "approximate"
    s = 1j * 5 / 60  # where the loop band ends, 5/Te
    cost = abs((1 + 1 / (60 * s) + 12 * s / (1 + 1.5 * s)) / (1 + 1 / (60 * s) + 12 * s) - 1)
    assert conversion.certificate.feedback.loop_band.max_deviation == pytest.approx(cost, rel=1e-9)


def test_an_exact_match_that_is_asked_for_is_refused_where_the_filter_ratio_is_out_of_range() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=12, Tf=0)
    with pytest.raises(ConversionRefusedError, match="ALPHA"):
        pidemu.convert(source, "emerson/deltav", match="exact")


def test_an_exact_match_that_is_asked_for_is_refused_where_the_filter_is_fixed() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=12, Tf=1)
    with pytest.raises(ConversionRefusedError, match="filter is fixed"):
        pidemu.convert(source, "honeywell/udc", match="exact")


def test_the_textbook_rule_is_refused_with_its_own_condition() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=20)
    with pytest.raises(ConversionRefusedError, match="4 times the derivative time"):
        pidemu.convert(source, "generic/series", match="textbook")


def test_a_controller_with_every_term_off_is_refused_as_such() -> None:
    source = pidemu.load_card("honeywell/tdc3000").settings(CTEQN="D", K=2, T1="off")
    for target in ("generic/parallel", "generic/standard", "emerson/deltav"):
        with pytest.raises(ConversionRefusedError, match="no action"):
            pidemu.convert(source, target)


def test_integral_action_alone_goes_to_cards_that_can_be_without_proportional_action() -> None:
    source = pidemu.load_card("generic/parallel").settings(kp=0, ki=0.1)
    assert pidemu.convert(source, "generic/parallel").verdict == "exact"
    for options in ({"STRUCTURE": "5"}, {"STRUCTURE": "6"}):
        conversion = pidemu.convert(source, "emerson/deltav", options=options)
        assert conversion.verdict == "exact"
        assert conversion.settings.law().moments()[0] == pytest.approx(0.1)
    tdc = pidemu.convert(source, "honeywell/tdc3000", options={"CTEQN": "D"}, emulate=False)  # its scan rule is another
    assert tdc.verdict == "exact"
    assert pidemu.convert(source, "foxboro/ia-pid", options={"MODOPT": "I"}).verdict == "exact"


def test_integral_alone_behind_a_measurement_filter_is_refused_by_a_series_form_and_does_not_crash() -> None:
    source = pidemu.load_card("emerson/deltav").settings(GAIN=1, RESET=1, STRUCTURE="5", PV_FTIME=1)
    with pytest.raises(ConversionRefusedError, match="the source has no proportional action"):
        pidemu.convert(source, "honeywell/tdc3000", options={"FORM": "interactive"}, match="low-frequency", emulate=False)


def test_a_dial_at_the_end_of_its_range_is_inside_it() -> None:
    for dials in (
        {"RSET": 0.02},
        {"RSET": 50},
        {"GAIN": 0.001, "RSET": 1},
        {"GAIN": 1000, "RSET": 1},
        {"RSET": 1, "RATE": 0.09},
        {"RSET": 1, "RATE": 10},
    ):
        card = pidemu.load_card("honeywell/udc")
        source = card.settings({**card.variant({}).chosen, "GAIN": 0.05, **dials})
        assert pidemu.convert(source, "honeywell/udc").verdict == "exact"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"match": "best"}, "match is 'best'; it is one of exact, same-numbers, low-frequency, textbook"),
        ({"given": {"GAIN": 2}}, "GAIN is what the conversion computes; it cannot be given"),
        ({"given": {"ALPHB": 0.1}}, "unknown setting 'ALPHB' (did you mean 'ALPHA'?)"),
        ({"given": {"ALPHA": 2}}, "outside 0.05 to 1"),
        ({"options": {"FORM": "Serie"}}, "did you mean 'Series'?"),
    ],
)
def test_wrong_wishes_are_errors_and_no_refusals(arguments: dict[str, object], message: str) -> None:
    source = pidemu.load_card("fisher/provox").settings(**PROVOX)
    with pytest.raises(PidemuError) as error:
        pidemu.convert(source, "emerson/deltav", **arguments)  # type: ignore[arg-type]
    assert not isinstance(error.value, ConversionRefusedError)
    assert message in str(error.value)


def test_a_new_range_of_the_target_alone_is_a_question_about_the_source_s() -> None:
    source = pidemu.load_card("fisher/provox").settings(**PROVOX)
    with pytest.raises(pidemu.QuestionError) as error:
        pidemu.convert(source, "emerson/deltav", to_pv_range=(0, 200))
    (question,) = error.value.questions
    assert (question.kind, question.about) == ("range", "pv_range")
    assert "the target's PV range is 0 to 200, the source's is not given; give both" in question.text
