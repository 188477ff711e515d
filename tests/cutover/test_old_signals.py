"""Signals at the cut-over are read as the old controller shows them, and set as the new one does."""

from __future__ import annotations

import pytest

import pidemu
from pidemu.conversion.result import Conversion
from pidemu.errors import ScanError, SettingError
from pidemu.settings.range_relation import in_target_units
from pidemu.settings.ranges import read_range


def converted(old: str | None, new: str | None) -> Conversion:
    source = pidemu.load_card("fisher/provox").settings(GAIN=2, RESET=4, **({} if old is None else {"pv_range": old}))
    return pidemu.convert(source, "emerson/deltav", to_pv_range=new, action="reverse")


@pytest.mark.parametrize(
    ("x", "old", "new", "shown"),
    [
        (150, "0,300 degC", "0,600 degF", 302),
        (300, "273.15,573.15 K", "0,300 degC", 26.85),
        (2, "0,10 bar", "0,1000 kPa", 200),
        (12, "4,20 mA", "0,100 %", 50),
        (8192, "0,16384 counts", "0,400 degC", 200),
        (150, "0,300 degC", "0,16384 counts", 8192),
        (8192, "0,16384 counts = 0..300 degC", "0,600 degF", 302),
        (150, "0,300 degC", "0,27648 counts = 0..600 degF", 302 / 600 * 27648),
        (50, "0,100 degC", None, 50),
        (50, None, None, 50),
    ],
)
def test_a_signal_is_the_same_one_in_the_new_units(x: float, old: str | None, new: str | None, shown: float) -> None:
    ranges = [None if r is None else read_range(r) for r in (old, new)]
    assert in_target_units(x, *ranges) == pytest.approx(shown, rel=1e-12)


def test_a_gauge_pressure_is_not_an_absolute_one() -> None:
    with pytest.raises(SettingError, match="pressure of the atmosphere"):
        in_target_units(3, read_range("0,10 barg"), read_range("1,11 bara"))


def test_a_plan_is_in_the_new_units_and_says_so() -> None:
    plan = converted("0,300 degC", "0,600 degF").transfer_plan(150, 150, 40)
    assert plan.steps[0].do == "set the target's setpoint to 302 degF"
    assert plan.notes[0] == "on the new controller, setpoint 150 degC is 302 degF, measurement 150 degC is 302 degF"
    assert plan.is_bumpless


@pytest.mark.parametrize("signals", [(500, 50, 40), (50, -11, 40)])
def test_a_percentage_beyond_the_range_is_noticed_without_a_range(signals: tuple[float, float, float]) -> None:
    conversion = converted(None, None)
    with pytest.raises(ScanError, match="is outside the old controller's range, 0 to 100 %"):
        conversion.transfer_plan(*signals)


@pytest.mark.parametrize("signals", [(302, 150, 40), (150, -31, 40)])
def test_a_signal_in_the_new_units_is_noticed(signals: tuple[float, float, float]) -> None:
    conversion = converted("0,260 degC", "0,600 degF")
    with pytest.raises(ScanError, match="is outside the old controller's range, 0 to 260 degC"):
        conversion.transfer_plan(*signals)
