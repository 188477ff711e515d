"""Output limits, bias and other things that are stated with a conversion, and what is said of those that cannot be."""

from __future__ import annotations

from typing import Any

import pytest

import pidemu
from pidemu.errors import PidemuError, ScanError, SettingError

STANDARD = pidemu.load_card("generic/standard").settings(K=2, Ti=20, Td=2)


def aspects(c: pidemu.Conversion) -> dict[str, str]:
    return {d.aspect: d.text for d in c.certificate.nonlinear}


def test_stated_limits_are_those_of_the_emulation_and_those_delivered_do_not_differ_then() -> None:
    plain, stated = (pidemu.convert(STANDARD, "ni/pid", limits=x) for x in (None, (20, 60)))
    assert aspects(plain)["limits"].startswith(
        "Output limits as delivered: 0 to 100 % on generic/standard, -100 to 100 % on ni/pid."
    )
    assert "limits" not in aspects(stated)
    windup = aspects(pidemu.convert(STANDARD, "allen-bradley/pide", limits=(20, 60)))["windup"]
    assert windup.startswith("With the valve at 60 % and the error reversing")


def test_a_plan_holds_the_output_against_the_stated_limits() -> None:
    c = pidemu.convert(STANDARD, "allen-bradley/pide", limits=(20, 60))
    assert c.transfer_plan(sp=50, pv=50, op=60, action="reverse").is_bumpless
    with pytest.raises(ScanError, match=r"the output of 80 % is outside the output limits, 20 % to 60 %"):
        c.transfer_plan(sp=50, pv=50, op=80, action="reverse")


@pytest.mark.parametrize(
    ("bias", "message"),
    [
        (150.0, "bias is 150 %; it is the output at SP = PV, between -10 and 110 %"),
        (-10.5, "bias is -10.5 %; it is the output at SP = PV, between -10 and 110 %"),
        (float("nan"), "bias is nan; give a finite number"),
        (float("inf"), "bias is inf; give a finite number"),
    ],
)
def test_a_bias_beyond_the_output_is_refused(bias: float, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        pidemu.convert(STANDARD, "emerson/deltav", bias=bias)


def test_compensation_without_effect_is_told_and_not_where_there_is_nothing_to_make_up_for() -> None:
    told = "Nothing was compensated: no settings come nearer at these scans, so these are the plain ones."
    assert told not in pidemu.convert(STANDARD, "generic/parallel", scan=1, compensate=True).warnings
    iec = pidemu.load_card("iec/61131-3-pid").settings(KP=1.2, TR=8, TD=0.6)
    found = pidemu.convert(iec, "iec/61131-3-pid", scan=(1, 0.1), compensate=True)
    assert (told in found.warnings) is (not found.certificate.compensated)


def test_a_source_that_is_not_settings_is_told_so() -> None:
    wrong: Any = "fisher/provox"
    with pytest.raises(PidemuError, match=r"source is 'fisher/provox'; give settings, such as load_card\("):
        pidemu.convert(wrong, "emerson/deltav")


def test_two_quantities_with_equal_ends_are_told_to_be_taken_as_the_same_signal() -> None:
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=3, pv_range="0,10 bar")
    said = pidemu.convert(source, "emerson/deltav", to_pv_range="0,10 m/s").warnings
    assert "PV range: 0 to 10 bar and 0 to 10 m/s are taken as the same signal, end for end, so the gain in percent stays." in said
