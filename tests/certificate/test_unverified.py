"""What no source states and a result rests on: only what is at work at the settings given."""

from __future__ import annotations

import pidemu
from pidemu.certificate.unverified import facts, unverified_law, unverified_program


def law_paths(card: str, *, rules: bool = False, **given: object) -> list[str]:
    return [s.path for s in unverified_law(pidemu.load_card(card).settings(given), rules=rules)]


def program_paths(card: str, **given: object) -> list[str]:
    return [s.path for s in unverified_program(pidemu.load_card(card).settings(given))]


def test_the_filter_that_provox_only_assumes_counts_where_there_is_a_derivative() -> None:
    assert law_paths("fisher/provox", GAIN=2, RESET=4, RATE=0.1) == ["derivative.filter.applies-to", "derivative.filter.ratio"]
    assert law_paths("fisher/provox", GAIN=2, RESET=4) == []


def test_scan_rules_count_for_the_law_of_a_scan_interval_alone_and_without_a_derivative_its_rule_does_not() -> None:
    assert law_paths("fisher/provox", rules=True, GAIN=2, RESET=4) == ["integral.rule"]


def test_an_option_that_makes_the_same_law_does_not_count() -> None:
    """At T2 = 0 ideal and interactive form of the TDC 3000 are one."""
    assert "FORM" not in law_paths("honeywell/tdc3000", K=2, T1=5)


def test_a_choice_that_was_made_does_not_count_and_one_that_was_not_does() -> None:
    left_open = law_paths("emerson/deltav", GAIN=2, RESET=20)
    stated = law_paths("emerson/deltav", GAIN=2, RESET=20, STRUCTURE=1, FRSIPID_OPTS="none")
    assert left_open == ["STRUCTURE", "FRSIPID_OPTS", "proportional.on", "integral.on"]
    assert stated == ["proportional.on", "integral.on"]  # inferred from the fieldbus block, whatever was chosen


def test_limits_that_are_given_and_a_scan_interval_that_is_given_are_not_the_cards() -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    found = {s.path for s in unverified_program(settings)} - {s.path for s in unverified_program(settings, scan=True, limits=True)}
    assert found == {"scan.default", "output.limits"}


def test_a_program_without_integral_rests_on_no_windup_scheme() -> None:
    assert "integral.windup.scheme" in program_paths("fisher/provox", GAIN=2, RESET=4)
    assert "integral.windup.scheme" not in program_paths("fisher/provox", GAIN=2, RESET="off")


def test_a_line_says_status_field_value_and_why() -> None:
    settings = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    assert str(facts(unverified_law(settings))[1]) == (
        "assumed: derivative.filter.ratio = 0.125 "
        "(not found for PROVOX; 0.1 to 0.125 is what Smuts calls usual for controllers in general)"
    )
