"""Options, signs and ranges: what a conversion decides, keeps, or tells the user to decide."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.errors import PidemuError, ScanError, SettingError
from tests.checks.bench import VALID, edited, written
from tests.conversion.support import HUNDRED, needed
from tests.conversion.usual import CARDS, SOURCES, usual


@pytest.mark.parametrize(("source", "target"), list(itertools.product(CARDS, CARDS)))
def test_the_textbook_column_is_what_the_textbook_match_gives(source: str, target: str) -> None:
    settings = dict(SOURCES)[source]
    held = {} if source == target else needed(pidemu.load_card(target))
    how: dict[str, Any] = {"given": held, "mode": "auto", "emulate": False}
    try:
        conversion = pidemu.convert(settings, target, **how)
        shown = conversion.textbook
    except ConversionRefusedError:
        return
    if shown.settings is None:
        with pytest.raises(ConversionRefusedError):
            pidemu.convert(settings, target, match="textbook", options=conversion.settings.options, **how)
    else:
        asked = pidemu.convert(settings, target, match="textbook", options=shown.settings.options, **how)
        assert {n: v.value for n, v in shown.settings.items()} == {n: v.value for n, v in asked.settings.items()}
        assert shown.certificate is not None
        assert shown.certificate.feedback == asked.certificate.feedback


@pytest.mark.parametrize("card_id", CARDS)
def test_a_card_to_itself_keeps_its_options_and_is_exact(card_id: str) -> None:
    for settings in usual(card_id):
        conversion = pidemu.convert(settings, card_id)
        assert conversion.settings.options == settings.options
        assert conversion.verdict == "exact"


def test_weights_above_one_are_kept() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=10, b=1.5)
    conversion = pidemu.convert(source, "generic/standard")
    assert (conversion.verdict, conversion.settings["b"].value) == ("exact", 1.5)


def test_options_that_nobody_gave_are_chosen_where_the_defaults_would_refuse() -> None:
    source = pidemu.load_card("emerson/deltav").settings(GAIN=2, STRUCTURE="4")
    conversion = pidemu.convert(source, "foxboro/ia-pid")
    assert dict(conversion.chosen) == {"MODOPT": "P"}
    assert conversion.verdict == "exact"
    with pytest.raises(ConversionRefusedError, match="cannot do"):
        pidemu.convert(source, "foxboro/ia-pid", options={"MODOPT": "PID"})


def test_options_that_nobody_gave_are_chosen_for_the_best_verdict() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    conversion = pidemu.convert(source, "emerson/deltav")
    assert dict(conversion.chosen) == {"FORM": "Series"}  # the same form; STRUCTURE 1 has P on the error and D on the measurement
    assert conversion.verdict == "exact"
    series = pidemu.convert(source, "honeywell/tdc3000")
    assert dict(series.chosen) == {"CTEQN": "B"}  # D on the measurement, as with PROVOX
    other = pidemu.convert(source, "honeywell/tdc3000", options={"CTEQN": "A"})
    least, more = (c.certificate.setpoint.loop_band.max_deviation for c in (series, other))
    assert least < more / 2


def test_options_that_the_user_chose_are_kept() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    conversion = pidemu.convert(source, "emerson/deltav", options={"FORM": "Standard", "STRUCTURE": "1"})
    assert conversion.settings.options == {"FORM": "Standard", "STRUCTURE": "1", "FRSIPID_OPTS": "none"}
    assert dict(conversion.chosen) == {}
    assert conversion.verdict == "exact-feedback"


def test_the_defaults_stay_where_no_choice_does_better() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=15)
    conversion = pidemu.convert(source, "emerson/deltav")
    assert dict(conversion.chosen) == {}
    assert conversion.verdict == "exact"


def test_every_choice_is_ranked_by_the_terms_that_see_the_setpoint_and_then_by_the_verdict() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    ranking = pidemu.convert(source, "emerson/deltav").ranking
    assert len(ranking) == 32  # two forms, eight structures, with and without nonlinear gain
    order = ["exact", "exact-feedback", "approximate", "refused"]
    places = [(0 if a.merit is None else a.merit.setpoint, order.index(a.verdict)) for a in ranking if a.verdict != "refused"]
    assert places == sorted(places)
    refused = [a.verdict == "refused" for a in ranking]
    assert refused == sorted(refused)
    assert {a.verdict for a in ranking} == {"exact", "exact-feedback", "refused"}
    for attempt in ranking:  # each as if it had been asked for
        try:
            asked = pidemu.convert(source, "emerson/deltav", options={"FORM": "Standard", "STRUCTURE": "1", **attempt.changed})
        except (ConversionRefusedError, SettingError):
            assert attempt.verdict == "refused"
        else:
            assert asked.verdict == attempt.verdict


def test_the_scan_rules_of_the_target_are_chosen_like_the_source_s() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60, Td=10, Tf=1)
    conversion = pidemu.convert(source, "mathworks/pid2")
    assert dict(conversion.chosen) == {"FORM": "standard", "IFormula": "BackwardEuler", "DFormula": "BackwardEuler"}
    assert conversion.verdict == "exact"
    forced = pidemu.convert(source, "mathworks/pid2", options={"IFormula": "Trapezoidal", "DFormula": "Trapezoidal"})
    assert forced.certificate.feedback.is_exact
    assert forced.certificate.scan_by_scan is not None
    assert not forced.certificate.scan_by_scan.is_exact
    assert conversion.certificate.scan_by_scan is not None
    assert conversion.certificate.scan_by_scan.is_exact


def test_negative_gains_become_positive_ones_with_the_other_action() -> None:
    source = pidemu.load_card("simple-pid/simple-pid").settings({"Kp": -2, "Ki": -0.05, **HUNDRED})
    conversion = pidemu.convert(source, "emerson/deltav")
    assert (conversion.settings["GAIN"].value, conversion.settings["RESET"].value) == (2, 40)
    assert conversion.verdict == "exact"
    direct = "direct acting, PV - SP"
    assert conversion.action_text == f"{direct}: Direct_Acting on in CONTROL_OPTS"  # the source has no switch: its sign says it
    sp, pv = np.full(50, 50.0), 50 + np.sin(np.arange(50) / 5)
    old = pidemu.Controller(source, 1.0, output_limits=(-1e6, 1e6)).run(sp, pv)
    new = pidemu.Controller(conversion.settings, 1.0, "direct", output_limits=(-1e6, 1e6)).run(sp, pv)
    assert np.max(np.abs(np.diff(old) - np.diff(new))) < 1e-9


def test_gains_of_both_signs_are_refused() -> None:
    source = pidemu.load_card("simple-pid/simple-pid").settings(Kp=2, Ki=-0.05)
    with pytest.raises(ConversionRefusedError, match="would have to be negative"):
        pidemu.convert(source, "emerson/deltav")


def test_a_card_in_engineering_units_takes_the_ranges() -> None:
    source = pidemu.load_card("bailey/fc19").settings(KP=2, KI=0.5, pv_range=(0, 300), op_range=(0, 100))
    conversion = pidemu.convert(source, "emerson/deltav")
    assert (conversion.settings["GAIN"].value, conversion.settings["RESET"].value) == (6, 240)
    assert not any("no ranges" in w or "not all ranges" in w for w in conversion.warnings)


def test_without_ranges_a_card_in_engineering_units_asks_or_says_what_is_assumed() -> None:
    source = pidemu.load_card("bailey/fc19").settings(KP=2, KI=0.5)
    with pytest.raises(pidemu.QuestionError) as error:
        pidemu.convert(source, "emerson/deltav")
    assert [(q.kind, q.about) for q in error.value.questions][:1] == [("range", "pv_range")]
    taken = [w for w in pidemu.convert(source, "emerson/deltav", assume=True).warnings if w.endswith("0 to 100 is taken.")]
    assert [w.partition(",")[0] for w in taken] == ["The PV range is not given", "The output range is not given"]


@pytest.mark.parametrize("value", ["2 eu/eu", "50 eu", "2 %/eu"])
def test_a_gain_in_engineering_units_needs_the_ranges(value: str) -> None:
    card = pidemu.load_card("fisher/provox")
    with pytest.raises(SettingError, match=r"pv_range.* must be given"):
        card.settings(GAIN=value, RESET=4)
    assert card.settings(GAIN=value, RESET=4, pv_range=(0, 200), op_range=(0, 100))["GAIN"].value == 4


def test_with_scan_intervals_the_kick_is_the_move_of_the_first_scan() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, RATE=0.1)
    conversion = pidemu.convert(source, "honeywell/tdc3000", scan=(1.0, 0.5))
    kick = conversion.certificate.setpoint_kick_at_scan
    assert kick is not None
    for settings, h, stated in ((source, 1.0, kick.source), (conversion.settings, 0.5, kick.target)):
        outputs = pidemu.Controller(settings, h, output_limits=(-1e6, 1e6)).run([50, 51], 50)
        assert outputs[1] - outputs[0] == pytest.approx(stated, rel=1e-12)


@pytest.mark.parametrize("scan", [(1.0,), (), (1, 2, 3), "1", (0.0, 1.0), (1.0, float("nan")), -1])
def test_a_scan_that_is_no_interval_or_two_is_refused(scan: object) -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    with pytest.raises(ScanError):
        pidemu.convert(source, "emerson/deltav", scan=scan)  # type: ignore[arg-type]


def test_numpy_numbers_are_scan_intervals() -> None:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4)
    assert pidemu.convert(source, "emerson/deltav", scan=np.float32(0.5)).scan == (0.5, 0.5)  # type: ignore[arg-type]


def test_the_options_of_settings_are_a_copy() -> None:
    settings = pidemu.load_card("emerson/deltav").settings(GAIN=2, RESET=60)
    settings.options["FORM"] = "Bogus"
    assert pidemu.load_card("emerson/deltav").settings(GAIN=2, RESET=60).options["FORM"] == "Standard"


def test_rounding_keeps_notes_and_never_makes_an_infinite_gain(tmp_path: Path) -> None:
    text = edited(
        VALID,
        ('GAIN: {sets: gain, unit: "%/%"}', 'GAIN: {sets: gain, unit: "%", resolution: 5}'),
        ("{GAIN: 2, RESET: 60, RATE: 16}", "{GAIN: 50, RESET: 60, RATE: 16}"),
    )
    target = pidemu.load_card(written(tmp_path, text))
    source = pidemu.load_card("generic/standard").settings(K=100, Ti="1 min")
    conversion = pidemu.convert(source, target, digits=5)
    assert conversion.settings["GAIN"].value == 5
    assert [d.name for d in conversion.certificate.dials] == ["GAIN"]
    assert conversion.source.notes == ("Ti: 1 min is 60 s",)


@pytest.mark.parametrize(("limits", "inside"), [("[0, 10]", 5.0), ("[0, 1e-6]", 1e-6), ("[1e6, 1e7]", 1e6)])
def test_a_range_far_from_the_source_is_refused_without_a_crash(tmp_path: Path, limits: str, inside: float) -> None:
    text = edited(
        VALID,
        ('GAIN: {sets: gain, unit: "%/%"}', f'GAIN: {{sets: gain, unit: "%/%", range: {limits}}}'),
        ("GAIN: 2,", f"GAIN: {inside},"),
        ("kp: 2, ki: 0.0333333, kd: 32", f"kp: {inside}, ki: {inside / 60:.6g}, kd: {inside * 16:.6g}"),
    )
    target = pidemu.load_card(written(tmp_path, text))
    source = pidemu.load_card("generic/standard").settings(K=20000, Ti=10, Td=1)
    with pytest.raises(PidemuError, match="outside"):
        pidemu.convert(source, target)


def test_noise_is_compared_without_the_sign_of_the_gains() -> None:
    card = pidemu.load_card("simple-pid/simple-pid")
    both = [card.settings({"Kp": 2 * k, "Ki": 0.05 * k, "Kd": 20 * k, **HUNDRED}) for k in (-1, 1)]
    found = [pidemu.convert(s, "emerson/deltav", scan=(1.0, 0.1), emulate=False).warnings for s in both]
    noise = [[w for w in warnings if w.startswith("Measurement noise")] for warnings in found]
    assert len(noise[0]) == 1
    assert noise[0] == noise[1]


def test_a_card_file_is_a_target(tmp_path: Path) -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=60)
    assert pidemu.convert(source, written(tmp_path, VALID)).settings.card.id == "nobody/bench"
