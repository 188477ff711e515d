"""Signal ranges are read with their units, and two of them are held against each other."""

from __future__ import annotations

import math
import re
import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import pidemu
from pidemu.errors import SettingError
from pidemu.settings.quantities import measure_of
from pidemu.settings.range_relation import RangeQuestion, Relation, relation
from pidemu.settings.ranges import (
    NO_LIMIT,
    PERCENT,
    RANGES,
    UNLIMITED,
    SignalRange,
    Which,
    are_limits,
    infinite_where_none,
    is_limit,
    read_range,
)

OVEN = SignalRange(0.0, 400.0, "degC")


@pytest.mark.parametrize(
    "given",
    [(0, 400, "degC"), [0, 400, " degC "], "0,400 degC", " 0 , 400degC ", "0..400 degC", "0 to 400 degC", "+0,4e2 degC", OVEN],
)
def test_a_range_is_read_from_numbers_and_from_text(given: object) -> None:
    assert read_range(given) == OVEN


@pytest.mark.parametrize("given", [(0, 400), "0,400", "0..400", "0.0..400.0"])
def test_a_range_may_come_without_a_unit(given: object) -> None:
    assert read_range(given) == SignalRange(0.0, 400.0)


def test_a_raw_scale_may_say_what_it_stands_for() -> None:
    found = read_range("0,27648 counts = 0..300 degC")
    assert (found.ends, found.unit, found.meaning) == ((0.0, 27648.0), "counts", SignalRange(0.0, 300.0, "degC"))
    assert str(found) == "0 to 27648 counts (which is 0 to 300 degC)"


@pytest.mark.parametrize("text", ["0,400 degC", "-50,150", "0.1,1e+14 bar", "0,27648 counts = -20,300 degC", "4,20 mA"])
def test_what_a_range_prints_as_an_argument_is_read_as_that_range(text: str) -> None:
    assert read_range(text).argument == text
    assert read_range(read_range(text).argument) == read_range(text)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("5", "'5' is not a range; write low and high with a unit, such as \"0,400 degC\""),
        ("0,1,2", "'0,1,2' is not a range; write"),
        ("0,4 counts = 5", "'0,4 counts = 5' is not a range; write"),
        ("0,4 counts = 0,1 m = 0,2 m", "is not a range; write"),
        ("0,400,degC", "'0,400,degC' is not a range; write"),
        ("400,0 degC", "400 to 0 degC is not a range; give two finite numbers, low before high"),
        ("0,27648 counts = 300..0 degC", "300 to 0 degC is not a range"),
        ((0, 0), "0 to 0 is not a range; give two finite numbers, low before high"),
        ((0, float("nan")), "0 to nan is not a range"),
        ((0, 1, 2), "(0, 1, 2)' is not a range; give low and high with a unit"),
        ((0, True), "is not a range"),
        (("0", "1"), "is not a range"),
        (None, "'None' is not a range"),
    ],
)
def test_what_is_not_a_range_is_refused_with_what_to_write(given: object, message: str) -> None:
    with pytest.raises(SettingError) as error:
        read_range(given)
    assert message in str(error.value)


EXACT: dict[tuple[str, str], str] = {  # one of the first in the second, by the definition of the units
    ("degC", "K"): "1", ("degC", "degF"): "9/5", ("°C", "F"): "9/5", ("bar", "kPa"): "100", ("bar", "mbar"): "1000",
    ("MPa", "bar"): "10", ("kg/cm2", "Pa"): "98066.5", ("atm", "torr"): "760", ("inH2O", "Pa"): "249.08891", ("m", "mm"): "1000",
    ("ft", "m"): "0.3048", ("m3/h", "l/min"): "50/3", ("gpm", "l/min"): "3.785411784", ("t/h", "kg/hr"): "1000",
    ("lb/h", "kg/h"): "0.45359237", ("psig", "psia"): "1", ("m3 per hour", "m³/h"): "1", ("mS/cm", "uS/cm"): "1000",
}  # fmt: skip


@pytest.mark.parametrize(("one", "other"), EXACT)
def test_units_of_one_quantity_have_their_exact_ratio(one: str, other: str) -> None:
    a, b = measure_of(one), measure_of(other)
    assert (a.quantity, a.kind) == (b.quantity, "physical")
    assert a.factor / b.factor == Fraction(EXACT[one, other])


def test_a_pound_per_square_inch_is_the_published_number_of_pascals() -> None:
    assert f"{float(measure_of('psi').factor):.7g}" == "6894.757"  # NIST SP 811, appendix B: 6.894 757 E+03


def test_upper_and_lower_case_do_not_matter_where_that_is_clear() -> None:
    assert measure_of("DEGC") == measure_of("degC")
    assert measure_of("KPA") == measure_of("kPa")
    assert measure_of("mv").quantity == "voltage"


def related(source: str, target: str, which: Which = "pv_range") -> Any:
    return relation(read_range(source), read_range(target), which)


PHYSICS: dict[tuple[str, str], str] = {
    ("0,200 degC", "0,400 degC"): "2",
    ("0,200 degC", "-50,50 degC"): "1/2",
    ("0,100 degC", "32,212 degF"): "1",
    ("0,100 degC", "0,100 degF"): "5/9",
    ("0,300 degC", "273,673 K"): "4/3",
    ("0,1 MPa", "0,16 bar"): "8/5",
    ("0,60 m3/h", "0,1000 l/min"): "1",
    ("0,500 NTU", "0,1000 ntu"): "2",
    ("0,27648 counts = 0..300 degC", "0,400 degC"): "4/3",
    ("0,400 degC", "0,27648 counts = 0..300 degC"): "3/4",
    ("0,4095 counts = 0..300 degC", "0,27648 counts = 0..600 degC"): "2",
    ("4,20 mA = 0..10 bar", "0,1000 kPa"): "1",
}


@pytest.mark.parametrize(("source", "target"), PHYSICS)
def test_another_range_of_the_same_quantity_changes_the_gain_by_the_spans(source: str, target: str) -> None:
    factor = Fraction(PHYSICS[source, target])
    assert related(source, target).factor == factor
    assert related(source, target, "op_range").factor == 1 / factor


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("0,16383 counts", "0,1000 degF"), ("0,255 pwm", "0,1 duty"), ("0,4095 counts", "0,16383 counts"), ("0,100 %", "0,9 degF"),
        ("4,20 mA", "0,400 degC"), ("4,20 mA", "0,100 %"), ("0,10 V", "4,20 mA"), ("0,255 pwm", "0,1"), ("0,3 furlong", "0,4 degC"),
        ("0,27648 counts = 0..300 degC", "0,16383 counts"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("which", RANGES)
def test_the_same_signal_on_another_scale_leaves_the_gain_and_says_so(source: str, target: str, which: Which) -> None:
    for one, other in ((source, target), (target, source)):
        found = related(one, other, which)
        assert found.factor == 1
        assert "are taken as the same signal, end for end" in found.text


def test_a_word_that_is_not_a_known_unit_is_named() -> None:
    assert related("0,300 furlong", "0,400 degC").text.endswith("('furlong': not a unit that pidemu knows)")


@pytest.mark.parametrize(
    ("source", "target"),
    [("0,400", "0,400"), ("0,400", "0,400 degC"), ("0,400 degC", "0,400"), ("0,200", "-50,150"), ("4,20 mA", "0.004,0.02 A")],
)
def test_nothing_is_asked_where_every_reading_has_the_same_gain(source: str, target: str) -> None:
    assert related(source, target) == Relation()


ASKED = [
    ("0,200", "0,400"), ("0,200", "0,400 degC"), ("0,10 bar", "0,500 degC"), ("0,100 kg/h", "0,50 m3/h"), ("0,100 %", "0,50 %"),
    ("4,20 mA", "0,20 mA"), ("0,27648 counts = 0..300 degC", "0,400"), ("0,2 mA", "0.1,0.2 A"), ("0,4", "0,27648 counts = 0..3 K"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "target"), ASKED)
@pytest.mark.parametrize("which", RANGES)
def test_it_is_asked_where_two_ranges_can_be_read_in_two_ways(source: str, target: str, which: Which) -> None:
    found = related(source, target, which)
    assert isinstance(found, RangeQuestion)
    assert (found.kind, found.about) == ("scale", which)
    assert [r.text.partition(":")[0] for r in found.readings] == [
        "the same signal (ends correspond)", "another range of the same quantity",
    ]  # fmt: skip


@pytest.mark.parametrize(("source", "target"), ASKED)
@pytest.mark.parametrize("which", RANGES)
def test_the_ranges_of_a_reading_state_that_reading_and_keep_the_controller_s_own_scale(
    source: str, target: str, which: Which
) -> None:
    given = read_range(source), read_range(target)
    for reading in related(source, target, which).readings:
        again = relation(read_range(reading.source.argument), read_range(reading.target.argument), which)
        assert isinstance(again, Relation)
        assert again.factor == reading.factor
        assert reading.source.ends == given[0].ends


def test_the_target_has_the_source_s_range_where_its_own_is_not_given() -> None:
    assert relation(OVEN, None, "pv_range") == Relation()
    assert relation(None, None, "op_range") == Relation()


def test_the_source_s_range_is_asked_for_where_only_the_target_s_is_given() -> None:
    found = relation(None, OVEN, "pv_range")
    assert isinstance(found, RangeQuestion)
    assert (found.kind, found.about, found.example) == ("range", "pv_range", '--pv-range "0,400 degC"')


VALVE = SignalRange(4.0, 20.0, "mA")


def test_a_level_counts_from_the_low_end_and_a_change_from_nothing() -> None:
    assert (VALVE.from_percent(25.0), VALVE.in_percent(8.0)) == (8.0, 25.0)
    assert (VALVE.change_from_percent(25.0), VALVE.change_in_percent(4.0)) == (4.0, 25.0)


def test_arrays_are_scaled_as_numbers_are() -> None:
    levels = np.array([4.0, 12.0, 20.0])
    assert VALVE.in_percent(levels).tolist() == [0.0, 50.0, 100.0]
    assert VALVE.from_percent(VALVE.in_percent(levels)).tolist() == levels.tolist()


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.floats(-200, 200))
def test_percent_there_and_back_is_the_same_but_for_rounding(low: float, span: float, x: float) -> None:
    own = SignalRange(low, low + span)
    assume(own.low < own.high)
    size = 100 * max(abs(own.low), abs(own.high)) / own.span
    assert own.in_percent(own.from_percent(x)) == pytest.approx(x, abs=1e-14 * max(size, abs(x)))
    assert own.change_in_percent(own.change_from_percent(x)) == pytest.approx(x, rel=1e-14)


def test_a_signal_in_percent_already_keeps_its_bits() -> None:
    for x in (-0.0, 0.1, 1e300, math.inf):
        assert [struct.pack("d", x)] * 2 == [struct.pack("d", f(x)) for f in (PERCENT.from_percent, PERCENT.in_percent)]


@pytest.mark.parametrize("x", [NO_LIMIT, 3.4e38, 1e38, math.inf])
def test_the_largest_float32_is_no_limit_and_neither_is_infinity(x: float) -> None:
    assert (is_limit(x), is_limit(-x), are_limits((0.0, x))) == (False, False, False)
    assert infinite_where_none((-x, 100.0)) == (-math.inf, 100.0)


def test_what_is_no_limit_is_none_in_any_unit() -> None:
    wide = SignalRange(0.0, 1e12)
    for limits in (UNLIMITED, (-math.inf, math.inf), (-1e38, 1e38)):
        assert wide.limits_in_percent(limits) == limits
        assert wide.limits_from_percent(limits) == limits
    assert VALVE.limits_in_percent((4.0, math.inf)) == (0.0, math.inf)
    assert VALVE.limits_from_percent((0, 75)) == (4.0, 16.0)


def test_no_other_module_has_a_number_of_its_own_for_no_limit() -> None:
    """Neither a pair such as (-1e12, 1e12) nor a name that says so."""
    source = Path(pidemu.__file__).parent
    found = [
        f"{path.relative_to(source)}: {line.strip()}"
        for path in source.rglob("*.py")
        if path != source / "settings" / "ranges.py"
        for line in path.read_text("utf-8").splitlines()
        if re.search(r"\(-(1e\d+), \1\)|^_?(NO_LIMIT|UNLIMITED|WIDE|FREE)\b.*=", line)
    ]
    assert found == []
