"""Signals that a program is to read before they come."""

from __future__ import annotations

import pytest

import pidemu
from pidemu.errors import ScanError

SETTINGS = {"GAIN": 2, "RESET": 4, "RATE": 0.1}


def controller() -> pidemu.Controller:
    return pidemu.Controller(pidemu.load_card("fisher/provox").settings(SETTINGS), 1.0, initial_output=40.0)


def test_a_program_that_listens_has_further_inputs_in_the_order_of_all_programs() -> None:
    one = controller()
    one.listen("track", "cascade")
    assert [q.name for q in one.program.inputs] == ["sp", "pv", "auto", "manual", "cascade", "track"]


def test_listening_changes_no_output_before_or_while_running() -> None:
    one, other = controller(), controller()
    other.listen("cascade")
    found = []
    for n in range(20):
        if n == 10:
            other.listen("track")
        sample = (50.0 + n % 3, 49.0 - n % 5)
        found.append(one.scan(*sample) == other.scan(*sample))
    assert found == [True] * 20
    assert one.events == other.events


def test_a_signal_that_is_none_or_has_no_place_is_refused() -> None:
    with pytest.raises(ScanError) as refused:
        controller().listen("casade")
    signals = "cascade, track, external_reset, feedforward"
    assert str(refused.value) == f"no signal 'casade' (did you mean 'cascade'?); signals: {signals}"
    with pytest.raises(ScanError, match="states no feedforward input"):
        controller().listen("feedforward")
