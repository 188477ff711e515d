"""What holds of every choice that a conversion makes and of every sentence it says, over all ordered pairs of cards."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.algorithm.model import Algorithm
from pidemu.errors import PidemuError
from pidemu.process.process import parse_process
from pidemu.settings.settings import limits
from pidemu.units import Role
from tests.conversion.policy import RANGES, TWO_SCANS, convert, converted, drawn, numbers, stated
from tests.helpers import made_up_card, option_combinations

PROCESS = parse_process("gain=1,lag=30,delay=5")


def p_sees_setpoint(a: Algorithm, mode: str) -> bool:
    weight = a.cascade_b if mode == "cascade" and a.cascade_b is not None else a.b
    return bool(a.kp and weight)


def spikes(a: Algorithm) -> bool:
    """Whether a setpoint step goes through a derivative without any filter."""
    return bool(a.kd and a.c and not (a.Tf or a.measurement.filter or a.error.filter or a.setpoint.filter))


@given(
    data=st.data(), scan=st.none() | TWO_SCANS, process=st.sampled_from([None, PROCESS]), mode=st.sampled_from(["auto", "cascade"])
)
@settings(max_examples=60)
def test_p_on_the_error_is_kept_wherever_a_choice_of_the_target_keeps_it(
    data: st.DataObject, scan: tuple[float, float] | None, process: object, mode: str
) -> None:
    source, target = drawn(data)
    a = source.algorithm()
    assume(p_sees_setpoint(a, mode))
    assume(process is None or a.kp > 0)  # with a gain of the other sign this process is refused
    how: dict[str, Any] = {"scan": scan, "process": process, "mode": mode}
    found = converted(source, target, **how)
    if p_sees_setpoint(found.settings.algorithm(), mode):
        return
    for options in option_combinations(pidemu.load_card(target)):
        try:
            other = convert(source, target, options=options, **how).settings.algorithm()
        except PidemuError:
            continue
        assert not p_sees_setpoint(other, mode) or (spikes(other) and not spikes(a)), options


@given(data=st.data(), scan=TWO_SCANS)
@settings(max_examples=50)
def test_plain_settings_do_not_depend_on_the_scan_intervals(data: st.DataObject, scan: tuple[float, float]) -> None:
    source, target = drawn(data)
    assume(not source.counts_scans)
    without, at_scan = converted(source, target), converted(source, target, scan=scan)
    assume(not without.settings.counts_scans)
    if without.settings.options != at_scan.settings.options:  # noise at the scans may choose a smoothing, or a form
        assert source.algorithm().kd
        at_scan = converted(source, target, scan=scan, options=without.settings.options)
    assert numbers(at_scan.settings) == numbers(without.settings)


def test_a_slow_scan_does_not_change_how_plain_settings_are_matched() -> None:
    """At 2 s half the scan rate ends the loop band before 5/Ti, where the match without scan intervals is judged."""
    source = pidemu.load_card("oscat/ft-pid").settings({"KP": 1, "TN": 1, "TV": 1, **RANGES})
    without, at_scan = (convert(source, "advanced-pid/advanced-pid", given={"Tf": 1}, scan=h) for h in (None, (2.0, 1.0)))
    assert numbers(at_scan.settings) == numbers(without.settings)


@given(data=st.data(), scan=TWO_SCANS)
@settings(max_examples=20)
def test_compensation_adds_no_derivative_and_turns_no_term_round(data: st.DataObject, scan: tuple[float, float]) -> None:
    source, target = drawn(data)
    a, b = source.algorithm(), converted(source, target, scan=scan, compensate=True).settings.algorithm()
    turn = -1 if (a.ki or a.kp) * (b.ki or b.kp) < 0 else 1  # the action may be carried by the sign
    assert a.kd or not b.kd
    for old, new in ((a.kp, b.kp), (a.ki, b.ki), (a.kd, b.kd)):
        assert turn * old * new >= 0


def test_compensation_keeps_the_gain_of_a_pi_controller_that_scans_more_slowly() -> None:
    source = pidemu.load_card("generic/standard").settings(K=0.4, Ti=6)
    found = pidemu.convert(source, "emerson/deltav", scan=(0.5, 4), compensate=True, assume=True)
    assert found.settings["GAIN"].value == pytest.approx(0.4, rel=1e-3)


def test_compensation_meets_the_gain_of_a_forward_rule_at_another_interval() -> None:
    """The hold takes ki h/2 from what acts in phase; the backward rule adds ki h/2, the forward rule takes it as well.

    In phase there is 2 + 0.05 - 0.05 = 2 before and kp - 0.1 - 0.1 after, so kp is 2.2.
    """
    forward = made_up_card(integral={"rule": "forward", "windup": {"scheme": "none"}})
    source = pidemu.load_card("generic/standard").settings(K=2, Ti=20)
    found = pidemu.convert(source, forward, scan=(1, 2), compensate=True, emulate=False)
    assert found.settings["kp"].value == pytest.approx(2.2, rel=1e-9)
    assert found.settings["ki"].value == pytest.approx(0.1, rel=1e-9)


@given(data=st.data(), declared=st.floats(0.1, 2), times=st.floats(0.1, 10))
@settings(max_examples=40)
def test_a_source_executed_at_another_interval_is_the_source_with_its_times_scaled(
    data: st.DataObject, declared: float, times: float
) -> None:
    source, target = drawn(data)
    e = source.equation
    filt = e.derivative.filter
    own_time = filt is not None and isinstance(filt.time, float | int)
    factors = any(v.role is Role.FILTER_FACTOR and v.active for v in source.values())
    assume(e.scan.interval != "measured" and not source.counts_scans and not own_time and not factors)
    scaled: dict[str, object] = {}
    for n, v in source.items():
        if v.active and not v.off and v.role in (Role.INTEGRAL, Role.DERIVATIVE, Role.FILTER_TIME, Role.TRACKING_TIME):
            rate = v.unit.startswith(("1/", "repeat/"))
            scaled[n] = v.value / times if rate or v.unit == "Hz" else v.value * times
            low, high = limits(v.setting)
            assume(low <= scaled[n] <= high)  # type: ignore[operator]
    other = source.card.settings({**stated(source), **RANGES, **scaled})
    paced = converted(source, target, scan=declared, runs_every=declared * times)
    plain = converted(other, target, scan=declared * times)
    assert paced.settings.options == plain.settings.options
    acting = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)
    for n, v in plain.settings.items():
        if v.active and v.role in acting:
            assert paced.settings[n].value == pytest.approx(v.value, rel=1e-6, abs=1e-12), n
    assert paced.verdict == plain.verdict


@given(data=st.data())
@settings(max_examples=50)
def test_what_is_printed_differs_from_the_unrounded_by_half_a_unit_of_the_fifth_digit(data: st.DataObject) -> None:
    source, target = drawn(data)
    found = converted(source, target, digits=5)
    plain = converted(source, target)
    assert numbers(found.unrounded) == numbers(plain.settings)
    for n, v in found.settings.items():
        exact, step = found.unrounded[n].value, v.setting.resolution
        if v.value == exact:
            continue
        most = 5e-5 * abs(exact) if step is None else step
        assert abs(v.value - exact) <= most * (1 + 1e-9), n
    if found.verdict != plain.verdict:
        assert found.verdict == "approximate"
        w = np.geomspace(0.01, 5, 400) / found.certificate.time_scale
        one, two = (s.law().response(w) for s in (found.settings, plain.settings))
        assert float(np.max(np.abs(one / two - 1))) > 1e-3


BANNED = (
    "may be lost or won", "rest on what nobody says", "of which nobody knows", "nobody said", "nobody says", "is no number",
    "is no time", "is no unit", "of as much the other way", "  ",
)  # fmt: skip


@given(data=st.data(), scan=st.none() | TWO_SCANS, digits=st.sampled_from([None, 5]))
@settings(max_examples=25)
def test_every_sentence_is_one_and_claims_nothing_of_margins_without_a_process(
    data: st.DataObject, scan: tuple[float, float] | None, digits: int | None
) -> None:
    source, target = drawn(data)
    found = converted(source, target, scan=scan, digits=digits, emulate=True, allow_approximate=True)
    for text in (found.sentence, *found.warnings, *found.at_the_loop):
        assert text.endswith((".", "!", ". ")), text
        assert text.strip() == text
        assert not [b for b in BANNED if b in text], text
        assert not re.search(r"\.\.|\. \.|,\.|;\.| ,|\(\)|\bnan\b|\bNone\b|\binf\b", text), text
    for line in (*map(str, found.conditions), *map(str, found.beside), *(x.spread for x in found.conditions)):
        assert not [b for b in BANNED if b in line], line
    assert not re.search(r"margin|stays? stable|\bMs\b", found.sentence)
