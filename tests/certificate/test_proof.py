"""The proof that two controllers have the same law: worked examples, near misses, and agreement with the verdict in floats."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from sympy.parsing.sympy_parser import convert_xor, implicit_multiplication, parse_expr, standard_transformations

import pidemu
from pidemu.certificate.linear import certify
from pidemu.certificate.models import EXACT
from pidemu.certificate.proof import Proof, prove
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import SettingError
from pidemu.settings.settings import Settings
from tests.conversion.exact_pairs import EXACT as EXACT_PAIRS
from tests.conversion.exact_pairs import FEEDBACK, Pair
from tests.conversion.support import needed, settings_that_act
from tests.conversion.usual import CARDS, SOURCES
from tests.helpers import made_up_card

PAIRS = list(itertools.product(CARDS, CARDS))
PARSED = (*standard_transformations, implicit_multiplication, convert_xor)
TOLD_APART = 1e-13
"""Difference of coefficients from which on two laws are never taken for the same: 25 times what the proof takes for rounding."""


def of(card: str, **values: object) -> Settings:
    return pidemu.load_card(card).settings(**values)


PROVOX = of("fisher/provox", GAIN=2, RESET="15 s/repeat", RATE="6 s")
DELTAV = {"GAIN": 2.7, "RESET": 20.25, "RATE": 133 / 36, "ALPHA": 27 / 133, "FORM": "Standard"}


def both_sides(line: str) -> list[Any]:
    """Both sides of a printed law, read by sympy."""
    names = {"s": sp.Symbol("s"), "sqrt": sp.sqrt}
    return [sp.sympify(parse_expr(side, names, transformations=PARSED), rational=True) for side in line.split(" = ")]


def assert_checks_by_hand(proof: Proof) -> None:
    """What is printed of a path is one function, on both sides of both lines where the paths are proven equal."""
    for path in proof.paths:
        source, target = both_sides(path.source), both_sides(path.target)
        for side in (*source, *target) if path.equal else source:
            assert sp.simplify(side - source[0]) == 0
        assert sp.simplify(target[0] - target[-1]) == 0


def test_provox_is_deltav_standard_with_the_numbers_of_the_worked_example() -> None:
    proof = prove(PROVOX, of("emerson/deltav", **DELTAV))
    assert (proof.decided, proof.feedback_equal, proof.setpoint_equal) == (True, True, False)
    assert proof.dials == {
        "GAIN": "27/10 %/%", "RESET": "81/4 s/repeat", "RATE": "133/36 s", "ALPHA": "27/133", "PV_FTIME": "0 s", "SP_FTIME": "0 s"
    }  # fmt: skip
    law = "(2/15 + 14/5 s + 12 s^2)/(s (1 + 3/4 s))"
    assert proof.source_law == f"2 (1 + 1/(15 s)) (1 + 6 s)/(1 + 3/4 s) = {law}"
    assert proof.target_law == f"27/10 (1 + 1/(81/4 s) + 133/36 s/(1 + 3/4 s)) = {law}"
    assert proof.residual < 1e-15
    assert_checks_by_hand(proof)


def test_the_setpoint_weight_that_keeps_the_kick_is_a_fraction() -> None:
    proof = prove(PROVOX, of("emerson/deltav", **DELTAV, STRUCTURE=7, BETA=2 / 2.7, GAMMA=0))
    assert (proof.feedback_equal, proof.setpoint_equal) == (True, True)
    assert proof.dials["BETA"] == "20/27"


def test_a_filter_ratio_of_a_seventh_turns_a_lead_lag_into_a_filtered_derivative_term() -> None:
    proof = prove(PROVOX, of("emerson/deltav", GAIN=2, RESET=15, RATE=5.25, ALPHA=1 / 7, FORM="Series", STRUCTURE=1))
    assert (proof.feedback_equal, proof.setpoint_equal) == (True, True)
    assert {n: proof.dials[n] for n in ("GAIN", "RESET", "RATE", "ALPHA")} == {
        "GAIN": "2 %/%", "RESET": "15 s/repeat", "RATE": "21/4 s", "ALPHA": "1/7"
    }  # fmt: skip
    assert_checks_by_hand(proof)


def test_series_dials_are_roots_of_a_quadratic() -> None:
    source = of("generic/standard", K=1, Ti=5, Td=1, Tf="0.25 s")  # n0 = 1/5, n1 = 21/20, n2 = 5/4: a root of 41/400
    conversion = pidemu.convert(source, "generic/series", emulate=False)
    proof = prove(source, conversion.settings)
    assert proof.feedback_equal
    assert proof.rounded
    assert all("sqrt(41)" in proof.dials[name] for name in ("K", "Ti", "Td", "alpha"))
    assert_checks_by_hand(proof)


def test_a_double_root_is_proven_though_floats_lose_half_their_digits_there() -> None:
    source = of("generic/parallel", kp=1.4, ki=0.07, kd=7.0)  # Ti = 4 Td
    conversion = pidemu.convert(source, "generic/series", emulate=False)
    proof = prove(source, conversion.settings)
    assert proof.feedback_equal
    assert {k: v for k, v in proof.dials.items() if k in ("K", "Ti", "Td")} == {"K": "7/10 %/%", "Ti": "10 s", "Td": "10 s"}


@pytest.mark.parametrize("pair", [*EXACT_PAIRS, *FEEDBACK], ids=str)
def test_every_pair_that_is_exact_is_proven(pair: Pair) -> None:
    source = of(pair.source, **pair.given)
    conversion = pidemu.convert(source, pair.target, options=pair.options, given=pair.dials, emulate=False)
    proof = prove(source, conversion.settings, conversion.factor, "auto")
    assert (proof.decided, proof.feedback_equal) == (True, True)
    assert proof.setpoint_equal == (pair.verdict == "exact")
    assert_checks_by_hand(proof)
    assert json.loads(json.dumps(proof.to_dict()))["feedback_equal"] is True


@given(data=st.data())
@settings(max_examples=150)
def test_the_proof_agrees_with_the_comparison_of_floats_over_all_pairs_of_cards(data: st.DataObject) -> None:
    conversion = converted(data)
    proof = prove(conversion.source, conversion.settings, conversion.factor, "auto", EXACT)
    assume(proof.decided)
    floats = certify(conversion.source.law(), conversion.settings.law(), None, conversion.factor)
    assert proof.feedback_equal == floats.feedback.is_exact
    if proof.feedback_equal:
        assert proof.setpoint_equal == floats.setpoint.is_exact


@given(data=st.data())
@settings(max_examples=60)
def test_what_is_exact_in_floats_is_proven_on_the_feedback_path(data: st.DataObject) -> None:
    # the setpoint path may stay open, where a setpoint filter in Hz cancels a zero: 2 pi is no fraction
    conversion = converted(data)
    floats = certify(conversion.source.law(), conversion.settings.law(), None, conversion.factor)
    assume(floats.feedback.is_exact)
    assert prove(conversion.source, conversion.settings, conversion.factor, "auto", EXACT).feedback_equal


def converted(data: st.DataObject) -> pidemu.Conversion:
    source, target = data.draw(st.sampled_from(PAIRS))
    drawn = settings_that_act(data, pidemu.load_card(source))
    held = {} if source == target else needed(pidemu.load_card(target))
    try:
        return pidemu.convert(drawn, target, given=held, emulate=False)
    except ConversionRefusedError:
        assume(False)
        raise


@pytest.mark.parametrize("dial", ["GAIN", "RESET", "RATE", "ALPHA"])
@pytest.mark.parametrize("change", [1e-12, -1e-12])
def test_a_target_off_by_a_trillionth_is_told_apart(dial: str, change: float) -> None:
    values = {name: x * (1 + change) if name == dial else x for name, x in DELTAV.items() if isinstance(x, float)}
    proof = prove(PROVOX, of("emerson/deltav", **values))
    assert (proof.decided, proof.feedback_equal) == (True, False)
    assert 1e-14 < proof.residual < 1e-11


@pytest.mark.parametrize("dial", ["GAIN", "RESET", "RATE"])
def test_a_source_off_by_a_trillionth_is_told_apart(dial: str) -> None:
    given_ = {"GAIN": 2.0, "RESET": 4.0, "RATE": 0.1}
    source = of("fisher/provox", **(given_ | {dial: given_[dial] * (1 + 1e-12)}))
    assert not prove(source, of("emerson/deltav", **DELTAV)).feedback_equal


def test_a_setpoint_weight_off_by_a_trillionth_is_told_apart() -> None:
    proof = prove(PROVOX, of("emerson/deltav", **DELTAV, STRUCTURE=7, BETA=2 / 2.7 * (1 + 1e-12), GAMMA=0))
    assert (proof.decided, proof.feedback_equal, proof.setpoint_equal) == (True, True, False)


@given(data=st.data(), change=st.sampled_from([1e-12, -1e-12, 1e-10]))
def test_near_misses_are_told_apart_over_all_pairs(data: st.DataObject, change: float) -> None:
    conversion = converted(data)
    proven = prove(conversion.source, conversion.settings, conversion.factor, "auto")
    assume(proven.decided and proven.feedback_equal)
    acting = [
        v.name
        for v in conversion.settings.values()
        if v.active and not v.off and v.setting.sets in ("gain", "integral", "derivative")
    ]
    name = data.draw(st.sampled_from(acting))
    try:
        missed = conversion.settings.changed({name: conversion.settings[name].value * (1 + change)})
    except SettingError:
        assume(False)
        raise
    proof = prove(conversion.source, missed, conversion.factor, "auto")
    assume(proof.residual > TOLD_APART)  # a dial that hardly matters hardly moves the law
    assert not proof.feedback_equal


def test_rounded_dials_are_not_equal_and_the_residual_says_by_how_much() -> None:
    proof = prove(PROVOX, of("emerson/deltav", GAIN=2.7, RESET=20.25, RATE=3.6944, ALPHA=0.20301))
    assert (proof.decided, proof.feedback_equal) == (True, False)
    assert 1e-6 < proof.residual < 1e-4
    assert any("coefficients differ by up to" in line for line in proof.text)


def test_in_cascade_the_setpoint_path_is_another_one() -> None:
    source = of("yokogawa/fieldbus-pid", GAIN=0.6, RESET=8)
    on_pv, on_error = (of("emerson/deltav", GAIN=0.6, RESET=8, STRUCTURE=x) for x in (2, 1))
    assert [prove(source, on_pv, mode=m).setpoint_equal for m in ("auto", "cascade", "both")] == [True, False, False]
    assert [prove(source, on_error, mode=m).setpoint_equal for m in ("auto", "cascade", "both")] == [False, True, False]
    proof = prove(source, on_error)
    assert [p.name for p in proof.paths] == ["feedback", "setpoint", "setpoint in cascade"]
    assert (proof.equal("setpoint"), proof.equal("setpoint in cascade")) == (False, True)


def test_where_no_equation_depends_on_the_mode_cascade_is_as_automatic() -> None:
    proof = prove(PROVOX, PROVOX)
    assert [p.name for p in proof.paths] == ["feedback", "setpoint"]
    assert proof.equal("setpoint in cascade")


@pytest.mark.parametrize("factor", [Fraction(4, 3), 4 / 3])
def test_new_ranges_multiply_the_gain_by_a_fraction(factor: Fraction | float) -> None:
    source = of("generic/parallel", kp=1, ki=0.1, kd=2, Tf=0.5)
    target = of("generic/standard", K=4 / 3, Ti=10, Td=2, Tf=0.5)
    proof = prove(source, target, factor)
    assert (proof.feedback_equal, proof.setpoint_equal) == (True, True)
    assert proof.source_law.startswith("4/3 (1 + (1/10)/s + 2 s/(1 + 1/2 s)) = ")
    assert_checks_by_hand(proof)


def test_ranges_are_the_decimals_that_were_typed() -> None:
    source = of("bailey/fc19", K=1, KP=2.5, KI=0.5, KD=0.2, pv_range=(0.1, 0.4), op_range=(0, 100))
    assert prove(source, source).source_law.startswith("3/400 + ")  # 2.5 output units per unit, 0.3 units per 100 output units


def test_negative_gains_are_proven_with_the_action_changed() -> None:
    source = of("simple-pid/simple-pid", Kp=-2, Ki=-0.1, Kd=0)
    target = of("generic/standard", K=2, Ti=20)
    assert prove(source, target, -1).feedback_equal
    assert not prove(source, target).feedback_equal
    assert_checks_by_hand(prove(source, target, -1))


def test_filters_before_the_algorithm_are_part_of_the_law() -> None:
    source = of("yokogawa/fieldbus-pid", GAIN=0.6, RESET=8, PV_FTIME=2)
    proof = prove(source, of("emerson/deltav", GAIN=0.6, RESET=8, STRUCTURE=2))
    assert (proof.feedback_equal, proof.equal("setpoint")) == (False, True)
    assert proof.source_law == "3/5 (1 + 1/(8 s))/(1 + 2 s) = (3/40 + 3/5 s)/(s (1 + 2 s))"


def test_filters_on_all_signals_are_drawn_and_multiplied() -> None:
    filters = {"error": 0.5, "measurement": 0.1, "setpoint": 3.0}
    card = made_up_card(**{signal: {"filter": {"time": time}} for signal, time in filters.items()})
    chosen = card.settings(kp=2, ki=0.1, kd=0)
    proof = prove(chosen, chosen)
    assert [p.source for p in proof.paths] == [
        "(2 + (1/10)/s)/((1 + 1/2 s) (1 + 1/10 s)) = (1/10 + 2 s)/(s (1 + 3/5 s + 1/20 s^2))",
        "(2 + (1/10)/s)/((1 + 1/2 s) (1 + 3 s)) = (1/10 + 2 s)/(s (1 + 7/2 s + 3/2 s^2))",
    ]
    assert_checks_by_hand(proof)


def test_the_multiplier_decides_about_a_filter_by_ratio() -> None:
    source = of("generic/parallel", kp=2, ki=0.05, kd=12, Tf=0.7)
    conversion = pidemu.convert(source, "bailey/fc19", emulate=False)
    proof = prove(source, conversion.settings, conversion.factor)
    assert proof.feedback_equal == conversion.certificate.feedback.is_exact


def test_a_filter_before_pi_is_a_negative_derivative_behind_the_same_filter() -> None:
    source = of("yokogawa/fieldbus-pid", GAIN=0.6, RESET=8, PV_FTIME=2)
    # 0.075 + 0.6 s over s (1 + 2 s): kp = 0.6 - 0.075 x 2, kd = -0.45 x 2
    for kd in (-0.9, -0.9 * (1 + 4e-16)):
        proof = prove(source, of("mathworks/pid2", Kp=0.45, Ki=0.075, Kd=kd, Tf=2))
        assert proof.feedback_equal
        assert proof.dials["Kd"] == "-9/10 s"
        assert_checks_by_hand(proof)


def test_dials_that_a_search_found_stand_for_exact_ones_a_little_away() -> None:
    source = of("ardupilot/ac-pid", P=1.252988244845353, IMAX=5.0, FLTE=0.15915494309189535, FLTD=0.0031830988618379067)
    searched = of("mathworks/pid2", Kp=1.252988244845353, Kd=-1.2529882448452, Tf=1 - 2e-13)
    strict, wide = prove(source, searched), prove(source, searched, within=EXACT)
    assert (strict.decided, strict.feedback_equal) == (True, False)
    assert (wide.decided, wide.feedback_equal) == (True, True)


def test_two_pi_is_named_where_a_filter_is_a_frequency() -> None:
    ardupilot = dict(SOURCES)["ardupilot/ac-pid"]
    assert any("FLTD is a frequency, and 2 pi is computed as" in line for line in prove(ardupilot, ardupilot).notes)


def test_a_recursion_in_scans_has_no_law_to_prove_anything_of() -> None:
    dahlin = next(c for c in pidemu.cards() if pidemu.load_card(c).data.form == "dahlin")
    given_ = {n: 1.0 for n, x in pidemu.load_card(dahlin).variant({}).equation.settings.items() if x.default is None}
    source = of(dahlin, **given_)
    proof = prove(source, PROVOX)
    assert (proof.decided, proof.feedback_equal, proof.setpoint_equal) == (False, False, False)
    assert "recursion in scans" in proof.why_not
    assert proof.text == (f"Exact arithmetic does not decide: {proof.why_not}.",)


def test_the_lines_for_the_certificate() -> None:
    mapping: Mapping[str, object] = DELTAV
    law = "(2/15 + 14/5 s + 12 s^2)/(s (1 + 3/4 s))"
    assert prove(PROVOX, of("emerson/deltav", **mapping), mode="auto").text == (
        "Exact settings of emerson/deltav: GAIN 27/10 %/%, RESET 81/4 s/repeat, RATE 133/36 s, ALPHA 27/133, PV_FTIME 0 s, "
        "SP_FTIME 0 s.",
        "From the measurement to the output:",
        f"  fisher/provox: 2 (1 + 1/(15 s)) (1 + 6 s)/(1 + 3/4 s) = {law}",
        f"  emerson/deltav: 27/10 (1 + 1/(81/4 s) + 133/36 s/(1 + 3/4 s)) = {law}",
        "  These are the same function: the cross products of numerator and denominator agree term by term.",
        "From the setpoint to the output:",
        "  fisher/provox: 2 (1 + 1/(15 s)) = (2/15 + 2 s)/s",
        "  emerson/deltav: 27/10 (1 + 1/(81/4 s)) = (2/15 + 27/10 s)/s",
        "  These are not the same function: coefficients differ by up to 0.26 of their size.",
    )


def test_a_share_per_scan_in_front_of_the_block_is_a_lag_that_is_proven() -> None:
    """A share of 0.8 every 0.05 s is 1/80 s; in floats 0.05 (1 - 0.8)/0.8 is something else."""
    source = pidemu.load_card("automationdirect/directlogic").settings(GAIN=1, RESET=0, FILTER=0.8, pv_range="0,100 degC")
    conversion = pidemu.convert(source, "bailey/fc18", assume=True, emulate=False)
    assert conversion.settings.lag == 0.0125
    assert conversion.certificate.proof is not None
    assert conversion.certificate.proof.feedback_equal
