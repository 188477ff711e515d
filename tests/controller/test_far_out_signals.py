"""Numbers that no signal reaches: a bad signal where no code is known, what the code does where it is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pidemu
from pidemu import Controller
from pidemu.card.load import Card
from pidemu.controller.signals import Event
from pidemu.errors import ScanError
from pidemu.settings.settings import Settings
from pidemu.units import Role
from tests.cli.helpers import said

PV = np.array([50.0, 51.0, 1e300, 50.0, 50.0, -1e300, 51.0, 50.0, 50.0])
KNOWN = [
    "advanced-pid/advanced-pid", "arduino/pid", "ardupilot/ac-pid", "bacnet/loop", "crazyflie/pid",
    "dvg/pid-controller", "epics/epid", "esphome/pid", "gnc-tools/cpid", "iec/61131-3-pid", "mathworks/pid2",
    "modelica/limpid", "ni/pid", "node-pid-controller/controller", "openbmc/pid", "oscat/ctrl-pi", "oscat/ctrl-pid", "oscat/ft-pid",
    "oscat/ft-pidw", "oscat/ft-pidwl", "oscat/ft-piw", "px4/pid", "ros/control-toolbox", "sedona/lp", "simple-pid/simple-pid",
    "simplefoc/pid", "wpilib/pid-controller",
]  # fmt: skip
"""Programs whose code is known."""


def usual(card: Card) -> Settings:
    """Settings with gain and integral 1 and derivative 1/2, in the card's units."""
    numbers = {Role.GAIN: 1.0, Role.INTEGRAL: 1.0, Role.DERIVATIVE: 0.5}
    dials = card.variant({}).equation.settings
    return card.settings({n: numbers.get(Role(s.sets), 1.0) for n, s in dials.items() if s.sets in numbers or s.default is None})


@pytest.mark.parametrize("name", pidemu.cards())
def test_a_value_beyond_any_signal_is_a_bad_one_unless_the_code_is_known(name: str) -> None:
    controller = Controller(usual(pidemu.load_card(name)), 1.0, initial_output=50.0)
    controller.run(np.full(9, 50.0), PV)
    events = [e for e in controller.events if e.kind in ("signal", "state")]
    if name in KNOWN:
        assert all(e.kind == "state" for e in events)
    else:
        assert events == [
            Event(2, "signal", "measurement is 1e+300: output held"),
            Event(5, "signal", "measurement is -1e+300: output held"),
        ]
        assert all(math.isfinite(x) for x in controller.state.values())


@pytest.mark.parametrize("name", pidemu.cards())
def test_a_run_notes_the_same_as_scan_after_scan_and_gives_the_same_bits(name: str) -> None:
    settings = usual(pidemu.load_card(name))
    whole, single = (Controller(settings, 1.0, initial_output=50.0) for _ in range(2))
    outputs = [single.scan(50.0, x) for x in PV.tolist()]
    assert repr(whole.run(np.full(9, 50.0), PV).tolist()) == repr(outputs)
    assert whole.events == single.events
    assert repr(whole.state) == repr(single.state)


def test_a_state_that_is_no_longer_finite_is_reported_once_with_its_scan() -> None:
    controller = Controller(usual(pidemu.load_card("iec/61131-3-pid")), 1.0)
    controller.run(np.full(5, 50.0), PV[[0, 1, 2, 3, 3]])
    assert [e.scan for e in controller.events if e.kind == "state"] == [2, 3, 4]  # the derivative remembers three measurements
    first = next(e for e in controller.events if e.kind == "state")
    assert first.text == "state no longer finite: u = inf, x1 = -inf, D = -inf, I = -inf"


@pytest.mark.parametrize("signal", ["manual", "track"])
def test_an_output_to_take_over_that_is_larger_than_any_signal_is_refused(signal: str) -> None:
    far: dict[str, Any] = {signal: 1e300}
    controller = Controller(usual(pidemu.load_card("emerson/deltav")), 1.0)
    with pytest.raises(ScanError, match=r"larger than any signal, 1e\+30"):
        controller.scan(50.0, 50.0, signal != "manual", **far)
    with pytest.raises(ScanError, match=r"is infinite or larger than any signal in sample 1 \(counted from 0\)"):
        controller.run(50.0, 50.0, signal != "manual", **{signal: [50.0, 1e300]})


def test_run_and_compare_say_where_a_record_is_far_out_and_where_a_state_was_lost(tmp_path: Path) -> None:
    record = tmp_path / "r.csv"
    record.write_text("sp,pv\n" + "".join(f"50,{x!r}\n" for x in PV.tolist()), encoding="utf-8")
    far = "column pv: 1e+300 in sample 2 (counted from 0), and 1 more: larger than any signal, 1e+30"
    held = said("run", "emerson/deltav", "GAIN=1", "RESET=10", "--record", str(record))
    assert held.status == 0
    assert f"note: {far}" in held.err
    assert "measurement is 1e+300: output held" in held.err
    lost = said("run", "iec/61131-3-pid", "KP=1", "TR=10", "--record", str(record))
    assert "state no longer finite: " in lost.err
    both = said("compare", "emerson/deltav", "GAIN=1", "RESET=10", "iec/61131-3-pid", "KP=1", "TR=10", "--record", str(record))
    assert far in both.out + both.err
    assert "iec/61131-3-pid: state no longer finite: " in both.out + both.err
    assert ", in scan 2 (counted from 0)" in both.out + both.err
