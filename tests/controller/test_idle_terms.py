"""Gains that come back from 0 while running: what the term finds, by hand; recorded programs stand in the cards' verification."""

from __future__ import annotations

import numpy as np
import pytest

import pidemu
from pidemu.controller.idle_terms import idle_dials


def controller(card: str, **given: float) -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card(card).settings(given), scan=1.0)


def test_a_sum_of_the_error_has_grown_while_its_gain_was_zero() -> None:
    ctl = controller("node-pid-controller/controller", k_p=2.0)
    assert ctl.run(50.0, np.full(10, 47.0)).tolist() == [6.0] * 10
    ctl.change(k_i=0.1)
    assert ctl.scan(50.0, 47.0) == pytest.approx(6.0 + 0.1 * 33.0, rel=1e-14)


def test_a_sum_of_gain_times_error_has_stood_still_and_still_counts() -> None:
    ctl = controller("dvg/pid-controller", Kp=1.0, Ki=0.5)
    first = ctl.run(50.0, np.full(4, 48.0))
    assert first.tolist() == [3.0, 4.0, 5.0, 6.0]
    ctl.change(Ki=0.0)
    assert ctl.run(50.0, np.full(5, 48.0)).tolist() == [6.0] * 5
    ctl.change(Ki=0.25)
    assert ctl.scan(50.0, 48.0) == 6.5


def test_a_gain_on_the_whole_sum_comes_back_to_the_integral_that_has_run_on() -> None:
    ctl = controller("oscat/ft-pid", KP=0.0, TN=10.0, TV=0.0)
    assert ctl.run(50.0, np.full(11, 48.0)).tolist() == [0.0] * 11
    ctl.change(KP=1.5)
    assert ctl.scan(50.0, 48.0) == pytest.approx(1.5 * (2.0 + 11 * 2.0 / 10.0), rel=1e-6)


def test_a_derivative_that_comes_back_knows_the_last_signal() -> None:
    ctl = controller("crazyflie/pid", kp=1.0)
    ctl.run(50.0, [50.0, 49.0, 48.0])
    ctl.change(kd=2.0)
    assert ctl.scan(50.0, 47.0) == 3.0 + 2.0


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_engines_agree_with_terms_that_run_on(engine: pidemu.Engine) -> None:
    settings = pidemu.load_card("oscat/ft-pidw").settings(KP=0.0, TN=6.0, TV=0.0)
    pv = np.linspace(40.0, 60.0, 50)
    ctl = pidemu.Controller(settings, scan=0.5, output_limits=(-20, 60), engine=engine)
    ctl.run(50.0, pv)
    ctl.change(KP=0.8, TV=1.5)
    reference = pidemu.Controller(settings, scan=0.5, output_limits=(-20, 60))
    for y in pv:
        reference.scan(50.0, y)
    reference.change(KP=0.8, TV=1.5)
    assert ctl.run(50.0, pv).tolist() == [reference.scan(50.0, y) for y in pv]


def test_a_program_without_idle_terms_is_what_is_printed() -> None:
    ctl = controller("crazyflie/pid", kp=1.0)
    assert "I" not in [q.name for q in ctl.lean_program.states]
    assert "I" in [q.name for q in ctl.program.states]
    settings = pidemu.load_card("crazyflie/pid").settings(kp=1.0)
    assert "integral" not in pidemu.code(settings, "python").text.split("def scan")[1]


def test_a_time_of_zero_and_a_card_that_says_nothing_have_no_idle_terms() -> None:
    assert idle_dials(pidemu.load_card("oscat/ft-pid").settings(KP=1.0, TN=0.0, TV=1.0)) == {}
    assert idle_dials(pidemu.load_card("arduino/pid").settings(Kp=0.0, Ki=0.0)) == {}
    assert set(idle_dials(pidemu.load_card("oscat/ft-pid").settings(KP=0.0, TN=0.0, TV=0.0))) == {"KP", "TV"}


def test_at_rest_and_with_a_bias_nothing_has_run_that_could_run_on() -> None:
    settings = pidemu.load_card("crazyflie/pid").settings(kp=1.0)
    ctl = pidemu.Controller(settings, scan=1.0)
    ctl.rest(50.0, 47.0, 3.0)
    assert ctl.scan(50.0, 47.0) == 3.0
    assert pidemu.Controller(settings, scan=1.0, bias=10.0).scan(50.0, 47.0) == 13.0


def test_states_of_another_controller_go_on_with_their_idle_terms() -> None:
    first = controller("node-pid-controller/controller", k_p=2.0)
    first.run(50.0, np.full(10, 47.0))
    second = controller("node-pid-controller/controller", k_p=2.0)
    second.start(**first.state)
    for ctl in (first, second):
        ctl.change(k_i=0.1)
    assert first.scan(50.0, 47.0) == second.scan(50.0, 47.0)
