"""A rule's answer in the dials of a card, and what is refused."""

from __future__ import annotations

import math

import pytest

import pidemu
from pidemu.errors import ProcessError
from pidemu.process.process import Process
from pidemu.tuning.compare import tune_all

lags = Process.from_lags
FLOW = lags(2.0, lags=[60], delay=6)


def test_simc_in_the_dials_of_a_deltav() -> None:
    found = pidemu.tune("emerson/deltav", FLOW)
    assert (found.settings["GAIN"].value, found.settings["RESET"].value, found.settings["RATE"].value) == (2.5, 48.0, 0.0)
    assert pytest.approx({"kp": 2.5, "ki": 2.5 / 48, "kd": 0.0}) == {k: found.gains[k] for k in ("kp", "ki", "kd")}
    assert "Astrom and Hagglund" in found.source
    assert found.figures.stable
    assert pytest.approx(48 / 2.5, rel=1e-3) == found.figures.iae


@pytest.mark.parametrize(
    ("card", "dials"),
    [
        ("fisher/provox", {"GAIN": 2.5, "RESET": 60 / 48}),
        ("honeywell/tdc3000", {"K": 2.5, "T1": 48 / 60}),
        ("allen-bradley/pide", {"PGain": 2.5, "IGain": 48 / 60}),
        ("generic/parallel", {"kp": 2.5, "ki": 2.5 / 48}),
        ("simple-pid/simple-pid", {"Kp": 2.5, "Ki": 2.5 / 48}),
    ],
)
def test_simc_in_the_units_of_a_card(card: str, dials: dict[str, float]) -> None:
    found = pidemu.tune(card, FLOW).settings
    assert pytest.approx(dials) == {name: found[name].value for name in dials}


def test_percent_gains_become_engineering_units_where_ranges_are_given() -> None:
    found = pidemu.tune("arduino/pid", FLOW, pv_range=(0, 400, "degC"), op_range=(0, 255, "pwm")).settings
    assert pytest.approx(2.5 * 255 / 400) == found["Kp"].value


def test_a_negative_process_gain_makes_the_controller_direct_acting() -> None:
    process = lags(-2.0, lags=[60], delay=6)
    switched, signed = (pidemu.tune(card, process) for card in ("emerson/deltav", "simple-pid/simple-pid"))
    assert (switched.action, switched.settings["GAIN"].value) == ("direct", 2.5)
    assert (signed.action, signed.settings["Kp"].value) == ("direct", -2.5)
    assert switched.figures.stable
    assert signed.figures.stable
    with pytest.raises(pidemu.ProcessError, match="a reverse acting controller makes the feedback positive"):
        pidemu.tune("emerson/deltav", process, action="reverse")


def test_kings_rule_puts_p_and_d_on_the_measurement() -> None:
    found = pidemu.tune("king/velocity", FLOW, "king")
    assert found.settings.law().kick() == 0.0
    a = found.settings.algorithm()
    assert (a.b, a.c) == (0, 0)


def test_a_family_alone_means_the_rule_with_the_most_terms() -> None:
    names = [pidemu.tune("generic/standard", FLOW, "iae", controller=c).rule.name for c in (None, "P", "PI")]
    assert names == ["iae-pid", "iae-p", "iae-pi"]


def test_parameters_take_units_and_have_defaults() -> None:
    assert dict(pidemu.tune("generic/standard", FLOW, Tcl="1 min").standard) == {"K": 60 / (2 * 66), "Ti": 60}
    assert dict(pidemu.tune("generic/standard", FLOW, "lambda").parameters) == {"lam": 180.0}


def test_dials_are_rounded_and_the_figures_are_theirs() -> None:
    found = pidemu.tune("generic/standard", FLOW, "amigo-pi", digits=2)
    assert (found.settings["K"].value, found.settings["Ti"].value) == (1.4, 36.0)
    assert pytest.approx(36 / 1.4, rel=1e-3) == found.figures.iae


@pytest.mark.parametrize(
    ("process", "rule", "parameters", "message"),
    [
        (FLOW, "simk", {}, r"no tuning rule 'simk' \(did you mean 'simc'\?\)"),
        (FLOW, "simc", {"controller": "PID"}, "has no settings for a controller 'PID'; it has simc"),
        (FLOW, "simc", {"lam": 5}, "'simc' has no parameter 'lam'; parameters: Tcl"),
        (FLOW, "lambda", {"lam": 5}, "lam is 5 s, and the rule 'lambda' allows no less than L, 6 s"),
        (FLOW, "lambda", {"lam": "soon"}, "lam is 'soon'; give a time"),
        (lags(2.0, lags=[60]), "simc", {}, "needs Tcl, which has no default for a process without dead time"),
        (lags(2.0, lags=[60]), "ziegler-nichols", {}, "no ultimate gain"),
        (lags(2.0, lags=[60]), "amigo-pi", {}, "it has no dead time, by which the rule divides"),
        (lags(2.0, lags=[60], delay=90), "iae-pi", {}, "this one is 1.5; the nearest that does is 'simc'"),
        (lags(0.1, integrators=1, delay=2), "one-third", {}, "it is integrating"),
        (Process(1.0, [-0.1 + 0.2j, -0.1 - 0.2j], delay=1), "simc", {}, "complex poles"),
        (Process(1.0, [0.1], delay=1), "simc", {}, "it is unstable"),
    ],
)
def test_what_a_rule_does_not_serve_is_refused_with_the_remedy(
    process: Process, rule: str, parameters: dict[str, object], message: str
) -> None:
    with pytest.raises(pidemu.TuningError, match=message):
        pidemu.tune("generic/standard", process, rule, **parameters)  # type: ignore[arg-type]


def test_a_gain_of_zero_is_no_process() -> None:
    with pytest.raises(pidemu.ProcessError, match="the gain is 0"):
        lags(0.0, lags=[10], delay=1)


def test_a_series_card_that_cannot_do_what_the_rule_says_refuses_and_names_the_rule() -> None:
    with pytest.raises(pidemu.ConversionRefusedError, match="what the rule 'ise-pid' says"):
        pidemu.tune("fisher/provox", FLOW, "ise-pid")
    near = pidemu.tune("fisher/provox", FLOW, "ise-pid", allow_approximate=True)
    assert any("only the nearest settings" in note for note in near.notes)


def test_all_rules_are_sorted_and_tell_which_do_not_serve() -> None:
    found = tune_all(pidemu.load_card("fisher/provox"), lags(2.0, lags=[60], delay=90), "iae")
    iae = [t.figures.iae for t in found.tunings]
    assert iae == sorted(iae)
    assert "stated for a dead time" in found.refused["iae-pi"]
    assert {t.rule.name for t in found.tunings} | set(found.refused) == {r.name for r in pidemu.tuning_rules()}
    margins = [t.figures.gain_margin for t in tune_all(pidemu.load_card("generic/standard"), FLOW, "gain_margin").tunings]
    assert margins == sorted(margins, reverse=True)


def test_a_table_gives_what_each_rule_gives_alone() -> None:
    card, process = pidemu.load_card("emerson/deltav"), lags(1.0, lags=[20, 5], delay=3)
    for t in tune_all(card, process, controller="PID").tunings:
        assert pidemu.tune(card, process, t.rule.name).settings == t.settings


def test_rules_see_an_integrating_process_with_its_velocity_gain() -> None:
    process = lags(0.05, integrators=1, delay=4)
    assert pytest.approx({"K": 1 / (0.05 * 8), "Ti": 32}) == dict(pidemu.tune("generic/standard", process, "simc").standard)
    assert math.isinf(pidemu.tune("generic/standard", process, "ziegler-nichols-step-p").settings["Ti"].value)


def test_a_gain_in_engineering_units_is_told_in_percent_by_the_ranges() -> None:
    in_degrees = pidemu.Process.from_lags(8.0, lags=[60], delay=6, unit="degC/%")  # 2 %/% over 0 to 400 degC
    plain = pidemu.tune("emerson/deltav", pidemu.Process.from_lags(2.0, lags=[60], delay=6))
    found = pidemu.tune("emerson/deltav", in_degrees, pv_range=(0, 400, "degC"))
    assert found.settings["GAIN"].value == plain.settings["GAIN"].value == 2.5
    with pytest.raises(ProcessError, match=r"is in degC/%; give the range of the measurement \(pv_range, --pv-range\)"):
        pidemu.tune("emerson/deltav", in_degrees)
    with pytest.raises(ProcessError, match="in another"):
        pidemu.tune("emerson/deltav", in_degrees, pv_range=(0, 7, "bar"))
