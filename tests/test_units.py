"""Dials against specs/equations.md, section 1."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pidemu.columns.replay import Recording
from pidemu.columns.traced import Tape
from pidemu.errors import UnitError
from pidemu.units import (
    UNITS,
    Dimension,
    Role,
    Spans,
    check_unit,
    convert_unit,
    from_canonical,
    from_canonical_exactly,
    is_reciprocal,
    parse_quantity,
    parse_unit,
    to_canonical,
    to_canonical_exactly,
)


def fits(role: Role, unit: str) -> bool:
    try:
        check_unit(role, UNITS[unit])
    except UnitError:
        return False
    return True


DIALS = [(role, unit) for role in Role for unit in UNITS if fits(role, unit)]
SCAN = Spans(scan=0.5)
INTEGRAL_FACTORS = {"ms": Fraction(1, 1000), "s": Fraction(1), "min": Fraction(60), "h": Fraction(3600)}


@pytest.mark.parametrize(
    ("role", "dial", "unit", "spans", "canonical"),
    [
        pytest.param(Role.GAIN, 2.5, "%/%", Spans(), 2.5, id="gain in percent per percent"),
        pytest.param(Role.GAIN, 40.0, "%", Spans(), 2.5, id="proportional band: K = 100/PB"),
        pytest.param(Role.GAIN, 50.0, "eu", Spans(pv=200.0), 4.0, id="proportional band in EU: K = PV span/PB"),
        pytest.param(Role.GAIN, 0.5, "eu/eu", Spans(pv=200.0, op=50.0), 2.0, id="gain per EU: K = gain PV span/OP span"),
        pytest.param(Role.GAIN, 0.5, "%/eu", Spans(pv=200.0, op=50.0), 1.0, id="percent per EU: K = gain PV span/100"),
        pytest.param(Role.GAIN, 6.0, "psi/in", Spans(pv=4.0, op=12.0), 2.0, id="sensitivity: K = S pen span/output span"),
        pytest.param(Role.INTEGRAL, 0.25, "min/repeat", Spans(), 1 / 15, id="minutes per repeat: Ti"),
        pytest.param(Role.INTEGRAL, 15.0, "s/repeat", Spans(), 1 / 15, id="seconds per repeat: Ti"),
        pytest.param(Role.INTEGRAL, 4.0, "repeat/min", Spans(), 1 / 15, id="repeats per minute: Ti = 1/rate"),
        pytest.param(Role.INTEGRAL, 2.0, "repeat/s", Spans(), 2.0, id="repeats per second: Ti = 1/rate"),
        pytest.param(Role.INTEGRAL, 240.0, "repeat/h", Spans(), 1 / 15, id="repeats per hour: Ti = 1/rate"),
        pytest.param(Role.INTEGRAL, 4.0, "1/min", Spans(), 1 / 15, id="integral gain per minute: ki"),
        pytest.param(Role.INTEGRAL, 0.3, "1/s", Spans(), 0.3, id="integral gain per second: ki"),
        pytest.param(Role.INTEGRAL, 0.25, "min", Spans(), 1 / 15, id="parallel integral time: ki = 1/Ip"),
        pytest.param(Role.DERIVATIVE, 0.5, "min", Spans(), 30.0, id="derivative in minutes"),
        pytest.param(Role.DERIVATIVE, 30.0, "s", Spans(), 30.0, id="derivative in seconds"),
        pytest.param(Role.DERIVATIVE, 250.0, "ms", Spans(), 0.25, id="derivative in milliseconds"),
        pytest.param(Role.FILTER_TIME, 0.1, "min", Spans(), 6.0, id="filter time"),
        pytest.param(Role.TRACKING_TIME, 2.0, "min", Spans(), 120.0, id="tracking time"),
        pytest.param(Role.FILTER_RATIO, 12.5, "%", Spans(), 0.125, id="filter ratio in percent"),
        pytest.param(Role.PROPORTIONAL_WEIGHT, 0.7, "1", Spans(), 0.7, id="setpoint weight"),
        pytest.param(Role.MULTIPLIER, 3.0, "1", Spans(), 3.0, id="overall multiplier"),
        pytest.param(Role.SETPOINT_RATE, 0.25, "eu/scan", Spans(pv=200.0, scan=0.5), 0.25, id="0.25 EU of 200 each half second"),
        pytest.param(Role.OUTPUT_RATE, 5.0, "%/scan", Spans(scan=0.25), 20.0, id="percent per scan of a quarter second"),
        pytest.param(Role.INTEGRAL, 0.05, "1/scan", Spans(scan=0.5), 0.1, id="integral gain per scan of half a second"),
        pytest.param(Role.INTEGRAL, 40.0, "scan/repeat", Spans(scan=0.5), 0.05, id="40 scans of half a second: 20 s"),
        pytest.param(Role.INTEGRAL, 0.125, "repeat/scan", Spans(scan=0.5), 0.25, id="repeats per scan"),
        pytest.param(Role.DERIVATIVE, 8.0, "scan", Spans(scan=0.25), 2.0, id="derivative time in scans"),
        pytest.param(Role.FILTER_TIME, 3.0, "scan", Spans(scan=2.0), 6.0, id="filter time in scans"),
        pytest.param(Role.GAIN, 50.0, "degC", Spans(pv=200.0), 4.0, id="band in the degrees of the range"),
        pytest.param(Role.GAIN, 90.0, "degF", Spans(pv=200.0, degree=Fraction(1)), 4.0, id="90 degF are 50 K, of 0 to 200 degC"),
        pytest.param(Role.GAIN, 50.0, "K", Spans(pv=360.0, degree=Fraction(5, 9)), 4.0, id="50 K, of 0 to 360 degF"),
        pytest.param(Role.GAIN, 0.5, "%/degF", Spans(pv=200.0, degree=Fraction(1)), 1.8, id="percent per degF, range in degC"),
        pytest.param(Role.DEADBAND, 9.0, "degF", Spans(pv=50.0, degree=Fraction(1)), 10.0, id="9 degF are 5 K, of 50"),
        pytest.param(Role.SETPOINT_RATE, 3.0, "degC/min", Spans(pv=200.0), 0.025, id="3 K per minute, of 200"),
        pytest.param(Role.SETPOINT_RATE, 1.0, "K/scan", Spans(pv=50.0, scan=0.5), 4.0, id="1 K each half second, of 50"),
    ],
)
def test_a_dial_means_what_section_1_says_and_back(role: Role, dial: float, unit: str, spans: Spans, canonical: float) -> None:
    assert canonical == to_canonical(role, dial, parse_unit(unit), spans)
    assert dial == from_canonical(role, canonical, parse_unit(unit), spans)


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("rep/min", "repeat/min"),
        ("reps/min", "repeat/min"),
        ("Repeats per Minute", "repeat/min"),
        ("rpm", "repeat/min"),
        ("rpt/min", "repeat/min"),
        ("minutes per repeat", "min/repeat"),
        ("min / rep", "min/repeat"),
        ("mn/rep", "min/repeat"),
        ("sec/rep", "s/repeat"),
        ("seconds", "s"),
        ("secs", "s"),
        ("SEC", "s"),
        ("msec", "ms"),
        ("hrs", "h"),
        ("hours", "h"),
        ("repeats/hour", "repeat/h"),
        ("1/sec", "1/s"),
        ("/min", "1/min"),
        ("percent", "%"),
        ("percent/EU", "%/eu"),
        ("EU/EU", "eu/eu"),
        ("psi/in", "eu/eu"),
        ("psi per inch", "eu/eu"),
        ("", "1"),
        ("samples", "scan"),
        ("EU per scan", "eu/scan"),
        ("repeats/scan", "repeat/scan"),
        ("°C", "degC"),
        ("degF per minute", "degF/min"),
        ("k/h", "K/h"),
    ],
)
def test_people_spell_units_in_many_ways(written: str, name: str) -> None:
    assert name == parse_unit(written).name


@pytest.mark.parametrize("name", UNITS)
def test_every_unit_reads_its_own_spelling(name: str) -> None:
    assert UNITS[name] == parse_unit(name)


@pytest.mark.parametrize(
    ("written", "meant"), [("repaet/min", "repeat/min"), ("min/repaet", "min/repeat"), ("s/reepat", "s/repeat")]
)
def test_an_unknown_unit_is_refused_with_the_nearest_one(written: str, meant: str) -> None:
    with pytest.raises(UnitError, match=rf"unknown unit '{written}' \(did you mean '{meant}'\?\); known units: 1, "):
        parse_unit(written)


def test_an_unknown_unit_far_from_all_is_refused_without_a_suggestion() -> None:
    with pytest.raises(UnitError, match="unknown unit 'furlong'; known units"):
        parse_unit("furlong")


@pytest.mark.parametrize(
    ("text", "number", "unit"),
    [
        ("20 s/repeat", 20.0, "s/repeat"),
        ("20s/repeat", 20.0, "s/repeat"),
        (" -1.5e-3 min ", -1.5e-3, "min"),
        (".5 min", 0.5, "min"),
        ("5. min", 5.0, "min"),
        ("+4 repeats per minute", 4.0, "repeat/min"),
        ("inf s", math.inf, "s"),
        ("Infinity min/repeat", math.inf, "min/repeat"),
        ("40%", 40.0, "%"),
    ],
)
def test_a_quantity_is_a_number_and_a_unit(text: str, number: float, unit: str) -> None:
    assert (number, UNITS[unit]) == parse_quantity(text)


def test_a_quantity_may_leave_its_unit_out() -> None:
    assert parse_quantity("7.25") == (7.25, None)


@pytest.mark.parametrize("text", ["0,5 min", "1,000", "2,5"])
def test_a_decimal_comma_is_refused_with_the_remedy(text: str) -> None:
    with pytest.raises(UnitError, match="has a comma; write a decimal point"):
        parse_quantity(text)


@pytest.mark.parametrize("text", ["", "min", "fast", "--3 s", "e5"])
def test_a_text_without_a_number_is_refused(text: str) -> None:
    with pytest.raises(UnitError, match="is not a number, nor a number with a unit"):
        parse_quantity(text)


@pytest.mark.parametrize(
    ("role", "unit"),
    [
        (Role.GAIN, "s"),
        (Role.GAIN, "repeat/min"),
        (Role.INTEGRAL, "%"),
        (Role.INTEGRAL, "%/%"),
        (Role.DERIVATIVE, "repeat/min"),
        (Role.DERIVATIVE, "s/repeat"),
        (Role.DERIVATIVE, "1/s"),
        (Role.FILTER_TIME, "1"),
        (Role.FILTER_RATIO, "s"),
        (Role.DERIVATIVE_WEIGHT, "eu"),
    ],
)
def test_a_unit_of_the_wrong_dimension_is_refused_with_units_that_fit(role: Role, unit: str) -> None:
    with pytest.raises(UnitError) as caught:
        to_canonical(role, 1.0, UNITS[unit])
    message = str(caught.value)
    assert message.startswith(f"'{unit}' is {UNITS[unit].meaning} and cannot set {role.value.replace('-', ' ')}; ")
    offered = message.split("use one of: ")[1].split(", ")
    assert all(fits(role, name) for name in offered)


def test_not_a_number_is_refused() -> None:
    with pytest.raises(UnitError, match="not a number"):
        to_canonical(Role.GAIN, math.nan, UNITS["%/%"])


def test_four_repeats_per_minute_are_exactly_fifteen_seconds_per_repeat() -> None:
    assert convert_unit(Role.INTEGRAL, 4.0, UNITS["repeat/min"], UNITS["s/repeat"]) == 15.0
    assert convert_unit(Role.INTEGRAL, 4.0, UNITS["repeat/min"], UNITS["min/repeat"]) == 0.25
    assert convert_unit(Role.INTEGRAL, 15.0, UNITS["s/repeat"], UNITS["repeat/min"]) == 4.0


@given(
    rate=st.floats(1e-6, 1e6),
    old=st.sampled_from(sorted(INTEGRAL_FACTORS)),
    new=st.sampled_from(sorted(INTEGRAL_FACTORS)),
)
def test_a_reset_rate_becomes_an_integral_time_by_exact_arithmetic_rounded_once(rate: float, old: str, new: str) -> None:
    exact = INTEGRAL_FACTORS[old] / Fraction(rate) / INTEGRAL_FACTORS[new]
    assert float(exact) == convert_unit(Role.INTEGRAL, rate, UNITS[f"repeat/{old}"], UNITS[f"{new}/repeat"])


@given(dial=st.sampled_from(DIALS), value=st.floats(1e-9, 1e9), pv=st.floats(0.01, 1e5), op=st.floats(0.01, 1e5))
def test_a_dial_value_survives_the_way_to_canonical_and_back(dial: tuple[Role, str], value: float, pv: float, op: float) -> None:
    role, unit, spans = dial[0], UNITS[dial[1]], Spans(pv, op, 0.3)
    there = to_canonical(role, value, unit, spans)
    # each way rounds once, by half a unit in the last place: 2^-53 each, of the value or of its reciprocal
    assert math.isclose(value, from_canonical(role, there, unit, spans), rel_tol=2**-51)


@given(
    role=st.sampled_from(list(Role)), value=st.floats(1e-9, 1e9), pv=st.floats(0.01, 1e5), op=st.floats(0.01, 1e5),
    data=st.data(),
)  # fmt: skip
def test_a_conversion_between_dials_keeps_the_canonical_value(
    role: Role, value: float, pv: float, op: float, data: st.DataObject
) -> None:
    units = st.sampled_from([UNITS[unit] for r, unit in DIALS if r is role])
    old, new, spans = data.draw(units), data.draw(units), Spans(pv, op, 0.3, Fraction(1))
    converted = convert_unit(role, value, old, new, spans)
    # three roundings: the conversion, and one canonical value on either side
    assert math.isclose(to_canonical(role, value, old, spans), to_canonical(role, converted, new, spans), rel_tol=2**-50)


@pytest.mark.parametrize(("role", "unit"), [(r, u) for r, u in DIALS if is_reciprocal(r, UNITS[u])])
def test_zero_and_infinity_change_places_on_a_reciprocal_dial(role: Role, unit: str) -> None:
    assert to_canonical(role, math.inf, UNITS[unit], SCAN) == 0.0
    assert math.inf == from_canonical(role, 0.0, UNITS[unit], SCAN)
    assert math.inf == to_canonical(role, 0.0, UNITS[unit], SCAN)


@pytest.mark.parametrize(("role", "unit"), [(r, u) for r, u in DIALS if not is_reciprocal(r, UNITS[u])])
def test_zero_and_infinity_stay_themselves_on_a_direct_dial(role: Role, unit: str) -> None:
    assert to_canonical(role, 0.0, UNITS[unit], SCAN) == 0.0
    assert math.inf == to_canonical(role, math.inf, UNITS[unit], SCAN)


def test_only_bands_integral_times_and_frequencies_are_reciprocal() -> None:
    reciprocal = {(r, UNITS[u].dimension) for r, u in DIALS if is_reciprocal(r, UNITS[u])}
    assert {
        (Role.GAIN, Dimension.PERCENT),
        (Role.GAIN, Dimension.PV_UNITS),
        (Role.INTEGRAL, Dimension.TIME),
        (Role.INTEGRAL, Dimension.TIME_PER_REPEAT),
        (Role.FILTER_TIME, Dimension.FREQUENCY),
    } == reciprocal


def test_an_integral_time_of_infinity_is_no_repeats_per_minute() -> None:
    assert convert_unit(Role.INTEGRAL, math.inf, UNITS["s/repeat"], UNITS["repeat/min"]) == 0.0
    assert math.inf == convert_unit(Role.INTEGRAL, 0.0, UNITS["repeat/min"], UNITS["s/repeat"])


def test_what_counts_in_scans_needs_the_scan_interval() -> None:
    with pytest.raises(UnitError, match="'eu/scan' counts in scans, and the scan interval is not known"):
        to_canonical(Role.SETPOINT_RATE, 1.0, UNITS["eu/scan"])


@pytest.mark.parametrize(
    ("role", "value", "old", "new", "expected"),
    [
        (Role.GAIN, 9.0, "degF", "degC", 5.0),
        (Role.GAIN, 1.0, "%/degC", "%/degF", 5 / 9),
        (Role.DEADBAND, 5.0, "K", "degF", 9.0),
        (Role.SETPOINT_RATE, 120.0, "degC/h", "K/min", 2.0),
    ],
)
@pytest.mark.parametrize("pv", [1.0, 100.0, 350.0])
def test_one_kind_of_degree_becomes_another_whatever_the_range(
    role: Role, value: float, old: str, new: str, expected: float, pv: float
) -> None:
    assert expected == convert_unit(role, value, UNITS[old], UNITS[new], Spans(pv=pv))


@pytest.mark.parametrize(("role", "unit", "other"), [(Role.BIAS, "degC", "eu"), (Role.OUTPUT_RATE, "degF/min", "eu/min")])
def test_the_output_is_not_measured_in_degrees(role: Role, unit: str, other: str) -> None:
    with pytest.raises(UnitError, match=f"belongs to the output; use '{other}'"):
        check_unit(role, UNITS[unit])


@pytest.mark.parametrize("role", list(Role))
def test_a_dial_in_scans_is_the_same_at_a_traced_interval(role: Role) -> None:
    numbers = np.array([[0.3, 7.0, 1e-3, 4.0], [0.1, 0.5, 3.0, 60.0]])
    for unit in (unit for unit in UNITS.values() if unit.scans):
        for convert in (to_canonical, from_canonical):
            try:
                expected = [convert(role, x, unit, Spans(16.0, 4.0, scan=h)) for x, h in numbers.T.tolist()]
            except UnitError:  # it does not set this
                continue
            tape, first = Tape(), numbers[:, 0].tolist()
            traced: Any = [tape.number(given) for given in first]
            result = convert(role, traced[0], unit, Spans(16.0, 4.0, scan=traced[1]))
            found, same = Recording.of(tape, first, [result]).replay(numbers)
            assert same.all()
            assert found[0].tolist() == expected


@pytest.mark.parametrize("role", list(Role))
def test_every_conversion_is_rounded_once(role: Role) -> None:
    spans = Spans(3.7, 16.0, 0.3)
    for old, new in itertools.product(UNITS.values(), repeat=2):
        for x in (0.1, 7.0, 1e-300, 4 / 3, 1e300):
            try:
                found = convert_unit(role, x, old, new, spans)
            except UnitError:
                continue
            degrees = replace(spans, degree=old.degree or new.degree)
            exactly = from_canonical_exactly(role, to_canonical_exactly(role, Fraction(x), old, degrees), new, degrees)
            assert found == (float(exactly) if exactly < 2**1024 else math.inf)
