"""Rockwell's PID and PIDE: independent gains in 1/s and s here, in 1/min and min there, dependent gains in minutes on both."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.errors import SettingError
from tests.conversion.support import difference, outputs, random_signal

PID, PIDE = "allen-bradley/logix-pid", "allen-bradley/pide"
ROUNDING = 1e-9
"""Of the span, or of what the outputs move over: sums over 200 scans of doubles, with a margin of a thousand and more."""

FORMS = [("independent", "false"), ("dependent", "true")]
"""PE of the PID and DependIndepend of the PIDE that are the same equation."""


def pid(**dials: object) -> pidemu.Settings:
    """Settings of the PID; independent gains where the equation is not named."""
    return pidemu.load_card(PID).settings({"PE": "independent", **dials})


def pide(**dials: object) -> pidemu.Settings:
    """Settings of the PIDE; independent gains where the form is not named."""
    return pidemu.load_card(PIDE).settings({"DependIndepend": "false", **dials})


def values(conversion: pidemu.Conversion, *names: str) -> list[float]:
    return [conversion.settings[n].value for n in names]


def agree_scan_by_scan(conversion: pidemu.Conversion) -> bool:
    """Tell whether both controllers give the same output for setpoint and measurement that wander and jump."""
    for seed in range(3):
        sp, pv = random_signal(seed), random_signal(100 + seed)
        a, b = (outputs(s, sp, pv, 1.0) for s in (conversion.source, conversion.settings))
        assert np.ptp(a) > 1
        if difference(a, b) > ROUNDING:
            return False
    return True


def named(part: pidemu.Settings | str | dict[str, str]) -> str:
    """Return how a source, a card or the options of a target are called in a test's name."""
    if isinstance(part, str):
        return part
    return ",".join(f"{n}={v}" for n, v in (part.options if isinstance(part, pidemu.Settings) else part).items())


gains = {"KP": st.floats(0.05, 20), "KI": st.floats(1e-3, 1), "KD": st.just(0.0) | st.floats(0.1, 60)}


@settings(max_examples=40)
@given(**gains)
def test_independent_gains_of_the_pid_are_60_times_the_integral_and_a_sixtieth_of_the_derivative_on_the_pide(
    KP: float, KI: float, KD: float
) -> None:
    conversion = pidemu.convert(pid(KP=KP, KI=KI, KD=KD, NDF="on"), PIDE, options={"DSmoothing": "false"}, scan=1.0)
    assert values(conversion, "PGain", "IGain", "DGain") == pytest.approx([KP, 60 * KI, KD / 60], rel=1e-12)
    assert [conversion.settings[n].unit for n in ("IGain", "DGain")] == ["1/min", "min"]
    assert conversion.verdict == "exact"
    back = pidemu.convert(conversion.settings, PID, options={"NDF": "on"}, scan=1.0)
    assert values(back, "KP", "KI", "KD") == pytest.approx([KP, KI, KD], rel=1e-12)


def test_the_same_equation_and_rules_at_one_scan_that_is_too_slow_are_exact_and_the_scan_is_named() -> None:
    """An integral time of half a second at a scan of one: nothing is lost from one controller to the other."""
    conversion = pidemu.convert(pid(KP=0.5, KI=1, KD=0, NDF="on"), PIDE, options={"DSmoothing": "false"}, scan=1.0)
    assert conversion.verdict == "exact"
    assert "Both scans are too slow for this loop" in conversion.sentence


def test_dependent_gains_stay_as_they_are_in_minutes() -> None:
    source = pid(PE="dependent", KP=2, KI=0.5, KD=0.1, NDF="on")
    conversion = pidemu.convert(source, PIDE, options={"DependIndepend": "true"}, scan=1.0)
    assert values(conversion, "PGain", "IGain", "DGain") == pytest.approx([2, 0.5, 0.1], rel=1e-12)
    assert [source[n].unit for n in ("KI", "KD")] == ["min/repeat", "min"]
    assert [conversion.settings[n].unit for n in ("IGain", "DGain")] == ["min/repeat", "min"]
    assert conversion.verdict == "exact"


def test_dependent_to_independent_gains_of_the_pid_by_the_manuals_formula() -> None:
    source = pid(PE="dependent", KP=2, KI=0.5, KD=0.1, NDF="on")
    conversion = pidemu.convert(source, PID, options={"PE": "independent", "NDF": "on"}, scan=1.0)
    Kc, Ti, Td = 2, 0.5, 0.1
    assert values(conversion, "KP", "KI", "KD") == pytest.approx([Kc, Kc / (60 * Ti), 60 * Kc * Td], rel=1e-12)
    assert values(conversion, "KP", "KI", "KD") == pytest.approx([2, 0.0667, 12], abs=5e-5)  # rounded to four digits
    assert conversion.settings["KI"].unit == "1/s"
    assert conversion.verdict == "exact"


def test_dependent_gains_of_the_pid_to_independent_ones_of_the_pide_are_per_minute_and_minutes() -> None:
    source = pid(PE="dependent", KP=2, KI=0.5, KD=0.1, NDF="on")
    conversion = pidemu.convert(source, PIDE, options={"DependIndepend": "false"}, scan=1.0)
    assert values(conversion, "PGain", "IGain", "DGain") == pytest.approx([2, 2 / 0.5, 2 * 0.1], rel=1e-12)
    assert conversion.verdict == "exact"


@pytest.mark.parametrize(
    ("source", "target", "options"),
    [
        (pid(KP=2, KI=0.05, KD=12, NDF="on"), PIDE, {}),
        (pid(KP=2, KI=0.05, KD=12), PIDE, {"DSmoothing": "true"}),
        (pid(KP=2, KI=0.05, KD=12, DOE="error", NDF="on"), PIDE, {"PVEDerivative": "false"}),
        (pid(KP=2, KI=0.5, KD=0.1, PE="dependent"), PIDE, {"DependIndepend": "true", "DSmoothing": "true"}),
        (pid(KP=2, KI=0.5, KD=0.1, PE="dependent", NDF="on"), PID, {"PE": "independent", "NDF": "on"}),
        (pid(KP=20, KI=0.5, KD=60), PID, {"PE": "dependent", "NDF": "off"}),
        (pid(KP=2, KI=0.5, KD=0.1, PE="dependent"), PIDE, {"DependIndepend": "false", "DSmoothing": "true"}),
        (pide(PGain=2, IGain=3, DGain=0.2), PIDE, {"DependIndepend": "true"}),
        (pide(DependIndepend="true", PGain=2, IGain=0.5, DGain=0.1), PID, {"NDF": "on"}),
        (pide(PGain=2, IGain=3, DGain=0.2, PVEProportional="true"), PIDE, {"DependIndepend": "true", "PVEProportional": "true"}),
    ],
    ids=named,
)
def test_where_the_verdict_is_exact_both_instructions_give_the_same_output(
    source: pidemu.Settings, target: str, options: dict[str, str]
) -> None:
    conversion = pidemu.convert(source, target, options=options, scan=1.0)
    assert conversion.verdict == "exact"
    assert agree_scan_by_scan(conversion)


def test_numbers_typed_over_from_one_instruction_to_the_other_are_another_controller() -> None:
    conversion = pidemu.convert(pid(KP=2, KI=0.05, KD=12, NDF="on"), PIDE, scan=1.0)
    sp, pv = random_signal(1), random_signal(101)
    wanted = outputs(conversion.source, sp, pv, 1.0)
    copied = outputs(pide(PGain=2, IGain=0.05, DGain=12), sp, pv, 1.0)
    assert difference(outputs(conversion.settings, sp, pv, 1.0), wanted) < ROUNDING
    assert difference(copied, wanted) > 0.1


def test_the_reset_of_the_pide_is_not_seconds_per_repeat() -> None:
    """With that advice, which is in print, half a minute per repeat would be entered as 30."""
    source = pid(PE="dependent", KP=2, KI=0.5, NDF="on")
    conversion = pidemu.convert(source, PIDE, options={"DependIndepend": "true"}, scan=1.0)
    assert conversion.settings["IGain"].to("s/repeat") == pytest.approx(30)
    assert conversion.settings["IGain"].value != pytest.approx(30)
    wrong = pide(DependIndepend="true", PGain=2, IGain=30)
    sp, pv = random_signal(1), random_signal(101)
    wanted = outputs(source, sp, pv, 1.0)
    assert difference(outputs(conversion.settings, sp, pv, 1.0), wanted) < ROUNDING
    assert difference(outputs(wrong, sp, pv, 1.0), wanted) > 0.1


@pytest.mark.parametrize("KP", [0.1, 1.0, 20.0])
def test_both_equations_of_one_block_smooth_the_derivative_with_the_same_time(KP: float) -> None:
    independent = [pid(KP=KP, KI=0.05, KD=12 * KP), pide(PGain=KP, IGain=3, DGain=0.2 * KP, DSmoothing="true")]
    dependent = [
        pid(PE="dependent", KP=KP, KI=1, KD=0.2),
        pide(DependIndepend="true", PGain=KP, IGain=1, DGain=0.2, DSmoothing="true"),
    ]
    assert [s.algorithm().Tf for s in (*independent, *dependent)] == pytest.approx([0.75] * 4, rel=1e-12)  # 12 s/16


@pytest.mark.parametrize(("PE", "DependIndepend"), FORMS)
def test_smoothing_is_exact_on_both_sides_only_and_then_rests_on_assumptions_of_both_cards(PE: str, DependIndepend: str) -> None:
    KI, KD = (0.05, 12) if PE == "independent" else (0.5, 0.1)
    source = pid(PE=PE, KP=2, KI=KI, KD=KD)
    rough, smooth = (
        pidemu.convert(source, PIDE, options={"DependIndepend": DependIndepend, "DSmoothing": word}, scan=1.0)
        for word in ("false", "true")
    )
    assert (rough.verdict, smooth.verdict) == ("approximate", "exact")
    assert not agree_scan_by_scan(rough)
    assert agree_scan_by_scan(smooth)
    for card in (PID, PIDE):
        found = [c for c in smooth.conditions if c.card == card and c.path.startswith("derivative.filter")]
        assert [c.status for c in found] == ["assumed"]
        assert found[0].text in smooth.sentence


def test_a_time_per_repeat_is_no_unit_of_an_independent_integral_gain() -> None:
    with pytest.raises(SettingError, match="a gain of its own"):
        pide(PGain=2, IGain="30 s/repeat")
    with pytest.raises(SettingError, match="a gain of its own"):
        pid(KP=2, KI="0.5 min/repeat")


def test_a_dial_given_in_the_other_instructions_unit_is_converted() -> None:
    assert pide(PGain=2, IGain="0.05 1/s", DGain="12 s")["IGain"].value == pytest.approx(3)
    assert pide(PGain=2, IGain="0.05 1/s", DGain="12 s")["DGain"].value == pytest.approx(0.2)
    assert pid(KP=2, KI="3 1/min", KD="0.2 min")["KI"].value == pytest.approx(0.05)
