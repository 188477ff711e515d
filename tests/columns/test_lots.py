"""Many computations of one kind: how often one is recorded, and what is left to be done alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from pidemu.columns.lots import KindOfComputation, Lot
from pidemu.columns.replay import Recording
from pidemu.columns.traced import Tape


@dataclass(frozen=True)
class Half:
    recording: Recording


class Halves:
    """Halves what is positive, leaves what is negative, and refuses 13; counts how often it is recorded."""

    def __init__(self) -> None:
        self.count = 0

    def record(self, _which: int, numbers: Sequence[float]) -> Half:
        self.count += 1
        tape = Tape()
        x = tape.number(numbers[0])
        if x == 13:
            raise ValueError(x)
        return Half(Recording.of(tape, numbers, [x / 2 if x > 0 else x]))


def lot(numbers: Sequence[float]) -> Lot:
    return Lot(np.arange(len(numbers)), np.array([numbers]))


def results(done: list[tuple[Half, Lot]]) -> dict[int, float]:
    return {i: x for _, one in done for i, x in zip(one.which.tolist(), one.columns[0].tolist(), strict=True)}


def test_each_structure_is_recorded_once_also_for_the_next_lots() -> None:
    halves, kind = Halves(), KindOfComputation[Half]()
    for _ in range(3):
        done, alone = kind.compute(lot([1, -1, 2, -2, 3, -3, 4, -4]), halves.record)
        assert results(done) == {0: 0.5, 1: -1, 2: 1, 3: -2, 4: 1.5, 5: -3, 6: 2, 7: -4}
        assert alone == []
    assert halves.count == 2


def test_what_cannot_be_recorded_and_what_is_too_few_is_left_alone() -> None:
    halves, kind = Halves(), KindOfComputation[Half]()
    done, alone = kind.compute(lot([13, 1, 2, 13, 3, -1, 4]), halves.record)
    assert results(done) == {1: 0.5, 2: 1, 4: 1.5, 6: 2}
    assert sorted(alone) == [0, 3, 5]
    assert kind.compute(lot([1, 2]), Halves().record)[1] == []  # one that is known does for any number
    assert KindOfComputation[Half]().compute(lot([1, 2, 3]), halves.record) == ([], [0, 1, 2])


def test_a_kind_of_which_no_recording_does_is_given_up_after_six() -> None:
    halves, kind = Halves(), KindOfComputation[Half]()
    done, alone = kind.compute(lot([13] * 100), halves.record)
    assert (done, sorted(alone), halves.count) == ([], list(range(100)), 6)


def test_lots_are_joined_in_order() -> None:
    joined = Lot.joined([Lot(np.array([1, 4]), np.array([[10.0, 40.0]])), Lot(np.array([0, 2]), np.array([[0.0, 20.0]]))])
    assert (joined.which.tolist(), joined.columns.tolist()) == ([0, 1, 2, 4], [[0.0, 10.0, 20.0, 40.0]])
    with pytest.raises(ValueError, match="need at least one"):
        Lot.joined([])
