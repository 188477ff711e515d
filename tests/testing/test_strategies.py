"""The public strategies draw what they say, for every card."""

from __future__ import annotations

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pidemu
from pidemu.card.library import card_files
from pidemu.testing import cards, processes, records, settings
from pidemu.testing.record import SignalRecord


@pytest.mark.parametrize("card", card_files())
@hypothesis.settings(max_examples=10)
@given(data=st.data())
def test_the_settings_of_every_card_run(card: str, data: st.DataObject) -> None:
    drawn = data.draw(settings(card))
    assert drawn.card.id == card
    assert drawn.algorithm() is not None


@given(settings("emerson/deltav", FORM="Series", GAIN=2.5))
def test_what_is_fixed_stays(drawn: pidemu.Settings) -> None:
    assert (drawn.options["FORM"], drawn["GAIN"].value) == ("Series", 2.5)


@given(records((2, 9), pv_range=(0, 400), modes=("automatic", "manual")))
def test_records_stay_within_their_ranges(record: SignalRecord) -> None:
    assert 2 <= len(record.scans) <= 9
    assert all(0 <= x <= 400 for x in (*record.sp, *record.pv))
    assert all(x is None or 0 <= x <= 100 for x in record.manual)
    assert all(auto or True for auto in record.auto)
    assert all(x is None for x, auto in zip(record.manual, record.auto, strict=True) if auto)


def test_records_shrink_to_the_middle() -> None:
    found = hypothesis.find(records((3, 9)), lambda _: True)
    assert (found.sp, found.pv) == ([50.0] * 3, [50.0] * 3)


def test_cards_shrink_to_a_plain_one() -> None:
    assert hypothesis.find(cards(), lambda _: True).id == "generic/dahlin"
    assert hypothesis.find(cards("fisher/provox"), lambda _: True).id == "fisher/provox"


@given(processes(delay=True, integrating=False, gains=(1,)))
def test_processes_are_what_is_asked_for(process: pidemu.Process) -> None:
    assert process.is_stable
    assert process.gain > 0
