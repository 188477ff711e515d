"""The command that runs two cards in cascade."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pidemu
from tests.cli.helpers import said, strict_json, told

WORDS = ("cascade", "generic/standard", "K=3", "Ti=100", "Td=0", "--process", "gain=0.8,lag=120,lag=20")
INNER = ("--inner", "emerson/deltav GAIN=4 RESET='10 s'", "--inner-process", "gain=1.2,lag=10")
LOOP = (*WORDS, *INNER, "--scan", "2,1")


def run() -> pidemu.CascadeRun:
    return pidemu.simulate_cascade(
        pidemu.load_card("generic/standard").settings(K=3, Ti=100, Td=0),
        pidemu.load_card("emerson/deltav").settings(GAIN=4, RESET=10),
        pidemu.Process.from_lags(0.8, [120, 20]),
        pidemu.Process.from_lags(1.2, [10]),
        (2.0, 1.0),
    )


def test_the_command_gives_the_numbers_of_python(tmp_path: Path) -> None:
    out = tmp_path / "signals.csv"
    found = strict_json(told(*LOOP, "--json", "-o", str(out)))
    expected = run()
    assert found["outer"]["iae"] == expected.outer.iae
    assert found["inner"]["card"] == "emerson/deltav"
    assert [r["step"] for r in found["outer"]["responses"]] == ["setpoint", "load"]
    header, *rows = out.read_text("utf-8").splitlines()
    assert header == "time,setpoint,measurement,inner_setpoint,inner_measurement,output"
    written = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert np.array_equal(written[:, 4], expected.inner.measurement)
    assert np.array_equal(written[::2, 2], expected.outer.measurement)
    assert np.array_equal(written[1:, 2][::2], expected.outer.measurement[: written[1::2].shape[0]])


def test_both_loops_are_told_and_drawn(tmp_path: Path) -> None:
    text = told(*LOOP, "--valve", "deadband=0.5", "--noise", "0.1", "--plot", str(tmp_path / "loop.svg"))
    for words in ("The outer loop: generic/standard: K 3, Ti 100, Td 0", "The inner loop: emerson/deltav: GAIN 4, RESET 10"):
        assert words in text
    assert "the output of the outer loop" in text
    assert "deadband=0.5" in text
    assert "inner: emerson/deltav: GAIN 4, RESET 10" in (tmp_path / "loop.svg").read_text("utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*WORDS, "--inner-process", "gain=1"), "Missing option '--inner'"),
        ((*LOOP, "--scan", "1.5,1"), "not a multiple of the inner one's 1 s"),
        ((*LOOP, "--inner", "emerson/delta GAIN=2"), "did you mean 'emerson/deltav'?"),
        ((*LOOP, "--inner", "emerson/deltav GAIN='2"), "--inner 'emerson/deltav GAIN='2' is not a card with settings"),
        ((*LOOP, "--valve", "deadband=-1"), "valve: deadband is -1 %; give 0 or more"),
        ((*LOOP, "--plot", "loop.gif"), "pictures are written as .png or .svg"),
        ((*WORDS, "--inner", "emerson/deltav GAIN=-4", "--inner-process", "gain=1"), "GAIN"),
    ],
)
def test_what_cannot_be_run_is_told(words: tuple[str, ...], message: str) -> None:
    result = said(*words)
    assert result.status != 0
    assert message in result.err
