"""There and back: every card to itself, to the parallel form and back, and from card to card and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pidemu
from pidemu.conversion.refused import ConversionRefusedError
from pidemu.conversion.result import Conversion
from pidemu.conversion.target.computed import is_computed
from pidemu.settings.settings import Settings
from pidemu.units import Role
from tests.conversion.support import needed, settings_that_act

ALL = [c for c in pidemu.cards() if pidemu.load_card(c).data.form != "dahlin"]  # a recursion has no PID settings
CORE = (Role.GAIN, Role.INTEGRAL, Role.DERIVATIVE)


def to_itself(s: Settings, **given_: object) -> Conversion:
    return pidemu.convert(s, s.card, options=s.options, given=given_, assume=True, emulate=False)


@pytest.mark.parametrize("card", ALL)
@given(data=st.data())
@settings(max_examples=80)
def test_a_card_to_itself_is_exact(card: str, data: st.DataObject) -> None:
    s = settings_that_act(data, pidemu.load_card(card))
    assume(has_distinct_times(s))
    assert to_itself(s, **uncomputed(s)).verdict == "exact"


@pytest.mark.parametrize("card", ALL)
@given(data=st.data())
@settings(max_examples=60)
def test_a_card_to_itself_with_its_other_dials_held_gives_the_same_dials(card: str, data: st.DataObject) -> None:
    s = settings_that_act(data, pidemu.load_card(card))
    assume(has_distinct_times(s))
    Td = times(s)[1]
    assume(not Td or abs(s.algorithm().Tf / Td - 1) > 1e-6)  # a filter as long as the derivative cancels it: its dial says nothing
    held = {n: v.value for n, v in s.items() if v.active and v.role not in CORE}
    conversion = to_itself(s, **held)
    assert conversion.verdict == "exact"
    if s.equation.derivative.rule == "lagged-difference" and not s.algorithm().kd:
        return  # without a filter this rule has no derivative, whatever the dial says
    if s.equation.proportional.on == "none":
        return  # gain and times are a product there, no dial has a value of its own
    for name, value in conversion.settings.items():
        if value.active and s.equation.form != "series":
            assert value.canonical == pytest.approx(s[name].canonical, rel=1e-9), name
    if s.equation.form == "series":
        found, wanted = (sorted(times(x)) for x in (conversion.settings, s))  # the two times may change places
        # the roots of a quadratic, a millionth apart or more: rounding of 1e-16 moves them by 1e-10
        assert found == pytest.approx(wanted, rel=1e-7)


def has_distinct_times(s: Settings) -> bool:
    """Whether the two times of a series form are apart: a double root moves by 1e-8 when its coefficients are rounded by 1e-16."""
    Ti, Td = times(s)
    return s.equation.form != "series" or Ti == math.inf or abs(Td / Ti - 1) > 1e-6


def times(s: Settings) -> tuple[float, float]:
    integral, derivative = s.by_role(Role.INTEGRAL), s.by_role(Role.DERIVATIVE)
    rate = integral.canonical if integral is not None else 0.0
    return (1 / rate if rate else math.inf), (derivative.canonical if derivative is not None else 0.0)


@pytest.mark.parametrize("card", ALL)
@given(data=st.data())
@settings(max_examples=60)
def test_to_the_parallel_form_and_back_is_exact_where_the_first_step_is(card: str, data: st.DataObject) -> None:
    s = settings_that_act(data, pidemu.load_card(card))
    a = s.algorithm()
    assume(
        a.setpoint.filter is a.measurement.filter is a.error.filter is None
    )  # the way back holds these, and the parallel form has none
    try:
        there = pidemu.convert(s, "generic/parallel", mode="auto", assume=True, emulate=False)
    except ConversionRefusedError:
        assume(False)
    assume(there.certificate.feedback.is_exact)
    back = pidemu.convert(
        there.settings, s.card, options=s.options, given=uncomputed(s), mode="auto", allow_approximate=True, emulate=False
    )
    assert back.certificate.feedback.is_exact
    if back.refusal:  # the parallel form holds its output by a bias where there is no integral, and this block does not
        assert not s.algorithm().ki
        assert "cannot hold the output of a loop without integral action" in back.refusal
        return
    assert back.verdict in ("exact", "exact-feedback")
    if there.verdict == "exact" and has_distinct_times(s) and s.equation.proportional.on != "none":
        assert back.verdict == "exact"


def uncomputed(s: Settings) -> dict[str, object]:
    """Dials that a conversion does not choose: of the module, limits, deadbands, times of tracking."""
    return {
        n: v.value for n, v in s.items() if v.active and (v.setting.scope == "module" or not is_computed(s.equation, n, v.role))
    }


def deviation(s: Settings, t: Settings, low: float, high: float) -> float:
    w = np.geomspace(low, high, 500)
    sign = math.copysign(1.0, t.algorithm().ki or t.algorithm().kp) * math.copysign(1.0, s.algorithm().ki or s.algorithm().kp)
    return float(np.max(np.abs(sign * t.law().response(w) / s.law().response(w) - 1)))  # negative gains become the other action


@given(data=st.data(), names=st.tuples(st.sampled_from(ALL), st.sampled_from(ALL)))
@settings(max_examples=250)
def test_there_and_back_stays_within_the_two_stated_deviations(data: st.DataObject, names: tuple[str, str]) -> None:
    a = settings_that_act(data, pidemu.load_card(names[0]))
    try:
        there = pidemu.convert(a, names[1], given=needed(pidemu.load_card(names[1])), mode="auto", assume=True, emulate=False)
        back = pidemu.convert(
            there.settings, a.card, options=a.options, given=uncomputed(a), mode="auto", assume=True, emulate=False
        )
    except ConversionRefusedError:
        assume(False)
    bands = [c.certificate.feedback.loop_band for c in (there, back)]
    low, high = max(b.low for b in bands), min(b.high for b in bands)
    if a.algorithm().ki:
        # both bands span 500 to 1 and are placed by the effective integral time, which an approximate conversion moves
        assert high / low > (100 if max(b.max_deviation for b in bands) < 0.01 else 20)
    assume(high > low)  # without integral action, by a ratio of moments that a conversion need not keep
    bound = math.prod(1 + b.max_deviation for b in bands) - 1
    # the bands' 300 frequencies do not meet the worst one exactly: 2 % of the deviation
    assert deviation(a, back.settings, low, high) <= 1.02 * bound + 1e-9


@pytest.mark.parametrize("card", ALL)
@given(data=st.data())
@settings(max_examples=40)
def test_what_a_conversion_wrote_reads_back_as_the_same_law(card: str, data: st.DataObject) -> None:
    conversion = to_itself(settings_that_act(data, pidemu.load_card(card)))
    s = conversion.settings
    written: dict[str, object] = {**s.options, **{n: f"{v.value!r} {v.unit}" for n, v in s.items() if v.active and not v.off}}
    written |= {n: v.value for n, v in s.items() if v.active and v.off}
    assert s.card.settings(written).law() == s.law()


def test_a_weight_of_zero_that_comes_back_as_zero_is_exact_though_arithmetic_without_rounding_has_a_trace_of_it() -> None:
    s = pidemu.load_card("emerson/deltav").settings(FORM="Series", STRUCTURE="7", GAIN=2.5, RESET=3, RATE=1, BETA=0)
    there = pidemu.convert(s, "generic/parallel", mode="auto")
    back = pidemu.convert(there.settings, "emerson/deltav", options=s.options, mode="auto")
    assert (there.verdict, back.verdict, back.settings["BETA"].value) == ("exact", "exact", 0.0)
    assert back.proof is not None
    assert float(back.proof.dials["BETA"].removesuffix("...")) != 0
