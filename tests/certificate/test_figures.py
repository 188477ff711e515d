"""The certificate's figures against an own computation, and against what emulated controllers do."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.certificate.figures import decibels, degrees, percent
from pidemu.certificate.linear import certify, differences, time_scale
from pidemu.certificate.models import Kick, PathComparison
from pidemu.cli import cli
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.settings.settings import Settings
from tests.checks.bench import edited
from tests.conversion.support import Floats, continuous, difference, settings_that_act
from tests.helpers import copied, made_up_card

PROVOX = {"GAIN": 2, "RESET": 4, "RATE": 0.1}
TERM_FILTERS = (
    "generic/standard",
    "generic/parallel",
    "generic/series",
    "fisher/provox",
    "emerson/deltav",
    "honeywell/udc",
    "bailey/fc19",
)


def convert(card: str, dials: Mapping[str, object], target: str, **arguments: object) -> pidemu.Conversion:
    return pidemu.convert(pidemu.load_card(card).settings(**dials), target, **arguments)  # type: ignore[arg-type]


POINTS = 300
"""Frequencies of a band, ends included, evenly in the logarithm."""


def figures(source: Settings, target: Settings, w: Floats, *, setpoint: bool) -> tuple[float, float, float] | None:
    """Deviation, dB and degrees of two block diagrams; `None` for a setpoint path that is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        lag = 1.0 if setpoint else 1 / (1 + 1j * w * target.lag)  # a filter in front of the block, where it has none of its own
        ratio = lag * continuous(target, w, setpoint=setpoint) / continuous(source, w, setpoint=setpoint)
    if not np.all(np.isfinite(ratio)) or np.any(ratio == 0):
        return None
    deviation, gain, phase = np.abs(ratio - 1), np.abs(20 * np.log10(np.abs(ratio))), np.abs(np.degrees(np.angle(ratio)))
    return float(np.max(deviation)), float(np.max(gain)), float(np.max(phase))


@given(data=st.data(), names=st.tuples(st.sampled_from(TERM_FILTERS), st.sampled_from(TERM_FILTERS)), textbook=st.booleans())
@settings(max_examples=100)
def test_the_figures_are_those_of_the_two_block_diagrams(data: st.DataObject, names: tuple[str, str], textbook: bool) -> None:
    source = settings_that_act(data, pidemu.load_card(names[0]))
    assume(source.equation.proportional.on != "none")
    try:
        conversion = pidemu.convert(source, names[1], match="textbook" if textbook else None, emulate=False)
    except ConversionRefusedError:
        assume(False)
    certificate = conversion.certificate
    for setpoint, comparison in ((False, certificate.feedback), (True, certificate.setpoint)):
        for band in (comparison.loop_band, comparison.full_band):
            own = figures(source, conversion.settings, np.geomspace(band.low, band.high, POINTS), setpoint=setpoint)
            if own is not None:
                # 1e-6: near a zero on the imaginary axis the response is the small difference of its terms. The certificate also
                # looks between the frequencies, so it may find a little more
                found = (band.max_deviation, band.gain_db, band.phase_deg)
                assert all(f >= o * (1 - 1e-6) - 1e-8 for f, o in zip(found, own, strict=True))
                there = figures(source, conversion.settings, np.array([band.worst_at]), setpoint=setpoint)
                assert there is not None
                assert there[0] == pytest.approx(band.max_deviation, rel=1e-6, abs=1e-9)


@given(data=st.data(), names=st.tuples(st.sampled_from(TERM_FILTERS), st.sampled_from(TERM_FILTERS)))
@settings(max_examples=60)
def test_ten_times_as_many_frequencies_find_no_larger_deviation(data: st.DataObject, names: tuple[str, str]) -> None:
    source = settings_that_act(data, pidemu.load_card(names[0]))
    n0, n1, n2, _, _ = source.law().coefficients()
    assume(n1 * n1 >= 0.1 * 4 * n0 * n2)  # zeros damped by 0.3 and more: a notch narrower than that falls between two frequencies
    assume(source.equation.proportional.on != "none")
    try:
        conversion = pidemu.convert(source, names[1], emulate=False)
    except ConversionRefusedError:
        assume(False)
    for band in (conversion.certificate.feedback.loop_band, conversion.certificate.feedback.full_band):
        found = figures(source, conversion.settings, np.geomspace(band.low, band.high, 10 * POINTS), setpoint=False)
        assert found is not None
        assert found[0] <= band.max_deviation * 1.02 + 1e-9


def test_the_loop_band_is_placed_by_the_effective_integral_time() -> None:
    conversion = convert("fisher/provox", PROVOX, "emerson/deltav")
    Ti = 20.25  # m1/m0 = 15 + 0.875 x 6
    band = conversion.certificate.feedback.loop_band
    assert conversion.certificate.time_scale == pytest.approx(Ti)
    assert (band.low, band.high) == pytest.approx((0.01 / Ti, 5 / Ti))


def test_the_full_band_ends_at_100_over_the_derivative_time_or_at_the_nyquist_frequency() -> None:
    without = convert("fisher/provox", PROVOX, "emerson/deltav").certificate.feedback.full_band
    assert without.high == pytest.approx(100 / (9.975 / 2.7))  # m2 = 2 x 0.875 x 6 (1 - 0.75/15), m1 = 2.7
    at_scan = convert("fisher/provox", PROVOX, "emerson/deltav", scan=(1.0, 0.5)).certificate
    assert at_scan.feedback.full_band.high == pytest.approx(math.pi / 1.0)
    assert at_scan.feedback_at_scan is not None
    assert at_scan.feedback_at_scan.full_band.high == pytest.approx(math.pi / 1.0)


@pytest.mark.parametrize(
    ("card", "dials", "time"),
    [
        ("generic/standard", {"K": 2, "Ti": 30, "Td": 5}, 30),
        ("generic/parallel", {"kp": 2, "ki": 0, "kd": 10}, 5),  # no integral: the derivative time
        ("generic/parallel", {"kp": 0, "ki": 0.2}, 5),  # no proportional: 1/ki
        ("generic/parallel", {"kp": 2, "ki": 0}, 1),  # proportional alone has no time
    ],
)
def test_the_time_scale_of_every_kind_of_controller(card: str, dials: dict[str, object], time: float) -> None:
    assert convert(card, dials, card).certificate.time_scale == pytest.approx(time)


def test_the_two_scans_are_those_of_source_and_target_in_that_order() -> None:
    conversion = convert("fisher/provox", PROVOX, "generic/parallel", scan=(0.5, 2.0))
    at_scan = conversion.certificate.feedback_at_scan
    assert at_scan is not None
    w = np.geomspace(at_scan.loop_band.low, at_scan.loop_band.high, 300)
    hold = [(1 - np.exp(-1j * w * h)) / (1j * w * h) for h in (0.5, 2.0)]  # as a process sees them
    ratio = conversion.settings.law(2.0).response(w) * hold[1] / (conversion.source.law(0.5).response(w) * hold[0])
    assert at_scan.loop_band.max_deviation == pytest.approx(float(np.max(np.abs(ratio - 1))))
    assert conversion.certificate.feedback.is_exact
    assert conversion.scan == (0.5, 2.0)
    one = convert("fisher/provox", PROVOX, "generic/parallel", scan=2.0)
    assert one.scan == (2.0, 2.0)
    assert one.verdict == "exact"
    none = convert("fisher/provox", PROVOX, "generic/parallel")
    assert none.certificate.feedback_at_scan is None
    assert none.verdict == "exact"


def test_a_scan_that_costs_phase_makes_it_approximate_and_one_that_gains_phase_leaves_it_exact() -> None:
    """The sign counts: what is lost one way is gained the other."""
    slower = convert("fisher/provox", PROVOX, "generic/parallel", scan=(0.5, 2.0))
    faster = convert("fisher/provox", PROVOX, "generic/parallel", scan=(2.0, 0.5))
    costs = [c.certificate.scan_cost for c in (slower, faster)]
    assert all(cost is not None and cost.at == pytest.approx(2 / 20.25) for cost in costs)  # 2/Te, Te = m1/m0
    lost = [cost.phase_deg for cost in costs if cost is not None]
    assert lost[0] == pytest.approx(-lost[1])
    assert lost[0] > 1
    assert (slower.verdict, faster.verdict) == ("approximate", "exact")


VERDICTS = [
    ("fisher/provox", PROVOX, "emerson/deltav", {"options": {"STRUCTURE": "7"}}, "exact"),
    ("fisher/provox", PROVOX, "emerson/deltav", {"options": {"FORM": "Standard", "STRUCTURE": "1"}}, "exact-feedback"),
    ("fisher/provox", PROVOX, "emerson/deltav", {}, "exact"),
    ("fisher/provox", PROVOX, "emerson/deltav", {"given": {"ALPHA": 0.125}}, "approximate"),
    ("fisher/provox", PROVOX, "emerson/deltav", {"match": "textbook"}, "approximate"),
    ("fisher/provox", {"GAIN": 2, "RESET": 4}, "emerson/deltav", {"match": "textbook"}, "exact"),
    ("fisher/provox", PROVOX, "emerson/deltav", {"options": {"STRUCTURE": "7"}, "scan": (1.0, 0.5)}, "exact"),
]


@pytest.mark.parametrize(("card", "dials", "target", "arguments", "verdict"), VERDICTS)
def test_the_verdict_follows_from_the_figures(
    card: str, dials: dict[str, object], target: str, arguments: dict[str, object], verdict: str
) -> None:
    conversion = convert(card, dials, target, **arguments)
    c = conversion.certificate
    assert conversion.verdict == verdict

    def largest(path: PathComparison) -> float:
        return max(path.loop_band.max_deviation, path.full_band.max_deviation)

    feedback, setpoint = largest(c.feedback), largest(c.setpoint)  # scans are judged apart, by the phase that they cost
    assert (feedback < 1e-9) == (verdict != "approximate")
    assert (feedback < 1e-9 and setpoint < 1e-9) == (verdict == "exact")


def test_the_textbook_rule_enlarges_the_setpoint_kick_by_one_plus_Td_over_Ti() -> None:
    options = {"FORM": "Standard", "STRUCTURE": "1"}
    conversion = convert("fisher/provox", PROVOX, "emerson/deltav", match="textbook", options=options)
    kick = conversion.certificate.setpoint_kick
    assert (kick.source, kick.target) == pytest.approx((2, 2 * (1 + 6 / 15)))
    assert kick.ratio == pytest.approx(1.4)
    assert any(
        "with the old controller the output jumps by 2 % per % at once, with the new one it jumps by 2.8 % per % at once" in w
        for w in conversion.warnings
    )


def test_a_setpoint_weight_keeps_the_kick() -> None:
    options = {"FORM": "Standard", "STRUCTURE": "7"}
    conversion = convert("fisher/provox", PROVOX, "emerson/deltav", options=options)
    assert conversion.certificate.setpoint_kick.ratio == pytest.approx(1, rel=1e-12)
    assert conversion.settings["BETA"].value == pytest.approx(15 / (15 + 0.875 * 6))
    held = convert("fisher/provox", PROVOX, "emerson/deltav", options=options, given={"BETA": 1})
    assert held.certificate.setpoint_kick.ratio == pytest.approx(1.35)


def test_the_weight_that_keeps_the_kick_of_an_unfiltered_series_form_is_Ti_over_Ti_plus_Td() -> None:
    source = pidemu.load_card("emerson/deltav").settings(GAIN=2, RESET=15, RATE=6, FORM="Series", ALPHA=0.05)
    b = pidemu.convert(source, "generic/standard").settings["b"].value
    # n1 - n0 Tf = K (1 + Td/Ti) whatever the filter on the D term
    assert b == pytest.approx(15 / (15 + 6))


@pytest.mark.parametrize(
    ("kick", "ratio"),
    [
        (Kick(2, 3), 1.5),
        (Kick(0, 0), 1),
        (Kick(math.inf, math.inf), 1),
        (Kick(0, 2), math.inf),
        (Kick(math.inf, 2), 0),
        (Kick(2, math.inf), math.inf),
    ],
)
def test_the_ratio_of_kicks_that_are_nothing_or_infinite(kick: Kick, ratio: float) -> None:
    assert kick.ratio == ratio


def test_the_kick_is_the_first_move_of_the_emulated_controller() -> None:
    conversion = convert("bailey/fc18", {"KP": 2, "KI": 0.5, "KD": 0.1, "pv_range": (0, 100)}, "emerson/deltav")
    kick = conversion.certificate.setpoint_kick
    h = 1e-4
    moves = []
    for s in (conversion.source, conversion.settings):
        controller = pidemu.Controller(s, h, output_limits=(-1e9, 1e9), initial_output=50)
        controller.scan(50, 50)
        moves.append(controller.scan(51, 50) - 50)
    # one scan of 0.1 ms adds ki h and blurs a filter of 0.6 s by h/Tf
    assert moves == pytest.approx([kick.source, kick.target], rel=1e-3)


class TestRescaling:
    """New signal ranges: the same effect in engineering units."""

    RANGES: ClassVar = {
        "pv": ((0.0, 100.0, "degC"), (50.0, 250.0, "degC")),
        "op": ((0.0, 80.0, "kg/h"), (0.0, 100.0, "kg/h")),
    }

    def convert(self, target: str, **options: str) -> pidemu.Conversion:
        source = pidemu.load_card("fisher/provox").settings(**PROVOX, pv_range=self.RANGES["pv"][0], op_range=self.RANGES["op"][0])
        return pidemu.convert(source, target, options=options, to_pv_range=self.RANGES["pv"][1], to_op_range=self.RANGES["op"][1])

    def test_the_factor_is_that_of_the_spans(self) -> None:
        assert self.convert("emerson/deltav").factor == pytest.approx(200 / 100 * 80 / 100)

    def test_all_three_gains_of_a_parallel_card_take_it(self) -> None:
        before = convert("fisher/provox", PROVOX, "generic/parallel").settings
        after = self.convert("generic/parallel").settings
        for name in ("kp", "ki", "kd"):
            assert after[name].value == pytest.approx(1.6 * before[name].value)
        assert after["Tf"].value == pytest.approx(before["Tf"].value)

    def test_only_the_gain_of_a_standard_card_takes_it(self) -> None:
        before = convert("fisher/provox", PROVOX, "emerson/deltav").settings
        after = self.convert("emerson/deltav").settings
        assert after["GAIN"].value == pytest.approx(1.6 * before["GAIN"].value)
        for name in ("RESET", "RATE", "ALPHA"):
            assert after[name].value == pytest.approx(before[name].value)

    @pytest.mark.parametrize(("target", "options"), [("generic/parallel", {}), ("emerson/deltav", {"STRUCTURE": "7"})])
    def test_the_effect_in_engineering_units_is_the_same(self, target: str, options: dict[str, str]) -> None:
        conversion = self.convert(target, **options)
        assert conversion.verdict == "exact"
        rng = np.random.default_rng(1)
        pv = 75 + np.concatenate(([0, 0], np.cumsum(rng.normal(0, 1, 150))))
        sp = np.where(np.arange(152) < 60, 75.0, 82.0)
        valves = []
        for s in (conversion.source, conversion.settings):
            assert s.pv_range is not None
            assert s.op_range is not None
            zero, span = s.pv_range.low, s.pv_range.span
            start = 100 * (40 - s.op_range.low) / s.op_range.span
            controller = pidemu.Controller(s, 1.0, output_limits=(-1e9, 1e9), initial_output=start)
            percent = controller.run(100 * (sp - zero) / span, 100 * (pv - zero) / span)
            valves.append(s.op_range.low + percent / 100 * s.op_range.span)
        assert np.ptp(valves[0]) > 1
        assert difference(valves[0], valves[1]) < 1e-9  # 152 scans of doubles

    def test_a_warning_says_so(self) -> None:
        assert self.convert("generic/parallel").warnings[:2] == (
            "PV range: 0 to 100 degC becomes 50 to 250 degC, so the gain in percent is multiplied by 2.",
            "Output range: 0 to 80 kg/h becomes 0 to 100 kg/h, so the gain in percent is multiplied by 0.8.",
        )

    def test_the_same_ranges_change_nothing(self) -> None:
        source = pidemu.load_card("fisher/provox").settings(**PROVOX, pv_range=(0, 300, "K"))
        conversion = pidemu.convert(source, "generic/parallel", to_pv_range=(100, 400, "K"))
        assert conversion.factor == 1
        assert conversion.settings["kp"].value == pytest.approx(2.7)


class TestRounding:
    """The UDC shows hundredths of a minute."""

    SOURCE: ClassVar = {"GAIN": 2, "RESET": 55.1, "RATE": 7.3, "FORM": "Standard"}

    def test_nothing_is_rounded_unasked(self) -> None:
        conversion = convert("emerson/deltav", self.SOURCE, "honeywell/udc")
        assert conversion.settings["RSET"].value == pytest.approx(55.1 / 60, rel=1e-12)
        assert conversion.certificate.dials == ()
        assert conversion.certificate.feedback_before_rounding is None

    def test_on_request_the_dials_are_rounded_and_the_effect_is_stated(self) -> None:
        exact = convert("emerson/deltav", self.SOURCE, "honeywell/udc")
        conversion = convert("emerson/deltav", self.SOURCE, "honeywell/udc", digits=5)
        assert conversion.settings["RSET"].value == 0.92
        assert conversion.settings["RATE"].value == 0.12
        assert conversion.settings["GAIN"].value == exact.settings["GAIN"].value  # no resolution stated
        c = conversion.certificate
        assert {d.name: d.rounded for d in c.dials} == {"RSET": 0.92, "RATE": 0.12}
        assert {d.name: d.exact for d in c.dials} == {n: exact.settings[n].value for n in ("RSET", "RATE")}
        assert c.feedback_before_rounding == exact.certificate.feedback
        w = np.geomspace(c.feedback.loop_band.low, c.feedback.loop_band.high, 300)
        ratio = continuous(conversion.settings, w) / continuous(conversion.source, w)
        assert c.feedback.loop_band.max_deviation == pytest.approx(float(np.max(np.abs(ratio - 1))), rel=1e-6)

    def test_dials_that_need_no_rounding_are_not_named(self) -> None:
        conversion = convert("emerson/deltav", self.SOURCE | {"RESET": 60, "RATE": 6}, "honeywell/udc", digits=5)
        assert conversion.certificate.dials == ()

    def test_rounding_makes_an_exact_conversion_approximate(self, tmp_path: Path) -> None:
        text = copied(Path(__file__).parents[2] / "vendors/generic/standard.yaml")
        changed = edited(text, ("K: {sets: gain, ", "K: {sets: gain, resolution: 0.5, "), ("vendor: Generic", "vendor: Acme"))
        file = tmp_path / "acme" / "coarse.yaml"
        file.parent.mkdir()
        file.write_text(changed, encoding="utf-8")
        card = pidemu.load_card("acme/coarse", [tmp_path])
        source = pidemu.load_card("generic/standard").settings(K=2.2, Ti=60)
        assert pidemu.convert(source, card).verdict == "exact"
        rounded = pidemu.convert(source, card, digits=5)
        assert rounded.verdict == "approximate"
        assert rounded.settings["K"].value == 2.0
        assert rounded.certificate.feedback.loop_band.max_deviation == pytest.approx(1 - 2 / 2.2)
        assert rounded.certificate.feedback_before_rounding is not None
        assert rounded.certificate.feedback_before_rounding.is_exact


def run_json(*words: str) -> tuple[int, dict[str, object]]:
    result = CliRunner().invoke(cli, ["convert", *words, "--json"])
    assert not isinstance(result.exception, Exception) or isinstance(result.exception, SystemExit), result.exception

    def reject(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    answer = json.loads(result.stdout, parse_constant=reject)
    assert isinstance(answer, dict)
    return result.exit_code, answer


def test_the_json_answer_has_the_shape_that_stays() -> None:
    code, answer = run_json("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav", "--scan", "1,0.5")
    assert code == 0
    assert {"from", "to", "verdict", "certificate", "warnings"} <= set(answer)
    goal, source, certificate = answer["to"], answer["from"], answer["certificate"]
    assert isinstance(goal, dict)
    assert isinstance(source, dict)
    assert isinstance(certificate, dict)
    assert goal["card"] == "emerson/deltav"
    assert goal["options"] == {"FORM": "Series", "STRUCTURE": "1", "FRSIPID_OPTS": "none"}
    assert answer["chosen"] == {"FORM": "Series"}
    assert goal["settings"]["RATE"] == {"value": 5.25, "unit": "s", "unrounded": pytest.approx(5.25, rel=1e-12)}
    assert goal["settings"]["ALPHA"] == {"value": 0.14286, "unit": "1", "unrounded": pytest.approx(1 / 7, rel=1e-12)}
    assert source["settings"]["RESET"] == {"value": 4.0, "unit": "repeat/min"}
    for path in ("feedback", "setpoint", "feedback_at_scan", "setpoint_at_scan"):
        for band in ("loop_band", "full_band"):
            assert {"max_deviation", "gain_db", "phase_deg", "low", "high", "worst_at"} <= set(certificate[path][band])
    assert answer["verdict"] == "exact"  # the new block scans faster, which costs no phase
    assert answer["scan"] == [1.0, 0.5]
    assert isinstance(answer["warnings"], list)


def test_the_json_answer_says_what_the_library_says() -> None:
    conversion = convert("fisher/provox", PROVOX, "emerson/deltav", digits=5)
    code, answer = run_json("fisher/provox", "GAIN=2", "RESET=4", "RATE=0.1", "--to", "emerson/deltav")
    assert code == 0
    expected = json.loads(json.dumps(conversion.to_dict()))
    assert {k: v for k, v in answer.items() if k != "request"} == {k: v for k, v in expected.items() if k != "request"}


@pytest.mark.parametrize(
    "words",
    [
        ("generic/parallel", "kp=2", "ki=0", "--to", "emerson/deltav"),  # RESET = inf
        ("honeywell/udc", "GAIN=2", "RSET=1", "RATE=0.1", "--to", "emerson/deltav"),  # an infinite setpoint kick
        ("generic/standard", "K=2", "Ti=60", "--to", "generic/standard", "--set", "b=0"),
        ("simple-pid/simple-pid", "Kp=0", "Ki=0.5", "--to", "arduino/pid"),
    ],
)
def test_infinities_are_strings_in_json(words: tuple[str, ...]) -> None:
    code, answer = run_json(*words)
    assert code == 0
    text = json.dumps(answer, allow_nan=False)
    # simple-pid has no output limits
    assert ('"inf"' in text) == (words[0] in ("generic/parallel", "honeywell/udc", "simple-pid/simple-pid"))


def test_a_refusal_in_json_has_the_reason_and_the_nearest_settings_and_exit_status_1() -> None:
    code, answer = run_json("generic/standard", "K=2", "Ti=1", "Td=0.5", "--to", "generic/series")
    assert code == 1
    assert answer["verdict"] == "refused"
    assert "complex zeros" in str(answer["reason"])
    nearest = answer["nearest"]
    assert isinstance(nearest, dict)
    assert set(nearest["to"]["settings"]) == {"K", "Ti", "Td", "alpha"}


def test_what_is_assumed_is_listed() -> None:
    conversion = convert("fisher/provox", PROVOX, "emerson/deltav")
    assert any("fisher/provox: assumed: derivative.filter.ratio = 0.125" in a for a in conversion.assumptions)
    assert convert("generic/standard", {"K": 2, "Ti": 60}, "generic/parallel").assumptions == ()


class TestNoResponse:
    """Where one path has no response there is nothing to compare, and no figure of 1e16 stands for it."""

    def test_a_filter_without_derivative_does_not_move_the_end_of_the_full_band(self) -> None:
        """K Tf/Ti (1 - 1) leaves m2 = 6e-14: no derivative time, at 100 times whose reciprocal the two would differ 1e16 times."""
        source = pidemu.load_card("generic/standard").settings(K=17, Ti=15, Tf=21, b=0)
        assert source.law().moments()[2] != 0
        c = pidemu.convert(source, "generic/standard", match="textbook", emulate=False).certificate
        assert c.setpoint.full_band.high == pytest.approx(100 / 15)
        assert c.setpoint.full_band.max_deviation == pytest.approx(100, rel=1e-9)  # K (1 + 1/(s Ti)) per K/(s Ti), less 1: s Ti
        assert time_scale(source.law()) == pytest.approx(15)

    def test_a_setpoint_path_that_is_zero_is_not_comparable(self) -> None:
        card = pidemu.load_card("generic/standard")
        on_pv, on_error = card.settings(K=2, Ti="off", b=0), card.settings(K=2, Ti="off")
        band = certify(on_pv.law(), on_error.law(), None).setpoint.loop_band
        assert (band.max_deviation, band.gain_db, band.phase_deg) == (math.inf, math.inf, math.inf)
        assert [percent(band.max_deviation), decibels(band), degrees(band)] == ["not comparable", "-", "-"]
        lost = certify(on_error.law(), on_pv.law(), None).setpoint.loop_band
        assert [percent(lost.max_deviation), decibels(lost), degrees(lost)] == ["100 %", "-", "-"]
        none = certify(on_pv.law(), on_pv.law(), None).setpoint.loop_band
        assert (none.max_deviation, none.gain_db, none.phase_deg) == (0, 0, 0)
        plain = certify(on_pv.law(), on_error.law(), None).to_dict()
        assert plain["setpoint"]["loop_band"]["max_deviation"] == "inf"

    def test_a_response_that_is_only_rounding_is_none(self) -> None:
        """A trapezoidal integral has no response at half the scan rate: there 1 + z^-1 is rounding."""
        text = {"rule": "trapezoidal", "windup": {"scheme": "none"}}
        source = made_up_card(integral=text).settings(kp=0, ki=0.1, kd=0)
        target = pidemu.load_card("generic/parallel").settings(kp=0, ki=0.1)
        w = np.array([0.1, math.pi])
        deviation, gain, _ = differences(source.law(1.0).held(w), target.law(1.0).held(w))
        assert deviation[0] < 0.1
        assert (deviation[1], gain[1]) == (math.inf, math.inf)
