"""The helpers for made-up algorithms refuse what does not exist, as a constructor would."""

from __future__ import annotations

from typing import Any

import pytest

from pidemu.card.model.base import Rule
from pidemu.card.model.signals import SignalFilter
from tests.algorithms import CLAMP, NONE, VELOCITY, algorithm, changed, incremental

A = algorithm(kp=2.0, ki=0.1)


def test_a_made_up_algorithm_is_plain_and_has_the_integral_time_of_its_gains() -> None:
    assert (A.implementation, A.integral.windup, A.Ti, A.transfer.start) == ("positional", NONE, 20.0, "bumpless")
    assert (algorithm(kp=2.0).Ti, algorithm(kp=-2.0, ki=-0.1).Ti, algorithm(kp=2.0, ki=0.1, Ti=3.0).Ti) == (0.0, 20.0, 3.0)
    assert algorithm(kp=1.0, windup=VELOCITY).velocity
    assert A.beyond_the_law == []


def test_fields_are_changed_at_any_depth_and_others_stay_as_they_are() -> None:
    lag: SignalFilter[float] = SignalFilter(time=3.0)
    a = changed(A, kp=3.0, integral__rule=Rule.FORWARD, integral__windup=CLAMP, setpoint__filter=lag)
    assert (a.kp, a.integral.rule, a.integral.windup, a.setpoint.filter) == (3.0, Rule.FORWARD, CLAMP, lag)
    assert changed(a, setpoint__filter__time=4.0).setpoint.filter == SignalFilter(time=4.0)
    assert (a.transfer is A.transfer, a.ki, a.setpoint.rate) == (True, A.ki, None)
    assert changed(a, kp=2.0, integral=A.integral, setpoint=A.setpoint) == A


def test_the_velocity_implementation_has_the_scheme_that_goes_with_it() -> None:
    a = incremental(A, output__rate=1.0)
    assert (a.velocity, a.integral.windup, a.output.rate) == (True, VELOCITY, 1.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"velocity": True}, "Algorithm has no field 'velocity'"),
        ({"transfer__stat": "keep"}, "Transfer has no field 'stat'"),
        ({"setpoint__filter__time": 2.0}, "there is no part that could have time"),
        ({"kp__big": 2.0}, "there is no part that could have big"),
        ({"setpoint": A.setpoint, "setpoint__rate": 1.0}, "setpoint: changed as a whole and in part"),
    ],
    ids=str,
)
def test_a_path_that_leads_nowhere_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        changed(A, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transfer__start": "keeps"}, "Transfer.start is one of bumpless, .*, not 'keeps'"),
        ({"integral__rule": Rule.EXACT}, "Integral.rule is one of backward, forward, trapezoidal, not"),
        ({"implementation": "speed"}, "Algorithm.implementation is one of positional, velocity, not 'speed'"),
    ],
    ids=str,
)
def test_a_word_that_is_none_of_the_choices_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        changed(A, **changes)
