"""The verdict in words: each kind of sentence, from certificates made by hand and from conversions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

import pidemu
from pidemu.certificate.models import (
    Band,
    Certificate,
    Kick,
    LoopComparison,
    LoopFigures,
    NonlinearDifference,
    PathComparison,
    ScanByScan,
    ScanCost,
)
from pidemu.certificate.sentence import sentence

EXACT = "The new controller does what the old one did, to load disturbances and to setpoint changes alike."
FEEDBACK = (
    "Against disturbances, and in stability, the new controller does exactly what the old one did; "
    "setpoint changes will look different"
)
LITTLE = "That is little beside usual margins."
WATCH = "A loop with usual margins stays stable, but will look a little different: watch it after the cut-over."
MUCH = "That is much: expect to tune the loop again."
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
    return Certificate(
        feedback=feedback or path(), setpoint=setpoint or path(), setpoint_kick=Kick(*kick), time_scale=10.0, **at_scan, **more
    )


def run(largest: float, on_measurement: float, size: float = 8.0) -> ScanByScan:
    return ScanByScan((1.0, 1.0), False, largest, 30.0, "setpoint steps", on_measurement, size)


def loop(before: bool, after: bool) -> LoopComparison:
    stable, unstable = (LoopFigures(x, 3.0, 50.0, 2.0, 0.1, 1.5, 1.1, 10.0) for x in (True, False))
    return LoopComparison("1 exp(-3 s)/(10 s + 1)", stable if before else unstable, stable if after else unstable)


def test_equal_controllers_do_the_same() -> None:
    assert sentence(certificate()) == EXACT
    assert sentence(certificate(scan_by_scan=run(1e-8, 1e-8))) == EXACT


@pytest.mark.parametrize(
    ("kick", "words"),
    [
        ((2.0, 2.7), ": a step moves the output at once by 2.7 % per %, before it was 2."),
        ((2.0, 0.0), ": a step does not move the output at once, before it was 2."),
        ((0.0, 2.0), ": a step moves the output at once by 2 % per %, before it did not."),
        ((2.0, math.inf), ": a step spikes the output for one scan, before it was 2."),
        ((math.inf, 2.0), ": a step moves the output at once by 2 % per %, before it spiked it."),
        ((0.0, math.inf), ": a step spikes the output for one scan, before it did not."),
        ((math.inf, 0.0), ": a step does not move the output at once, before it spiked it."),
        ((math.inf, math.inf), "."),
        ((2.0, 2.0), "."),
        ((-2.0, -2.71828), ": a step moves the output at once by -2.72 % per %, before it was -2."),
    ],
)
def test_where_only_the_setpoint_differs_both_kicks_are_named(kick: tuple[float, float], words: str) -> None:
    assert sentence(certificate(setpoint=path(0.3), kick=kick)) == FEEDBACK + words


def test_at_the_scans_the_kick_is_the_one_of_the_first_scan() -> None:
    at_scan: dict[str, Any] = {"feedback_at_scan": path(), "setpoint_at_scan": path(0.3), "setpoint_kick_at_scan": Kick(3.0, 4.0)}
    found = sentence(certificate(kick=(math.inf, math.inf), **at_scan))
    assert found == FEEDBACK + ": a step moves the output at once by 4 % per %, before it was 3."


def test_what_counts_is_the_law_at_the_scans_where_there_is_one() -> None:
    assert sentence(certificate(path(0.3), path(0.3), feedback_at_scan=path(), setpoint_at_scan=path())) == EXACT
    worse = sentence(certificate(feedback_at_scan=path(0.012, 0.1, 0.5), setpoint_at_scan=path()))
    assert worse.startswith("The new controller comes within 1.2 % of the old one where the loop works: ")


def test_where_an_emulated_setpoint_step_alone_differs_it_is_the_setpoint() -> None:
    assert sentence(certificate(scan_by_scan=run(3.0, 1e-9))) == FEEDBACK + "."


@pytest.mark.parametrize(
    ("gain_db", "phase_deg", "advice"),
    [
        (0.0, 0.0, LITTLE),
        (0.6, 3.0, LITTLE),  # a tenth of 6 dB and 30 degrees
        (0.61, 3.0, WATCH),
        (0.6, 3.1, WATCH),
        (2.0, 10.0, WATCH),  # a third
        (2.1, 1.0, MUCH),
        (0.1, 10.1, MUCH),
        (math.inf, 180.0, MUCH),
    ],
)
def test_an_approximate_one_is_judged_by_usual_margins(gain_db: float, phase_deg: float, advice: str) -> None:
    assert sentence(certificate(path(0.1234, gain_db, phase_deg))) == (
        "The new controller comes within 12 % of the old one where the loop works: up to "
        f"{gain_db:.2f} dB of gain margin and {phase_deg:.1f} degrees of phase margin may be lost or won. {advice}"
    )


@pytest.mark.parametrize(
    ("deviation", "words"),
    [
        (0.00004567, "0.0046 %"),
        (0.01, "1 %"),
        (0.126, "13 %"),
        (1.26, "130 %"),
        (9.99, "1000 %"),
        (10.1, "more than 1000 %"),
        (math.inf, "more than 1000 %"),
    ],
)
def test_deviations_have_two_digits(deviation: float, words: str) -> None:
    assert f"comes within {words} of the old one" in sentence(certificate(path(deviation)))


def test_equal_laws_that_run_differently_are_said_to() -> None:
    same = (
        "Against disturbances the two equations are the same, but run scan by scan, with the setpoint at rest, "
        "they differ by up to "
    )
    found = sentence(certificate(scan_by_scan=run(0.5, 0.25)))
    reason = "because of scan rule, arithmetic or a nonlinear option."
    assert found == f"{same}0.25 % of span on test signals that move the output by 8 %, {reason}"
    other = sentence(certificate(setpoint=path(0.3), kick=(2.0, 1.0), scan_by_scan=run(0.5, 0.25)))
    assert other == f"{found} Setpoint changes will look different: a step moves the output at once by 1 % per %, before it was 2."


@pytest.mark.parametrize("aspect", ["error", "output"])
def test_a_nonlinear_option_that_the_record_does_not_show_is_named_all_the_same(aspect: str) -> None:
    bent = (NonlinearDifference(aspect, "output deadband [%]: 0.5", {}),)
    assert sentence(certificate(scan_by_scan=run(1e-9, 1e-9), nonlinear=bent)) == (
        "Against disturbances the two equations are the same, but one has a nonlinear option that the other has not: see what to "
        "watch for."
    )


@pytest.mark.parametrize("aspect", ["windup", "transfer", "limits", "arithmetic"])
def test_what_shows_at_limits_and_transfers_alone_changes_no_verdict(aspect: str) -> None:
    assert sentence(certificate(scan_by_scan=run(0.0, 0.0), nonlinear=(NonlinearDifference(aspect, "", {}),))) == EXACT


def test_a_setpoint_that_moves_otherwise_makes_setpoint_changes_different() -> None:
    limited = (NonlinearDifference("setpoint", "setpoint rate limit", {}),)
    assert sentence(certificate(scan_by_scan=run(0.0, 0.0), nonlinear=limited)) == FEEDBACK + "."


class TestLoop:
    """What is said of the loop comes last, and louder where it is worse."""

    def test_a_stable_loop_needs_no_words(self) -> None:
        assert sentence(certificate(loop=loop(True, True))) == EXACT

    def test_a_loop_that_becomes_unstable_is_a_reason_not_to_use_the_settings(self) -> None:
        found = sentence(certificate(path(0.9, 5.0, 40.0), loop=loop(True, False)))
        assert found.endswith(f"{MUCH} {UNSTABLE}")

    def test_a_loop_that_was_unstable_raises_doubts_about_the_process(self) -> None:
        assert sentence(certificate(loop=loop(False, False))) == (
            f"{EXACT} With this process the loop is unstable, before and after: check the process, or the action."
        )
        assert sentence(certificate(loop=loop(False, True))).endswith(
            "With this process the loop is unstable before and stable after: check the process."
        )

    def test_small_deviations_in_the_band_do_not_hide_an_unstable_loop(self) -> None:
        assert UNSTABLE in sentence(certificate(path(0.01, 0.1, 0.5), loop=loop(True, False)))


class TestScansTooLong:
    """Half the scan rate within the loop band leaves figures of a part of it."""

    def test_the_sentence_then_says_so_and_gives_no_margins(self) -> None:
        short = replace(path(0.2, 1.0, 5.0), loop_band=Band(0.001, 0.3, 0.2, 1.0, 5.0, 0.1))  # 5/Ti is 0.5 rad/s
        found = sentence(
            certificate(feedback_at_scan=short, setpoint_at_scan=path(0.1), scan_cost=ScanCost(0.3, 4.0, False, 0.2, cut=True))
        )
        assert found.startswith("A scan interval is too long for this loop, whose integral time is 10 s: ")
        assert "margin" not in found

    def test_a_band_that_is_whole_is_judged_as_ever(self) -> None:
        found = sentence(
            certificate(feedback_at_scan=path(0.2, 1.0, 5.0), setpoint_at_scan=path(), scan_cost=ScanCost(0.5, 4.0, False, 0.2))
        )
        assert found.endswith(WATCH)

    def test_with_a_process_the_band_ends_elsewhere(self) -> None:
        short = replace(path(0.2, 1.0, 5.0), loop_band=Band(0.001, 0.3, 0.2, 1.0, 5.0, 0.1))
        cost = ScanCost(0.3, 4.0, False, 0.2)
        found = sentence(certificate(feedback_at_scan=short, setpoint_at_scan=path(0.1), scan_cost=cost, loop=loop(True, True)))
        assert found.endswith(WATCH)


CASES: dict[str, tuple[dict[str, object], str, dict[str, Any], str]] = {
    "exact": ({"K": 2, "Ti": 30, "Td": 4, "Tf": 0.5}, "generic/parallel", {}, EXACT),
    "setpoint": (
        {"K": 2, "Ti": 30, "b": 0},
        "generic/series",
        {},
        FEEDBACK + ": a step moves the output at once by 2 % per %, before it did not.",
    ),
    "spike": (
        {"K": 2, "Ti": 30, "Td": 4, "c": 0},
        "generic/series",
        {},
        FEEDBACK + ": a step spikes the output for one scan, before it was 2.",
    ),
    "filter": (
        {"K": 2, "Ti": 30, "Td": 4, "Tf": 0.5},
        "generic/parallel",
        {"given": {"Tf": 4}},
        "The new controller comes within ",
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
    found = pidemu.convert(source, "generic/parallel", process=process, scan=(0.1, 1.5), compensate=False)
    loop_ = found.certificate.loop
    assert loop_ is not None
    assert (loop_.source.stable, loop_.target.stable) == (True, False)
    # the same by simulation: it goes on swinging, from limit to limit
    before, after = (pidemu.simulate(s, process, h, setpoint=0, time=300) for s, h in ((source, 0.1), (found.settings, 1.5)))
    assert abs(before.error[-1]) < 0.1
    assert max(abs(after.error[-20:])) > 1
    assert found.sentence.endswith(UNSTABLE)
