"""What is chosen, claimed and asked: every fault that was found once, with the right answer (specs/equations.md, section 9)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError, QuestionError
from pidemu.conversion.result import Conversion
from pidemu.errors import SettingError

PROVOX: dict[str, object] = {"GAIN": 2, "RESET": 4, "RATE": 0.1}
IDEAL_TDC: dict[str, object] = {"K": 0.5, "T1": 0.1, "FORM": "ideal", "CTEQN": "A"}


def convert(source: str, settings: dict[str, object], target: str, **arguments: object) -> Conversion:
    return pidemu.convert(pidemu.load_card(source).settings(settings), target, **arguments)  # type: ignore[arg-type]


def dials(c: Conversion, *names: str) -> list[float]:
    return [float(f"{c.settings[n].value:.6g}") for n in names]


def asked(source: str, given: dict[str, object], target: str, **arguments: object) -> QuestionError:
    with pytest.raises(QuestionError) as question:
        convert(source, given, target, **arguments)
    return question.value


class TestModes:
    YOKOGAWA: ClassVar[dict[str, object]] = {"GAIN": 0.6, "RESET": 8}

    def test_a_mode_on_which_the_source_depends_is_asked_for(self) -> None:
        (question,) = asked("yokogawa/fieldbus-pid", self.YOKOGAWA, "emerson/deltav", scan=0.5).questions
        assert (question.kind, question.about) == ("mode", "mode")
        structures = [a.conversion.settings.options["STRUCTURE"] for a in question.readings if a.conversion is not None]
        assert structures == ["2", "1"]
        assert [a.command.split("--mode ")[1] for a in question.readings] == ["auto", "cascade"]

    @pytest.mark.parametrize(("mode", "structure", "kick"), [("cascade", "1", 0.6), ("auto", "2", 0.0)])
    def test_in_one_mode_the_same_terms_see_the_setpoint(self, mode: str, structure: str, kick: float) -> None:
        found = convert("yokogawa/fieldbus-pid", self.YOKOGAWA, "emerson/deltav", scan=0.5, mode=mode)
        assert (found.settings.options["STRUCTURE"], found.verdict) == (structure, "exact")
        assert found.certificate.setpoint_kick.source == pytest.approx(kick)
        assert found.certificate.setpoint_kick.target == pytest.approx(kick)

    def test_the_stated_mode_is_the_one_that_is_emulated(self) -> None:
        source = pidemu.load_card("yokogawa/fieldbus-pid").settings(self.YOKOGAWA)
        target = pidemu.convert(source, "emerson/deltav", scan=0.5, mode="cascade").settings
        for settings in (source, target):
            controller = pidemu.Controller(settings, 0.5, initial_output=50)
            controller.rest(50.0, 50.0, 50.0)
            steps = controller.run([50, 50, 60], 50, cascade=[50, 50, 60])
            assert steps[2] - steps[1] == pytest.approx(6 + 6 * 0.5 / 8)  # P on the error, and one scan of the integral

    def test_a_mode_on_which_only_the_target_depends_is_not_asked_for_and_told(self) -> None:
        found = convert("fisher/provox", {"GAIN": 0.8, "RESET": 10}, "yokogawa/fieldbus-pid")
        assert found.verdicts == {"auto": "exact-feedback", "cascade": "exact"}
        assert found.verdict == "exact-feedback"
        assert "setpoint changes are the same in cascade and differ in automatic" in found.sentence

    def test_a_mode_that_is_not_one_is_refused(self) -> None:
        with pytest.raises(SettingError, match="mode is 'manual'; it is one of auto, cascade, both"):
            convert("fisher/provox", PROVOX, "emerson/deltav", mode="manual")


class TestTermsThatSeeTheSetpoint:
    PROCESS = pidemu.Process.from_lags(1, [3], delay=1)

    @pytest.mark.parametrize("target", ["emerson/deltav", "allen-bradley/pide", "honeywell/udc"])
    def test_p_on_error_stays_on_error_whatever_the_scans(self, target: str) -> None:
        found = convert("honeywell/tdc3000", IDEAL_TDC, target, scan=(1, 0.1), process=self.PROCESS)
        assert found.settings.algorithm().b == 1
        assert found.certificate.setpoint_kick.target == pytest.approx(0.5)
        assert found.certificate.loop is not None
        assert found.certificate.loop.target.gain_margin > found.certificate.loop.source.gain_margin
        assert "tune again" not in found.sentence

    def test_foxboro_into_udc_keeps_p_on_the_error(self) -> None:
        process = pidemu.Process.from_lags(1, [300], delay=30)
        found = convert("foxboro/ia-pid", {"PBAND": 80, "INT": 5, "MODOPT": "PI"}, "honeywell/udc", scan=(1, 0.5), process=process)
        assert (found.settings.options["ALGO"], found.verdict) == ("A", "exact")

    def test_an_unfiltered_derivative_on_the_setpoint_is_the_greater_evil_and_both_are_shown(self) -> None:
        found = convert("fisher/provox", {"GAIN": 4, "RESET": 0.2, "RATE": 0.5}, "honeywell/udc", digits=5)
        assert found.settings.options["ALGO"] == "B"
        assert found.runner_up is not None
        assert found.runner_up.settings.options["ALGO"] == "A"


class TestRanges:
    BAILEY: ClassVar[dict[str, object]] = {"K": 1, "KP": 2.5, "KI": 0.5, "KD": 0.2}

    def test_a_range_that_decides_a_dial_is_asked_for(self) -> None:
        (question,) = asked("bailey/fc19", self.BAILEY, "emerson/deltav").questions
        assert (question.kind, question.about) == ("range", "pv_range")
        assert "--pv-range" in question.text

    def test_with_the_range_the_gain_is_in_percent(self) -> None:
        assert dials(convert("bailey/fc19", {**self.BAILEY, "pv_range": (0, 400)}, "emerson/deltav"), "GAIN") == [10.0]

    def test_an_equation_takes_the_signals_of_the_other_side(self) -> None:
        found = convert("bailey/fc19", self.BAILEY, "generic/parallel")
        assert dials(found, "kp", "ki", "kd") == pytest.approx([2.5, 0.5 / 60, 12])

    def test_counts_shown_as_degrees_are_the_same_signal(self) -> None:
        given = {"EQUATION": "ISA", "KC": 20, "TI": 1.4, "pv_range": "0,16383 counts", "op_range": "0,16383 counts"}
        found = convert(
            "allen-bradley/plc5", given, "allen-bradley/logix-pid", options={"PE": "dependent"},
            to_pv_range="0,1000 degF", to_op_range="0,100 %",
        )  # fmt: skip
        assert (found.verdict, dials(found, "KP", "KI")) == ("exact", [20, 1.4])

    def test_pwm_shown_as_a_fraction_scales_all_three_gains(self) -> None:
        given = {"Kp": 22.2, "Ki": 1.08, "Kd": 114, "pv_range": (0, 300, "degC"), "op_range": (0, 255, "pwm")}
        found = convert("arduino/pid", given, "simple-pid/simple-pid", to_op_range=(0, 1, "duty"))
        assert dials(found, "Kp", "Ki", "Kd") == [0.0870588, 0.00423529, 0.447059]

    def test_two_pairs_of_numbers_without_units_are_asked_about(self) -> None:
        error = asked("fisher/provox", {**PROVOX, "pv_range": (0, 200)}, "emerson/deltav", to_pv_range=(0, 400))
        (question,) = error.questions
        assert question.kind == "scale"
        gains = sorted(a.conversion.settings["GAIN"].value for a in question.readings if a.conversion is not None)
        assert gains == pytest.approx([2, 4])


class TestAction:
    def test_the_size_of_the_dials_does_not_depend_on_it_and_both_words_are_named(self) -> None:
        found = convert("fisher/provox", PROVOX, "allen-bradley/logix-pid")
        assert found.at_the_loop[0].startswith("Action: reverse acting, SP - PV: CA 0; direct acting, PV - SP: CA 1.")

    def test_a_cut_over_plan_is_about_the_loops_own_action(self) -> None:
        found = convert("honeywell/tdc3000", {"K": 2, "T1": math.inf}, "emerson/deltav", action="direct")
        plan = found.transfer_plan(sp=50, pv=55, op=60)
        assert [step.set for step in plan.steps if "bias [%]" in step.set] == [{"bias [%]": 50.0}]
        assert plan.bump == 0

    def test_an_action_against_the_sign_of_the_gains_is_asked_about(self) -> None:
        error = asked("simple-pid/simple-pid", {"Kp": -2, "Ki": -0.5}, "generic/parallel", action="reverse")
        assert [q.kind for q in error.questions] == ["action"]


class TestLimits:
    @pytest.mark.parametrize(
        ("source", "given"),
        [("emerson/deltav", {"GAIN": 2, "STRUCTURE": "4"}), ("allen-bradley/plc5", {"EQUATION": "ISA", "KC": 4, "TI": 0})],
    )
    def test_a_loop_held_by_a_bias_is_not_put_into_a_block_that_forgets(self, source: str, given: dict[str, object]) -> None:
        with pytest.raises(ConversionRefusedError, match="cannot hold the output of a loop without integral action") as refusal:
            convert(source, given, "allen-bradley/pide")
        assert any("allen-bradley/logix-pid" in text for text in refusal.value.alternatives)
        found = convert(source, given, "allen-bradley/pide", allow_approximate=True)
        assert (found.verdict, found.settings["IGain"].value) == ("approximate", 0)

    def test_a_block_that_forgets_converts_with_the_warning(self) -> None:
        found = convert("honeywell/tdc3000", {"K": 2, "T1": math.inf}, "emerson/deltav")
        assert (found.settings.options["STRUCTURE"], found.verdict) == ("4", "exact")
        assert any("shifted after every limit" in w for w in found.warnings)
        assert any(w.startswith("Open: the bias.") for w in found.warnings)

    def test_limits_are_told_only_where_they_differ(self) -> None:
        found = convert("fisher/provox", {"GAIN": 2, "RESET": 4}, "emerson/deltav")
        assert "inside its limits" not in found.sentence
        assert not any("limit and the error" in w for w in found.warnings)


class TestChoices:
    def test_series_stays_series_and_the_filter_moves_only_to_be_exact(self) -> None:
        found = convert("fisher/provox", PROVOX, "emerson/deltav")
        assert {n: found.settings.options[n] for n in ("FORM", "STRUCTURE")} == {"FORM": "Series", "STRUCTURE": "1"}
        assert dials(found, "GAIN", "RESET", "RATE", "ALPHA") == [2, 15, 5.25, 0.142857]
        assert found.verdict == "exact"
        assert "if PROVOX's derivative filter is RATE/8 (assumed)" in found.sentence
        assert found.runner_up is not None
        assert str(found.runner_up).startswith("FORM=Standard, STRUCTURE=7: also exact, GAIN 2.7, RESET 20.25, RATE 3.69")

    def test_an_ideal_derivative_is_not_imitated(self) -> None:
        found = convert("generic/standard", {"K": 2, "Ti": 20, "Td": 3}, "emerson/deltav")
        assert dials(found, "ALPHA", "GAIN", "RESET", "RATE") == [0.125, 2, 20, 3]
        assert found.certificate.feedback.loop_band.max_deviation == pytest.approx(0.061, abs=5e-4)

    def test_a_filter_that_is_only_assumed_is_not_imitated(self) -> None:
        given = {"GAIN": 2, "RSET": 0.5, "RATE": 0.1, "ALGO": "A", "MINorRPM": "MIN"}
        assert dials(convert("honeywell/udc", given, "emerson/deltav"), "ALPHA") == [0.125]

    @pytest.mark.parametrize(
        ("given", "options", "expected"),
        [
            ({"EQUATION": "ISA", "DERIVATIVE": "PV", "KC": 2, "TI": 1, "TD": 0.1}, {"DependIndepend": "true"}, [2, 1, 0.1]),
            ({"EQUATION": "independent", "KP": 2, "KI": 0.03, "KD": 12}, {"DependIndepend": "false"}, [2, 1.8, 0.2]),
        ],
    )
    def test_dependent_gains_stay_dependent(self, given: dict[str, object], options: dict[str, str], expected: list[float]) -> None:
        found = convert("allen-bradley/plc5", given, "allen-bradley/pide")
        assert found.settings.options["DependIndepend"] == options["DependIndepend"]
        assert dials(found, "PGain", "IGain", "DGain") == expected

    def test_smoothing_is_on_where_that_is_nearer(self) -> None:
        found = convert("fisher/provox", PROVOX, "allen-bradley/pide")
        assert {n: found.settings.options[n] for n in ("DSmoothing", "DependIndepend")} == {
            "DSmoothing": "true", "DependIndepend": "true",
        }  # fmt: skip

    def test_a_term_that_is_missing_is_missing_by_structure(self) -> None:
        found = convert("honeywell/tdc3000", {"K": 2, "T1": math.inf, "CTEQN": "A", "FORM": "ideal"}, "emerson/deltav")
        assert found.settings.options["STRUCTURE"] == "4"
        assert "RESET" not in {n for n, v in found.settings.items() if v.active}

    def test_zero_says_what_switches_off(self) -> None:
        with pytest.raises(SettingError, match="0 min/repeat would be infinite action; inf switches it off"):
            pidemu.load_card("honeywell/tdc3000").settings(K=2, T1=0)


class TestMatch:
    def test_beyond_five_percent_the_largest_deviation_is_least(self) -> None:
        source: dict[str, object] = {"K": 1, "Ti": 100, "Td": 55, "alpha": 0.18}
        found = convert("generic/series", source, "foxboro/ia-pid", given={"KD": 10})
        assert found.match == "constrained"
        process = pidemu.Process.from_lags(1, [100, 55], delay=20)
        loops = [
            convert("generic/series", source, "foxboro/ia-pid", given={"KD": 10}, process=process, match=m)
            for m in (None, "low-frequency")
        ]
        changes = [abs(c.certificate.loop.target.Ms / c.certificate.loop.source.Ms - 1) for c in loops if c.certificate.loop]
        assert changes[0] <= changes[1]
        assert "stays stable" not in found.sentence

    def test_without_a_process_nothing_is_claimed_of_margins(self) -> None:
        found = convert("generic/series", {"K": 1, "Ti": 100, "Td": 55, "alpha": 0.18}, "foxboro/ia-pid")
        assert "margin" not in found.sentence
        assert "where the crossover of the loop usually lies" in found.sentence.lower()


class TestScans:
    def test_settings_are_per_second(self) -> None:
        for scan in (None, 0.5, (0.5, 4.0)):
            assert dials(convert("generic/standard", {"K": 0.4, "Ti": 6}, "emerson/deltav", scan=scan), "GAIN", "RESET") == [0.4, 6]

    def test_making_up_for_scans_keeps_the_gain_of_a_controller_without_derivative(self) -> None:
        found = convert("generic/standard", {"K": 0.4, "Ti": 6}, "emerson/deltav", scan=(0.5, 4.0), compensate=True)
        assert dials(found, "GAIN", "RATE") == [0.4, 0]

    @pytest.mark.parametrize(("rule", "gain"), [("forward", 2.2), ("trapezoidal", 2.1)])
    def test_making_up_for_scans_meets_the_first_moment(self, rule: str, gain: float) -> None:
        options = {"INTEGRAL_RULE": rule}
        source: dict[str, object] = {"K": 2, "Ti": 20, "INTEGRAL_RULE": "backward"}
        found = convert("generic/standard", source, "generic/parallel", options=options, scan=(1, 2), compensate=True)
        assert dials(found, "kp", "ki") == pytest.approx([gain, 0.1])

    def test_what_is_executed_faster_than_it_computes_is_faster(self) -> None:
        given = {"EQUATION": "ISA", "KC": 2, "TI": 1, "TD": 0.1}
        found = convert("allen-bradley/plc5", given, "allen-bradley/logix-pid", scan=0.2, runs_every=0.02)
        assert dials(found, "KP", "KI", "KD") == [2, 0.1, 0.01]
        assert found.scan == (0.02, 0.02)

    def test_a_controller_that_measures_its_interval_has_no_other(self) -> None:
        with pytest.raises(pidemu.ScanError, match="measures its interval"):
            convert("simple-pid/simple-pid", {"Kp": 1, "Ki": 0.1}, "generic/parallel", scan=0.2, runs_every=0.02)

    def test_a_loss_of_more_than_a_degree_is_not_exact_and_a_gain_is(self) -> None:
        slower, faster = (convert("fisher/provox", PROVOX, "emerson/deltav", scan=scan) for scan in ((0.1, 1), (1, 0.1)))
        assert (slower.verdict, faster.verdict) == ("approximate", "exact")
        assert "The new controller scans more slowly: the loop loses" in slower.sentence
        assert "The new controller scans faster: the loop gains" in faster.sentence


class TestQuestions:
    def test_a_unit_that_an_option_decides_is_asked_for(self) -> None:
        (question,) = asked("honeywell/udc", {"GAIN": 2, "RSET": 0.5, "ALGO": "A"}, "allen-bradley/pide").questions
        assert (question.kind, question.about, [a.value for a in question.readings]) == ("option", "MINorRPM", ["MIN", "RPM"])
        resets = [a.conversion.settings["IGain"].value for a in question.readings if a.conversion is not None]
        assert resets == [0.5, 2]

    def test_what_cannot_matter_is_not_asked_and_said(self) -> None:
        found = convert("honeywell/tdc3000", {"K": 2, "T1": 1, "CTEQN": "B"}, "emerson/deltav")
        assert any("FORM is not stated; it makes no difference until T2 is used" in w for w in found.warnings)

    def test_a_difference_on_the_setpoint_alone_is_answered_with_the_other_beside(self) -> None:
        found = convert("honeywell/tdc3000", {"K": 2, "T1": 1, "FORM": "ideal"}, "emerson/deltav")
        assert found.settings.options["STRUCTURE"] == "1"
        assert any("CTEQN is not stated and A is taken; with C:" in str(b) for b in found.beside)

    def test_assuming_takes_the_defaults_and_says_so(self) -> None:
        found = convert("honeywell/udc", {"GAIN": 2, "RSET": 0.5, "ALGO": "A"}, "allen-bradley/pide", assume=True)
        assert found.settings["IGain"].value == 0.5
        assert found.sentence.startswith("Assuming MINorRPM = MIN, which was not stated.")

    def test_a_time_that_says_per_is_accepted(self) -> None:
        assert dials(convert("fisher/provox", {"GAIN": 2, "RESET": "9 min/repeat"}, "emerson/deltav"), "RESET") == [540]

    def test_software_runs_with_its_documented_defaults(self) -> None:
        found = convert("arduino/pid", {"Kp": 2, "Ki": 0.1, "Kd": 0}, "generic/parallel")
        assert dials(found, "kp", "ki") == [2, 0.1]


class TestWhatIsTakenForGranted:
    """What is assumed has to show, and a contradiction has no default."""

    def test_an_assumed_mode_shows_and_its_verdict_is_for_that_mode(self) -> None:
        found = convert("yokogawa/fieldbus-pid", {"GAIN": 0.6, "RESET": 8}, "emerson/deltav", scan=0.5, assume=True)
        assert found.assumed == ("mode = auto",)
        assert found.verdicts.keys() == {"auto"}

    def test_where_both_modes_lead_to_the_same_dials_nothing_is_asked_and_both_count(self) -> None:
        found = convert("yokogawa/fieldbus-pid", {"GAIN": 1.2, "RESET": 180, "RATE": 18}, "honeywell/udc", assume=True)
        assert found.verdicts.keys() == {"auto", "cascade"}
        assert found.assumed == ()

    def test_an_assumed_range_shows(self) -> None:
        found = pidemu.convert(
            pidemu.load_card("arduino/pid").settings(Kp=2, Ki=0.1, Kd=0), "emerson/deltav", assume=True, action="reverse"
        )
        assert found.assumed == ("pv_range = 0 to 100", "op_range = 0 to 100")
        assert found.sentence.startswith("Assuming pv_range = 0 to 100 and op_range = 0 to 100, which were not stated.")

    def test_a_contradiction_is_asked_about_whatever_is_assumed(self) -> None:
        found = asked("epics/epid", {"KP": -2, "KI": 0.1}, "generic/parallel", action="reverse", assume=True)
        assert [q.kind for q in found.questions] == ["action"]

    def test_gains_that_were_not_given_are_turned_as_well_where_the_action_is_right(self) -> None:
        (question,) = asked("simple-pid/simple-pid", {}, "generic/standard", action="direct").questions
        assert [dict(answer.given) for answer in question.readings] == [{}, {"Kp": -1.0}]
        assert all(answer.conversion is not None for answer in question.readings)

    @pytest.mark.parametrize(("gain", "action"), [(1, "direct"), (-1, "reverse")])
    def test_positive_feedback_is_refused(self, gain: float, action: str) -> None:
        process = pidemu.Process.from_lags(gain, [100], delay=10)
        with pytest.raises(SettingError, match="is positive feedback"):
            convert("fisher/provox", PROVOX, "emerson/deltav", process=process, action=action)
        other = "reverse" if action == "direct" else "direct"
        found = convert("fisher/provox", PROVOX, "emerson/deltav", process=process, action=other)
        assert found.certificate.loop is not None

    def test_a_bias_is_said_to_be_unused_where_the_integral_does_its_work(self) -> None:
        found = convert("fisher/provox", PROVOX, "emerson/deltav", bias=40)
        assert "The bias of 40 % is not used: the integral action finds the output at SP = PV." in found.warnings

    @pytest.mark.parametrize(
        ("limits", "message"),
        [
            ((90, 10), "give the lower limit first"),
            ((10, 10), "give the lower limit first"),
            ((math.nan, 10), "limits is nan; give a finite number"),
        ],
    )
    def test_limits_have_the_lower_one_first(self, limits: tuple[float, float], message: str) -> None:
        with pytest.raises(SettingError, match=message):
            convert("fisher/provox", PROVOX, "emerson/deltav", limits=limits)

    def test_compensation_needs_the_scans(self) -> None:
        with pytest.raises(SettingError, match="add --scan"):
            convert("fisher/provox", PROVOX, "emerson/deltav", compensate=True)

    def test_real_intervals_alone_are_those_computed_with(self) -> None:
        found = convert("fisher/provox", PROVOX, "emerson/deltav", runs_every=(1, 0.1))
        assert found.scan == (1, 0.1)
        assert (found.request.pace, dials(found, "RESET")) == ((1, 1), [15])
        assert any("Only the real intervals were stated" in w for w in found.warnings)

    def test_another_reading_with_the_same_dials_and_another_verdict_stands_beside(self) -> None:
        given = {"GAIN": 2, "RSET": 0.5, "RATE": 0.1, "MINorRPM": "MIN", "PBorGAIN": "GAIN"}
        found = convert("honeywell/udc", given, "generic/standard", assume=True)
        texts = [str(b) for b in found.beside if b.kind == "unstated"]
        assert any("ALGO is not stated" in t for t in texts)


class TestDigits:
    def test_from_python_nothing_is_rounded(self) -> None:
        assert convert("fisher/provox", PROVOX, "emerson/deltav").settings["ALPHA"].value == pytest.approx(1 / 7, rel=1e-12)

    def test_the_certificate_is_about_the_numbers_that_are_printed(self) -> None:
        found = convert("fisher/provox", PROVOX, "emerson/deltav", digits=3)
        assert found.settings["ALPHA"].value == 0.143
        assert found.unrounded["ALPHA"].value == pytest.approx(1 / 7)
        assert found.verdict == "exact"
        assert 0 < found.certificate.feedback.loop_band.max_deviation < 1e-3


class TestOutsideCards:
    def test_what_check_calls_an_error_is_refused_wherever_the_card_is_used(self, tmp_path: Path) -> None:
        text = Path("vendors/simple-pid/simple-pid.yaml").read_text(encoding="utf-8")
        file = tmp_path / "acme" / "oven.yaml"
        file.parent.mkdir()
        file.write_text(text.replace("Kp: {sets: gain, unit: eu/eu", "Kp: {sets: gain, unit: '%/%'"), encoding="utf-8")
        assert file.read_text(encoding="utf-8") != text
        with pytest.raises(pidemu.CardError, match=r"oven\.yaml:\d+:\d+:"):
            pidemu.load_card(file)


class TestSentences:
    def test_a_setpoint_path_that_differs_more_is_told_though_nothing_moves_at_once(self) -> None:
        """The ideal TDC has its lag on the output: a setpoint step moves nothing at once, and P follows behind the lag."""
        given = {"K": 2, "T1": 1, "T2": 0.2, "FORM": "ideal", "CTEQN": "B"}
        found = convert("honeywell/tdc3000", given, "honeywell/udc", options={"ALGO": "B"})
        assert found.certificate.setpoint_kick.source == found.certificate.setpoint_kick.target == 0
        assert "Setpoint changes: the first move of the output is the same, what follows is not." in found.sentence
