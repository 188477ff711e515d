"""What a verdict rests on, in words: on whose filter, and nothing where both are the same."""

from __future__ import annotations

from typing import Any

import pytest

import pidemu

LOGIX = pidemu.load_card("allen-bradley/logix-pid").settings(KP=1.8, KI=0.4, KD=0.2, PE="independent")


def conditions(source: pidemu.Settings, target: str, **how: Any) -> list[str]:
    return [c.text for c in pidemu.convert(source, target, emulate=False, **how).conditions]


def test_a_filter_of_a_part_of_the_derivative_time_of_parallel_gains_is_of_their_quotient() -> None:
    assert conditions(LOGIX, "generic/standard") == ["Logix 5000's derivative filter is (KD/KP)/16"]


@pytest.mark.parametrize("how", [{"options": {"PE": "independent"}}, {"options": {"PE": "independent"}, "scan": 0.5}])
def test_between_two_of_the_same_block_nothing_is_a_condition(how: dict[str, Any]) -> None:
    assert conditions(LOGIX, "allen-bradley/logix-pid", **how) == []
    assert conditions(LOGIX, "allen-bradley/logix-pid", options={"PE": "dependent"}) != []
