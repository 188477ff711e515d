"""The verdict in words: each kind of sentence, from certificates made by hand and from conversions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

import pidemu
from pidemu.analysis.loop_figures import LoopComparison, LoopFigures
from pidemu.certificate.models import (
    Band,
    Certificate,
    EmulationFigures,
    Kick,
    NonlinearDifference,
    PathComparison,
    ScanByScan,
    ScanCost,
)
from pidemu.certificate.sentence import sentence

EXACT = "The new controller does what the old one did, for disturbances and for setpoint changes."
FEEDBACK = "For disturbances and in stability, the new controller does what the old one did; setpoint changes differ: "
SAME = "The two equations are the same; "
FIRST = "the first move of the output is the same, what follows is not."
STEP = "a step of 1 % moves the output at once by"
NOT = "with the old controller it did not"
UNSTABLE = "WITH THIS PROCESS THE LOOP WOULD BE UNSTABLE: do not use these settings."


def path(deviation: float = 0.0, gain_db: float = 0.0, phase_deg: float = 0.0) -> PathComparison:
    """Loop band 0.001 to 0.5 rad/s, which are those of an integral time of 10 s."""
    return PathComparison(
        Band(0.001, 0.5, deviation, gain_db, phase_deg, 0.1), Band(0.001, 5.0, 2 * deviation, 2 * gain_db, 2 * phase_deg, 1.0)
    )


def certificate(
    feedback: PathComparison | None = None,
    setpoint: PathComparison | None = None,
    kick: tuple[float, float] = (2.0, 2.0),
    **more: Any,
) -> Certificate:
    at_scan = {name: more.pop(name, None) for name in ("feedback_at_scan", "setpoint_at_scan", "setpoint_kick_at_scan")}
    ran = EmulationFigures(**{name: more.pop(name) for name in ("scan_by_scan", "nonlinear") if name in more})
    return Certificate(
        feedback=feedback or path(),
        setpoint=setpoint or path(),
        setpoint_kick=Kick(*kick),
        time_scale=10.0,
        emulation=ran,
        **at_scan,
        **more,
    )


def run(largest: float, on_measurement: float, *, same_rules: bool = True, scan: tuple[float, float] = (1.0, 1.0)) -> ScanByScan:
    return ScanByScan(scan, False, largest, 30.0, "setpoint steps", on_measurement, 8.0, same_rules)


def loop(before: bool, after: bool) -> LoopComparison:
    stable, unstable = (LoopFigures(x, 3.0, 50.0, 2.0, 0.1, 1.5, 1.1, 10.0) for x in (True, False))
    return LoopComparison("1 exp(-3 s)/(10 s + 1)", stable if before else unstable, stable if after else unstable)


def test_equal_controllers_do_the_same() -> None:
    assert sentence(certificate()) == EXACT
    assert sentence(certificate(scan_by_scan=run(1e-8, 1e-8))) == EXACT


@pytest.mark.parametrize(
    ("kick", "words"),
    [
        ((2.0, 2.7), "a step of 1 % moves the output at once by 2.7 %; with the old controller it moved it by 2 %."),
        ((2.0, 0.0), "a step of 1 % does not move the output at once; with the old controller it moved it by 2 %."),
        ((0.0, 2.0), "a step of 1 % moves the output at once by 2 %; with the old controller it did not."),
        ((2.0, math.inf), "a step of 1 % spikes the output for one scan; with the old controller it moved it by 2 %."),
        ((math.inf, 2.0), "a step of 1 % moves the output at once by 2 %; with the old controller it spiked it."),
        ((0.0, math.inf), "a step of 1 % spikes the output for one scan; with the old controller it did not."),
        ((math.inf, 0.0), "a step of 1 % does not move the output at once; with the old controller it spiked it."),
        ((math.inf, math.inf), FIRST),
        ((2.0, 2.0), FIRST),
        ((-2.0, -2.71828), "a step of 1 % moves the output at once by -2.72 %; with the old controller it moved it by -2 %."),
    ],
)
def test_where_only_the_setpoint_differs_both_kicks_are_named(kick: tuple[float, float], words: str) -> None:
    assert sentence(certificate(setpoint=path(0.3), kick=kick)) == FEEDBACK + words


@pytest.mark.parametrize(
    ("auto", "cascade", "words"),
    [
        (0.0, 0.3, f"setpoint changes are the same in automatic and differ in cascade: {STEP} 4 %"),
        (0.3, 0.0, f"setpoint changes are the same in cascade and differ in automatic: {STEP} 2 %"),
        (0.3, 0.3, f"setpoint changes differ: in automatic, {STEP} 2 %; {NOT}; in cascade, {STEP} 4 %"),
    ],
)  # fmt: skip
def test_where_the_equation_depends_on_the_mode_each_mode_is_spoken_of(auto: float, cascade: float, words: str) -> None:
    found = sentence(
        certificate(setpoint=path(auto), kick=(0.0, 2.0), setpoint_in_cascade=path(cascade), kick_in_cascade=Kick(0.0, 4.0))
    )
    begin = "For disturbances and in stability, the new controller does what the old one did; "
    assert found == f"{begin}{words}; with the old controller it did not."


def test_settings_that_make_up_for_the_scans_are_judged_at_the_scans() -> None:
    assert sentence(certificate(path(0.3), path(0.3), feedback_at_scan=path(), setpoint_at_scan=path(), compensated=True)) == EXACT


def test_plain_settings_are_judged_by_the_continuous_laws() -> None:
    assert sentence(certificate(feedback_at_scan=path(0.3), setpoint_at_scan=path(0.3))) == EXACT


@pytest.mark.parametrize(
    ("gain_db", "phase_deg", "words"),
    [(0.6, 3.0, "0.6 dB and its phase by up to 3 degrees"), (2.14159, 10.4567, "2.14 dB and its phase by up to 10.5 degrees")],
)
def test_an_approximate_one_is_described_by_gain_and_phase_and_claims_no_margins(
    gain_db: float, phase_deg: float, words: str
) -> None:
    found = sentence(certificate(path(0.1234, gain_db, phase_deg)))
    assert found == f"Where the crossover of the loop usually lies, the controller's gain differs by up to {words}."


def test_with_a_process_the_crossover_is_known() -> None:
    assert sentence(certificate(path(0.1, 1.0, 5.0), loop=loop(True, True))).startswith("Where the crossover of the loop lies, ")


def test_an_approximate_one_says_what_becomes_of_the_kick_where_it_changes() -> None:
    assert sentence(certificate(path(0.1, 1.0, 5.0), kick=(2.0, 2.03))).endswith("5 degrees.")  # within 2 %
    assert sentence(certificate(path(0.1, 1.0, 5.0), kick=(2.0, 2.8))).endswith(
        "5 degrees. Setpoint changes: a step of 1 % moves the output at once by 2.8 %; with the old controller it moved it by 2 %."
    )


def test_controllers_of_which_one_does_not_respond_are_not_compared_in_decibels() -> None:
    assert sentence(certificate(path(math.inf, math.inf, math.inf))) == (
        "Where the crossover of the loop usually lies, the two cannot be compared, since one of them does not respond."
    )


def test_equal_laws_by_the_same_rules_whose_outputs_differ_are_said_to() -> None:
    differ = "but emulated scan by scan, the outputs differ by up to 0.25 % of span."
    assert sentence(certificate(scan_by_scan=run(0.5, 0.25))) == SAME + differ
    other = sentence(certificate(setpoint=path(0.3), kick=(2.0, 1.0), scan_by_scan=run(0.5, 0.25)))
    step = "a step of 1 % moves the output at once by 1 %; with the old controller it moved it by 2 %."
    assert other == f"{SAME}{differ} Setpoint changes differ too: {step}"


def test_outputs_that_differ_since_the_rules_do_change_no_verdict() -> None:
    assert sentence(certificate(scan_by_scan=run(0.5, 0.25, same_rules=False))) == EXACT


@pytest.mark.parametrize(
    ("aspect", "words"),
    [
        ("error", "what is done to the error"),
        ("output", "what is done to the output"),
        ("arithmetic", "the arithmetic they are computed with"),
    ],
)
def test_what_is_nonlinear_inside_the_limits_is_named_though_the_record_does_not_show_it(aspect: Any, words: str) -> None:
    bent = (NonlinearDifference(aspect, "output deadband [%]: 0.5", {}),)
    assert sentence(certificate(scan_by_scan=run(1e-9, 1e-9), nonlinear=bent)) == f"{SAME}what differs is {words}."


@pytest.mark.parametrize("aspect", ["transfer", "limits", "bias"])
def test_what_shows_at_transfers_alone_changes_no_verdict(aspect: Any) -> None:
    assert sentence(certificate(scan_by_scan=run(0.0, 0.0), nonlinear=(NonlinearDifference(aspect, "", {}),))) == EXACT


def test_two_that_recover_differently_from_a_limit_are_alike_inside_their_limits() -> None:
    recovery = (NonlinearDifference("windup", "", {}),)
    assert sentence(certificate(nonlinear=recovery)) == EXACT.replace("changes.", "changes, inside its limits.")
    assert sentence(certificate(nonlinear=recovery), ["P acts on the error"]) == EXACT.replace(
        "changes.", "changes, inside its limits, if P acts on the error."
    )


def test_two_that_stay_apart_after_a_limit_are_not_called_alike() -> None:
    assert sentence(certificate(shifts_for_good=True)) == (
        f"{SAME}but without integral action the new controller does not hold the output as the old one did, once it was at a limit."
    )


def test_a_setpoint_that_moves_otherwise_makes_setpoint_changes_different() -> None:
    limited = (NonlinearDifference("setpoint", "setpoint rate limit", {"setpoint rate limit [%/s]": (2.0, math.inf)}),)
    assert (
        sentence(certificate(scan_by_scan=run(0.0, 0.0), nonlinear=limited))
        == FEEDBACK + "the two do not limit the rate of the setpoint alike."
    )
    in_manual = (NonlinearDifference("setpoint", "in manual the setpoint follows the measurement", {}),)
    assert sentence(certificate(scan_by_scan=run(0.0, 0.0), nonlinear=in_manual)) == EXACT


@pytest.mark.parametrize(("cost", "coarse"), [(0.0009, False), (0.002, True)])
def test_dials_that_round_coarsely_cost_the_verdict_from_a_thousandth_on(cost: float, coarse: bool) -> None:
    found = sentence(
        certificate(path(cost, 0.017, 0.1), feedback_before_rounding=path(), setpoint_before_rounding=path(), setpoint=path(cost))
    )
    gain = (
        "but the dials round so coarsely that the controller's gain differs by up to 0.017 dB and its phase by up to 0.1 degrees."
    )
    assert found == (SAME + gain if coarse else EXACT)


def test_what_the_verdict_rests_on_stands_in_the_sentence_two_facts_in_full() -> None:
    assert sentence(certificate(), ["a"]) == EXACT.replace("changes.", "changes, if a.")
    assert sentence(certificate(), ["a", "b"]) == EXACT.replace("changes.", "changes, if a and b.")
    assert sentence(certificate(), ["a", "b", "c", "d"]) == EXACT.replace("changes.", "changes, if a and b (and 2 more, below).")


def test_what_was_assumed_comes_first() -> None:
    assert sentence(certificate(), assumed=["FORM = ideal"]) == f"Assuming FORM = ideal, which was not stated. {EXACT}"
    assert sentence(certificate(), assumed=["A = 1", "B = 2"]) == f"Assuming A = 1 and B = 2, which were not stated. {EXACT}"


class TestLoop:
    """What is said of the loop comes last, and louder where it is worse."""

    def test_margins_are_stated_before_and_after(self) -> None:
        assert sentence(certificate(loop=loop(True, True))) == (
            f"{EXACT} With this process: gain margin from 3 to 3, phase margin from 50 to 50 degrees, Ms from 1.5 to 1.5."
        )

    def test_a_margin_that_is_infinite_is_left_out(self) -> None:
        figures = LoopFigures(True, math.inf, 50.0, 2.0, 0.1, 1.5, 1.1, 10.0)
        both = LoopComparison("1/(10 s + 1)", figures, replace(figures, phase_margin=45.678, Ms=1.6))
        assert sentence(certificate(loop=both)) == (
            f"{EXACT} With this process: phase margin from 50 to 45.7 degrees, Ms from 1.5 to 1.6."
        )

    def test_a_loop_that_becomes_unstable_is_a_reason_not_to_use_the_settings(self) -> None:
        assert sentence(certificate(path(0.9, 5.0, 40.0), loop=loop(True, False))).endswith(f"40 degrees. {UNSTABLE}")

    def test_a_loop_that_was_unstable_raises_doubts_about_the_process(self) -> None:
        assert sentence(certificate(loop=loop(False, False))) == (
            f"{EXACT} With this process the loop is unstable, before and after: check the process, or the action."
        )
        assert sentence(certificate(loop=loop(False, True))).endswith(
            "With this process the loop is unstable before and stable after: check the process."
        )

    def test_small_deviations_in_the_band_do_not_hide_an_unstable_loop(self) -> None:
        assert UNSTABLE in sentence(certificate(path(0.01, 0.1, 0.5), loop=loop(True, False)))


class TestScans:
    """What the scans cost is said apart from the laws, with its sign."""

    LOSES = f"{SAME}what differs is how they are computed, scan by scan."

    def test_phase_that_is_gained_leaves_it_exact_and_is_stated(self) -> None:
        cost = ScanCost(0.0987654, -4.0514)
        assert sentence(certificate(scan_cost=cost, scan_by_scan=run(9.0, 9.0, same_rules=False, scan=(2.0, 0.5)))) == (
            f"{EXACT} The new controller scans faster: the loop gains 4.05 degrees of phase at 0.0988 rad/s."
        )

    def test_a_degree_that_is_lost_leaves_it_exact_and_is_stated(self) -> None:
        cost = ScanCost(0.1, 1.0)
        assert sentence(certificate(scan_cost=cost, scan_by_scan=run(9.0, 9.0, same_rules=False, scan=(0.5, 1.0)))) == (
            f"{EXACT} The new controller scans more slowly: the loop loses 1 degrees of phase at 0.1 rad/s."
        )

    def test_more_than_a_degree_that_is_lost_does_not(self) -> None:
        found = sentence(certificate(scan_cost=ScanCost(0.1, 1.01), scan_by_scan=run(9.0, 9.0, same_rules=False)))
        assert found == (
            f"{self.LOSES} As the two integrate or differentiate by different rules, the loop loses 1.01 degrees of phase at "
            "0.1 rad/s."
        )

    def test_next_to_nothing_is_not_worth_a_word(self) -> None:
        assert sentence(certificate(scan_cost=ScanCost(0.1, 0.049))) == EXACT

    def test_settings_that_make_up_for_the_scans_are_exact_whatever_the_scans_cost(self) -> None:
        cost = ScanCost(0.1, 5.0)
        assert sentence(certificate(scan_cost=cost, compensated=True)).startswith(EXACT)

    @pytest.mark.parametrize(
        ("slow", "words", "remedy"),
        [
            ("source", "The old scan was too slow", "What the new scan changes cannot be said: watch the loop after the cut-over."),
            ("target", "The new scan is too slow", "Scan faster, or tune the loop slower."),
            ("both", "Both scans are too slow", "Scan faster, or tune the loop slower."),
        ],
    )  # fmt: skip
    def test_a_scan_that_is_too_slow_is_named_and_no_figure_stands_for_it(self, slow: Any, words: str, remedy: str) -> None:
        assert sentence(certificate(scan_cost=ScanCost(0.3, math.inf, slow))) == (
            f"{self.LOSES} {words} for this loop: the crossover lies above half the scan rate. {remedy}"
        )


CASES: dict[str, tuple[dict[str, object], str, dict[str, Any], str]] = {
    "exact": ({"K": 2, "Ti": 30, "Td": 4, "Tf": 0.5}, "generic/parallel", {}, EXACT),
    "setpoint": (
        {"K": 2, "Ti": 30, "b": 0},
        "generic/series",
        {},
        FEEDBACK + "a step of 1 % moves the output at once by 2 %; with the old controller it did not.",
    ),
    "spike": (
        {"K": 2, "Ti": 30, "Td": 4, "c": 0},
        "generic/series",
        {},
        FEEDBACK + "a step of 1 % spikes the output for one scan; with the old controller it moved it by 2 %.",
    ),
    "filter": (
        {"K": 2, "Ti": 30, "Td": 4, "Tf": 0.5},
        "generic/parallel",
        {"given": {"Tf": 4}},
        "Where the crossover of the loop usually lies, the controller's gain differs by up to ",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_conversion_says_it(name: str) -> None:
    given, target, more, words = CASES[name]
    found = pidemu.convert(pidemu.load_card("generic/standard").settings(given), target, emulate=False, **more)
    assert found.sentence.startswith(words)
    assert found.sentence == sentence(found.certificate) == found.to_dict()["sentence"]


def test_a_conversion_that_makes_the_loop_unstable_says_so() -> None:
    source = pidemu.load_card("generic/standard").settings(K=8, Ti=30, Td=0.5, Tf=0.2)
    process = pidemu.Process.from_lags(1.0, lags=[10], delay=1.2)
    found = pidemu.convert(source, "generic/parallel", process=process, scan=(0.1, 1.5))
    loop_ = found.certificate.loop
    assert loop_ is not None
    assert (loop_.source.stable, loop_.target.stable) == (True, False)
    # the same by simulation: it goes on swinging, from limit to limit
    before, after = (pidemu.simulate(s, process, h, setpoint=0, time=300) for s, h in ((source, 0.1), (found.settings, 1.5)))
    assert abs(before.error[-1]) < 0.1
    assert max(abs(after.error[-20:])) > 1
    assert found.sentence.endswith(UNSTABLE)


def test_a_rate_limit_of_the_setpoint_on_one_side_alone_is_named() -> None:
    dials = {"Kp": 2, "Ki": 0.1, "Kd": 0, "Tf": 0.1, "b": 1, "c": 0, "rRampMax": 1}
    c = pidemu.convert(pidemu.load_card("gnc-tools/cpid").settings(dials), "generic/parallel")
    assert c.verdict == "exact-feedback"
    assert c.sentence.endswith("setpoint changes differ: the two do not limit the rate of the setpoint alike.")
