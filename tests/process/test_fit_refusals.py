"""What cannot be fitted: each with its cause and a remedy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from pidemu.errors import FitRefusedError, PidemuError, ProcessError, RecordError
from pidemu.process.fit.fit import fit_process
from pidemu.process.process import Process
from tests.process.curves import curve, held, measured

T, U, Y = curve("01-fopdt")


def refused(kind: type[PidemuError], message: str, *columns: Any, **how: Any) -> None:
    with pytest.raises(kind, match="^" + re.escape(message)):
        fit_process(*columns, **how)


def test_a_bump_test_without_a_bump_is_refused() -> None:
    refused(
        FitRefusedError,
        "the output stays at 10: without a bump there is nothing to fit; move the output in manual by some percent and record",
        T, np.full(T.size, 10.0), Y,
    )  # fmt: skip


def test_a_bump_at_the_end_of_the_record_is_refused() -> None:
    u = np.where(T == T[-2], 15.0, 10.0)
    refused(FitRefusedError, "the output first moves at sample 499 of 500, at the end of the record; go on", T, u, Y)


@pytest.mark.parametrize("method", ["least-squares", "tangent", "two-point"])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_measurement_that_does_not_answer_is_refused(method: str, noise: float) -> None:
    for seed in range(10):
        y = 40 + noise * np.random.default_rng(seed).normal(size=T.size)
        refused(FitRefusedError, "the measurement does not answer the output", T, U, y, method=method)


def test_a_wandering_measurement_is_no_answer() -> None:
    refusals = 0
    for seed in range(10):
        y = 40 + np.cumsum(0.05 * np.random.default_rng(seed).normal(size=T.size))
        try:
            fit_process(T, U, y)
        except FitRefusedError:
            refusals += 1
    assert refusals >= 7


def test_a_curve_that_has_not_settled_is_not_read() -> None:
    refused(FitRefusedError, "the measurement has not settled: it still moves by", T[:120], U[:120], Y[:120], method="tangent")


def test_a_curve_of_several_steps_is_not_read() -> None:
    u = held(T, [(20, 5), (120, -5)], 10)
    y = measured(Process.from_lags(2, [30], delay=7), T, u)
    message = "a curve is read after one step, and the output moves by +5 at 20 s, -5 at 120 s; method='least-squares' does without"
    refused(FitRefusedError, message, T, u, y, method="two-point")


def test_an_integrator_whose_slope_stays_is_not_read() -> None:
    t, u, _ = curve("09-integ")
    refused(
        FitRefusedError,
        "the slope of the measurement does not change after the step",
        t,
        u,
        50 + 0.1 * t,
        model="ipdt",
        method="tangent",
    )


def test_a_record_in_automatic_is_refused() -> None:
    ones, half = np.ones(T.size), (T >= 100).astype(float)
    refused(
        FitRefusedError, "the controller was in automatic: what moved the output is the measurement itself;", T, U, Y, auto=ones
    )
    refused(
        FitRefusedError, "the controller was in automatic from 100 s to 249.5 s, for a part of the record; cut", T, U, Y, auto=half
    )
    assert fit_process(T, U, Y, auto=np.zeros(T.size)).process.gain == pytest.approx(2, rel=1e-6)


def test_words_that_are_none_are_refused() -> None:
    refused(ProcessError, "model is 'foptd' (did you mean 'fopdt'?); models: fopdt, sopdt, ipdt", T, U, Y, model="foptd")
    refused(ProcessError, "method is 'lsq'; methods: least-squares, tangent, two-point", T, U, Y, method="lsq")
    message = "the method two-point reads no ipdt off a curve, but fopdt; use method='least-squares'"
    refused(ProcessError, message, T, U, Y, model="ipdt", method="two-point")
    refused(ProcessError, "the unit of a process gain is 'degC'", T, U, Y, unit="degC")


COLUMNS: dict[str, tuple[tuple[Any, Any, Any], str]] = {
    "lengths": ((T, U[:-1], Y), "the columns have different numbers of samples: time 500, output 499, measurement 500"),
    "words": ((T, U, ["a"] * 500), "measurement is ['a', 'a'"),
    "table": ((T, U, np.column_stack([Y, Y])), "measurement has the shape (500, 2); give one value per sample"),
    "few": ((T[35:42], U[35:42], Y[35:42]), "7 samples with a measurement; a fit needs 8 at least"),
    "back": ((np.where(T == 50, 40, T), U, Y), "time: sample 101, 40 s, goes back from 49.5 s; give samples in the order"),
    "twice": ((np.where(T == 50, 49.5, T), U, Y), "time: sample 101, 49.5 s, is that of the sample before; give samples in"),
    "no time": ((np.where(T == 50, np.nan, T), U, Y), "time: sample 101 has no time; give every sample its time in seconds"),
    "no output": ((T, np.where(T == 0, np.nan, U), Y), "the output of the first sample is missing; begin the record where"),
    "huge": (
        (T, U, np.where(T == 50, 1e40, Y)),
        "measurement: sample 101 is 1e+40, which no signal is; correct it, or make it nan",
    ),
    "infinite": ((T, np.where(T == 50, np.inf, U), Y), "output: sample 101 is inf, which no signal is"),
}


@pytest.mark.parametrize("name", COLUMNS)
def test_columns_that_are_no_signals_are_refused(name: str) -> None:
    columns, message = COLUMNS[name]
    refused(RecordError, message, *columns)


def test_a_mode_column_of_another_length_is_refused() -> None:
    refused(RecordError, "auto has 3 samples, and time 500; give one value of each per sample", T, U, Y, auto=[0, 0, 0])
