"""Sampled models of many processes at once are those of each alone."""

from __future__ import annotations

import numpy as np
import pytest

from pidemu import Process
from pidemu.columns.replay import Recording
from pidemu.columns.traced import Tape
from pidemu.errors import ProcessError
from pidemu.process.hold_columns import sampled_columns

LAGS = ((), (8.0,), (3.0, 40.0), (1.0, 1.0, 0.2), (0.01, 5.0, 600.0, 2.0))


@pytest.mark.parametrize("leads", [(), (-1.5,), (2.0, 0.3)])
@pytest.mark.parametrize("integrators", [0, 1])
def test_many_models_are_those_of_each_alone(leads: tuple[float, ...], integrators: int) -> None:
    rng = np.random.default_rng(14)
    for lags in LAGS:
        if len(leads) > len(lags) + integrators:
            continue
        made = [
            Process.from_lags(
                float(rng.uniform(-2, 2)),
                [lag * float(rng.uniform(0.5, 2)) for lag in lags],
                leads,
                integrators,
                float(rng.choice([0.0, 0.5, rng.uniform(0, 20)])),
            )
            for _ in range(40)
        ]
        scans = rng.choice([0.1, 0.5, 2.0], size=40)
        roots = np.array([[r.real for r in (*p.poles, *p.zeros)] for p in made]).reshape(40, -1).T
        n = len(made[0].poles)
        gains, delays = np.array([p.gain for p in made]), np.array([p.delay for p in made])
        found, fits = sampled_columns(n, [0] * len(roots), gains, delays, scans, *roots)
        assert fits.all()
        for p, h, row in zip(made, scans.tolist(), found, strict=True):
            s = p.sampled(h)
            assert row.tolist() == [*s.growth.ravel(), *s.early, *s.late, *s.row, s.through, s.scans]


def test_a_process_that_outgrows_all_numbers_costs_itself_only() -> None:
    unstable = Process(1.0, [300.0])
    with pytest.raises(ProcessError, match="the process outgrows all numbers within one scan of 10 s"):
        unstable.sampled(10.0)
    one, ten = np.ones(2), np.full(2, 10.0)
    _, fits = sampled_columns(1, [0], one, one, ten, np.array([-0.1, 300.0]))
    assert fits.tolist() == [True, False]


@pytest.mark.parametrize("zeros", [[], [-0.3 + 0.1j, -0.3 - 0.1j]])
def test_models_with_complex_roots_are_those_of_each_alone(zeros: list[complex]) -> None:
    rng = np.random.default_rng(3)
    made = [Process(1.3, [-1.0, p := complex(*rng.uniform(-1, 1, 2)), p.conjugate()], zeros, 0.7) for _ in range(30)]
    h = np.full(30, 0.5)
    found, fits = sampled_columns(3, [0, 1, -1, 1, -1][: 3 + len(zeros)], h + 0.8, h + 0.2, h, *parts(made))
    assert fits.all()
    for process, row in zip(made, found, strict=True):
        s = process.sampled(0.5)
        assert row.tolist() == [*s.growth.ravel(), *s.early, *s.late, *s.row, s.through, s.scans]


def parts(made: list[Process]) -> np.ndarray:
    """Return the roots as columns, of a pair the upper one's parts."""
    rows = [[x for r in (*p.poles, *p.zeros) if r.imag >= 0 for x in ((r.real, r.imag) if r.imag else (r.real,))] for p in made]
    return np.array(rows).T


def test_the_model_of_a_traced_process_is_recorded() -> None:
    process = Process.from_lags(1.2, [8, 3], delay=2.3)
    numbers = (1.2, 2.3, *(r.real for r in process.poles))
    tape = Tape()
    gain, delay, *roots = (tape.number(x) for x in numbers)
    s = process.with_numbers(gain, delay, roots).sampled(0.5)
    results = [*s.growth.ravel(), *s.early, *s.late, *s.row, s.through, s.scans]
    other = Process.from_lags(0.7, [3, 9], delay=4.1)
    found, fits = Recording.of(tape, numbers, results).replay(np.array([[0.7], [4.1], *([r.real] for r in other.poles)]))
    expected = other.sampled(0.5)
    assert fits.all()
    assert found[:, 0].tolist() == [
        *expected.growth.ravel(), *expected.early, *expected.late, *expected.row, expected.through, expected.scans,
    ]  # fmt: skip
